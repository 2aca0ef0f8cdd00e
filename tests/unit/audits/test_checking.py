"""Cells that are no facts, and values that are hardly meant, by hand."""

import pyarrow as pa
import pytest

from evenhand.audits.count import checks, count, group_by
from evenhand.audits.read.mapping import Mapping
from evenhand.audits.read.sources import open_source
from evenhand.core.errors import InputError
from support.refusals import refused


def warned(columns, **roles):
    who = ["a", "b"] * (len(next(iter(columns.values()))) // 2)
    source = open_source(pa.table({"who": who, **columns}))
    return count.tally(source, Mapping(identities=("who",), **roles))[1]


@pytest.mark.parametrize(
    ("distances", "sentence"),
    [
        # more than half of those that are known
        ([0.01, 0.01, 1.0, None], "half of column 'd' is less than 0.02 m: is its unit 'm'?"),
        ([21.0, 21.0, 1.0, None], "half of column 'd' is more than 20 m: is its unit 'm'?"),
        # half, and not more
        ([0.01, 0.01, 1.0, 1.0], None),
        ([21.0, 21.0, 1.0, 1.0], None),
        # small ones and great ones do not add up
        ([0.01, 21.0, 1.0, None], None),
        # at the limits
        ([0.02, 0.02, 0.02, 20.0], None),
        ([20.0, 20.0, 20.0, 0.02], None),
        # nothing is known
        (pa.array([None] * 4, pa.float64()), None),
    ],
)
def test_a_median_that_is_hardly_meant(distances, sentence):
    found = warned({"d": distances}, min_distance="d")
    assert [one for one in found if "unit" in one] == ([sentence] if sentence else [])


def test_times_of_those_who_gave_up_are_looked_at_too():
    columns = {"ok": ["no"] * 4, "t": [1.0] * 4, "w": [700.0, 700.0, 700.0, 5.0]}
    found = warned(columns, responded="ok", response_time="t", waited="w")
    assert "half of column 'w' is more than 600 s: is its unit 's'?" in found
    assert not [one for one in found if "column 't'" in one]


WRONG = "row 3, column 'ok': 'perhaps' is neither yes nor no"


def test_a_wrong_cell_comes_before_too_many_groups():
    who = list(range(2000))
    log = {"who": who, "ok": ["yes", "no", "perhaps", *["yes"] * 1997]}
    roles = Mapping(identities=("who",), responded="ok")
    with pytest.raises(InputError, match=WRONG):
        count.tally(open_source(pa.table(log)), roles)
    log["ok"][2] = "no"
    with pytest.raises(InputError, match=f"more than {checks.MOST_GROUPS} groups"):
        count.tally(open_source(pa.table(log)), roles)


def test_a_wrong_cell_comes_before_too_many_combinations(monkeypatch):
    monkeypatch.setattr(group_by, "MOST_ROWS", 3)
    log = {"who": ["a", "b", "c", "d"], "ok": ["yes", "no", "perhaps", "yes"]}
    roles = Mapping(identities=("who",), responded="ok")
    with pytest.raises(InputError, match=WRONG):
        count.tally(open_source(pa.table(log)), roles)
    log["ok"][2] = "no"
    with refused("range strata", "3"):
        count.tally(open_source(pa.table(log)), roles)


def test_the_first_wrong_column_is_told_whatever_the_row():
    log = {"who": ["a", "b", "a"], "ok": ["yes", "no", "perhaps"], "d": ["x", "1", "1"]}
    roles = Mapping(identities=("who",), responded="ok", min_distance="d")
    with pytest.raises(InputError, match=WRONG):
        count.tally(open_source(pa.table(log)), roles)


def test_a_log_that_was_mended_while_it_was_read(monkeypatch):
    source = open_source(pa.table({"who": ["a", "b"], "ok": ["yes", "perhaps"]}))
    monkeypatch.setattr(checks, "refuse_wrong", lambda source, mapping, read: None)
    with refused("changed log"):
        count.tally(source, Mapping(identities=("who",), responded="ok"))
