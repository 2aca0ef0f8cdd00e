"""Chance-corrected gaps and standard errors: by hand, by enumeration."""

import itertools

import numpy as np
import pytest
from scipy.stats import binom

from evenhand.methods.paper.scores import Counts
from evenhand.statistics import chance, intervals
from support.refusals import refused

NAN = np.nan


def counts(*cells) -> Counts:
    """Cells (n, x, m, y) as groups of one issue."""
    columns = np.array(cells, float).T[..., None]
    return Counts(*columns)


class TestSquaredGap:
    def test_by_hand(self):
        # (2/4 − 1/5)² − .25/3 − .16/4
        found = chance.squared_gap(counts((4, 2, 5, 1)))
        np.testing.assert_allclose(found, [[0.09 - 0.25 / 3 - 0.04]])

    @pytest.mark.parametrize(("n", "m", "p", "q"), [(2, 5, 0.3, 0.3), (4, 3, 0.9, 0.2)])
    def test_its_mean_over_all_outcomes_is_the_true_square(self, n, m, p, q):
        mean = 0.0
        for x, y in itertools.product(range(n + 1), range(m + 1)):
            weight = binom.pmf(x, n, p) * binom.pmf(y, m, q)
            mean += weight * chance.squared_gap(counts((n, x, m, y)))[0, 0]
        assert mean == pytest.approx((p - q) ** 2, abs=1e-12)

    @pytest.mark.parametrize("cell", [(1, 1, 9, 3), (9, 3, 1, 0), (0, 0, 9, 3), (0, 0, 0, 0)])
    def test_with_fewer_than_two_on_a_side_it_is_missing(self, cell):
        assert np.isnan(chance.squared_gap(counts(cell))).all()

    def test_the_score_averages_first_and_keeps_the_sign(self):
        squared = np.array([[0.09, -0.5], [-0.05, 0.1], [NAN, NAN]])
        found = chance.corrected_issue_score(squared)
        np.testing.assert_allclose(found, [np.sqrt(0.02), -np.sqrt(0.2)])
        windows = np.stack([squared, squared + 0.2])
        pooled = chance.corrected_issue_score(windows, axis=(0, 1))
        np.testing.assert_allclose(pooled, [np.sqrt(0.12), -np.sqrt(0.1)])

    @pytest.mark.parametrize("services", [30, 300, 5000])
    def test_it_does_not_depend_on_the_number_of_services(self, services):
        """Rates 0.5 and 0.2, a third of the people inside: 0.3, however many are counted."""
        rng, n = np.random.default_rng(services), services // 3
        windows = 20_000
        x, y = rng.binomial(n, 0.5, windows), rng.binomial(services - n, 0.2, windows)
        many = Counts(*(np.broadcast_to(v, windows)[:, None, None].astype(float)
                        for v in (n, x, services - n, y)))  # fmt: skip
        found = chance.corrected_issue_score(chance.squared_gap(many), axis=(0, 1))
        np.testing.assert_allclose(found, [0.3], atol=0.01)

    def test_an_even_robot_scores_around_zero(self):
        rng = np.random.default_rng(1)
        x, y = rng.binomial(50, 0.2, (4000, 22)), rng.binomial(100, 0.2, (4000, 22))
        many = Counts(*(np.broadcast_to(v, x.shape)[..., None].astype(float)
                        for v in (50, x, 100, y)))  # fmt: skip
        found = chance.corrected_issue_score(chance.squared_gap(many))
        assert abs(found.mean()) < 0.005
        # a root that is clipped finds something in every window
        assert np.maximum(found, 0.0).mean() > 0.01

    def test_a_score_of_nothing_is_missing(self):
        assert np.isnan(chance.corrected_issue_score(np.full((3, 2), NAN))).all()

    def test_scores_by_identity(self):
        groups = [("one", "a"), ("one", "b"), ("two", "c")]
        found = chance.corrected_scores(
            counts((4, 4, 4, 0), (4, 2, 4, 2), (1, 1, 7, 3)), groups, ["late"]
        )
        # squares: 1; 0 − 2 · .25/3; missing
        np.testing.assert_allclose(found.overall, [np.sqrt((1 - 0.5 / 3) / 2)])
        np.testing.assert_allclose(found.by_identity["one"], found.overall)
        assert np.isnan(found.by_identity["two"]).all()
        np.testing.assert_allclose(found.gap, [[1], [-np.sqrt(0.5 / 3)], [NAN]])
        np.testing.assert_array_equal(found.missing, [1])


class TestExcess:
    @pytest.mark.parametrize("sizes", [(3, 1, 4, 2), (1, 0, 5, 2), (2, 2, 5, 3), (4, 0, 2, 0)])
    def test_the_even_gap_is_the_mean_over_all_assignments(self, sizes):
        n, x, m, y = sizes
        drawn = [
            abs(sum(i < x + y for i in who) / n - (x + y - sum(i < x + y for i in who)) / m)
            for who in itertools.combinations(range(n + m), n)
        ]
        assert chance.even_gaps(counts(sizes))[0, 0] == pytest.approx(np.mean(drawn), abs=1e-12)

    def test_the_published_size_of_the_bias(self):
        # sqrt(2/π) sqrt(p(1−p)(1/n + 1/m)) for large windows.
        found = chance.even_gaps(counts((20000, 6000, 30000, 9000)))[0, 0]
        assert found == pytest.approx(np.sqrt(2 / np.pi * 0.21 * (1 / 2e4 + 1 / 3e4)), rel=1e-3)

    def test_scores_are_the_difference(self):
        found = chance.excess_scores(counts((1, 1, 1, 0), (1, 0, 1, 0)), [("a", "b")] * 2, ["k"])
        # With one on each side and one issue, chance alone gives 1; with none, 0.
        np.testing.assert_allclose(found.gap, [[0], [0]], atol=1e-12)
        wide = chance.excess_scores(counts((2, 2, 2, 0)), [("a", "b")], ["k"])
        np.testing.assert_allclose(wide.overall, [1 - 2 / 6])  # 1, 1 or four times 0

    def test_an_empty_side_is_missing(self):
        assert np.isnan(chance.even_gaps(counts((0, 0, 5, 2), (5, 2, 0, 0)))).all()

    def test_it_needs_whole_numbers(self):
        with refused("type counts"):
            chance.even_gaps(counts((1.5, 1, 2, 1)))


class TestStandardErrors:
    def test_the_standard_error_by_hand(self):
        found = chance.standard_error(counts((2, 1, 6, 1)))
        np.testing.assert_allclose(found, [[np.sqrt(0.25 / 4 + 0.25 * 0.75 / 8)]])

    def test_three_of_three_is_not_certain(self):
        assert chance.standard_error(counts((3, 3, 3, 0)))[0, 0] > 0.2

    def test_large_counts_give_the_plain_formula(self):
        found = chance.standard_error(counts((1e6, 3e5, 2e6, 4e5)))
        np.testing.assert_allclose(found, np.sqrt(0.21 / 1e6 + 0.16 / 2e6), rtol=1e-5)


@pytest.mark.parametrize("cell", [(4, -1, 5, 2), (4, 5, 5, 2), (NAN, 1, 5, 2), (4, 1, np.inf, 2)])
@pytest.mark.parametrize(
    "compute",
    [
        chance.squared_gap,
        chance.even_gaps,
        chance.standard_error,
        intervals.newcombe,
    ],
)
def test_counts_that_cannot_be(cell, compute):
    with refused("range counts", "0"):
        compute(counts(cell))


def test_many_windows_at_once():
    one, two = counts((4, 2, 5, 1), (6, 3, 3, 0)), counts((9, 2, 5, 1), (6, 6, 8, 0))
    stacked = Counts(
        np.stack([one.inside_n, two.inside_n]),
        np.stack([one.inside_x, two.inside_x]),
        np.stack([one.outside_n, two.outside_n]),
        np.stack([one.outside_x, two.outside_x]),
    )
    for compute in (chance.squared_gap, chance.even_gaps):
        np.testing.assert_array_equal(compute(stacked), np.stack([compute(one), compute(two)]))
