"""What an epoch of five services teaches, by hand.

Three children and two adults ask, alike in all else, so only the gaps of child and adult can be
said. The first child gets no response and a robot that comes too close; the second gets one at
0.8 m; all others are served perfectly. Rates of children: willingness 1/3, quality 1/2 (of two
responses), priority 0, risk 1/3; of adults 0.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evenhand.methods.beyond import levelup
from evenhand.methods.beyond.levelup import CreditSettings
from evenhand.methods.guidance import KINDS
from evenhand.methods.paper.scores import Counts
from evenhand.restaurant import people
from evenhand.restaurant.simulation import layout
from evenhand.training import advantages, train
from evenhand.training.memory import Past
from evenhand.training.policy import state_values
from evenhand.training.rivals import methods
from evenhand.training.rivals.base import EpochOutcome, to_arrays
from evenhand.training.settings import TrainSettings
from support.lessons import (
    ADULT,
    BIASED,
    CALM,
    CHILD,
    CODES,
    EPOCH,
    EXACT,
    LEVELUP,
    MASK,
    PAID,
    QUALITY,
    X,
    assert_at_decisions,
    evenness,
    learn,
    past_of,
    settings,
)

# --- what is remembered ---


def test_the_epoch_is_counted_and_the_guard_looks_at_imperfect_services():
    past = past_of(settings(), CALM, EPOCH)
    assert past.memory.filled == 2
    newest = past.memory.windows[-1]
    # inside n and x, outside n and x of children: services, responses, responses, services
    np.testing.assert_array_equal(
        newest[CHILD], [[3, 1, 2, 0], [2, 1, 2, 0], [2, 0, 2, 0], [3, 1, 2, 0]]
    )
    seen = past.guard.recent.windows[-1]
    np.testing.assert_array_equal(seen[[CHILD, ADULT, 22], 0, :2], [[3, 2], [2, 1], [5, 3]])
    assert len(seen) == 23


def test_remembering_leaves_the_past_before_as_it_was():
    before = Past.empty(settings())
    after = advantages.remembered(settings(), EPOCH, before)
    assert (before.memory.filled, after.memory.filled) == (0, 1)
    assert (before.memory.windows == 0).all()
    assert after.rival is before.rival
    assert after.reflection is before.reflection


@pytest.mark.parametrize("kind", KINDS)
def test_only_who_looks_back_learns_from_what_is_remembered(kind):
    chosen = settings(kind)
    policy = train.untrained(chosen).policy
    following = layout.draw(people.population("uniform"), 1, np.random.default_rng(0))
    value = np.asarray(state_values(policy, EPOCH.done.observation))
    with_it, without = (
        advantages.learn_from(chosen, policy, value, EPOCH, past_of(chosen, *epochs), following)[0]
        for epochs in ((CALM, EPOCH), (CALM, CALM))
    )
    same = all(
        np.array_equal(getattr(with_it, name), getattr(without, name))
        for name in ("advantage", "target", "fair", "even")
        if getattr(with_it, name) is not None
    )
    assert same != advantages.looks_back(chosen)


# --- what evenness adds ---


BY_HAND = [
    # Eq. 4: 4 - 7/6 for both groups that can be said, of at most 4
    (settings("score"), np.full(5, 17 / 24)),
    (settings("score", evenness_weight=2.0), np.full(5, 17 / 12)),
    (settings("score", tau=(1.0, 1.0, 1.0, 2.0)), np.full(5, (5 - 3 / 2) / 5)),
    (settings("penalty"), np.full(5, 17 / 24)),
    (settings("levelup"), LEVELUP),
    (settings("levelup", strength=2.0), 2 * LEVELUP),
    (settings("levelup", tau=(0.0, 1.0, 1.0, 2.0)), np.array([-7 / 6, -1 / 2, 0, 0, 0])),
    (settings("levelup", evenness_weight=9.0), LEVELUP),  # a weight of Eq. 4 and 5 only
    (settings("influence"), PAID),
    (settings("influence", strength=0.5), PAID / 2),
    (settings("none"), np.zeros(5)),
    (settings("surgery"), np.zeros(5)),
]


@pytest.mark.parametrize(("chosen", "expected"), BY_HAND)
def test_evenness_by_hand(chosen, expected):
    np.testing.assert_allclose(evenness(chosen, EPOCH), expected, atol=1e-12)


def test_the_penalty_halves_a_biased_epoch_and_the_score_does_not():
    np.testing.assert_allclose(evenness(settings("penalty"), BIASED), np.full(5, 17 / 48))
    np.testing.assert_allclose(evenness(settings("score"), BIASED), np.full(5, 17 / 24))


def test_gaps_are_of_the_last_epochs_together():
    """After a calm epoch children meet 1/6, 1/5 (of five responses), 0, 1/6; now n is 3 and 2."""
    found = evenness(settings("levelup"), CALM, EPOCH)
    np.testing.assert_allclose(found, [-8 / 15, -1 / 5, 0, 0, 0], atol=1e-12)
    first = (5 / 6 + 4 / 5 + 5 / 6) / 3
    second, third = -1 / 18 + 2 / 5 - 1 / 18, -1 / 18 - 1 / 10 - 1 / 18
    expected = -5 * np.array([first, second, third, 0, 0])
    np.testing.assert_allclose(evenness(settings("influence"), CALM, EPOCH), expected, atol=1e-12)


def test_epochs_that_left_the_memory_no_longer_count():
    chosen = settings("levelup")
    weigh = replace(chosen.guidance.weigh, windows=1)
    short = replace(chosen, guidance=replace(chosen.guidance, weigh=weigh))
    np.testing.assert_allclose(evenness(short, CALM, EPOCH), LEVELUP, atol=1e-12)
    np.testing.assert_allclose(evenness(short, EPOCH, CALM), np.zeros(5), atol=1e-12)


def pooled_by_hand() -> Counts:
    """Of the epoch and a calm one before it: n and x inside, n and x outside, by issue."""
    everybody = [[10, 1, 0, 0], [9, 1, 0, 0], [9, 0, 0, 0], [10, 1, 0, 0]]
    nobody = [[0, 0, 10, 1], [0, 0, 9, 1], [0, 0, 9, 0], [0, 0, 10, 1]]
    rows = dict.fromkeys(people.GROUPS, nobody)
    for group in (("race", "White"), ("gender", "Female"), ("disability", "No"), ("skin", "I")):
        rows[group] = everybody
    rows["age", "Child"] = [[6, 1, 4, 0], [5, 1, 4, 0], [5, 0, 4, 0], [6, 1, 4, 0]]
    rows["age", "Adult"] = [[4, 0, 6, 1], [4, 0, 5, 1], [4, 0, 5, 0], [4, 0, 6, 1]]
    return Counts(*np.moveaxis(np.array(list(rows.values()), float), -1, 0))


REWARDS: dict[Any, Callable[..., np.ndarray]] = {
    "influence": levelup.influence_reward,
    "levelup": levelup.levelup_reward,
}


@pytest.mark.parametrize("kind", ["influence", "levelup"])
@pytest.mark.parametrize("shrink", [0.0, 0.2, 0.7])
def test_it_is_the_credit_of_counts_pooled_by_hand(kind, shrink):
    tau = (1.0, 2.0, 0.5, 1.5)
    weigh = CreditSettings(shrink=shrink, strength=0.7)
    expected = REWARDS[kind](X, people.encode(CODES).astype(float), tau, pooled_by_hand(), weigh)
    assert np.abs(expected).max() > 0.1
    found = evenness(settings(kind, shrink, tau=tau, strength=0.7), CALM, EPOCH)
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("kind", ["influence", "levelup"])
def test_chance_gaps_of_few_services_do_not_steer_by_default(kind):
    # 1/3 of three against 0 of two: a standard error of √(1/5 · 4/5 · (1/3 + 1/2)) = 0.37
    np.testing.assert_array_equal(
        evenness(settings(kind, 1.0, tau=(1.0, 0.0, 1.0, 1.0)), EPOCH), np.zeros(5)
    )


@pytest.mark.parametrize(("kind", "paid"), [("influence", PAID), ("levelup", LEVELUP)])
def test_when_biased_it_counts_in_biased_epochs_only(kind, paid):
    chosen = settings(kind, when="biased")
    np.testing.assert_array_equal(evenness(chosen, EPOCH), np.zeros(5))
    np.testing.assert_allclose(evenness(chosen, BIASED), paid, atol=1e-12)


@pytest.mark.parametrize(("kind", "paid"), [("influence", PAID), ("levelup", LEVELUP)])
def test_the_guard_takes_its_share(kind, paid):
    """Its strength, times the two of five services that were perfect."""
    for guarded, share in ((True, 0.25 * 2 / 5), (False, 1.0)):
        chosen = settings(kind, guarded=guarded, strength=2.0)
        past = past_of(chosen, EPOCH)
        past = replace(past, guard=replace(past.guard, strength=0.25))
        found = advantages.evenness(chosen, EPOCH, past)
        np.testing.assert_allclose(found, share * 2.0 * paid, atol=1e-12)


# --- what the update is given ---


EARNED = [
    (settings("none"), QUALITY),
    (settings("levelup"), QUALITY + LEVELUP),
    (settings("influence"), QUALITY + PAID),
    (settings("score"), QUALITY + 17 / 24),
    (settings("surgery"), QUALITY),
    # a child brings 0.3 of the terms of a response, and 300 steps cost 0.25
    (
        settings("none", scenario="tips"),
        np.array([-0.5 - 0.25, 0.24 - 0.125, 0.3 - 0.125, 1.0 - 0.0625, 0.925 - 0.1875]),
    ),
    (
        settings("levelup", scenario="everyday"),
        np.array([-0.5 - 0.125, 0.52 - 0.0625, 0.65 - 0.0625, 1.0 - 0.03125, 0.925 - 0.09375])
        + LEVELUP,
    ),
]


@pytest.mark.parametrize(("chosen", "earned"), EARNED)
def test_what_is_earned_reaches_all_decisions(chosen, earned):
    taught, _, value = learn(chosen, EPOCH)
    assert_at_decisions(taught.target, earned)
    assert_at_decisions(np.asarray(taught.advantage) + value, earned)
    assert (np.asarray(taught.advantage)[MASK == 0] == 0.0).all()


@pytest.mark.parametrize("kind", ["none", "score", "penalty", "influence", "levelup"])
def test_what_evenness_added_is_told(kind):
    taught, _, _ = learn(settings(kind), EPOCH)
    np.testing.assert_allclose(taught.even, evenness(settings(kind), EPOCH))
    assert taught.fair is None


class TestSurgery:
    def test_fair_is_minus_the_exact_influence_at_every_decision(self):
        taught, _, _ = learn(settings("surgery", strength=0.7), EPOCH)
        expected = np.where(MASK > 0, (-0.7 * 5 * EXACT)[:, None], 0.0)
        np.testing.assert_allclose(np.asarray(taught.fair), expected, atol=1e-12)
        assert (taught.even == 0.0).all()

    def test_when_biased(self):
        chosen = settings("surgery", when="biased")
        assert learn(chosen, EPOCH)[0].fair is None
        fair = learn(chosen, BIASED)[0].fair
        assert fair is not None
        np.testing.assert_allclose(fair[:, 0], -5 * EXACT, atol=1e-12)

    def test_the_guard_takes_its_share(self):
        chosen = settings("surgery", guarded=True)
        past = past_of(chosen, EPOCH)
        past = replace(past, guard=replace(past.guard, strength=0.25))
        policy = train.untrained(chosen).policy
        following = layout.draw(people.population("uniform"), 1, np.random.default_rng(0))
        value = state_values(policy, EPOCH.done.observation)
        taught, _ = advantages.learn_from(chosen, policy, value, EPOCH, past, following)
        assert taught.fair is not None
        np.testing.assert_allclose(taught.fair[:, 0], -5 / 4 * 2 / 5 * EXACT, atol=1e-12)


# --- rivals ---


def without(name: str, strength: float | None = None) -> TrainSettings:
    return settings("none", rival=name, rival_strength=strength)


def outcome(value: np.ndarray, cost: np.ndarray, score: float) -> EpochOutcome:
    """The epoch by hand; identities are numbered as ``people`` orders them."""
    return EpochOutcome(
        reward=QUALITY,
        x=X,
        inside=people.encode(CODES).astype(float),
        identity=np.repeat(np.arange(5), [6, 3, 5, 2, 6]),
        advantage=np.where(MASK > 0, QUALITY[:, None] - value, 0.0),
        mask=MASK,
        score=score,
        cost=cost,
    )


# By chance the one of 3 and 2 is a child with 3/5: a mean gap of 3/5 · 1/3 + 2/5 · 1/2 = 2/5; the
# one of 2 and 2 makes a gap of 1/2 either way. So 1/3 - 2/5 for willingness and risk, 1/2 - 1/2.
SCORE = 2 * (1 / 3 - 2 / 5)


@pytest.mark.parametrize("name", list(methods.RIVALS))
def test_a_rival_shapes_the_epoch(name):
    chosen = without(name)
    taught, after, value = learn(chosen, EPOCH)
    rival = methods.rival(name)
    expected, state = rival.shape(outcome(value, 5 * EXACT, SCORE), rival.begin(22, 4))
    found = np.asarray(taught.advantage)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5)
    assert_at_decisions(taught.target, QUALITY)  # its critic goes on learning service quality
    assert (taught.even == 0.0).all()
    assert taught.fair is None
    for key, values in to_arrays(state).items():
        np.testing.assert_allclose(to_arrays(after.rival)[key], values, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", sorted(set(methods.RIVALS) - {"lagrangian"}))
def test_a_rival_does_something(name):
    """λ of the Lagrangian begins at 0."""
    taught, _, value = learn(without(name), EPOCH)
    plain = np.where(MASK > 0, QUALITY[:, None] - value, 0.0)
    assert np.abs(np.asarray(taught.advantage) - plain).max() > 0.01


def test_the_strength_reaches_the_rival_and_it_remembers():
    """Limit 0.1, λ was 1: it falls by 0.1 (2/15 + 0.1) and mixes the centred cost in."""
    state = methods.LagrangianState(np.asarray(1.0))
    taught, after, value = learn(without("lagrangian", 0.1), EPOCH, rival=state)
    lam = 1.0 - 0.1 * (2 / 15 + 0.1)
    assert float(after.rival.lam) == pytest.approx(lam)
    # 6, 2 and 3 of 16 decisions
    mean = 5 * (6 * 4 / 9 + 2 * 1 / 36 - 3 * 17 / 36) / 16
    expected = (QUALITY[:, None] - value - lam * (5 * EXACT - mean)[:, None]) / (1.0 + lam)
    valid = MASK > 0
    found = np.asarray(taught.advantage)
    np.testing.assert_allclose(found[valid], expected[valid], rtol=1e-4, atol=1e-5)


def test_tips_are_what_a_rival_shares_out():
    """Group DRO remembers the mean reward of each group."""
    chosen = settings("none", rival="group_dro", scenario="tips")
    _, after, _ = learn(chosen, EPOCH)
    assert after.rival.mean[CHILD] == pytest.approx((-0.75 + 0.115 + 0.175) / 3)
    assert after.rival.mean[ADULT] == pytest.approx((0.9375 + 0.7375) / 2)
