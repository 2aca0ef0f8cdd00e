"""Laws of tables of services: nothing is lost or made up on the way to a file and back."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from hypothesis import assume, given
from hypothesis import strategies as st

from evenhand.methods.services import FACTS, Services

# Numbers that float64 and the file hold exactly; text as people write it, but not empty in a CSV.
_VALUES = {
    pa.int32(): st.integers(-(2**31), 2**31 - 1),
    pa.int64(): st.integers(-(2**53), 2**53),
    pa.float64(): st.floats(allow_nan=False),
    pa.bool_(): st.booleans(),
    pa.string(): st.text(min_size=1),
}
# CSV cannot carry a lone carriage return or a NUL.
_TEXT = st.text(
    st.characters(exclude_categories=["Cs", "Cc"], include_characters='\n,"'), min_size=1
)
_NAMES = st.sampled_from(["race", "gender", "site of service", 'age,"group"'])


@st.composite
def columns(draw: Any) -> tuple[dict[str, Any], dict[str, list[Any]]]:
    """Identities as (codes, categories) and facts as lists with None."""
    n = draw(st.integers(0, 8))
    identities = {}
    for name in draw(st.lists(_NAMES, max_size=3, unique=True)):
        categories = draw(st.lists(_TEXT, min_size=1, max_size=4, unique=True))
        codes = draw(st.lists(st.integers(-1, len(categories) - 1), min_size=n, max_size=n))
        identities[name] = (np.array(codes, int), tuple(categories))
    facts = {}
    for name in draw(st.lists(st.sampled_from(list(FACTS)), min_size=1, unique=True)):
        one = _TEXT if FACTS[name] == pa.string() else _VALUES[FACTS[name]]
        facts[name] = draw(st.lists(st.none() | one, min_size=n, max_size=n))
    return identities, facts


def labels(identity: tuple[np.ndarray, tuple[str, ...]]) -> list[str | None]:
    codes, categories = identity
    return [None if code < 0 else categories[code] for code in codes]


def assert_holds(table: Services, made: tuple[dict[str, Any], dict[str, list[Any]]]) -> None:
    identities, facts = made
    assert table.identities == tuple(identities)
    assert table.column_names == [*identities, *facts]
    arrow = table.to_arrow()
    for name, identity in identities.items():
        assert labels(table.identity(name)) == labels(identity)
    for name, values in facts.items():
        assert arrow[name].to_pylist() == values
        assert arrow[name].type == FACTS[name]


@given(columns())
def test_a_table_holds_what_it_was_built_from(made):
    assert_holds(Services.build(*made), made)


@given(columns())
def test_arrow_and_back(made):
    table = Services.build(*made)
    again = Services.from_arrow(table.to_arrow())
    assert again == table
    assert_holds(again, made)


@given(columns())
def test_parquet_and_back(made):
    table = Services.build(*made)
    with tempfile.TemporaryDirectory() as folder:
        table.write_parquet(Path(folder) / "x.parquet")
        again = Services.read_parquet(Path(folder) / "x.parquet")
    assert_holds(again, made)
    if len(table):  # a file without rows has no categories
        assert again == table


@given(columns())
def test_csv_and_back(made):
    assume(len(made[0]) + len(made[1]) > 1)  # of one column, a null is an empty line
    with tempfile.TemporaryDirectory() as folder:
        Services.build(*made).write_csv(Path(folder) / "x.csv")
        again = Services.read_csv(Path(folder) / "x.csv", list(made[0]))
    assert_holds(again, made)


@given(columns(), st.data())
def test_parts_put_together_are_the_whole(made, data):
    table = Services.build(*made)
    cut = data.draw(st.integers(0, len(table)))
    rows = np.arange(len(table))
    parts = [table.take(rows[:cut]), table.take(rows >= cut)]
    assert_holds(Services.concat(parts), made)


@given(columns())
def test_facts_are_nan_exactly_where_a_cell_is_null(made):
    table = Services.build(*made)
    for name, values in made[1].items():
        seen = table.fact(name)
        if FACTS[name] == pa.string():
            assert seen.tolist() == values
        else:
            assert seen.dtype == np.float64
            assert [None if np.isnan(x) else x for x in seen.tolist()] == values
