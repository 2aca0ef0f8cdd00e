"""Differences within participants: by hand, against scipy, and against every permutation."""

from itertools import permutations, product

import numpy as np
import pytest
from scipy import stats

from evenhand.study.analysis import contrasts
from evenhand.study.analysis.answers import Answers
from evenhand.study.analysis.judgements import Judged, judge
from support.answered import judged, protocol

NAN = np.nan


def made(fairness, control, place=None) -> Judged:
    fairness = np.array(fairness, float)
    codes = np.full(fairness.shape, -1)
    if place is None:
        place = np.where(np.isnan(fairness), -1, np.arange(fairness.shape[1]))
    return Judged(
        participants=tuple(f"p{i}" for i in range(len(fairness))),
        sets=tuple(f"s{i}" for i in range(fairness.shape[1])),
        control=np.array(control, bool),
        fairness=fairness,
        middle=3.0,
        issue=codes,
        issues=(),
        identity=codes,
        identities=(),
        place=np.array(place),
    )


def test_the_difference_is_within_participants():
    # 1 - (5 + 3) / 2 = -3, 2 - 4 = -2, and the third rated no control
    found, _, _ = contrasts.exchange(
        np.array([[1.0], [2], [1]]),
        np.array([[5, 3], [NAN, 4], [NAN, NAN]]),
        np.random.default_rng(0),
    )
    expected = stats.ttest_1samp([-3, -2], 0).confidence_interval(0.95)
    assert (found.mean, found.n) == (-2.5, 2)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))


def test_the_drawn_p_value_is_that_of_all_exchanges():
    these, others = np.array([[1.0], [2], [3]]), np.array([[4.0, 3], [2, 5], [4, 1]])
    rows = np.concatenate([these, others], axis=1)

    def statistic(table):
        return abs(np.mean([row[0] - (row[1] + row[2]) / 2 for row in table]))

    observed = statistic(rows)
    every = [statistic(table) for table in product(*[list(permutations(row)) for row in rows])]
    exact = np.mean([value >= observed - 1e-9 for value in every])
    _, p, drawn = contrasts.exchange(these, others, np.random.default_rng(1), 1999)
    assert drawn == 1999
    assert p == pytest.approx(exact, abs=4 * np.sqrt(exact * (1 - exact) / 1999))


def test_missing_ratings_are_never_exchanged():
    # one participant, two known ratings: half of the exchanges turn the sign, so |T| is reached
    # always; a missing rating that was dealt would change the mean
    _, p, _ = contrasts.exchange(
        np.array([[1.0, NAN]]), np.array([[5.0, NAN, NAN]]), np.random.default_rng(0), 299
    )
    assert p == 1.0


def test_a_level_test_is_right_as_often_as_it_says():
    rng = np.random.default_rng(5)
    p = [
        contrasts.exchange(x[:, :1], x[:, 1:], rng, 199)[1]
        for x in rng.integers(1, 6, (300, 12, 4)).astype(float)
    ]
    # 300 even studies: 15 expected at or below 0.05, at most 31 but once in 10,000 times
    assert stats.binom.ppf(1e-4, 300, 0.05) <= np.sum(np.array(p) <= 0.05) <= 31
    assert stats.binom.sf(31, 300, 0.05) < 1e-3


def test_scenarios_are_held_against_controls_and_corrected_together():
    rng = np.random.default_rng(2)
    fairness = rng.integers(1, 6, (40, 5)).astype(float)
    fairness[:, 0] = rng.integers(1, 3, 40)
    found = contrasts.controls(made(fairness, [0, 0, 0, 1, 1]), rng, 999)
    assert [one.name for one in found] == ["s0", "s1", "s2", "all"]
    assert found[0].difference.high < 0
    assert found[0].p == pytest.approx(1 / 1000)
    assert found[1].p > 0.05
    assert np.isnan(found[-1].p_adjusted)
    assert contrasts.controls(made(fairness, [0] * 5), rng) == []
    assert contrasts.controls(made(fairness, [1] * 5), rng) == []


def test_without_participants_nothing_can_be_said():
    (one, _) = contrasts.controls(made([[1.0, NAN]], [0, 1]), np.random.default_rng(0))
    assert np.isnan(one.p)
    assert np.isnan(one.difference.mean)
    assert one.difference.n == 0


def test_ratings_by_place_are_less_the_mean_of_their_set():
    # set means 2 and 4; participant 0 saw s0 first, participant 1 saw s1 first
    found = contrasts.by_place(made([[1, 5], [3, 3]], [0, 1], [[0, 1], [1, 0]]))
    assert [(place, one.mean) for place, one in found] == [(0, -1.0), (1, 1.0)]


def test_slopes_are_those_of_a_regression():
    rng = np.random.default_rng(3)
    fairness = rng.integers(1, 8, (6, 5)).astype(float)
    place = np.argsort(rng.random((6, 5)), axis=1)
    left = fairness - fairness.mean(axis=0)
    slopes = [np.polyfit(p, y, 1)[0] for p, y in zip(place, left, strict=True)]
    found = contrasts.slope(made(fairness, [0] * 5, place))
    assert found.mean == pytest.approx(np.mean(slopes))
    assert found.n == 6


def test_early_and_late_are_different_participants():
    rows = [r for i in range(4) for r in [
        *judged(f"p{i}", "late", 1 if i < 2 else 5, position=1 if i < 2 else 9),
        *judged(f"p{i}", "even-one", 5, position=4)]]  # fmt: skip
    found = {name: (counts, low, high) for name, counts, low, high in
             contrasts.early_and_late(judge(Answers.of_rows(rows), protocol()))}  # fmt: skip
    counts, low, high = found["late"]
    assert [float(np.ravel(c)[0]) for c in (counts.inside_x, counts.inside_n, counts.outside_x,
                                            counts.outside_n)] == [2, 2, 0, 2]  # fmt: skip
    # Wilson of 2/2 is [0.342, 1], of 0/2 [0, 0.658]: 1 - sqrt(0.658^2 + 0.658^2) = 0.070
    assert (low, high) == pytest.approx((0.070, 1.0), abs=1e-3)
    assert np.isnan(found["too-close"][1])
