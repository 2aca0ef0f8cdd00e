"""What arrays and foreign columns become: nothing is turned into another value in silence."""

import numpy as np
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from evenhand.core.errors import InputError
from evenhand.methods.services import Services
from support.refusals import refused

GROUP = ["a", "b", "a", "b"]


def taken(**facts: pa.Array) -> Services:
    return Services.from_arrow(pa.table({"g": GROUP, **facts}), ["g"])


@pytest.mark.parametrize("kind", [pa.float64(), pa.float32()])
def test_not_a_number_is_null_in_every_fact(kind, tmp_path):
    values = np.array([1.0, 0.0, np.nan, np.nan], kind.to_pandas_dtype())
    column = pa.array(values, from_pandas=False)
    assert column.null_count == 0
    table = taken(responded=column, steps=column, min_distance=column)
    pq.write_table(pa.table({"g": GROUP, "responded": column}), tmp_path / "x.parquet")
    for name in ("responded", "steps", "min_distance"):
        np.testing.assert_array_equal(table.fact(name), [1.0, 0.0, np.nan, np.nan])
    frame = pl.DataFrame({"g": GROUP, "responded": values})
    np.testing.assert_array_equal(
        Services.from_arrow(frame.to_arrow(), ["g"]).fact("responded"), [1, 0, np.nan, np.nan]
    )


@pytest.mark.parametrize("values", [[1.0, 0.5, 0.0, 1.0], [1, 2, 0, 1], [1, -1, 0, None]])
def test_yes_and_no_are_1_and_0_and_nothing_else(values):
    said = "is neither 1 .yes. nor 0 .no."
    with pytest.raises(InputError, match=f"column 'responded': .*{said}"):
        taken(responded=pa.array(values))
    with pytest.raises(InputError, match=f"fact 'responded': .*{said}"):
        Services.build({}, {"responded": values})


def test_yes_and_no_as_numbers():
    for values in ([1, 0, None, 1], [1.0, 0.0, None, 1.0]):
        np.testing.assert_array_equal(
            taken(responded=pa.array(values)).fact("responded"), [1, 0, np.nan, 1]
        )


@pytest.mark.parametrize("codes", [[0.0, 0.9], [0.0, np.nan], [0, 2], [-2, 0]])
def test_codes_are_whole_and_have_a_category(codes):
    said = "identity 'g': codes must be whole numbers of -1 to 1"
    with pytest.raises(InputError, match=said):
        Services.build({"g": (np.array(codes), ["a", "b"])}, {})


def test_codes_may_be_written_as_floats():
    table = Services.build({"g": (np.array([1.0, -1.0]), ["a", "b"])}, {})
    assert table.identity("g")[0].tolist() == [1, -1]


def test_two_groups_of_one_name():
    with refused("duplicate g", "'g'"):
        Services.build({"g": (np.array([0, 2]), ["a", "b", "a"])}, {})


def test_whole_numbers_beyond_2_to_the_53_are_rounded():
    table = Services.build({}, {"service": np.array([2**53 + 1, 3])})
    assert table.fact("service").tolist() == [2.0**53, 3.0]


def test_take_of_an_empty_list():
    table = Services.build({"g": (np.array([0, 1]), ["a", "b"])}, {"steps": [1, 2]})
    assert len(table.take([])) == 0  # type: ignore[arg-type]
