"""Waiting from counts against statsmodels, rows of services, and hand numbers."""

import math
from typing import Any

import numpy as np
import pytest
from scipy import stats
from statsmodels.duration.survfunc import SurvfuncRight, survdiff
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.proportion import proportion_confint

from evenhand.audits.count.tally import Identity, Tally, Waits
from evenhand.audits.judge import waits
from evenhand.statistics.intervals import recovered_limits

IDENTITIES = (Identity("race", ("A", "B")), Identity("age", ("young", "middle", "old")))


def log(codes, step, responded, n, late, seconds=0.5, identities=IDENTITIES, stratum=0):
    """A tally that tells little but waiting."""
    codes = np.array(codes, np.int64)
    strata = np.broadcast_to(np.array(stratum), len(codes))
    step, responded = np.array(step), np.array(responded, bool)
    told = Waits(codes, strata, step, responded, np.array(n), seconds, late)
    return Tally(
        identities=identities,
        issues=("willingness",),
        strata=("",),
        codes=codes,
        stratum=np.zeros(len(codes), np.int64),
        x=1.0 - np.array(responded, float)[:, None],
        n=np.array(n),
        waits=told,
    )


def random_log():
    rng = np.random.default_rng(0)
    codes = rng.integers(0, (2, 3), (150, 2))
    step = rng.integers(1, 15 + 10 * codes[:, 1])
    return log(codes, step, rng.random(150) < 0.8, rng.integers(1, 6, 150), late=12)


def services(tally):
    """One row a service: steps, responses and membership."""
    told = tally.waits
    rows = np.repeat(np.arange(len(told.n)), told.n)
    return told.step[rows].astype(float), told.responded[rows].astype(float), tally.inside()[rows]


def test_hand_numbers():
    # A: answered at 1, 2, 2, 4; one left at 3. B: answered at 6 twice, one left at 6.
    rows = [(0, 1, 1, 1), (0, 2, 1, 2), (0, 3, 0, 1), (0, 4, 1, 1), (1, 6, 1, 2), (1, 6, 0, 1)]
    codes, step, responded, n = zip(*rows, strict=True)
    tally = log(
        [[c] for c in codes], step, responded, n, late=2, identities=(Identity("race", ("A", "B")),)
    )
    a, b = waits.compare(tally)
    assert (a.n, a.responses, b.n, b.responses) == (5, 4, 3, 2)
    assert a.unserved == pytest.approx(4 / 5 * 2 / 4)
    assert (b.unserved, a.rest_unserved, b.rest_unserved) == pytest.approx((1, 1, 0.4))
    assert a.difference == pytest.approx(-0.6)
    assert (a.median, b.median) == (1.0, 3.0)  # steps 2 and 6 of half a second
    # Wilson's limits for three of three who still wait: low = 3 / (3 + 1.96²).
    assert (b.unserved_low, b.unserved_high) == pytest.approx((3 / (3 + 1.959964**2), 1))


# Weeks of remission of acute leukaemia, Freireich et al., Blood 1963: (weeks, ended, patients).
TREATED = [
    *((6, 1, 3), (6, 0, 1), (7, 1, 1), (9, 0, 1), (10, 1, 1), (10, 0, 1), (11, 0, 1), (13, 1, 1)),
    *((16, 1, 1), (17, 0, 1), (19, 0, 1), (20, 0, 1), (22, 1, 1), (23, 1, 1), (25, 0, 1)),
    *((32, 0, 2), (34, 0, 1), (35, 0, 1)),
]
PLACEBO = [
    *((1, 1, 2), (2, 1, 2), (3, 1, 1), (4, 1, 2), (5, 1, 2), (8, 1, 4), (11, 1, 2), (12, 1, 2)),
    *((15, 1, 1), (17, 1, 1), (22, 1, 1), (23, 1, 1)),
]


@pytest.mark.parametrize(
    ("week", "treated", "placebo"),
    [(6, 0.857, 0.571), (7, 0.807, 0.571), (10, 0.753, 0.381), (13, 0.690, 0.190),
     (16, 0.627, 0.143), (22, 0.538, 0.048), (23, 0.448, 0.0)],
)  # fmt: skip
def test_the_published_waiting_times_of_a_trial(week, treated, placebo):
    """Kaplan and Meier's shares as in Gehan (1965) and textbooks since; Mantel's χ² is 16.79."""
    rows = [(g, *row) for g, side in enumerate((TREATED, PLACEBO)) for row in side]
    codes, step, ended, n = zip(*rows, strict=True)
    kinds = (Identity("drug", ("6-MP", "placebo")),)
    a, b = waits.compare(log([[c] for c in codes], step, ended, n, week, 1.0, kinds))
    assert (a.n, a.responses, b.n, b.responses) == (21, 9, 21, 21)
    assert (a.unserved, b.unserved) == pytest.approx((treated, placebo), abs=5e-4)
    assert (a.median, b.median) == (23, 8)
    # both sides of the one comparison, adjusted for two by Holm
    assert stats.chi2.isf(a.p / 2, 1) == pytest.approx(16.79, abs=5e-3)
    assert a.p == b.p


def test_exactly_one_half_is_reached():
    rows = [(0, step, True, 1) for step in range(1, 7)] + [(1, 9, False, 4)]
    codes, step, responded, n = zip(*rows, strict=True)
    tally = log(
        [[c] for c in codes], step, responded, n, late=9, identities=(Identity("race", ("A", "B")),)
    )
    a, b = waits.compare(tally)
    assert a.median == 1.5  # three of six are answered at step 3, whatever rounding says
    assert math.isnan(b.median)
    assert b.responses == 0


def test_shares_against_statsmodels():
    tally = random_log()
    waited, responded, inside = services(tally)
    for one, member in zip(waits.compare(tally), inside.T, strict=True):
        for side, share in ((1, one.unserved), (0, one.rest_unserved)):
            rows = member == side
            oracle: Any = SurvfuncRight(waited[rows], responded[rows])
            last = np.flatnonzero(oracle.surv_times <= 12)[-1]
            assert share == pytest.approx(oracle.surv_prob[last])
            if side:
                below = np.flatnonzero(oracle.surv_prob <= 0.5)[0]
                assert one.median == oracle.surv_times[below] * 0.5
        assert one.n == member.sum()
        assert one.responses == responded[member == 1].sum()


def test_log_rank_against_statsmodels_with_holm():
    tally = random_log()
    waited, responded, inside = services(tally)
    p = [survdiff(waited, responded, member)[1] for member in inside.T]
    adjusted: Any = multipletests(p, method="holm")[1]
    found = [one.p for one in waits.compare(tally)]
    assert found == pytest.approx(list(adjusted), rel=1e-9)
    assert min(found) < 0.001 < 0.05 < max(found)


def left(waited, responded, late, level):
    """Share still waiting after ``late`` and its limits from log(−log S), from one row a service.

    Statsmodels' share and Greenwood's error; Wilson's limits of all who are still at risk where
    nobody was answered, of all who were answered where nobody is left.
    """
    oracle: Any = SurvfuncRight(waited, responded)
    done = np.flatnonzero(np.array(oracle.surv_times) <= late)
    share = oracle.surv_prob[done[-1]] if len(done) else 1.0
    if share in (0.0, 1.0):
        n = responded.sum() if share == 0 else (waited >= late).sum()
        if n == 0:
            return math.nan, math.nan, math.nan
        return share, *proportion_confint(share * n, n, 1 - level, method="wilson")
    half = stats.norm.isf((1 - level) / 2) * oracle.surv_prob_se[done[-1]]
    half /= share * abs(math.log(share))
    if not (waited >= late).any():
        return math.nan, math.nan, math.nan
    return share, share ** math.exp(half), share ** math.exp(-half)


def sides(tally, late, level):
    """Share and limits of each group and of all others, [2, G, 3]."""
    waited, responded, inside = services(tally)
    return np.array(
        [
            [left(waited[m == side], responded[m == side], late, level) if (m == side).any()
             else (math.nan,) * 3 for m in inside.T]
            for side in (1, 0)
        ]
    )  # fmt: skip


def test_limits_are_those_of_a_row_for_each_service():
    tally = random_log()
    (alone, _), (here, there) = sides(tally, 12.0, 0.95), sides(tally, 12.0, 1 - 0.05 / 5)
    low, high = recovered_limits(here[:, 0], here[:, 1:].T, there[:, 0], there[:, 1:].T)
    found = waits.compare(tally)
    for name, expected in (
        ("unserved_low", alone[:, 1]),
        ("unserved_high", alone[:, 2]),
        ("difference", here[:, 0] - there[:, 0]),
        ("low", low),
        ("high", high),
    ):
        assert [getattr(one, name) for one in found] == pytest.approx(list(expected))


@pytest.mark.parametrize("late", [0, 1, 40])
def test_edges_are_those_of_a_row_for_each_service(late):
    codes = [[0, 0], [0, 1], [1, 0], [1, 0], [0, 1]]
    tally = log(codes, [1, 3, 2, 2, 5], [1, 1, 0, 1, 1], [2, 1, 3, 1, 2], late)
    here, there = sides(tally, late, 1 - 0.05 / 5)
    low, high = recovered_limits(here[:, 0], here[:, 1:].T, there[:, 0], there[:, 1:].T)
    found = waits.compare(tally)
    np.testing.assert_allclose([one.unserved for one in found], here[:, 0])
    np.testing.assert_allclose([one.rest_unserved for one in found], there[:, 0])
    np.testing.assert_allclose([one.low for one in found], low)
    np.testing.assert_allclose([one.high for one in found], high)
    # Nobody is old: missing, not 0.
    old = found[-1]
    assert old.n == 0
    assert all(math.isnan(v) for v in (old.unserved, old.median, old.difference, old.p))


def test_a_log_without_waiting_has_no_findings():
    tally = random_log()
    object.__setattr__(tally, "waits", None)
    assert waits.compare(tally) == ()
