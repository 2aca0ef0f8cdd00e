"""From the services of an epoch to the advantages of their decisions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jax.typing import ArrayLike

from evenhand.methods import guidance, registry
from evenhand.methods.epoch import Epoch
from evenhand.methods.paper import losses
from evenhand.restaurant import walks
from evenhand.restaurant.simulation import layout, task
from evenhand.training.epoch import answers_of
from evenhand.training.observation import view
from evenhand.training.policy import ActorCritic, state_values
from evenhand.training.settings import TrainSettings


@dataclass(frozen=True)
class Advantages:
    """What the update is given.

    Attributes:
        advantage: of every decision, [n, L].
        target: of the critic, [n, L].
        fair: of every decision towards evenness, for gradient surgery, [n, L]; None without it.
        evenness: what evenness added to each person's reward, [n].
    """

    advantage: np.ndarray
    target: np.ndarray
    fair: np.ndarray | None
    evenness: np.ndarray


def learn_from(
    settings: TrainSettings,
    policy: ActorCritic,
    value: ArrayLike,
    epoch: Epoch,
    memory: Any,
    following: layout.Setups,
) -> tuple[Advantages, Any]:
    """Advantages and critic targets of an epoch.

    Args:
        settings: of the run.
        policy: that served.
        value: of its critic at every decision, [n, L].
        epoch: what happened.
        memory: of the method.
        following: the person after the last one (S_T of Eq. 6).

    Returns:
        What the update is given, and the method's memory from now on.

    Raises:
        InputError: as `methods.guidance.teach`.
    """
    value = np.asarray(value)
    if settings.preset == "paper":
        paid = guidance.alone(settings.method, epoch)
        return _over_people(settings, policy, value, paid, following), memory
    given, memory = guidance.teach(settings.method, epoch, memory)
    if given.advantages is not None:
        # the critic goes on learning what service is worth
        target = epoch.advantage + value
        return Advantages(given.advantages, target, given.fair, given.added(epoch.reward)), memory
    advantage = epoch.advantages_of(given.earned(epoch.reward))
    added = given.added(epoch.reward)
    return Advantages(advantage, advantage + value, given.fair, added), memory


@dataclass(frozen=True)
class Worth:
    """What the update with all answers is given.

    Attributes:
        worth: of every answer, [n, L + 1].
        fair: the same towards evenness, for gradient surgery; None without it.
        evenness: what evenness added to each person's reward, [n].
    """

    worth: np.ndarray
    fair: np.ndarray | None
    evenness: np.ndarray


def weigh_answers(
    settings: TrainSettings, walked: walks.Walks, epoch: Epoch, memory: Any
) -> tuple[Worth, Any]:
    """What every answer of the services of an epoch is worth.

    Args:
        settings: of the run.
        walked: the services to their end.
        epoch: what happened.
        memory: of the method.

    Returns:
        What the update is given, and the method's memory from now on.

    Raises:
        InputError: as `methods.guidance.teach` and `methods.guidance.worth`.
    """
    method = settings.method
    given, memory = guidance.teach(method, epoch, memory)
    answers = answers_of(settings, walked, epoch)
    worth, fair = guidance.worth(method, answers, memory), None
    if registry.DIRECTION in registry.needs_of(method):
        fair = guidance.direction(method, answers, memory)
    return Worth(worth, fair, given.added(epoch.reward)), memory


def _over_people(
    settings: TrainSettings,
    policy: ActorCritic,
    value: np.ndarray,
    reward: np.ndarray,
    following: layout.Setups,
) -> Advantages:
    """Eq. 6: t runs over people."""
    none = np.zeros(1, np.int64)
    ahead = task.observe(none, following.one_hot, following.start_distance, none, np.zeros(1))
    value_next = float(state_values(policy, view(settings, ahead))[0])
    gamma = settings.update.gamma
    returns = np.asarray(losses.people_returns(reward, value_next, gamma))
    advantage = np.asarray(losses.people_advantages(reward, value, value_next, gamma))
    return Advantages(advantage, np.broadcast_to(returns[:, None], value.shape), None, reward)
