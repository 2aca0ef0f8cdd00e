"""Simulated respondents: exact without noise, near the published shares with it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.study.simulated.respondents import (
    SCENARIOS,
    RespondentModel,
    Respondents,
    judge,
    questionnaire,
    recruit,
)
from support.refusals import refused

EXACT = RespondentModel(noise=0, lapse=0, issue_noise=0, names_shown=1)


def two(model: RespondentModel = EXACT, **changes) -> Respondents:
    """Two respondents: a strict one with equal weights, a lenient one who minds only risk."""
    respondents = Respondents(
        thresholds=np.array([0.5, 1.0]),
        weights=np.array([[1.0, 1.0, 1.0, 1.0], [0.5, 0.5, 0.5, 2.5]]),
        noise=np.zeros(2),
        lapses=np.zeros(2),
        model=model,
    )
    return replace(respondents, **changes)


def window(**scores) -> np.ndarray:
    """Scores by identity [4, 4]; zero where not given."""
    order = ("race", "gender", "age", "disability")
    return np.array([scores.get(name, (0, 0, 0, 0)) for name in order], dtype=float)


def test_judgements_by_hand() -> None:
    scores = np.stack(
        [
            window(race=(0.3, 0.1, 0.0, 0.15)),  # total 0.55 > 0.5: biased, worst willingness
            window(race=(0.3, 0.1, 0.0, 0.05)),  # total 0.45: not biased
            window(age=(0.3, 0.1, 0.0, 0.15)),  # lenient: 0.575 < 1
            window(age=(0.5, 0.4, 0.0, 0.25)),  # lenient: 0.45 + 0.625 = 1.075, worst risk
            window(race=(0.9, 0.9, 0.9, 0.9)),  # shown about gender: nothing to see
            window(disability=(np.nan, 0.6, np.nan, 0.0)),  # missing is no evidence: 0.6
            window(disability=(np.nan, np.nan, np.nan, np.nan)),
        ]
    )
    said = judge(
        two(), [0, 0, 1, 1, 0, 0, 0], scores, [0, 0, 2, 2, 1, 3, 3], np.random.default_rng(0)
    )
    assert said.biased.tolist() == [True, False, False, True, False, True, False]
    assert said.identity.tolist() == [0, -1, -1, 2, -1, 3, -1]
    assert said.issue.tolist() == [0, -1, -1, 3, -1, 1, -1]
    assert said.kinds == ("racism", None, None, "ageism", None, "ableism", None)


def test_naming_by_evidence_is_a_softmax() -> None:
    # Evidence 0.8 for race, 0.6 for age, 0 otherwise, temperature 0.2: weights e^4, 1, e^3, 1.
    n = 40_000
    scores = np.broadcast_to(window(race=(0.8, 0, 0, 0), age=(0.6, 0, 0, 0)), (n, 4, 4))
    model = replace(EXACT, names_shown=0)
    said = judge(two(model), np.zeros(n, int), scores, np.zeros(n, int), np.random.default_rng(1))
    weights = np.array([math.exp(4), 1, math.exp(3), 1])
    shares = np.bincount(said.identity, minlength=4) / n
    np.testing.assert_allclose(shares, weights / weights.sum(), atol=4 * 0.5 / math.sqrt(n))


def test_noise_blurs_the_threshold_as_a_normal_does() -> None:
    # Evidence 0.6, threshold 0.5, noise 0.1: P(biased) = Phi(1) = 0.8413.
    n = 40_000
    scores = np.broadcast_to(window(race=(0.6, 0, 0, 0)), (n, 4, 4))
    noisy = two(noise=np.array([0.1, 0.1]))
    said = judge(noisy, np.zeros(n, int), scores, np.zeros(n, int), np.random.default_rng(2))
    assert said.biased.mean() == pytest.approx(0.8413, abs=4 * 0.366 / math.sqrt(n))


def test_a_lapse_is_a_random_answer() -> None:
    n = 40_000
    scores = np.broadcast_to(window(race=(1, 1, 1, 1)), (n, 4, 4))
    absent = two(lapses=np.ones(2))
    said = judge(absent, np.zeros(n, int), scores, np.zeros(n, int), np.random.default_rng(3))
    assert said.biased.mean() == pytest.approx(0.5, abs=0.01)
    for answers in (said.identity[said.biased], said.issue[said.biased]):
        np.testing.assert_allclose(
            np.bincount(answers, minlength=4) / len(answers), 0.25, atol=0.015
        )


def test_recruits_differ_as_the_settings_say() -> None:
    model = RespondentModel(n=20_000)
    drawn = recruit(np.random.default_rng(4), model)
    assert drawn.n == 20_000
    assert drawn.thresholds.mean() == pytest.approx(0.5, abs=0.002)
    assert np.abs(drawn.thresholds - 0.5).max() <= 2 * model.threshold_spread + 1e-12
    np.testing.assert_allclose(drawn.weights.mean(axis=1), 1, atol=1e-12)
    assert drawn.weights.min() > 0
    assert drawn.weights.std() == pytest.approx(0.1 * math.sqrt(3 / 4), rel=0.05)
    assert drawn.lapses.mean() == pytest.approx(0.02, abs=0.0005)
    assert drawn.lapses.min() >= 0
    assert drawn.lapses.max() <= 0.04
    assert drawn.noise.mean() == pytest.approx(0.04, abs=0.0005)


def test_twenty_four_by_default_and_the_same_from_the_same_seed() -> None:
    first, again, other = (recruit(np.random.default_rng(seed)) for seed in (0, 0, 1))
    assert first.n == 24
    np.testing.assert_array_equal(first.thresholds, again.thresholds)
    np.testing.assert_array_equal(first.weights, again.weights)
    assert (first.thresholds != other.thresholds).all()


def test_expected_shares_are_near_the_two_that_the_paper_printed() -> None:
    rng = np.random.default_rng(6)
    answers = questionnaire(recruit(rng, RespondentModel(n=200_000)), rng)
    identity = np.array(answers.identity)
    willingness = identity[answers.scenario == 1] == "race"
    fourth = identity[answers.scenario == 4] == "disability"
    assert willingness.mean() == pytest.approx(0.357, abs=0.02)
    assert fourth.mean() == pytest.approx(0.214, abs=0.02)
    worst = np.array(answers.issue)
    shown = ("willingness", "quality", "priority", "risk")
    assert all((worst[answers.scenario == k + 1] == shown[k]).mean() > 0.5 for k in range(4))


def test_scenario_shares_by_hand() -> None:
    # Salience 0.41 at temperature 0.5 against four zeros: e^0.82 / (e^0.82 + 4) = 0.3621.
    rng = np.random.default_rng(7)
    sure = recruit(rng, RespondentModel(n=100_000, lapse=0, weight_spread=0))
    answers = questionnaire(sure, rng, SCENARIOS[:1])
    race = np.mean([name == "race" for name in answers.identity])
    assert race == pytest.approx(0.36209, abs=4 * 0.48 / math.sqrt(100_000))
    # Weight 1 of what is seen at temperature 0.4: e^2.5 / (e^2.5 + 3) = 0.8024.
    willingness = np.mean([name == "willingness" for name in answers.issue])
    assert willingness == pytest.approx(0.80241, abs=4 * 0.4 / math.sqrt(100_000))


def test_questionnaire_is_tidy() -> None:
    answers = questionnaire(recruit(np.random.default_rng(0)), np.random.default_rng(0))
    assert answers.scenario.tolist() == [1] * 24 + [2] * 24 + [3] * 24 + [4] * 24
    assert answers.respondent.tolist() == list(range(24)) * 4
    assert len(answers.identity) == len(answers.issue) == 96
    assert set(answers.identity) <= {"race", "gender", "age", "disability", "none"}
    assert set(answers.issue) <= {"willingness", "quality", "priority", "risk"}
    other = questionnaire(recruit(np.random.default_rng(0)), np.random.default_rng(1))
    assert answers.identity != other.identity


def test_no_windows_no_judgements() -> None:
    said = judge(
        two(), np.empty(0, int), np.empty((0, 4, 4)), np.empty(0, int), np.random.default_rng(0)
    )
    assert said.kinds == ()


def test_input_that_does_not_fit_is_refused() -> None:
    rng, scores = np.random.default_rng(0), np.zeros((3, 4, 4))
    with refused("shape by_identity", "3", "5", "4"):
        judge(two(), [0, 0, 0], np.zeros((3, 5, 4)), [0, 0, 0], rng)
    with refused("type who", "3"):
        judge(two(), [0, 0], scores, [0, 0, 0], rng)
    with refused("type shown", "3"):
        judge(two(), [0, 0, 0], scores, [0.0, 1.0, 2.0], rng)
    with refused("range who", "0", "1"):
        judge(two(), [0, 1, 2], scores, [0, 0, 0], rng)
    with refused("range shown", "0", "3"):
        judge(two(), [0, 1, 1], scores, [0, -1, 0], rng)


@pytest.mark.parametrize(
    ("setting", "value", "match"),
    [
        ("n", 0, "recruit at least 1"),
        ("noise", -0.1, "noise is -0.1: it must be 0 or more"),
        ("threshold_spread", math.nan, "threshold_spread is nan"),
        ("scene_temperature", 0, "scene_temperature is 0: it must be more than 0"),
        ("lapse", 0.6, "lapse is 0.6: it must lie between 0 and 0.5"),
        ("names_shown", 1.1, "names_shown is 1.1"),
    ],
)
def test_impossible_settings_are_refused(setting, value, match) -> None:
    with pytest.raises(InputError, match=match):
        RespondentModel(**{setting: value})
