"""Statistics over seeds: by hand, against SciPy, and laws."""

from math import isnan, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import stats
from scipy.stats import mannwhitneyu

from evenhand.core.errors import InputError
from evenhand.experiments.comparison import aggregate
from support.refusals import refused

NUMBERS = st.floats(-1e3, 1e3)
CORNERS = st.lists(st.tuples(st.integers(-2, 5), st.integers(-2, 5)), max_size=6)


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


class TestInterquartileMean:
    @pytest.mark.parametrize(
        ("values", "expected"),
        [
            ([7], 7),
            ([1, 2], 1.5),
            ([6, 1, 2], 2.5),  # (1/4 + 2 + 6/4) / 1.5
            ([4, 1, 3, 2], 2.5),
            ([100, 0, 1, 3, 2], 2),  # (3/4 · 1 + 2 + 3/4 · 3) / 2.5
            ([1, 2, 3, 4, 5, 6, 7, 8, 9, 1000], 5.5),  # (3/2 + 4 + 5 + 6 + 7 + 8/2) / 5
        ],
    )
    def test_by_hand(self, values, expected):
        assert aggregate.iqm(np.array(values)) == pytest.approx(expected, abs=1e-12)

    @given(st.integers(1, 6).flatmap(lambda k: hnp.arrays(float, (3, 4 * k), elements=NUMBERS)))
    def test_as_scipy_trims_where_quarters_are_whole(self, values):
        expected = stats.trim_mean(values, 0.25, axis=1)
        np.testing.assert_allclose(aggregate.iqm(values, 1), expected, atol=1e-9)
        np.testing.assert_allclose(aggregate.iqm(values.T, 0), expected, atol=1e-9)

    @given(hnp.arrays(float, st.integers(1, 15), elements=NUMBERS), NUMBERS, st.floats(0, 10))
    def test_laws(self, values, shift, scale):
        found = aggregate.iqm(values)
        assert values.min() - 1e-9 <= found <= values.max() + 1e-9
        assert aggregate.iqm(values[::-1]) == pytest.approx(found, abs=1e-9)
        moved = aggregate.iqm(scale * values + shift)
        assert moved == pytest.approx(scale * found + shift, abs=1e-7)
        assert aggregate.iqm(-values) == pytest.approx(-found, abs=1e-9)

    @given(hnp.arrays(float, st.integers(4, 15), elements=st.floats(0, 1)))
    def test_one_wild_seed_does_not_carry_it(self, values):
        wild = np.sort(values)
        wild[-1] = 1e9
        assert aggregate.iqm(wild) == pytest.approx(aggregate.iqm(values), abs=1e-6)

    @pytest.mark.parametrize("values", [[], [1.0, nan], [np.inf, 1.0]])
    def test_nothing_or_missing_is_refused(self, values):
        with refused("range values"):
            aggregate.iqm(np.array(values))


class TestBootstrap:
    def test_as_scipy(self):
        values = np.random.default_rng(0).gamma(2.0, size=10)
        found = aggregate.mean_of([values], rng())
        oracle = stats.bootstrap(
            (values,), lambda x, axis: aggregate.iqm(x, axis), n_resamples=10_000,
            method="percentile", rng=np.random.default_rng(9),
        )  # fmt: skip
        low, high = oracle.confidence_interval
        assert (found.low, found.high) == pytest.approx((low, high), abs=0.02 * (high - low) + 0.02)
        assert found.low < found.value < found.high
        assert found.n == 10

    def test_the_interval_of_many_is_that_of_the_normal_law(self):
        values = np.random.default_rng(1).normal(size=400)
        found = aggregate.bootstrap([values], lambda drawn: drawn[0].mean(axis=1), rng())
        half = 1.96 * values.std() / 20
        assert found.value == pytest.approx(values.mean())
        assert (found.low, found.high) == pytest.approx(
            (values.mean() - half, values.mean() + half), abs=0.05 * half
        )

    def test_strata_keep_their_shares(self):
        # within each stratum nothing scatters; drawn from all alike, the mean would run 0 to 10
        found = aggregate.mean_of([np.zeros(2), np.full(2, 10.0)], rng())
        assert (found.value, found.low, found.high, found.n) == (5.0, 5.0, 5.0, 4)

    def test_a_stratum_of_one_value_leaves_no_interval(self):
        # nothing is known of its scatter; without it the interval would be far too narrow
        found = aggregate.mean_of([np.arange(10.0), np.array([3.0])], rng())
        assert found.n == 11
        assert isnan(found.low)
        assert isnan(found.high)

    def test_seeds_stay_together(self):
        x = np.array([1.0, 5.0, 9.0, 30.0])
        found = aggregate.difference([np.stack([x + 2.0, x], axis=1)], rng())
        assert (found.value, found.low, found.high) == (2.0, 2.0, 2.0)

    def test_one_value_has_no_interval_and_none_no_value(self):
        one = aggregate.mean_of([np.array([3.0])], rng())
        assert (one.value, one.n) == (3.0, 1)
        assert isnan(one.low)
        assert isnan(one.high)
        none = aggregate.mean_of([np.empty(0)], rng())
        assert none.n == 0
        assert isnan(none.value)

    def test_the_same_stream_gives_the_same_interval(self):
        values = [np.arange(7.0)]
        assert aggregate.mean_of(values, rng()) == aggregate.mean_of(values, rng())

    @pytest.mark.parametrize(
        ("options", "said"),
        [({"resamples": 0}, "resamples is 0"), ({"level": 1.0}, "level is 1.0"),
         ({"level": nan}, "level is nan")],
    )  # fmt: skip
    def test_out_of_range(self, options, said):
        with pytest.raises(InputError, match=said):
            aggregate.bootstrap([np.ones(3)], lambda drawn: drawn[0].mean(axis=1), rng(), **options)


class TestImprovement:
    def test_by_hand(self):
        pairs = np.array([[2.0, 1.0], [1.0, 1.0], [0.0, 1.0], [5.0, 1.0]])
        found = aggregate.improvement([pairs], rng())
        # any of 2, 1, 0, 5 against any 1
        assert found.value == pytest.approx((1 + 0.5 + 0 + 1) / 4)
        assert 0.0 <= found.low < found.value < found.high <= 1.0

    @given(hnp.arrays(float, st.tuples(st.integers(2, 9), st.just(2)), elements=NUMBERS))
    def test_it_is_the_statistic_of_mann_and_whitney(self, pairs):
        found = aggregate.improvement([pairs], rng())
        theirs = mannwhitneyu(pairs[:, 0], pairs[:, 1]).statistic / len(pairs) ** 2
        assert found.value == pytest.approx(theirs)

    def test_every_stratum_counts_alike(self):
        good, bad = np.array([[1.0, 0.0]] * 9), np.array([[0.0, 1.0]] * 3)
        assert aggregate.improvement([good, bad], rng()).value == 0.5

    @given(hnp.arrays(float, st.tuples(st.integers(1, 9), st.just(2)), elements=NUMBERS))
    def test_one_side_gains_what_the_other_loses(self, pairs):
        forth = aggregate.improvement([pairs], rng())
        back = aggregate.improvement([pairs[:, ::-1]], rng())
        assert forth.value + back.value == pytest.approx(1.0)
        if len(pairs) > 1:
            assert forth.low + back.high == pytest.approx(1.0)


class TestShare:
    def test_by_hand(self):
        rows = np.array([[0.06, 0.02, 0.01]] * 4)
        found = aggregate.share([rows], rng())
        assert (found.value, found.low, found.high) == pytest.approx((0.8, 0.8, 0.8))

    def test_shares_are_normalised_before_they_are_pooled(self):
        # all of 0.5 in one scenario, a fifth of 0.05 in the other: not nearly all together
        large, small = np.array([[0.5, 0.0, 0.0]] * 4), np.array([[0.05, 0.04, 0.0]] * 4)
        assert aggregate.share([large, small], rng()).value == pytest.approx((1.0 + 0.2) / 2)

    def test_where_nothing_can_be_attained_it_is_missing(self):
        assert isnan(aggregate.share([np.array([[0.01, 0.0, 0.01]])], rng()).value)
        assert isnan(aggregate.share([np.array([[0.01, 0.0, 0.02]])], rng()).value)

    def test_its_limits_are_missing_where_perhaps_nothing_can_be_attained(self):
        found = aggregate.share([np.array([[0.05, 0.02, 0.01], [0.0, 0.02, 0.01]])], rng())
        assert found.value == pytest.approx((0.025 - 0.02) / (0.025 - 0.01))
        assert isnan(found.low)
        assert isnan(found.high)


class TestFronts:
    def test_by_hand(self):
        points = np.array([[3, 1], [2, 2], [1, 3], [1, 2], [2, 2], [0, 0], [nan, 9]])
        front = [True, True, True, False, True, False, False]
        assert aggregate.pareto_front(points).tolist() == front
        assert aggregate.pareto_front(np.empty((0, 2))).tolist() == []

    @pytest.mark.parametrize(
        ("points", "area"),
        [
            ([(3, 1), (2, 2), (1, 3)], 6),  # a stair of 3 + 2 + 1
            ([(3, 1), (3, 1)], 3),
            ([(2, 2), (1, 1)], 4),
            ([(-1, 5), (5, 0)], 0),
            ([], 0),
        ],
    )
    def test_areas_by_hand(self, points, area):
        assert aggregate.hypervolume(np.array(points), (0.0, 0.0)) == area

    @given(CORNERS)
    def test_the_area_is_the_number_of_squares_below(self, corners):
        squares = {
            (x, y) for a, b in corners for x in range(-1, a) for y in range(-1, b)
        }  # fmt: skip
        area = aggregate.hypervolume(np.array(corners, float).reshape(-1, 2), (-1.0, -1.0))
        assert area == len(squares)

    @given(CORNERS.filter(bool))
    def test_the_front_alone_has_the_whole_area(self, corners):
        points = np.array(corners, float)
        front = points[aggregate.pareto_front(points)]
        worst = (-3.0, -3.0)
        assert len(front)
        assert aggregate.hypervolume(front, worst) == aggregate.hypervolume(points, worst)

    @pytest.mark.parametrize("points", [[[1.0, nan]], [[1.0, 2.0, 3.0]]])
    def test_points_that_are_no_pairs_are_refused(self, points):
        with refused("range points"):
            aggregate.hypervolume(np.array(points), (0.0, 0.0))
