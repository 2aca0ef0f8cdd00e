"""What an epoch teaches: from its services to the advantages of their decisions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jax.typing import ArrayLike

from evenhand.methods import guidance
from evenhand.methods.beyond import guard, levelup
from evenhand.methods.paper import losses
from evenhand.methods.paper.scores import count
from evenhand.restaurant import people
from evenhand.restaurant.scenarios import tips
from evenhand.restaurant.simulation import layout, task
from evenhand.statistics import chance
from evenhand.training.epoch import Epoch
from evenhand.training.memory import GUARD, Past
from evenhand.training.observation import view
from evenhand.training.policy import ActorCritic, state_values
from evenhand.training.rivals import methods
from evenhand.training.rivals.base import EpochOutcome
from evenhand.training.settings import TrainSettings

_IDENTITY = np.unique([name for name, _ in people.GROUPS], return_inverse=True)[1]
"""Number of the identity of each group, [22]."""
_TAU = (1.0, 1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Lesson:
    """What the update is given.

    Attributes:
        advantage: of every decision, [n, L].
        target: of the critic, [n, L].
        fair: of every decision towards evenness, for gradient surgery, [n, L]; None without it.
        even: what evenness added to each person's reward, [n].
    """

    advantage: np.ndarray
    target: np.ndarray
    fair: np.ndarray | None
    even: np.ndarray


def looks_back(settings: TrainSettings) -> bool:
    """Whether what is learned from an epoch depends on what is remembered, itself included."""
    return settings.guidance.kind in ("influence", "levelup", "surgery") or settings.rival != "none"


def remembered(settings: TrainSettings, epoch: Epoch, past: Past) -> Past:
    """The past with this epoch in it."""
    everybody = np.concatenate([epoch.inside, np.ones((len(epoch.x), 1))], axis=1)
    imperfect = 1.0 - epoch.done.facts.perfect[:, None]
    watched, _ = guard.watch(past.guard, count(imperfect, everybody), GUARD)
    return replace(past, memory=levelup.remember(past.memory, epoch.counts), guard=watched)


def learn_from(
    settings: TrainSettings,
    policy: ActorCritic,
    value: ArrayLike,
    epoch: Epoch,
    past: Past,
    following: layout.Setups,
) -> tuple[Lesson, Past]:
    """Advantages and critic targets of an epoch.

    Args:
        settings: of the run.
        policy: that served.
        value: of its critic at every decision, [n, L].
        epoch: what happened.
        past: with this epoch in it, if ``looks_back``.
        following: the person after the last one (S_T of Eq. 6).

    Returns:
        What the update is given, and the past with what a rival remembers.
    """
    value = np.asarray(value)
    if settings.preset == "paper":
        even = guidance.person_rewards(epoch.scores, epoch.inside, epoch.biased, settings.guidance)
        return _over_people(settings, policy, value, even, following), past
    quality = tips.reward(
        settings.world.tips, epoch.codes, epoch.done.facts.terms, epoch.done.facts.steps
    )
    even = evenness(settings, epoch, past)
    advantage = _over_decisions(settings, epoch.done.mask, value, quality + even)
    target = advantage + value
    fair = None
    if settings.guidance.kind == "surgery" and _counts_now(settings, epoch):
        fair = _towards_evenness(settings, epoch, past)
    if settings.rival != "none":
        rival = methods.strong(settings.rival, settings.rival_strength)
        outcome = _outcome(epoch, past, quality, advantage)
        advantage, state = rival.shape(outcome, past.rival)
        past = replace(past, rival=state)
    return Lesson(advantage, target, fair, even), past


def evenness(settings: TrainSettings, epoch: Epoch, past: Past) -> np.ndarray:
    """What evenness adds to the reward of each service in the service preset, [n].

    Args:
        settings: of the run.
        epoch: what happened.
        past: with this epoch in it.
    """
    kind = settings.guidance.kind
    if kind in ("score", "penalty"):
        reward = guidance.person_rewards(
            epoch.scores, epoch.inside, epoch.biased, settings.guidance
        )
        return settings.evenness_weight * reward / sum(settings.guidance.tau)
    if kind not in ("influence", "levelup") or not _counts_now(settings, epoch):
        return np.zeros(len(epoch.done.mask))
    reward = levelup.influence_reward if kind == "influence" else levelup.levelup_reward
    pooled = levelup.pooled(past.memory)
    return reward(epoch.x, epoch.inside, settings.guidance.tau, pooled, _weighed(settings, past))


def _counts_now(settings: TrainSettings, epoch: Epoch) -> bool:
    return settings.guidance.when == "always" or epoch.biased


def _weighed(settings: TrainSettings, past: Past) -> levelup.CreditSettings:
    """How evenness weighs now, after what the guard saw."""
    weigh = settings.guidance.weigh
    share = guard.weight(past.guard) if settings.guidance.guarded else 1.0
    return replace(weigh, strength=weigh.strength * share)


def _towards_evenness(settings: TrainSettings, epoch: Epoch, past: Past) -> np.ndarray:
    """-μ n w of each service at all its decisions, [n, L]."""
    weigh = _weighed(settings, past)
    pooled = levelup.pooled(past.memory)
    found = levelup.influence(epoch.x, epoch.inside, settings.guidance.tau, pooled, weigh)
    each = -weigh.strength * len(epoch.x) * found.total
    return np.where(epoch.done.mask > 0, each[:, None], 0.0)


def _over_people(
    settings: TrainSettings,
    policy: ActorCritic,
    value: np.ndarray,
    reward: np.ndarray,
    following: layout.Setups,
) -> Lesson:
    """Eq. 6: t runs over people."""
    none = np.zeros(1, np.int64)
    ahead = task.observe(none, following.one_hot, following.start_distance, none, np.zeros(1))
    value_next = float(state_values(policy, view(settings, ahead))[0])
    gamma = settings.update.gamma
    returns = np.asarray(losses.people_returns(reward, value_next, gamma))
    advantage = np.asarray(losses.people_advantages(reward, value, value_next, gamma))
    return Lesson(advantage, np.broadcast_to(returns[:, None], value.shape), None, reward)


def _over_decisions(
    settings: TrainSettings, mask: np.ndarray, value: np.ndarray, earned: np.ndarray
) -> np.ndarray:
    """Each service is an episode, paid at its end."""
    reward = np.zeros_like(value)
    last = mask.sum(axis=1).astype(int) - 1
    reward[np.arange(len(last)), last] = earned
    chosen = settings.update
    return np.asarray(losses.gae(reward, value, mask, chosen.gamma, chosen.gae_lambda))


def _outcome(epoch: Epoch, past: Past, quality: np.ndarray, advantage: np.ndarray) -> EpochOutcome:
    pooled = levelup.pooled(past.memory)
    exact = levelup.CreditSettings(shrink=0.0)
    cost = levelup.influence(epoch.x, epoch.inside, _TAU, pooled, exact).total * len(epoch.x)
    groups, names = epoch.scores.groups, epoch.scores.issues
    return EpochOutcome(
        reward=quality,
        x=epoch.x,
        inside=epoch.inside,
        identity=_IDENTITY,
        advantage=advantage,
        mask=epoch.done.mask,
        # without what chance gives, else the constraint could never be met
        score=float(chance.excess_scores(pooled, groups, names).total),
        cost=cost,
    )
