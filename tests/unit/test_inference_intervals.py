"""Intervals of shares and of their differences: published, by statsmodels, by enumeration."""

import numpy as np
import pytest
from scipy.stats import binom
from statsmodels.stats.proportion import confint_proportions_2indep, proportion_confint

from evenhand.methods.paper.scores import Counts
from evenhand.statistics import intervals
from support.refusals import refused

NAN = np.nan
CELLS = [(70, 56, 80, 48), (10, 9, 10, 3), (10, 0, 20, 0), (5, 5, 7, 0), (3, 0, 900, 400)]
LEVELS = (0.5, 0.95, 0.9994)


def counts(*cells) -> Counts:
    """Cells (n, x, m, y) as groups of one issue."""
    return Counts(*np.array(cells, float).T[..., None])


def test_newcombe_s_own_example():
    # 56/70 − 48/80, Newcombe 1998, table II, method 10.
    low, high = intervals.newcombe(counts((70, 56, 80, 48)))
    assert (round(low.item(), 4), round(high.item(), 4)) == (0.0524, 0.3339)


@pytest.mark.parametrize("level", LEVELS)
def test_newcombe_against_statsmodels(level):
    low, high = intervals.newcombe(counts(*CELLS), level)
    for cell, found in zip(CELLS, np.stack([low, high], -1)[:, 0], strict=True):
        n, x, m, y = cell
        expected = confint_proportions_2indep(x, n, y, m, method="newcomb", alpha=1 - level)
        np.testing.assert_allclose(found, np.array(expected), atol=1e-12)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(
    ("limits", "method"), [(intervals.wilson, "wilson"), (intervals.clopper_pearson, "beta")]
)
def test_limits_of_a_share_against_statsmodels(limits, method, level):
    x, n = np.array([0, 3, 10, 1, 1]), np.array([10, 10, 10, 4000, 1])
    expected = proportion_confint(x, n, alpha=1 - level, method=method)
    np.testing.assert_allclose(limits(x, n, level), np.array(expected), atol=1e-12)


def test_the_limits_of_the_sides_can_be_chosen():
    # 3 of 10 and 9 of 40 by Newcombe's formula from Clopper and Pearson's limits.
    (a, b), (c, d) = (proportion_confint(x, n, method="beta") for x, n in ((3, 10), (9, 40)))
    low, high = intervals.newcombe(counts((10, 3, 40, 9)), 0.95, intervals.clopper_pearson)
    assert low.item() == pytest.approx(0.075 - np.sqrt((0.3 - a) ** 2 + (d - 0.225) ** 2))
    assert high.item() == pytest.approx(0.075 + np.sqrt((b - 0.3) ** 2 + (0.225 - c) ** 2))


@pytest.mark.parametrize("rate", [0.02, 0.1, 0.3, 0.5])
@pytest.mark.parametrize("sizes", [(3, 97), (10, 290), (10, 990), (50, 50)])
def test_limits_of_88_gaps_hold_together_even_where_issues_are_rare(sizes, rate):
    """All outcomes of one gap of an even robot, each with its probability."""
    n, m = sizes
    x, y = (v.ravel() for v in np.meshgrid(np.arange(n + 1.0), np.arange(m + 1.0)))
    cells = counts(*zip(np.full_like(x, n), x, np.full_like(x, m), y, strict=True))
    chance = binom.pmf(x, n, rate) * binom.pmf(y, m, rate)

    def missed(limits: intervals.ShareLimits) -> float:
        low, high = (v[:, 0] for v in intervals.newcombe(cells, 1 - 0.05 / 88, limits))
        return chance[(low > 1e-12) | (high < -1e-12)].sum()

    assert missed(intervals.clopper_pearson) <= 0.05 / 88
    if rate == 0.02 and n < m:
        assert missed(intervals.wilson) > 10 * 0.05 / 88  # why they are not taken here


@pytest.mark.parametrize("limits", [intervals.wilson, intervals.clopper_pearson])
def test_an_empty_side_has_no_interval(limits):
    cells = counts((0, 0, 5, 1), (5, 1, 0, 0), (0, 0, 0, 0))
    for limit in intervals.newcombe(cells, 0.95, limits):
        assert np.isnan(limit).all()
    for limit in limits(np.zeros(2), np.zeros(2), 0.95):
        assert np.isnan(limit).all()


@pytest.mark.parametrize("level", [0.0, 1.0, -1, NAN])
@pytest.mark.parametrize("limits", [intervals.wilson, intervals.clopper_pearson])
def test_a_level_outside_0_to_1(level, limits):
    with refused("range level"):
        intervals.newcombe(counts((70, 56, 80, 48)), level, limits)
