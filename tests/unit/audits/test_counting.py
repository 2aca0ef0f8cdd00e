"""Counts of a log, by hand."""

import datetime
import math

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

from evenhand.audits.count.count import tally
from evenhand.audits.read.guess_columns import guess
from evenhand.audits.read.mapping import Mapping, limits
from evenhand.audits.read.sources import open_source
from evenhand.core.errors import InputError
from evenhand.methods.paper.issues import indicators
from evenhand.methods.services import Services


def count(columns: dict, **roles):
    frame = columns if isinstance(columns, pa.Table) else pa.table(columns)
    return tally(open_source(frame), Mapping(**{"identities": ("who",), **roles}))


def told(found, issue: str) -> dict[str, tuple[int, int]]:
    """(services to which the issue applies, with it) of each group of the first identity."""
    x = found.x[:, found.issues.index(issue)]
    return {
        group: (
            int(found.n[(found.codes[:, 0] == g) & ~np.isnan(x)].sum()),
            int(found.n[(found.codes[:, 0] == g) & (x == 1)].sum()),
        )
        for g, group in enumerate(found.identities[0].groups)
    }


def test_the_four_issues_at_their_limits():
    found, _ = count(
        {
            "who": ["a", "a", "a", "a", "b", "b"],
            "ok": [True, True, True, True, False, None],
            "t": [4.0, 4.001, None, 0.0, 9.0, 9.0],
            "d": [1.0, 1.5, 0.999, 1.501, 9.0, 9.0],
            "m": [0.5, 0.499, None, 3.0, 0.1, 0.5],
        },
        responded="ok",
        response_time="t",
        response_distance="d",
        min_distance="m",
    )
    assert found.issues == ("willingness", "quality", "priority", "risk")
    assert told(found, "willingness") == {"a": (4, 0), "b": (1, 1)}
    # of those without a response, or of whom it is not known, neither is said
    assert told(found, "quality") == {"a": (4, 2), "b": (0, 0)}
    assert told(found, "priority") == {"a": (3, 1), "b": (0, 0)}
    assert told(found, "risk") == {"a": (3, 1), "b": (2, 1)}
    assert found.services == 6


@pytest.mark.parametrize(
    ("unit", "late", "later"), [("s", 4.0, 4.01), ("ms", 4000, 4001), ("steps", 200, 201)]
)
def test_a_time_at_the_limit_is_not_late_in_any_unit(unit, late, later):
    found, _ = count({"who": ["a", "b"], "t": [late, later]}, response_time="t", time_unit=unit)
    assert told(found, "priority") == {"a": (1, 0), "b": (1, 1)}
    assert found.waits is not None
    assert found.waits.step.tolist() == [200, 201]


@pytest.mark.parametrize(
    ("unit", "near", "nearer"), [("cm", 70.0, 69.9), ("mm", 700, 699), ("in", 28, 27), ("ft", 3, 2)]
)
def test_a_distance_in_another_unit(unit, near, nearer):
    # 0.7 m is 70 cm, 27.56 inches and 2.297 feet
    found, _ = count(
        {"who": ["a", "b"], "m": [near, nearer]},
        min_distance="m",
        distance_unit=unit,
        thresholds=limits(risk=0.7),
    )
    assert told(found, "risk") == {"a": (1, 0), "b": (1, 1)}


def test_identities_of_any_type_become_text_and_what_is_missing_a_group():
    found, _ = count(
        {
            "who": [" x ", "x", None, "", "y"],
            "number": [10.0, 9.0, float("nan"), None, 2.5],
            "flag": [True, False, None, True, True],
            "day": [datetime.date(2026, 3, 14)] * 5,
            "ok": [1, 0, 1, 0, 1],
        },
        identities=("who", "number", "flag", "day"),
        responded="ok",
    )
    groups = {one.name: one.groups for one in found.identities}
    assert groups == {
        "who": ("x", "y", "unknown"),
        "number": ("2.5", "9", "10", "unknown"),
        "flag": ("false", "true", "unknown"),
        "day": ("2026-03-14",),
    }
    assert told(found, "willingness") == {"x": (2, 1), "y": (1, 0), "unknown": (2, 1)}


def test_bins_hold_their_lower_edge():
    found, _ = count(
        {"who": [17.9, 18, 64.5, 65, None], "ok": [1, 1, 0, 0, 1]},
        bins={"who": (18.0, 65.0)},
        responded="ok",
    )
    assert told(found, "willingness") == {
        "below 18": (1, 0),
        "18 to below 65": (2, 1),
        "65 and above": (1, 1),
        "unknown": (1, 0),
    }


def test_strata_are_kept_apart():
    found, _ = count(
        {"who": ["a", "b", "a"], "ok": [1, 1, 0], "site": ["n", "s", "n"], "day": [1, 1, 2]},
        responded="ok",
        within=("site", "day"),
    )
    assert found.strata == ("n · 1", "n · 2", "s · 1")
    assert sorted(zip(found.codes[:, 0].tolist(), found.stratum.tolist(), strict=True)) == [
        (0, 0),
        (0, 1),
        (1, 2),
    ]


@pytest.mark.parametrize("word", ["YES", " y", "True", "1", "ja", "J", "on", "t"])
def test_usual_spellings_of_yes(word):
    found, _ = count({"who": ["a", "b"], "ok": [word, "nein"]}, responded="ok")
    assert told(found, "willingness") == {"a": (1, 0), "b": (1, 1)}


def test_waiting_in_steps_with_those_who_got_no_response():
    found, warnings = count(
        {
            "who": ["a"] * 5 + ["b"] * 4,
            "ok": [True, True, True, True, False, False, False, None, True],
            # 0.14 / 0.02 is a little more than 7 in doubles
            "t": [0.14, 0.141, 0.0, 60.0, 1.0, None, None, 1.0, None],
            "left": [None, None, None, None, None, 2.0, 60.0, 1.0, None],
        },
        responded="ok",
        response_time="t",
        waited="left",
    )
    waits = found.waits
    assert waits is not None
    assert (waits.seconds, waits.late) == (0.02, 200)
    rows = zip(waits.codes[:, 0], waits.step, waits.responded, waits.n, strict=True)
    assert sorted(tuple(int(v) for v in row) for row in rows) == [
        (0, 0, 1, 1),
        (0, 7, 1, 1),
        (0, 8, 1, 1),
        (0, 200, 0, 1),  # not known how long: until the limit at least
        (0, 400, 0, 1),  # a response after a minute: waiting still after 8 s
        (1, 100, 0, 1),
        (1, 400, 0, 1),
    ]
    assert any("2 of 9 services" in warning for warning in warnings)


def test_without_an_answer_column_only_times_tell_of_waiting():
    found, _ = count({"who": ["a", "b", "b"], "t": [1.0, None, 2.0]}, response_time="t")
    assert found.issues == ("priority",)
    assert found.waits is not None
    assert found.waits.responded.tolist() == [True, True]
    assert told(found, "priority") == {"a": (1, 0), "b": (1, 0)}


def test_a_measure_is_counted_value_by_value():
    found, _ = count(
        {"who": ["a", "b", "b", "a"], "ok": [1, 1, 0, 1], "smiles": ["-1.5", "2", "2.0", ""]},
        responded="ok",
        measures=("smiles",),
    )
    (smiles,) = found.values
    rows = zip(smiles.codes[:, 0], smiles.value, smiles.n, strict=True)
    assert sorted((int(g), float(v), int(n)) for g, v, n in rows) == [(0, -1.5, 1), (1, 2.0, 2)]


def test_a_measure_of_a_great_log_keeps_its_mean():
    rng = np.random.default_rng(3)
    value, who = rng.normal(50, 10, 210_000), rng.integers(0, 2, 210_000)
    found, warnings = count(
        {"who": who, "ok": np.ones(210_000), "v": value}, responded="ok", measures=("v",)
    )
    (counted,) = found.values
    assert len(np.unique(counted.value)) < 5_000
    assert counted.n.sum() == 210_000
    assert np.average(counted.value, weights=counted.n) == pytest.approx(value.mean(), rel=1e-9)
    inside = counted.codes[:, 0] == 1
    mean = np.average(counted.value[inside], weights=counted.n[inside])
    assert mean == pytest.approx(value[who == 1].mean(), abs=0.01)
    assert any("steps between its quartiles" in warning for warning in warnings)


def test_moments_as_text_and_as_timestamps():
    asked = ["2026-03-14 10:00:00", "2026-03-14T10:00:00Z", "2026-03-14 23:59:59.5", None]
    answered = [
        "2026-03-14 10:00:04",
        "2026-03-14T12:00:04.000001+02:00",
        "2026-03-15 00:00:03.4999",
        "2026-03-15 00:00:00",
    ]
    roles = {"asked_at": "from", "answered_at": "to"}
    who = ["exact", "later", "night", "none"]
    found, _ = count({"who": who, "from": asked, "to": answered}, **roles)
    expected = {"exact": (1, 0), "later": (1, 1), "night": (1, 0), "none": (0, 0)}
    assert told(found, "priority") == expected
    stamps = [
        [None if one is None else pd.Timestamp(one).tz_localize(None) for one in column]
        for column in (asked, ["2026-03-14 10:00:04", "2026-03-14 10:00:04.000001", *answered[2:]])
    ]
    found, _ = count({"who": who, "from": stamps[0], "to": stamps[1]}, **roles)
    assert told(found, "priority") == expected


@pytest.mark.parametrize(
    "make", [pa.table, pd.DataFrame, pl.DataFrame], ids=["pyarrow", "pandas", "polars"]
)
def test_every_frame_gives_the_same_counts(make):
    frame = make({"race": ["a", "b", None, "b"], "served": [True, False, True, None]})
    source = open_source(frame)
    found, _ = tally(source, guess(source.table.columns))
    assert told(found, "willingness") == {"a": (1, 0), "b": (1, 1), "unknown": (1, 0)}


def test_interactions_have_the_issues_that_they_have_elsewhere():
    rng = np.random.default_rng(1)
    responded = rng.random(500) < 0.7
    log = Services.build(
        {"race": (rng.integers(-1, 3, 500), ["a", "b", "c"])},
        {
            "responded": responded,
            "response_step": np.ma.array(rng.integers(0, 400, 500), mask=~responded),
            "response_distance": np.where(responded, rng.uniform(0.5, 2, 500), np.nan),
            "min_distance": rng.uniform(0, 1, 500),
            "steps": rng.integers(400, 500, 500),
        },
    )
    source = open_source(log)
    mapping = guess(source.table.columns)
    found, _ = tally(source, mapping)
    expected = indicators(log)
    codes, _ = log.identity("race")
    for k, issue in enumerate(found.issues):
        for group, (n, cases) in told(found, issue).items():
            mine = expected[codes == {"a": 0, "b": 1, "c": 2, "unknown": -1}[group], k]
            assert (n, cases) == ((~np.isnan(mine)).sum(), np.nansum(mine)), (issue, group)
    assert found.waits is not None
    assert found.waits.n.sum() == 500
    assert found.waits.n[found.waits.responded].sum() == responded.sum()


def test_rows_come_in_one_order_whatever_the_engine_gives():
    columns = {"who": ["b", "a", "b", "a"], "ok": [1, 0, 0, 1]}
    one, _ = count(columns, responded="ok")
    other, _ = count({name: cells[::-1] for name, cells in columns.items()}, responded="ok")
    assert np.array_equal(one.codes, other.codes)
    assert np.array_equal(one.x, other.x, equal_nan=True)
    assert not math.isnan(one.x.sum())


@pytest.mark.parametrize(
    ("columns", "roles", "sentence"),
    [
        ({"who": ["a", "a"], "ok": [1, 0]}, {}, "every identity has one group only, who (a)"),
        ({"who": list(range(1500)), "ok": [1] * 1500}, {}, "more than 1000 groups"),
        ({"who": list(range(1001)), "ok": [1] * 1001}, {}, "more than 1000 groups"),
        ({"who": [["a"], ["b"]], "ok": [1, 0]}, {}, "identity 'who' holds varchar[]"),
        ({"who": ["a", "b"], "ok": [1, 2]}, {}, "row 2, column 'ok': '2' is neither yes nor no"),
        ({"who": ["a", "b"], "ok": [b"1", b"0"]}, {}, "holds blob, expected yes or no"),
        (
            {"who": ["a", "b"], "ok": [1, 0], "t": [1.0, float("nan")]},
            {"response_time": "t"},
            "row 2, column 't': it is NaN",
        ),
        (
            {"who": ["a", "b"], "ok": [1, 0], "t": [float("inf"), 1.0]},
            {"response_time": "t"},
            "row 1, column 't': 'inf' is infinite",
        ),
        (
            {"who": ["a", "b"], "ok": [1, 0], "t": [1, -3]},
            {"min_distance": "t"},
            "row 2, column 't': '-3' is negative, which no distance can be",
        ),
        (
            {
                "who": ["a", "b"],
                "ok": [1, 0],
                "f": ["2026-01-01 00:00:00", "2026-01-01 00:00:09"],
                "t": ["2026-01-01 00:00:01", "2026-01-01 00:00:08"],
            },
            {"asked_at": "f", "answered_at": "t"},
            "row 2: answered ('t': 2026-01-01 00:00:08) before asked",
        ),
        (
            {"who": ["a", "b"], "ok": [1, 0], "f": ["2026-02-30 00:00:00"] * 2, "t": ["x"] * 2},
            {"asked_at": "f", "answered_at": "t"},
            "row 1, column 'f': '2026-02-30 00:00:00' is no timestamp",
        ),
    ],
)
def test_what_cannot_be_counted_is_said_in_one_sentence(columns, roles, sentence):
    with pytest.raises(InputError) as caught:
        count(columns, **{"responded": "ok", **roles})
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_hardly_meant_is_warned_of():
    _, warnings = count(
        {
            "who": ["Black", "black", "x"],
            "age": ["1", "1", "1"],
            "ok": [1, 0, 1],
            "t": [3000, 2500, 900],
            "d": [120, 130, 0.1],
        },
        identities=("who", "age"),
        responded="ok",
        response_time="t",
        response_distance="d",
    )
    assert [
        "half of column 't' is more than 600 s: is its unit 's'?" in warnings,
        "half of column 'd' is more than 20 m: is its unit 'm'?" in warnings,
        "groups 'Black' and 'black' of 'who' differ in spelling only" in warnings,
        "identity 'age' has one group only: there is nothing to compare" in warnings,
    ] == [True] * 4
