"""Waiting and measures as counts, by hand and by NumPy."""

import dataclasses

import numpy as np
import pyarrow as pa
import pytest

from evenhand.audits.count import waits_and_measures
from evenhand.audits.count.count import tally
from evenhand.audits.example import synthetic_log
from evenhand.audits.judge import means, waits
from evenhand.audits.read.guess_columns import guess
from evenhand.audits.read.mapping import Mapping
from evenhand.audits.read.sources import open_source


def count(columns: dict, **roles):
    mapping = Mapping(**{"identities": ("who",), "responded": "ok", **roles})
    return tally(open_source(pa.table(columns)), mapping)[0]


def test_waiting_is_counted_within_strata():
    found = count(
        {
            "who": ["a", "b", "a", "a"],
            "site": ["x", "y", "y", "y"],
            "ok": [True, True, False, False],
            "t": [0.02, 0.04, None, None],
        },
        response_time="t",
        within=("site",),
    )
    told = found.waits
    assert told is not None
    assert found.strata == ("x", "y")
    rows = zip(told.codes[:, 0], told.stratum, told.step, told.responded, told.n, strict=True)
    assert [tuple(int(cell) for cell in row) for row in rows] == [
        (0, 0, 1, 1, 1),
        (0, 1, 200, 0, 2),
        (1, 1, 2, 1, 1),
    ]


def test_more_combinations_than_a_count_has_are_counted_one_identity_after_the_other(monkeypatch):
    source = open_source(synthetic_log(400, np.random.default_rng(0)))
    mapping = dataclasses.replace(guess(source.table.columns), within=("site",))
    whole, _ = tally(source, mapping)
    monkeypatch.setattr(waits_and_measures, "MOST_ROWS", 2000)
    apart, warnings = tally(source, mapping)
    assert whole.waits is not None
    assert apart.waits is not None
    assert len(mapping.identities) == 3
    assert len(apart.waits.n) > 2 * len(whole.waits.n)
    assert apart.waits.services == whole.waits.services == 400
    assert waits.compare(apart) == waits.compare(whole)
    assert not any("do not tell how long" in warning for warning in warnings)


def test_means_of_a_great_log_are_exact_where_some_values_lie_far_out():
    """1 % of 210,000 values far out, other ones for men and for women: 19.7 and 11.9 on average."""
    rng = np.random.default_rng(5)
    n = 210_000
    who, kind = rng.choice(["f", "m"], n), rng.choice([" x", "y"], n)
    far = rng.random(n) < 0.01
    value = np.where(far, rng.normal(np.where(who == "f", 1000, 200), 5), rng.normal(10, 1, n))
    value[:3] = -1e9, -1e12, 3e5
    log = {"who": who, "kind": kind, "ok": np.ones(n), "v": value}
    found = count(log, identities=("who", "kind"), measures=("v",))
    f, m, *_ = means.compare(found, np.random.default_rng(0), 200)
    women = who == "f"
    for one, side in ((f, women), (m, ~women)):
        assert one.mean == pytest.approx(value[side].mean(), rel=1e-9)
        assert one.rest_mean == pytest.approx(value[~side].mean(), rel=1e-9)
        assert one.median == pytest.approx(np.median(value[side]), abs=0.01)
    log["v"] = value[3:]
    found = count({name: cells[-len(log["v"]) :] for name, cells in log.items()}, measures=("v",))
    f, m = means.compare(found, np.random.default_rng(0), 200)
    assert f.mean - m.mean == pytest.approx(7.8, abs=0.8)
    assert f.mean_p == m.mean_p == pytest.approx(1 / 201)


@pytest.mark.parametrize("heavy", [False, True])
def test_steps_lose_nothing_that_the_test_of_means_needs(heavy):
    """The spread of a measure in steps is that of its values, however far they lie out."""
    rng = np.random.default_rng(6)
    n = 210_000
    value = rng.standard_cauchy(n) ** 3 if heavy else rng.gamma(2.0, 3.0, n)
    found = count({"who": rng.integers(0, 2, n), "ok": np.ones(n), "v": value}, measures=("v",))
    (counted,) = found.values
    assert len(counted.n) < 40_000
    for values in (counted.value, counted.mean):
        assert np.average(values, weights=counted.n) == pytest.approx(value.mean(), rel=1e-9)
        spread = np.average((values - value.mean()) ** 2, weights=counted.n)
        assert spread == pytest.approx(value.var(), rel=1e-4)


def test_the_test_of_medians_in_steps_errs_as_often_as_it_says():
    """Services of the step that holds the median count for neither side, whoever they are."""
    rng = np.random.default_rng(7)
    n = 210_000
    p = []
    for _ in range(12):
        log = {"who": rng.integers(0, 2, n), "ok": np.ones(n), "v": rng.normal(0, 1, n)}
        found = count(log, measures=("v",))
        p.append(means.compare(found, rng, 200)[0].median_p)
    # half of them below 1/2; eleven of twelve would be one time in 300
    assert 2 <= sum(one < 0.5 for one in p) <= 10
    assert min(p) > 0.01
