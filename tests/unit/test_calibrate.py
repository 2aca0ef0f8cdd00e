"""The search for the odds of the biased robots."""

import numpy as np
import pytest

from evenhand import robots
from evenhand.experiments import calibrate
from evenhand.experiments.calibrate import Pool
from evenhand.robots import BIASES, MANNERS

NAN = np.nan
# One measured service of each manner, with distances and steps that tell the manners apart.
POOL = Pool(
    issue=np.array(
        [
            [[0, 0, 0, 0]],  # proper
            [[0, 1, 0, 0]],  # far
            [[0, 1, 0, 0]],  # near
            [[0, 1, 0, 1]],  # close
            [[0, 0, 1, 0]],  # late
            [[1, NAN, NAN, 1]],  # ignore
        ],
        float,
    ),
    steps=np.array([[100.0], [0.0], [120.0], [150.0], [220.0], [300.0]]),
    distance=np.array([[1.25], [3.0], [0.75], [0.48], [1.3], [0.42]]),
)


def scores(worse: dict[str, float], others: dict[str, float]):
    """Scores of windows by a robot with these odds of improper manners, about disability."""
    odds = np.array([[row.get(name, 0.0) for name in MANNERS[1:]] for row in (worse, others)])
    return calibrate.expected_scores(POOL, BIASES["ableist"], odds, windows=300, seed=4)


class TestExpectedScores:
    def test_an_even_robot_has_none(self):
        score, distance, step, ignored = scores({}, {})
        np.testing.assert_array_equal(score, [0, 0, 0, 0])
        assert (distance, step, ignored) == (1.25, 100.0, 0.0)

    @pytest.mark.parametrize(
        ("manner", "expected"),
        [
            ("far", (0, 1, 0, 0)),
            ("near", (0, 1, 0, 0)),
            ("close", (0, 1, 0, 1)),
            ("late", (0, 0, 1, 0)),
            ("ignore", (1, NAN, NAN, 1)),
        ],
    )
    def test_one_manner_for_those_served_worse(self, manner, expected):
        with np.errstate(all="raise"):
            # ignored people have no quality, so there is nothing to compare: some are served
            served = {"ignore": 0.9} if manner == "ignore" else {manner: 1.0}
            score, *_, ignored = scores(served, {})
        known = ~np.isnan(expected)
        if manner == "ignore":
            assert score[known] == pytest.approx([0.9, 0.9], abs=0.01)
            assert ignored == pytest.approx(0.45, abs=0.02)
        else:
            np.testing.assert_array_equal(score, expected)

    def test_means_over_responses(self):
        _, distance, step, ignored = scores({"far": 1.0}, {"ignore": 0.5})
        # of 4 people 2 are served from 3 m at once, 1 properly, 1 not at all
        assert distance == pytest.approx((2 * 3.0 + 1.25) / 3, abs=0.05)
        assert step == pytest.approx(100 / 3, abs=2.0)
        assert ignored == pytest.approx(0.25, abs=0.02)

    def test_the_same_seed_the_same_windows(self):
        first, again = (scores({"far": 0.4}, {"near": 0.2})[0] for _ in range(2))
        np.testing.assert_array_equal(first, again)


def test_every_manner_is_measured():
    pool = calibrate.measure(40, np.random.default_rng(2))
    assert pool.issue.shape == (6, 40, 4)
    assert pool.steps.shape == pool.distance.shape == (6, 40)
    proper, far, *_, ignore = range(6)
    assert (pool.issue[proper] == 0).mean() > 0.97
    assert (pool.steps[far] == 0).all()
    assert (pool.issue[far, :, 1] == 1).all()
    assert (pool.issue[ignore, :, 0] == 1).all()
    assert np.isnan(pool.issue[ignore, :, 1]).all()


def test_a_search_comes_near_the_signature():
    odds = calibrate.search(POOL, "ableist", windows=60, seed=3, rounds=1)
    assert odds.shape == (2, 5)
    assert (odds >= 0).all()
    assert (odds.sum(axis=1) <= 1).all()
    score, distance, *_ = calibrate.expected_scores(
        POOL, BIASES["ableist"], odds, windows=2000, seed=9
    )
    # on windows that the search has not seen
    assert score == pytest.approx(np.array(calibrate.SIGNATURES["ableist"]), abs=0.08)
    assert distance == pytest.approx(1.89, abs=0.08)


def test_the_signatures_are_the_printed_ones():
    assert calibrate.SIGNATURES == {
        "racist": (0.49, 0.25, 0.38, 0.43),
        "ageist": (0.42, 0.68, 0.54, 0.49),
        "ableist": (0.05, 0.66, 0.0, 0.0),
    }
    assert set(calibrate.SIGNATURES) <= set(robots.NAMES)
