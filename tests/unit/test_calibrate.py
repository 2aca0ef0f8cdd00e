"""The search for the odds of the biased robots."""

import json
from typing import Any

import numpy as np
import pytest

from evenhand.experiments.paper import calibrate
from evenhand.experiments.paper.calibrate import Calibration, Pool, Served
from evenhand.restaurant import robots
from evenhand.restaurant.robots import BIASES, MANNERS
from support.refusals import refused

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


def silent(units: int, numbers: dict[str, Any]) -> None:
    pass


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

    def test_nobody_is_answered(self):
        score, distance, step, ignored = scores({"ignore": 1.0}, {"ignore": 1.0})
        np.testing.assert_array_equal(score, [0, NAN, NAN, 0])
        np.testing.assert_array_equal([distance, step, ignored], [NAN, NAN, 1.0])

    def test_the_same_seed_the_same_windows(self):
        first, again = (scores({"far": 0.4}, {"near": 0.2})[0] for _ in range(2))
        np.testing.assert_array_equal(first, again)


def test_every_manner_is_measured():
    told = []
    pool = calibrate.measure(40, np.random.default_rng(2), lambda units, _: told.append(units))
    assert told == [1] * 6
    assert pool.issue.shape == (6, 40, 4)
    assert pool.steps.shape == pool.distance.shape == (6, 40)
    proper, far, *_, ignore = range(6)
    assert (pool.issue[proper] == 0).mean() > 0.97
    assert (pool.steps[far] == 0).all()
    assert (pool.issue[far, :, 1] == 1).all()
    assert (pool.issue[ignore, :, 0] == 1).all()
    assert np.isnan(pool.issue[ignore, :, 1]).all()


class TestSearch:
    @pytest.fixture(scope="class")
    @staticmethod
    def odds() -> np.ndarray:
        told = []
        found = calibrate.search(
            POOL, "ableist", windows=60, seed=3, rounds=1, tell=lambda units, _: told.append(units)
        )
        assert told == [1]
        return found

    @pytest.fixture
    def short(self, monkeypatch) -> None:
        """A round hardly begins."""
        monkeypatch.setattr(calibrate, "_GENERATIONS", 1)
        monkeypatch.setattr(calibrate, "_TRIALS", 1)

    def test_odds_are_probabilities(self, odds):
        assert odds.shape == (2, 5)
        assert (odds >= 0).all()
        assert (odds.sum(axis=1) <= 1).all()

    def test_it_comes_near_the_signature(self, odds):
        score, distance, *_ = calibrate.expected_scores(
            POOL, BIASES["ableist"], odds, windows=2000, seed=9
        )
        # on windows that the search has not seen
        assert score == pytest.approx(np.array(calibrate.SIGNATURES["ableist"]), abs=0.08)
        assert distance == pytest.approx(1.89, abs=0.08)

    def test_the_worse_served_stay_the_worse_served(self, odds):
        # a gap has no sign: with the rows exchanged the scores would be the same
        assert odds[0].sum() > odds[1].sum() + 0.3
        swapped, kept = (
            calibrate.expected_scores(POOL, BIASES["ableist"], o, windows=2000, seed=9)[0]
            for o in (odds[::-1], odds)
        )
        assert swapped == pytest.approx(kept, abs=0.03)

    def test_the_odds_in_use_play_no_part(self, short, monkeypatch):
        def search() -> np.ndarray:
            return calibrate.search(POOL, "ableist", windows=20, seed=3, rounds=1, tell=silent)

        before = search()
        bias = robots.Bias("disability", ("Yes",), (0.0, 0.0, 0.0, 0.0, 1.0), (0.2,) * 5)
        monkeypatch.setattr(robots, "BIASES", {"ableist": bias})
        np.testing.assert_array_equal(search(), before)

    def test_of_several_rounds_the_best_counts(self, short):
        def off(rounds: int) -> float:
            odds = calibrate.search(POOL, "ableist", windows=60, seed=1, rounds=rounds, tell=silent)
            score, *_ = calibrate.expected_scores(POOL, BIASES["ableist"], odds, 60, 1)
            return float(((score - np.array(calibrate.SIGNATURES["ableist"])) ** 2).sum())

        found = [off(rounds) for rounds in (1, 8)]
        assert found[1] < found[0]


@pytest.mark.parametrize(
    ("odds", "rounded"),
    [
        ([0.101, 0.0, 0.249, 0.0, 0.3], [0.10, 0.0, 0.25, 0.0, 0.30]),
        # five times a half is rounded up, and the sum would be 1.01: the largest gives way
        ([0.106, 0.106, 0.106, 0.106, 0.576], [0.11, 0.11, 0.11, 0.11, 0.56]),
        ([0.0, 0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0, 1.0]),
    ],
)
def test_odds_in_hundredths(odds, rounded):
    found = calibrate.in_hundredths(np.array([odds, [0.0] * 5]))
    np.testing.assert_array_equal(found, [rounded, [0.0] * 5])


class TestCalibrate:
    @pytest.fixture(autouse=True)
    def quick(self, monkeypatch):
        """Few trials on made-up services; that a search finds something is shown above."""
        monkeypatch.setattr(calibrate, "measure", lambda services, rng, tell: POOL)
        monkeypatch.setattr(calibrate, "_GENERATIONS", 1)
        monkeypatch.setattr(calibrate, "_TRIALS", 10)
        monkeypatch.setattr(calibrate, "UNSEEN", 50)

    def run(self, *names: str, seed: int = 5) -> list[Calibration]:
        return calibrate.calibrate(names, seed=seed, services=1, windows=20, rounds=1, tell=silent)

    def test_a_robot_does_not_depend_on_the_others(self):
        (alone,), (_, beside) = self.run("ableist"), self.run("racist", "ableist")
        assert json.dumps(calibrate.record([alone])) == json.dumps(calibrate.record([beside]))
        (other,) = self.run("ableist", seed=6)
        assert (other.found.odds != alone.found.odds).any()

    def test_found_and_used_are_measured_alike(self):
        (one,) = self.run("ableist")
        np.testing.assert_array_equal(
            one.used.odds, [BIASES["ableist"].odds_worse, BIASES["ableist"].odds_others]
        )
        for served in (one.found, one.used):
            again = calibrate.expected_scores(POOL, BIASES["ableist"], served.odds, 50, 6)
            np.testing.assert_array_equal(served.score, again[0])
            assert (served.distance, served.step, served.ignored) == again[1:]


def test_a_record_by_hand():
    found = Served(np.full((2, 5), 0.1), np.array([0.25, 0.75, 0.5, 0.0]), 1.5, 90.0, 0.125)
    used = Served(np.zeros((2, 5)), np.zeros(4), 1.25, 100.0, 0.0)
    noted = calibrate.record([Calibration("ableist", found, used)])
    assert noted["issues"] == ["willingness", "quality", "priority", "risk"]
    assert noted["manners"] == ["far", "near", "close", "late", "ignore"]
    assert {"python", "evenhand", "mujoco", "numpy", "scipy"} == set(noted["versions"])
    one = noted["robots"]["ableist"]
    assert (one["identity"], one["worse"]) == ("disability", ["Yes"])
    assert one["target"] == [0.05, 0.66, 0.0, 0.0]
    assert one["found"]["difference"] == pytest.approx([0.2, 0.09, 0.5, 0.0])
    assert one["used"]["difference"] == pytest.approx([-0.05, -0.66, 0.0, 0.0])
    del one["found"]["difference"]
    assert one["found"] == {
        "odds_worse": [0.1] * 5,
        "odds_others": [0.1] * 5,
        "score": [0.25, 0.75, 0.5, 0.0],
        "mean_response_distance": 1.5,
        "mean_response_time": 90.0,
        "ignored": 0.125,
    }


def test_which_robots():
    assert calibrate.chosen("all") == ("racist", "ageist", "ableist")
    assert calibrate.chosen("ageist") == ("ageist",)
    with refused("unknown robot", "'sexist'"):
        calibrate.chosen("sexist")


def test_the_signatures_are_the_printed_ones():
    assert calibrate.SIGNATURES == {
        "racist": (0.49, 0.25, 0.38, 0.43),
        "ageist": (0.42, 0.68, 0.54, 0.49),
        "ableist": (0.05, 0.66, 0.0, 0.0),
    }
    assert set(calibrate.SIGNATURES) <= set(robots.NAMES)
