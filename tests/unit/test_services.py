"""Services: what a log lacks is absent, what a row lacks is null, and nothing is made up."""

import contextlib
import os

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from evenhand.core.errors import InputError
from evenhand.methods.services import FACTS, Services
from support.refusals import refused

AGES = ("Child", "Adult", "Elder")


def made(**changed) -> Services:
    """Three services; the second has no response, the third person's age is not known."""
    facts = {
        "responded": np.array([True, False, True]),
        "response_step": np.ma.array([60, 300, 205], mask=[False, True, False]),
        "response_distance": [1.25, None, 0.75],
        "min_distance": np.array([1.25, 0.42, 0.75]),
        "robot": ["even", None, "racist"],
    }
    facts = {name: v for name, v in {**facts, **changed}.items() if v is not None}
    return Services.build({"age": (np.array([0, 2, -1]), AGES)}, facts)


class TestBuild:
    def test_what_is_there_and_what_is_not(self):
        table = made()
        assert len(table) == 3
        assert table.identities == ("age",)
        assert table.column_names == ["age", *_FACTS]
        assert "response_step" in table
        assert "steps" not in table  # absent: this log has no such column

    def test_facts_as_numbers_with_nan_for_null(self):
        table = made()
        np.testing.assert_array_equal(table.fact("response_step"), [60.0, np.nan, 205.0])
        np.testing.assert_array_equal(table.fact("response_distance"), [1.25, np.nan, 0.75])
        np.testing.assert_array_equal(table.fact("responded"), [1.0, 0.0, 1.0])
        assert table.fact("response_step").dtype == np.float64

    def test_text_as_objects_with_none(self):
        assert made().fact("robot").tolist() == ["even", None, "racist"]

    def test_an_identity_as_codes_with_minus_one_for_missing(self):
        codes, categories = made().identity("age")
        assert codes.tolist() == [0, 2, -1]
        assert codes.dtype == np.int64
        assert categories == AGES

    def test_cells_are_null_not_numbers(self):
        arrow = made().to_arrow()
        assert arrow["response_step"].to_pylist() == [60, None, 205]
        assert arrow["age"].to_pylist() == ["Child", "Elder", None]

    def test_nan_is_null(self):
        # as the environment says of a service without a response
        arrow = made(
            response_step=np.array([60.0, np.nan, 205.0]), response_distance=[1.25, np.nan, 0.75]
        ).to_arrow()
        assert arrow["response_step"].to_pylist() == [60, None, 205]
        assert arrow["response_distance"].to_pylist() == [1.25, None, 0.75]

    @pytest.mark.parametrize("name", list(FACTS))
    def test_every_fact_can_be_all_null_or_empty(self, name):
        empty = Services.build({}, {name: []})
        null = Services.build({}, {name: [None, None]})
        assert (len(empty), len(null)) == (0, 2)
        assert null.to_arrow()[name].type == FACTS[name]
        assert null.to_arrow()[name].null_count == 2

    def test_an_array_that_is_not_contiguous(self):
        table = made(min_distance=np.arange(12.0).reshape(3, 4)[:, 1])
        np.testing.assert_array_equal(table.fact("min_distance"), [1.0, 5.0, 9.0])


_FACTS = ["responded", "response_step", "response_distance", "min_distance", "robot"]


class TestWrongBuild:
    def test_an_unknown_fact_offers_the_nearest(self):
        with refused("unknown fact", "'min_distanse'"):
            made(min_distanse=np.zeros(3))

    def test_columns_of_unequal_length(self):
        with refused("shape columns", "'age'", "3", "'robot'", "2"):
            made(robot=["even", "even"])

    @pytest.mark.parametrize(
        ("name", "values"),
        [
            ("min_distance", ["near", "far", "far"]),
            ("response_step", [60.5, None, 205]),
            ("steps", np.array([1, 2**40, 3])),
            ("min_distance", [[1.0], [2.0], [3.0]]),
            ("min_distance", np.zeros((3, 2))),
            ("responded", ["yes", "no", "no"]),
            ("min_distance", [1.0, "far", 2.0]),
        ],
    )
    def test_values_of_the_wrong_type_name_their_fact(self, name, values):
        with pytest.raises(InputError, match=f"fact '{name}': "):
            made(**{name: values})

    def test_an_identity_with_the_name_of_a_fact(self):
        with refused("duplicate steps", "'steps'"):
            Services.build({"steps": (np.zeros(2, int), ("a",))}, {})


class TestAsking:
    def test_an_absent_fact_offers_the_nearest_of_this_table(self):
        with refused("unknown fact", "'min_dist'"):
            made().fact("min_dist")
        with refused("unknown fact", "'steps'"):
            made().fact("steps")

    def test_an_identity_is_no_fact_and_the_other_way_round(self):
        with refused("unknown fact", "'age'"):
            made().fact("age")
        with refused("unknown identity", "'robot'"):
            made().identity("robot")

    def test_equality(self):
        assert made() == made()
        assert made() != made(robot=["even", "even", "racist"])
        assert made() != made(robot=None)
        assert made() != "made"

    def test_tables_are_no_keys(self):
        with pytest.raises(TypeError, match="unhashable"):
            hash(made())


class TestArrow:
    def test_identities_are_noted(self):
        again = Services.from_arrow(made().to_arrow())
        assert again == made()
        assert again.identities == ("age",)

    def test_no_identities_are_noted_too(self):
        alone = Services.build({}, {"steps": [1, 2]})
        assert Services.from_arrow(alone.to_arrow()) == alone

    def test_a_foreign_table_needs_names_of_identities(self):
        foreign = pa.table({"sex": ["f", None, "m"], "steps": [1.0, None, 3.0]})
        with refused("missing identities"):
            Services.from_arrow(foreign)
        taken = Services.from_arrow(foreign, ["sex"])
        codes, categories = taken.identity("sex")
        assert (codes.tolist(), categories) == ([0, -1, 1], ("f", "m"))
        np.testing.assert_array_equal(taken.fact("steps"), [1.0, np.nan, 3.0])

    def test_categories_of_another_type_are_taken(self):
        # what pandas writes: small codes, large strings
        column = pa.DictionaryArray.from_arrays(
            pa.array([1, None, 0], pa.int8()), pa.array(["f", "m"], pa.large_string())
        )
        foreign = Services.from_arrow(pa.table({"sex": column}), ["sex"])
        ours = Services.build({"sex": (np.array([0]), ("m",))}, {})
        both = Services.concat([foreign, ours])
        assert both.to_arrow()["sex"].to_pylist() == ["m", None, "f", "m"]

    def test_a_category_that_is_null_or_twice_there_is_cleared_up(self):
        column = pa.DictionaryArray.from_arrays(
            pa.array([0, 1, 2, 3, None], pa.int32()), pa.array(["f", None, "f", "m"])
        )
        codes, categories = Services.from_arrow(pa.table({"sex": column}), ["sex"]).identity("sex")
        assert codes.tolist() == [0, -1, 0, 1, -1]
        assert categories == ("f", "m")

    def test_chunks_with_other_categories_become_one_column(self):
        column = pa.chunked_array(
            [pa.array(["m", "f"]).dictionary_encode(), pa.array(["x", "m"]).dictionary_encode()]
        )
        codes, categories = Services.from_arrow(pa.table({"sex": column}), ["sex"]).identity("sex")
        assert [categories[code] for code in codes] == ["m", "f", "x", "m"]

    def test_a_column_without_chunks(self):
        column = pa.chunked_array([], type=pa.dictionary(pa.int32(), pa.string()))
        codes, categories = Services.from_arrow(pa.table({"sex": column}), ["sex"]).identity("sex")
        assert (codes.tolist(), categories) == ([], ())

    @pytest.mark.parametrize(
        ("column", "said"),
        [
            ({"stps": [1]}, "unknown fact 'stps': did you mean 'steps'"),
            ({"steps": ["many"]}, "column 'steps': "),
            ({"steps": [[1]]}, "column 'steps': "),
            ({"sex": [[1]]}, "column 'sex': "),
            ({"age": ["Child"]}, "no column 'sex': the identities named are"),
        ],
    )
    def test_wrong_columns(self, column, said):
        table = pa.table({"sex": ["f"], **column} if "age" not in column else column)
        with pytest.raises(InputError, match=said):
            Services.from_arrow(table, ["sex", "age"] if "age" in column else ["sex"])

    def test_a_column_that_stands_there_twice(self):
        table = pa.table([pa.array(["f"]), pa.array(["m"])], ["sex", "sex"])
        with refused("duplicate sex", "'sex'"):
            Services.from_arrow(table, ["sex"])

    def test_the_constructor_takes_checked_columns_only(self):
        with refused("type sex", "'sex'"):
            Services(pa.table({"sex": ["f"]}), ["sex"])
        with refused("type steps", "'steps'"):
            Services(pa.table({"steps": [1]}), [])


class TestFiles:
    def test_parquet_keeps_everything(self, tmp_path):
        path = tmp_path / "services.parquet"
        made().write_parquet(path)
        assert Services.read_parquet(path) == made()
        assert os.listdir(tmp_path) == ["services.parquet"]  # nothing is left beside it

    def test_csv_by_its_letters(self, tmp_path):
        path = tmp_path / "services.csv"
        made().write_csv(path)
        assert path.read_text() == (
            '"age","responded","response_step","response_distance","min_distance","robot"\n'
            '"Child",true,60,1.25,1.25,"even"\n'
            '"Elder",false,,,0.42,\n'
            ',true,205,0.75,0.75,"racist"\n'
        )
        assert os.listdir(tmp_path) == ["services.csv"]

    def test_csv_of_others(self, tmp_path):
        path = tmp_path / "services.csv"
        path.write_text("sex,responded,min_distance\nf,1,0.4\n,false,\nm,True,nan\n")
        table = Services.read_csv(path, ["sex"])
        assert table.to_arrow()["sex"].to_pylist() == ["f", None, "m"]
        np.testing.assert_array_equal(table.fact("responded"), [1.0, 0.0, 1.0])
        assert table.to_arrow()["min_distance"].to_pylist() == [0.4, None, None]
        assert "steps" not in table

    @pytest.mark.parametrize("left", [0, 4, 100, -1, -9])
    def test_a_cut_off_parquet_file(self, tmp_path, left):
        path = tmp_path / "services.parquet"
        made().write_parquet(path)
        path.write_bytes(path.read_bytes()[:left])
        with refused("format file", "services.parquet"):
            Services.read_parquet(path)

    def test_a_parquet_file_of_something_else(self, tmp_path):
        path = tmp_path / "other.parquet"
        pq.write_table(pa.table({"a": [1]}), path)
        with refused("missing identities", "other.parquet"):
            Services.read_parquet(path)

    def test_a_file_that_is_not_there(self, tmp_path):
        with refused("format file"):
            Services.read_csv(tmp_path / "nothing", ["age"])
        with refused("format file"):
            Services.read_parquet(tmp_path / "nothing")

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("age,steps\nChild,many\n", r"x\.csv cannot be read as CSV: .*'many'"),
            ("age,steps\nChild\n", r"x\.csv cannot be read as CSV: .*Expected 2 columns"),
            ("", r"x\.csv cannot be read as CSV: Empty CSV file"),
            ("sex,steps\nf,1\n", r"x\.csv: unknown fact 'sex'"),
            ("steps\n1\n", r"x\.csv: no column 'age'"),
            ("age,stps\nChild,1\n", r"x\.csv: unknown fact 'stps': did you mean 'steps'"),
            ("age,age\nChild,Adult\n", r"x\.csv: column 'age' stands there twice"),
        ],
    )
    def test_wrong_csv(self, tmp_path, text, said):
        path = tmp_path / "x.csv"
        path.write_text(text)
        with pytest.raises(InputError, match=said):
            Services.read_csv(path, ["age"])

    @pytest.mark.parametrize("write", [Services.write_csv, Services.write_parquet])
    def test_a_place_that_cannot_be_written(self, tmp_path, write):
        with refused("unavailable file"):
            write(made(), tmp_path / "nowhere" / "x")

    def test_a_failed_write_leaves_nothing_and_keeps_what_was_there(self, tmp_path):
        (tmp_path / "x").mkdir()  # a folder cannot be replaced by a file
        with refused("unavailable file"):
            made().write_parquet(tmp_path / "x")
        assert os.listdir(tmp_path) == ["x"]


class TestRows:
    def test_take_by_index_and_by_mask(self):
        table = made()
        picked = table.take(np.array([2, 0]))
        assert picked.to_arrow()["response_step"].to_pylist() == [205, 60]
        assert picked.identity("age")[0].tolist() == [-1, 0]
        masked = table.take(np.array([False, True, True]))
        assert masked.to_arrow()["response_step"].to_pylist() == [None, 205]
        assert masked.identity("age")[1] == AGES

    def test_take_nothing(self):
        none = made().take(np.zeros(3, bool))
        assert len(none) == 0
        assert none.identity("age")[0].tolist() == []
        assert none.fact("responded").tolist() == []

    def test_concat(self):
        other = Services.build(
            {"age": (np.array([1, 0]), ("Middle Aged", "Child"))},
            {name: [None, None] for name in _FACTS},
        )
        both = Services.concat([made(), other])
        assert len(both) == 5
        assert both.to_arrow()["age"].to_pylist() == [
            "Child",
            "Elder",
            None,
            "Child",
            "Middle Aged",
        ]
        codes, categories = both.identity("age")
        assert categories == (*AGES, "Middle Aged")
        assert codes.tolist() == [0, 2, -1, 0, 3]
        np.testing.assert_array_equal(
            both.fact("response_step"), [60.0, np.nan, 205.0, np.nan, np.nan]
        )

    def test_concat_of_nothing(self):
        with refused("empty tables"):
            Services.concat([])

    def test_concat_of_tables_with_other_columns(self):
        with refused("conflict tables"):
            Services.concat([made(), made(robot=None)])

    def test_a_table_does_not_follow_the_arrays_it_was_built_from(self):
        least, step = (
            np.array([1.25, 0.42, 0.75]),
            np.ma.array([60, 0, 205], mask=[False, True, False]),
        )
        codes = np.array([0, 1, 2], np.int32)
        facts = {"min_distance": least, "response_step": step}
        table = Services.build({"age": (codes, AGES)}, facts)
        least[:], step[:], codes[:] = 9.0, 9, 0
        np.testing.assert_array_equal(table.fact("min_distance"), [1.25, 0.42, 0.75])
        np.testing.assert_array_equal(table.fact("response_step"), [60.0, np.nan, 205.0])
        assert table.identity("age")[0].tolist() == [0, 1, 2]

    @pytest.mark.parametrize("name", ["min_distance", "response_distance", "responded"])
    def test_what_is_asked_for_cannot_change_the_table(self, name):
        table = made()
        before = table.fact(name).copy()
        seen = table.fact(name)
        with contextlib.suppress(ValueError):  # read-only is as good
            seen[:] = 9.0
        np.testing.assert_array_equal(table.fact(name), before)


def test_other_libraries_take_it_by_arrow_and_it_says_what_it_holds():
    import polars as pl
    import pyarrow as pa

    table = Services.build(
        identities={"age": (np.array([0, 1]), ["child", "adult"])},
        facts={"responded": [True, None]},
    )
    assert pa.table(table).column_names == ["age", "responded"]
    assert pl.DataFrame(table)["responded"].to_list() == [True, None]
    assert repr(table) == "Services with 2 rows; identities: age; facts: responded"
