"""What a method gives after an epoch, and the check of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.core import tree
from evenhand.core.errors import InputError
from evenhand.methods import registry


@dataclass(frozen=True, eq=False)
class Guidance:
    """What an epoch of n services of at most L decisions teaches; without any, service alone.

    Attributes:
        evenness: what is added to the reward of each service, [n].
        rewards: of the services instead, [n].
        advantages: of the decisions instead, [n, L]; then the critic goes on learning what the
            rewards of the epoch are.
        fair: a second direction beside them, for gradient surgery: advantages of the decisions
            towards evenness, [n, L].
    """

    evenness: np.ndarray | None = None
    rewards: np.ndarray | None = None
    advantages: np.ndarray | None = None
    fair: np.ndarray | None = None

    def added(self, reward: np.ndarray) -> np.ndarray:
        """What evenness adds to the rewards of an epoch, [n]; 0 where advantages are given.

        Args:
            reward: of the epoch, [n].
        """
        if self.rewards is not None:
            return self.rewards - reward
        return np.zeros(len(reward)) if self.evenness is None else self.evenness

    def earned(self, reward: np.ndarray) -> np.ndarray:
        """Rewards of the services, [n].

        Args:
            reward: of the epoch, [n].
        """
        return self.rewards if self.rewards is not None else reward + self.added(reward)


def begin(method: Any, scheme: Any) -> Any:
    """Memory of a method before the first epoch.

    Raises:
        InputError: when it holds something that a checkpoint cannot.
    """
    memory = method.begin(scheme)
    tree.leaves(memory, f"memory of method {registry.name_of(method)!r}")
    return memory


def teach(method: Any, epoch: Any, memory: Any) -> tuple[Guidance, Any]:
    """What a method makes of an epoch, checked.

    Args:
        method: that is asked.
        epoch: a `methods.epoch.Epoch`.
        memory: of the method.

    Returns:
        Its guidance, advantages 0 where no decision happened; and its memory from now on.

    Raises:
        InputError: when it gives something else, another shape, or a number that is not finite.
    """
    what = _which(method, epoch)
    found = method.teach(epoch, memory)
    if not isinstance(found, tuple) or len(found) != 2:
        raise InputError(
            "type method",
            f"{what}: teach gave {type(found).__name__}: give rewards or advantages and the memory",
        )
    given, after = found
    was, now = tree.shapes(memory), tree.shapes(after)
    if was != now:
        odd = next(name for name in {**was, **now} if was.get(name) != now.get(name))
        raise InputError(
            "shape method",
            f"{what}: {odd or 'the memory'} was of shape {was.get(odd)} and is of {now.get(odd)}: "
            "keep the shapes that begin gave",
        )
    n, length = np.shape(epoch.mask)
    if not isinstance(given, Guidance):
        values = _numbers(what, "it", given)
        if values.shape not in ((n,), (n, length)):
            raise InputError(
                "shape method",
                f"{what}: it gave an array of shape {values.shape}: give rewards of the services, "
                f"{(n,)}, or advantages of their decisions, {(n, length)}",
            )
        given = Guidance(rewards=values) if values.ndim == 1 else Guidance(advantages=values)
    happened = np.asarray(epoch.mask) > 0
    return _checked(what, given, happened), after


def weighs_answers(method: Any) -> bool:
    """Whether a method can say what services with other answers would have been worth."""
    return hasattr(method, "worth") or hasattr(method, "pay")


def worth(method: Any, answers: Any, memory: Any) -> np.ndarray:
    """What each service would have been worth with each answer, [n, A], checked.

    Args:
        method: that is asked.
        answers: a `methods.epoch.Answers` of the epoch that it was taught last.
        memory: of the method since then.

    Raises:
        InputError: when it gives another shape, or a number that is not finite.
    """
    if hasattr(method, "worth"):
        values, name = method.worth(answers, memory), "worth"
    else:
        paid, name = method.pay(answers.flat, answers.window, memory), "pay"
        paid = _numbers(_which(method, answers.window), name, paid)
        values = answers.reward + paid.reshape(answers.reward.shape)
    return _weighed(method, answers, name, values)


def direction(method: Any, answers: Any, memory: Any) -> np.ndarray:
    """What each service with each answer is worth towards evenness alone, [n, A], checked.

    Arguments and errors as for `worth`, of a method that follows a second direction.
    """
    return _weighed(method, answers, "direction", method.direction(answers, memory))


def _weighed(method: Any, answers: Any, name: str, values: Any) -> np.ndarray:
    what, shape = _which(method, answers.window), answers.reward.shape
    found = _numbers(what, name, values)
    if found.shape != shape:
        raise InputError(
            "shape method",
            f"{what}: {name} has shape {found.shape}: give a number for each answer, {shape}",
        )
    if not np.isfinite(found).all():
        place = int(np.flatnonzero(~np.isfinite(found).all(axis=1))[0])
        raise InputError(
            "range method", f"{what}, service {place}: {name} is not finite: give finite numbers"
        )
    return found


def _which(method: Any, epoch: Any) -> str:
    return f"method {registry.name_of(method)!r}, epoch {epoch.number}"


def alone(method: Any, epoch: Any) -> np.ndarray:
    """Rewards of an epoch where evenness is all that is rewarded, [n].

    Raises:
        InputError: as `teach`.
    """
    what = _which(method, epoch)
    given = Guidance(rewards=_numbers(what, "alone", method.alone(epoch)))
    rewards = _checked(what, given, np.asarray(epoch.mask) > 0).rewards
    assert rewards is not None
    return rewards


def _checked(what: str, given: Guidance, happened: np.ndarray) -> Guidance:
    n, length = happened.shape
    checked: dict[str, np.ndarray | None] = {}
    for name, shape in (
        ("evenness", (n,)), ("rewards", (n,)), ("advantages", (n, length)), ("fair", (n, length)),
    ):  # fmt: skip
        values = getattr(given, name)
        if values is None:
            continue
        values = _numbers(what, name, values)
        if values.shape != shape:
            raise InputError(
                "shape method", f"{what}: {name} has shape {values.shape}: give {shape}"
            )
        if len(shape) == 2:
            values = np.where(happened, values, 0.0)
        odd = ~np.isfinite(values)
        if odd.any():
            place = int(np.flatnonzero(odd.reshape(n, -1).any(axis=1))[0])
            raise InputError(
                "range method",
                f"{what}, service {place}: {name} is {values[odd][0]}: give finite numbers",
            )
        checked[name] = values
    return Guidance(**checked)


def _numbers(what: str, name: str, values: Any) -> np.ndarray:
    try:
        found = np.asarray(values)
    except ValueError:
        found = np.array(None)
    if found.dtype.kind not in "biuf":
        raise InputError(
            "type method", f"{what}: {name} gave {type(values).__name__}: give an array of numbers"
        )
    return found
