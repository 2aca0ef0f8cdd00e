"""Hypergeometric numbers against the probabilities that SciPy gives, and NumPy's own draws."""

import numpy as np
import pytest
from scipy import stats

from evenhand.statistics.urns import deal

DRAWS = 40_000


def drawn(good, bad, taken, seed=0, draws=DRAWS):
    """How many of the balls taken are good: a cell of tables of two rows and two columns."""
    sums = np.array([good, bad]), np.array([taken, good + bad - taken])
    return deal(*sums, draws, np.random.default_rng(seed))[0, 0]


@pytest.mark.parametrize(
    ("good", "bad", "taken"),
    [
        (3, 5, 2),
        (5, 3, 7),
        (30, 20, 9),
        (8, 900, 450),
        (900, 8, 700),
        (100, 200, 15),
        (300, 200, 480),
        (4000, 3000, 3500),
        (11, 30_000, 20_000),
        (400_000, 300_000, 650_000),  # factorials beyond those that are looked up
        (3_000_000, 6_000_000, 40),
        (6_000_000, 3_000_000, 5_000_000),
    ],
)
def test_numbers_come_as_often_as_scipy_says(good, bad, taken):
    values = drawn(good, bad, taken)
    assert values.shape == (DRAWS,)
    law = stats.hypergeom(good + bad, good, taken)
    # Cells between quantiles, whose probabilities SciPy gives too.
    edges = np.unique(law.ppf(np.linspace(0.02, 0.98, 40)))
    p = np.diff(np.concatenate([[0.0], law.cdf(edges), [1.0]]))
    seen = np.bincount(np.searchsorted(edges, values), minlength=len(p))
    kept = p * DRAWS > 1e-6
    assert seen[~kept].sum() == 0
    assert stats.chisquare(seen[kept], p[kept] * DRAWS / p[kept].sum()).pvalue > 1e-3


def test_the_variance_of_a_large_urn():
    values = drawn(500_000_000, 400_000_000, 10_000_000)
    share, total = 5 / 9, 900_000_000
    variance = 1e7 * share * (1 - share) * (total - 1e7) / (total - 1)
    spread = np.sqrt(variance)
    assert abs(values.mean() - 1e7 * share) < 5 * spread / DRAWS**0.5
    assert values.var() == pytest.approx(variance, rel=5 * (2 / DRAWS) ** 0.5)


@pytest.mark.parametrize(
    ("good", "bad", "taken", "found"),
    [(0, 5, 3, 0), (5, 0, 3, 3), (4, 3, 7, 4), (7, 2, 0, 0), (0, 0, 0, 0)],
)
def test_where_nothing_is_open(good, bad, taken, found):
    np.testing.assert_array_equal(drawn(good, bad, taken, draws=5), found)


def test_the_same_seed_gives_the_same_numbers():
    np.testing.assert_array_equal(drawn(100, 200, 50, 3), drawn(100, 200, 50, 3))
    assert (drawn(100, 200, 50, 3) != drawn(100, 200, 50, 4)).any()
