"""Waiting within strata: against statsmodels, hand numbers, and logs that are drawn."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy import stats
from statsmodels.duration.survfunc import survdiff
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.proportion import proportion_confint

from evenhand.audits.count.tally import Identity, Tally, Waits
from evenhand.audits.judge import waits
from evenhand.methods.paper.scores import Counts
from evenhand.statistics.strata import mantel_haenszel

RACE = (Identity("race", ("A", "B")),)
AGE = Identity("age", ("young", "middle", "old"))


def log(codes, stratum, step, responded, n, late, identities=RACE):
    """A tally that tells little but waiting."""
    codes, stratum, n = (np.array(a, np.int64) for a in (codes, stratum, n))
    codes = codes.reshape(len(n), -1)
    responded = np.array(responded, bool)
    return Tally(
        identities=identities,
        issues=("willingness",),
        strata=tuple(f"site {s}" for s in range(stratum.max() + 1)),
        codes=np.maximum(codes, 0),
        stratum=stratum,
        x=1.0 - responded[:, None],
        n=n,
        waits=Waits(codes, stratum, np.array(step), responded, n, 1.0, late),
    )


def random_log(identities=(*RACE, AGE)):
    """Three sites; the old are many where all are slow, and slower nowhere."""
    rng = np.random.default_rng(4)
    site = rng.integers(0, 3, 400)
    old = rng.random(400) < (0.1 + 0.35 * site)
    codes = np.column_stack([rng.integers(0, 2, 400), np.where(old, 2, rng.integers(0, 2, 400))])
    step = rng.integers(1, 10 + 12 * site + 6 * codes[:, 0])
    n = rng.integers(1, 3, 400)
    return log(codes, site, step, rng.random(400) < 0.8, n, 12, identities)


def test_log_rank_within_strata_against_statsmodels_with_holm():
    tally = random_log()
    told = tally.waits
    assert told is not None
    each = np.repeat(np.arange(len(told.n)), told.n)
    step, responded, site = told.step[each], told.responded[each], told.stratum[each]
    inside = tally.inside()[each]
    p = [survdiff(step, responded, member, strata=site)[1] for member in inside.T]
    adjusted: Any = multipletests(p, method="holm")[1]
    found = [one.p for one in waits.compare(tally)]
    assert found == pytest.approx(list(adjusted), rel=1e-9)
    assert min(found) < 0.001 < 0.05 < max(found)
    # over all sites the old seem to wait longer
    assert survdiff(step, responded, inside[:, 4])[1] < 0.001


def test_by_hand():
    """After step 2: at site 0, 3/4 of A and 1/2 of B; at site 1, 2/5 of A and 1/5 of B.

    Weights 4·2/6 = 4/3 and 5·5/10 = 5/2; A (4/3·3/4 + 5/2·2/5) / (23/6) = 12/23, as B is
    (2/3 + 1/2) / (23/6) = 7/23. A counts as (23/6)² / ((4/3)²/4 + (5/2)²/5) = 529/61 people, B as
    (23/6)² / ((4/3)²/2 + (5/2)²/5) = 529/77. In all, A is 5/9 and B 2/7.
    """
    rows = [(0, 0, 1, 1), (0, 0, 9, 3), (1, 0, 2, 1), (1, 0, 9, 1)]
    rows += [(0, 1, 2, 3), (0, 1, 9, 2), (1, 1, 1, 4), (1, 1, 9, 1)]
    code, site, step, n = zip(*rows, strict=True)
    a, b = waits.compare(log(code, site, step, [True] * 8, n, 2))
    assert (a.unserved, a.rest_unserved) == pytest.approx((5 / 9, 2 / 7))
    assert (a.difference, b.difference) == pytest.approx((5 / 23, -5 / 23))
    ends = []
    for share, people in ((12 / 23, 529 / 61), (7 / 23, 529 / 77)):
        # the delta method on log(−log S), each of two limits at 97.5 %
        spread = math.sqrt((1 - share) / (share * people)) / abs(math.log(share))
        z = stats.norm.isf(0.0125)
        ends.append([share ** math.exp(z * spread), share ** math.exp(-z * spread)])
    (low, high), (rest_low, rest_high) = ends
    assert a.low == pytest.approx(5 / 23 - np.hypot(12 / 23 - low, rest_high - 7 / 23))
    assert a.high == pytest.approx(5 / 23 + np.hypot(high - 12 / 23, 7 / 23 - rest_low))


def test_without_censoring_it_is_mantel_and_haenszels_difference():
    tally = random_log()
    assert tally.waits is not None
    told = dataclasses.replace(tally.waits, responded=np.ones(400, bool))
    found = waits.compare(dataclasses.replace(tally, waits=told))
    parts, inside, later = [], tally.inside(), (told.step > 12)[:, None]
    for site in range(3):
        n = np.where(told.stratum == site, told.n, 0)[:, None]
        sides = (inside, 1 - inside)
        parts.append(Counts(*(np.sum(n * k * s, axis=0) for s in sides for k in (1, later))))
    expected = mantel_haenszel(parts)
    assert [one.difference for one in found] == pytest.approx(list(expected.difference))


def test_where_all_or_none_still_wait_a_small_group_is_not_sure():
    """Three of A at each of two sites all wait: (2·w)² / Σ w²/3 = 6, so Wilson's for 6 of 6."""
    rows = [(0, 0, 9, 3), (0, 1, 9, 3), (1, 0, 1, 20), (1, 1, 1, 20)]
    code, site, step, n = zip(*rows, strict=True)
    a, b = waits.compare(log(code, site, step, [True] * 4, n, 2))
    assert (a.difference, b.difference) == (1.0, -1.0)
    low, _ = proportion_confint(6, 6, alpha=0.025, method="wilson")
    _, high = proportion_confint(0, 40, alpha=0.025, method="wilson")
    assert a.low == pytest.approx(1 - np.hypot(1 - low, high))
    assert a.high == 1.0


def test_a_stratum_with_one_side_or_out_of_sight_says_nothing():
    both = [(0, 0, 1, True, 3), (0, 0, 9, True, 2), (1, 0, 1, True, 1), (1, 0, 9, True, 4)]
    alone = [(0, 1, 1, True, 30)]
    # everybody of A at the third site is lost from sight before the limit
    lost = [(0, 2, 1, False, 5), (1, 2, 1, True, 5)]
    found = []
    for rows in (both, both + alone, both + alone + lost):
        code, site, step, responded, n = zip(*rows, strict=True)
        found.append(waits.compare(log(code, site, step, responded, n, 2))[0])
    one, two, three = found
    for name in ("difference", "low", "high"):
        assert getattr(two, name) == pytest.approx(getattr(one, name))
        assert getattr(three, name) == pytest.approx(getattr(one, name))
    assert two.p == pytest.approx(one.p)
    assert two.n == 35


def test_groups_that_never_meet_are_not_compared():
    rows = [(0, 0, 1, 5), (0, 0, 9, 5), (1, 1, 1, 5), (1, 1, 9, 5)]
    code, site, step, n = zip(*rows, strict=True)
    for one in waits.compare(log(code, site, step, [True] * 4, n, 2)):
        assert one.unserved == pytest.approx(0.5)
        assert all(math.isnan(value) for value in (one.difference, one.low, one.high, one.p))


def test_limits_cover_a_difference_that_all_strata_have():
    """600 logs of six sites, other speeds each; 12 of A and 40 of B, 20 to 30 % out of sight.

    Exponential waiting with S_B = exp(−2 r) and S_A = S_B + 0.15 at step 200, people leave
    evenly until step 400. Limits of 95 % (two groups: 97.5 % each).
    """
    rng, covered, differences = np.random.default_rng(11), [], []
    late, sites = 200, np.linspace(0.15, 0.65, 6)
    site = np.repeat(np.arange(6), 52)
    code = np.tile(np.repeat([0, 1], [12, 40]), 6)
    share = sites[site] + 0.15 * (code == 0)
    for _ in range(600):
        wait = np.ceil(-late / np.log(share) * rng.exponential(size=len(site)))
        leave = np.ceil(rng.uniform(0, 2 * late, len(site)))
        step = np.minimum(wait, leave).astype(np.int64)
        one = waits.compare(log(code, site, step, wait <= leave, np.ones(len(site)), late))[0]
        covered.append(one.low <= 0.15 <= one.high)
        differences.append(one.difference)
    assert 0.96 <= np.mean(covered) <= 0.995
    assert np.mean(differences) == pytest.approx(0.15, abs=0.01)


def test_identities_that_were_counted_by_themselves_give_the_same():
    tally = random_log()
    told = tally.waits
    assert told is not None
    apart = np.concatenate(
        [np.where(np.arange(2) == d, told.codes, -1) for d in range(2)], dtype=np.int64
    )
    twice = {
        name: np.concatenate([getattr(told, name)] * 2)
        for name in ("stratum", "step", "responded", "n")
    }
    split = dataclasses.replace(told, codes=apart, **twice)
    assert split.services == told.services == told.n.sum()
    assert waits.compare(dataclasses.replace(tally, waits=split)) == waits.compare(tally)
