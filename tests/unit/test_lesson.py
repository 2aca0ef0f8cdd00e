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

from evenhand.core import tree
from evenhand.core.errors import InputError
from evenhand.methods import registry
from evenhand.methods.beyond.influence import CreditSettings, influence_reward
from evenhand.methods.beyond.levelup import levelup_reward
from evenhand.methods.guidance import Guidance
from evenhand.methods.paper.scores import Counts
from evenhand.restaurant import people
from evenhand.training.memory import Memory
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
    settings,
)
from support.refusals import refused

# --- what is remembered ---


def test_the_epoch_is_counted_and_the_guard_looks_at_imperfect_services():
    _, memory, _ = learn(settings("levelup"), CALM, EPOCH)
    assert memory.method.filled == 2
    newest = memory.method.windows[-1]
    # inside n and x, outside n and x of children: services, responses, responses, services
    np.testing.assert_array_equal(
        newest[CHILD], [[3, 1, 2, 0], [2, 1, 2, 0], [2, 0, 2, 0], [3, 1, 2, 0]]
    )
    seen = memory.guard.recent.windows[-1]
    np.testing.assert_array_equal(seen[[CHILD, ADULT, 22], 0, :2], [[3, 2], [2, 0], [5, 2]])
    assert len(seen) == 23


@pytest.mark.parametrize("name", registry.names())
def test_learning_leaves_the_memory_before_as_it_was(name):
    chosen = settings(name)
    before = Memory.begin(chosen)
    kept = {path: leaf.copy() for path, leaf in tree.leaves(before).items()}
    learn(chosen, EPOCH, memory=before.method)
    for path, leaf in tree.leaves(before).items():
        np.testing.assert_array_equal(leaf, kept[path], err_msg=path)


# --- what evenness adds ---


BY_HAND = [
    # Eq. 4: 4 - 7/6 for both groups that can be said, of at most 4
    (settings("score"), np.full(5, 17 / 24)),
    (settings("score", strength=2.0), np.full(5, 17 / 12)),
    (settings("score", tau=(1.0, 1.0, 1.0, 2.0)), np.full(5, (5 - 3 / 2) / 5)),
    (settings("penalty"), np.full(5, 17 / 24)),
    (settings("levelup"), LEVELUP),
    (settings("levelup", strength=2.0), 2 * LEVELUP),
    (settings("levelup", tau=(0.0, 1.0, 1.0, 2.0)), np.array([-7 / 6, -1 / 2, 0, 0, 0])),
    (settings("influence"), PAID),
    (settings("influence", strength=0.5), PAID / 2),
    (settings("service"), np.zeros(5)),
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
    short = settings("levelup", windows=1)
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
    "influence": influence_reward,
    "levelup": levelup_reward,
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
    """Its strength, times the three of five services without an issue."""
    for guarded, share in ((True, 0.25 * 3 / 5), (False, 1.0)):
        chosen = settings(kind, guarded=guarded, strength=2.0)
        found = evenness(chosen, EPOCH, guard=0.25)
        np.testing.assert_allclose(found, share * 2.0 * paid, atol=1e-12)


# --- what the update is given ---


EARNED = [
    (settings("service"), QUALITY),
    (settings("levelup"), QUALITY + LEVELUP),
    (settings("influence"), QUALITY + PAID),
    (settings("score"), QUALITY + 17 / 24),
    (settings("surgery"), QUALITY),
    # a child brings 0.3 of the terms of a response, and 300 steps cost 0.25
    (
        settings("service", scenario="tips"),
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


@pytest.mark.parametrize("kind", ["service", "score", "penalty", "influence", "levelup"])
def test_what_evenness_added_is_told(kind):
    taught, _, _ = learn(settings(kind), EPOCH)
    expected = {"service": 0.0, "influence": PAID, "levelup": LEVELUP}.get(kind, 17 / 24)
    np.testing.assert_allclose(taught.evenness, expected * np.ones(5), atol=1e-12)
    assert taught.fair is None


class TestSurgery:
    def test_fair_is_minus_the_exact_influence_at_every_decision(self):
        taught, _, _ = learn(settings("surgery", strength=0.7), EPOCH)
        expected = np.where(MASK > 0, (-0.7 * 5 * EXACT)[:, None], 0.0)
        np.testing.assert_allclose(np.asarray(taught.fair), expected, atol=1e-12)
        assert (taught.evenness == 0.0).all()

    def test_when_biased(self):
        chosen = settings("surgery", when="biased")
        assert learn(chosen, EPOCH)[0].fair is None
        fair = learn(chosen, BIASED)[0].fair
        assert fair is not None
        np.testing.assert_allclose(fair[:, 0], -5 * EXACT, atol=1e-12)

    def test_the_guard_takes_its_share(self):
        fair = learn(settings("surgery", guarded=True), EPOCH, guard=0.25)[0].fair
        assert fair is not None
        np.testing.assert_allclose(fair[:, 0], -5 / 4 * 3 / 5 * EXACT, atol=1e-12)


# --- published methods ---

PUBLISHED = ("lagrangian", "a_ppo", "r_ppo", "elbert", "group_dro", "ggf")


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_published_method_leaves_the_critic_to_service(name):
    taught, _, _ = learn(settings(name), EPOCH)
    assert_at_decisions(taught.target, QUALITY)
    assert (taught.evenness == 0.0).all()
    assert taught.fair is None
    assert (np.asarray(taught.advantage)[MASK == 0] == 0.0).all()


@pytest.mark.parametrize("name", sorted({*PUBLISHED} - {"lagrangian"}))
def test_a_published_method_does_something(name):
    """λ of the Lagrangian begins at 0."""
    taught, _, value = learn(settings(name), EPOCH)
    plain = np.where(MASK > 0, QUALITY[:, None] - value, 0.0)
    assert np.abs(np.asarray(taught.advantage) - plain).max() > 0.001


# Squared gaps less chance: (1/3)² - (2/9) / 2 for willingness and risk, and (1/2)² - (1/4) / 1.
SCORE = 0.0


def test_the_lagrangian_constrains_the_score_without_chance_and_remembers():
    """Limit 0.1, λ was 1: it falls by 0.1 · 0.1 and mixes the centred cost in."""
    chosen = replace(settings(), method=registry.create("lagrangian@0.1"))
    memory = replace(Memory.begin(chosen).method, lam=1.0)
    taught, after, value = learn(chosen, EPOCH, memory=memory)
    lam = 1.0 - 0.1 * (0.1 - SCORE)
    assert after.method.lam == pytest.approx(lam, abs=1e-7)  # a root of rounding errors
    # 6, 2 and 3 of 16 decisions; the critic of the cost has seen nothing yet
    mean = 5 * (6 * 4 / 9 + 2 * 1 / 36 - 3 * 17 / 36) / 16
    valid = MASK > 0
    plain = QUALITY[:, None] - value
    plain = (plain - plain[valid].mean()) / plain[valid].std()
    expected = (plain - lam * (5 * EXACT - mean)[:, None]) / (1.0 + lam)
    found = np.asarray(taught.advantage)
    np.testing.assert_allclose(found[valid], expected[valid], rtol=1e-4, atol=1e-5)


def test_tips_are_what_a_published_method_shares_out():
    """Group DRO remembers the mean reward of each group."""
    _, after, _ = learn(settings("group_dro", scenario="tips"), EPOCH)
    assert after.method.mean[CHILD] == pytest.approx((-0.75 + 0.115 + 0.175) / 3)
    assert after.method.mean[ADULT] == pytest.approx((0.9375 + 0.7375) / 2)


# --- methods of users ---


def own(give):
    class Mine:
        def begin(self, scheme):
            return {"epochs": 0}

        def teach(self, epoch, memory):
            return give(epoch), {"epochs": memory["epochs"] + 1}

    return Mine


def test_rewards_of_a_user_become_advantages(registered):
    kind = registered("mine")(own(lambda epoch: epoch.reward - (epoch.x == 1).sum(axis=1)))
    taught, memory, value = learn(replace(settings(), method=kind()), EPOCH, EPOCH)
    earned = QUALITY - [2, 1, 0, 0, 0]
    assert_at_decisions(taught.target, earned)
    assert_at_decisions(np.asarray(taught.advantage) + value, earned)
    np.testing.assert_allclose(taught.evenness, [-2, -1, 0, 0, 0], atol=1e-12)
    assert memory.method == {"epochs": 2}


def test_advantages_of_a_user_are_used_as_they_are(registered):
    kind = registered("mine")(own(lambda epoch: 2.0 * epoch.advantage + 1.0))
    taught, _, value = learn(replace(settings(), method=kind()), EPOCH)
    expected = np.where(MASK > 0, 2.0 * (QUALITY[:, None] - value) + 1.0, 0.0)
    np.testing.assert_allclose(taught.advantage, expected, rtol=1e-5, atol=1e-5)
    assert_at_decisions(taught.target, QUALITY)


def spoilt(shape, place):
    values = np.zeros(shape)
    values[place] = np.nan
    return values


WRONG = [
    (
        lambda e: np.zeros(4),
        r"it gave an array of shape \(4,\): give rew.*\(5,\), or .*\(5, 6\)",
    ),
    (lambda e: np.zeros((5, 5)), r"it gave an array of shape \(5, 5\)"),
    (lambda e: "much", "it gave str: give an array of numbers"),
    (lambda e: spoilt(5, 3), "service 3: rewards is nan"),
    (lambda e: spoilt((5, 6), (1, 1)), "service 1: advantages is nan"),
    (lambda e: Guidance(fair=spoilt((5, 6), (2, 0))), "service 2: fair is nan"),
    (lambda e: Guidance(evenness=np.zeros((5, 6))), r"evenness has shape \(5, 6\): give \(5,\)"),
]


@pytest.mark.parametrize(("give", "said"), WRONG)
def test_what_a_method_may_not_give(registered, give, said):
    kind = registered("mine")(own(give))
    with pytest.raises(InputError, match=f"method 'mine', epoch 0[:,] {said}"):
        learn(replace(settings(), method=kind()), EPOCH)


def test_where_no_decision_happened_anything_may_stand(registered):
    kind = registered("mine")(own(lambda epoch: spoilt((5, 6), (3, 5))))
    assert (learn(replace(settings(), method=kind()), EPOCH)[0].advantage == 0.0).all()


def test_teach_gives_two_things_and_keeps_the_shape_of_its_memory(registered):
    class Mine:
        def begin(self, scheme):
            return np.zeros(len(scheme.issues))

        def teach(self, epoch, memory):
            return (epoch.reward, memory[:2]) if epoch.biased else epoch.reward

    chosen = replace(settings(), method=registered("mine")(Mine)())
    with refused("type method"):
        learn(chosen, EPOCH)
    with pytest.raises(InputError, match=r"the memory was of shape \(4,\) and is of \(2,\)"):
        learn(chosen, BIASED)


def test_a_memory_that_no_checkpoint_can_hold_is_refused_at_once(registered):
    class Mine:
        def begin(self, scheme):
            return {"rng": np.random.default_rng()}

        def teach(self, epoch, memory):
            return epoch.reward, memory

    chosen = replace(settings(), method=registered("mine")(Mine)())
    with refused("type state", "'mine'"):
        Memory.begin(chosen)
