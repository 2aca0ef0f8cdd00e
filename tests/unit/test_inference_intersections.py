"""Tiny intersections: the prior against a search on a grid."""

import numpy as np
import pytest
from scipy.stats import beta, betabinom

from evenhand.core.errors import InputError
from evenhand.statistics import intersections
from support.refusals import refused

NAN = np.nan


class TestPrior:
    def test_no_point_of_a_grid_is_more_probable(self):
        cases, n = np.array([0, 1, 3, 9, 4, 0, 12]), np.array([2, 5, 4, 30, 5, 7, 20])
        a, b = intersections.fit_prior(cases, n)
        mean, precision = np.meshgrid(np.linspace(0.02, 0.98, 97), np.geomspace(0.2, 2000, 80))
        grid = betabinom.logpmf(
            cases, n, (mean * precision)[..., None], ((1 - mean) * precision)[..., None]
        ).sum(axis=-1)
        mine = betabinom.logpmf(cases, n, a, b).sum()
        assert grid.max() <= mine + 1e-6
        assert mine < grid.max() + 0.1  # the grid is fine enough to come close

    def test_it_finds_what_made_the_counts(self):
        rng = np.random.default_rng(0)
        n = rng.integers(1, 40, 3000)
        a, b = intersections.fit_prior(rng.binomial(n, rng.beta(3, 7, 3000)), n)
        assert a / (a + b) == pytest.approx(0.3, abs=0.01)
        assert a + b == pytest.approx(10, rel=0.15)

    def test_rates_that_are_all_alike_are_pooled(self):
        a, b = intersections.fit_prior(np.full(20, 6.0), np.full(20, 20.0))
        assert a / (a + b) == pytest.approx(0.3, abs=1e-3)
        assert a + b > 1e4

    @pytest.mark.parametrize("share", [0, 1])
    def test_an_issue_never_or_always_seen_is_not_certain(self, share):
        n = np.array([3.0, 5, 2])
        found = intersections.shrink(n * share, n)
        assert ((found.rate > 0) & (found.rate < 1)).all()
        np.testing.assert_allclose(found.rate, share, atol=0.06)


class TestShrinking:
    def test_with_a_given_prior_by_hand(self):
        found = intersections.shrink(np.array([0, 4.0, 0]), np.array([1, 4.0, 0]), 0.8, (1.0, 3.0))
        np.testing.assert_allclose(found.rate, [1 / 5, 5 / 8, 1 / 4])
        np.testing.assert_allclose(found.low, beta.ppf(0.1, [1, 5, 1], [4, 3, 3]))
        np.testing.assert_allclose(found.high, beta.ppf(0.9, [1, 5, 1], [4, 3, 3]))
        np.testing.assert_array_equal(found.raw, [0, 1, NAN])
        np.testing.assert_array_equal(found.n, [1, 4, 0])

    def test_the_smaller_the_cell_the_more_it_is_shrunk(self):
        found = intersections.shrink(np.array([2, 20, 200, 30.0]), np.array([2, 20, 200, 100.0]))
        moved = 1 - found.rate[:3]
        assert moved[0] > moved[1] > moved[2] > 0
        assert (found.low < found.rate).all()
        assert (found.rate < found.high).all()

    def test_intervals_hold_the_truth_about_as_often_as_stated(self):
        rng = np.random.default_rng(1)
        truth, n = rng.beta(2, 6, 2000), rng.integers(1, 10, 2000)
        found = intersections.shrink(rng.binomial(n, truth), n, 0.9)
        held = ((found.low <= truth) & (truth <= found.high)).mean()
        assert held == pytest.approx(0.9, abs=0.03)
        raw = np.abs(found.raw - truth).mean()
        assert np.abs(found.rate - truth).mean() < 0.75 * raw

    @pytest.mark.parametrize(
        ("cases", "n", "message"),
        [
            ([1], [3], "fewer than two combinations"),
            ([1, 0], [3, 0], "fewer than two combinations"),
            ([], [], "fewer than two combinations"),
            ([4, 1], [3, 3], "fewer services than issues"),
            ([-1, 1], [3, 3], "fewer services than issues"),
            ([NAN, 1], [3, 3], "not finite"),
            ([1, 1], [3], "do not match"),
        ],
    )
    def test_counts_that_cannot_be(self, cases, n, message):
        with pytest.raises(InputError, match=message):
            intersections.shrink(np.array(cases, float), np.array(n, float))

    def test_counts_that_cannot_be_whatever_the_prior(self):
        with refused("range cases"):
            intersections.shrink(np.array([5.0]), np.array([3.0]), prior=(1.0, 1.0))

    def test_a_prior_that_cannot_be(self):
        with refused("range prior"):
            intersections.shrink(np.ones(2), np.ones(2), prior=(0.0, 1.0))
