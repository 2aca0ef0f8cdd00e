"""Measures against SciPy's permutation and median tests, exact variances, and hand numbers."""

import itertools
import math
import statistics
from typing import Any

import numpy as np
import pytest
from scipy import stats

from evenhand.audits.count.tally import Identity, Tally, Values
from evenhand.audits.judge import means

PERMUTATIONS = 4000
NAME = "smiles_per_minute"


def log(codes, value, groups, n=None, stratum=None):
    """A tally with one measure; groups are the sizes of the identities."""
    codes = np.array(codes, np.int64)
    n = np.ones(len(codes), np.int64) if n is None else np.array(n)
    place = np.zeros(len(codes), np.int64) if stratum is None else np.array(stratum)
    value = np.array(value, float)
    return Tally(
        identities=tuple(
            Identity(f"identity{d}", tuple(f"group{g}" for g in range(size)))
            for d, size in enumerate(groups)
        ),
        issues=("willingness",),
        strata=("",),
        codes=codes[:1],
        stratum=np.zeros(1, np.int64),
        x=np.zeros((1, 1)),
        n=np.ones(1, np.int64),
        values=(Values(NAME, codes, place, value, value, n),),
    )


def compared(tally, seed=0):
    return means.compare(tally, np.random.default_rng(seed), PERMUTATIONS)


def p_values(tally, seed=0):
    rng = np.random.default_rng(seed)
    return means.p_values(tally, tally.values[0], rng, PERMUTATIONS)


def near(q):
    """Five standard errors of the difference of two drawn p-values."""
    return 5 * math.sqrt(2 * q * (1 - q) / PERMUTATIONS) + 2 / PERMUTATIONS


def test_means_and_medians_by_hand():
    tally = log([[0], [0], [1], [1], [1]], [4, 1, 7, 2, 3], [3], n=[2, 1, 1, 1, 4])
    a, b, empty = compared(tally)
    assert (a.measure, a.identity, a.group, a.n) == (NAME, "identity0", "group0", 3)
    assert (a.mean, a.rest_mean) == (9 / 3, 21 / 6)
    assert (a.median, a.rest_median) == (4, statistics.median([7, 2, 3, 3, 3, 3]))
    assert (b.mean, b.rest_mean, b.n) == (21 / 6, 3, 6)
    assert empty.n == 0
    missing = (empty.mean, empty.median, empty.mean_p, empty.median_p)
    assert all(math.isnan(value) for value in missing)
    assert (empty.rest_mean, empty.rest_median) == (30 / 9, 3)


def test_an_even_number_of_services_has_the_middle_of_two():
    assert means.median(np.array([1.0, 2.0, 5.0]), np.array([1, 1, 2])) == 3.5
    assert means.median(np.array([1.0, 5.0]), np.array([2, 2])) == 3.0
    assert math.isnan(means.median(np.array([1.0]), np.array([0])))


def test_all_assignments_of_a_tiny_log():
    value, groups = [1.0, 2.5, 4.0, 8.0, 9.0, 30.0], [0, 0, 1, 0, 1, 1]
    ends = [sum(v for v, g in zip(value, groups, strict=True) if g == 0) / 3]
    middle = sum(value) / 6
    every = [sum(part) / 3 for part in itertools.combinations(value, 3)]
    p = sum(abs(m - middle) >= abs(ends[0] - middle) - 1e-9 for m in every) / len(every)
    found = p_values(log([[g] for g in groups], value, [2]))
    assert found[:, 0] == pytest.approx([p, p], abs=5 * math.sqrt(p * (1 - p) / PERMUTATIONS))


@pytest.mark.parametrize("shuffled", [means.SHUFFLED, 0], ids=["shuffled", "drawn"])
def test_two_groups_against_scipy(shuffled, monkeypatch):
    monkeypatch.setattr(means, "SHUFFLED", shuffled)
    rng = np.random.default_rng(1)
    codes = (rng.random(600) < 0.4).astype(int)
    value = rng.gamma(2.0, 1.0, 600) + 0.35 * codes
    a, b = value[codes == 0], value[codes == 1]
    oracle = stats.permutation_test(
        (a, b),
        lambda a, b, axis: np.abs(a.mean(axis=axis) - b.mean(axis=axis)),
        vectorized=True,
        n_resamples=PERMUTATIONS,
        alternative="greater",
        rng=np.random.default_rng(2),
    ).pvalue
    found = p_values(log(codes[:, None], value, [2]))
    assert 0.005 < oracle < 0.3
    assert found[:, 0] == pytest.approx([oracle] * 2, abs=near(oracle))
    tested: Any = stats.median_test(a, b, correction=False)
    median = tested.pvalue
    assert 0.005 < median < 0.6
    # The chi-square law of a discrete count is off by about half a step.
    assert found[:, 1] == pytest.approx([median] * 2, abs=near(median) + 0.05)


def strata_log(stratum_shift):
    rng = np.random.default_rng(3)
    codes = rng.integers(0, (3, 2), (500, 2))
    stratum = np.where(rng.random(500) < 0.2 + 0.3 * codes[:, 0], 1, 0)
    value = rng.exponential(1.0, 500) + stratum_shift * stratum
    return codes, value, stratum


def test_what_a_stratum_explains_is_no_difference():
    codes, value, stratum = strata_log(5.0)
    apart = p_values(log(codes, value, [3, 2]))
    within = p_values(log(codes, value, [3, 2], stratum=stratum))
    assert (apart[[0, 2]] < 0.001).all()
    assert (within > 0.02).all()


@pytest.mark.parametrize("way", ["_shuffled", "_drawn"])
def test_drawn_sums_have_the_exact_moments(way, monkeypatch):
    codes, value, stratum = strata_log(1.0)
    n = 1 + np.arange(500) % 3
    tally = log(codes, value, [3, 2], n=n, stratum=stratum)
    rows = means._scored(tally, tally.values[0])
    drawn = np.concatenate([*getattr(means, way)(rows, np.random.default_rng(4), 20_000)])
    # The same from rows of services, in plain loops over strata and groups.
    each = np.repeat(np.arange(500), n)
    v, s, c = value[each], stratum[each], codes[each]
    spread = 0.0
    variance = np.zeros(5)
    for one in (0, 1):
        own = s == one
        spread += ((v[own] - v[own].mean()) ** 2).sum()
        for g, (d, code) in enumerate([(0, 0), (0, 1), (0, 2), (1, 0), (1, 1)]):
            inside, size = (c[own, d] == code).sum(), own.sum()
            variance[g] += inside * (size - inside) / size * v[own].var(ddof=1)
    variance /= spread / len(each)  # the measure is brought to a spread of 1
    np.testing.assert_allclose(means._moments(rows)[1][:, 0], variance)
    np.testing.assert_allclose(drawn[..., 0].var(axis=0), variance, rtol=0.06)
    np.testing.assert_allclose(drawn[..., 0].mean(axis=0) / np.sqrt(variance), 0, atol=0.04)
    # The two groups of the second identity add up to everybody.
    np.testing.assert_allclose(drawn[..., 3, :], -drawn[..., 4, :], atol=1e-8)


def test_small_groups_of_a_large_skewed_log_keep_their_shape(monkeypatch):
    # One service in a hundred has the value 1; one of five in the small group does.
    monkeypatch.setattr(means, "SHUFFLED", 0)
    value = np.zeros(4000)
    value[4:44] = 1.0
    codes = np.ones((4000, 1), int)
    codes[:5], codes[40:1900] = 0, 2
    tally = log(codes, value, [3])
    rows = means._scored(tally, tally.values[0])
    drawn = np.concatenate([*means._drawn(rows, np.random.default_rng(6), PERMUTATIONS)])
    # A normal law would have it in one of 50,000 permutations (z = 4.3), not in one of twenty.
    sums, variance, _ = means._moments(rows)
    share = (np.abs(drawn[:, 0, 0]) >= sums[0, 0] - 1e-9).mean()
    p = stats.hypergeom.sf(0, 4000, 40, 5)
    assert share == pytest.approx(p, abs=near(p))
    assert 2 * stats.norm.sf(sums[0, 0] / variance[0, 0] ** 0.5) < 1e-4
    # What the small group takes is missing elsewhere: all groups together are everybody.
    np.testing.assert_allclose(drawn.sum(axis=1), 0, atol=1e-8)
    np.testing.assert_allclose(drawn[..., 0].var(axis=0), variance[:, 0], rtol=0.15)


def test_a_measure_that_never_varies_shows_nothing():
    found = p_values(log([[0], [1]] * 30, [0.1] * 60, [2]))
    np.testing.assert_array_equal(found, 1.0)


def test_ties_on_the_median_count_for_neither_side():
    # Six in ten are 0 in one group, nine in ten in the other: the common median is 0.
    value = [0] * 60 + [3] * 40 + [0] * 90 + [3] * 10
    found = p_values(log([[0]] * 100 + [[1]] * 100, value, [2]))
    exact: Any = stats.fisher_exact([[60, 40], [90, 10]])
    assert exact.pvalue < 1e-5
    assert found[:, 1] == pytest.approx([1 / (PERMUTATIONS + 1)] * 2)


def test_ten_million_services_as_counts():
    n = np.array([2_501_000, 2_499_000, 2_500_000, 2_500_000])
    a, b = compared(log([[0], [0], [1], [1]], [1, 0, 1, 0], [2], n=n))
    # 0.0002 over the standard error sqrt(0.25 (1/5e6 + 1/5e6)).
    p = 2 * stats.norm.sf(0.0002 / math.sqrt(0.25 * 2 / 5e6))
    assert a.mean_p == b.mean_p == pytest.approx(p, abs=near(p))
    assert a.mean - a.rest_mean == pytest.approx(0.0002)
