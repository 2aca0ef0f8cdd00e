"""What a rival is given after every epoch, what it is, and what it may remember."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Protocol, TypeVar

import numpy as np

from evenhand.core.errors import InputError
from evenhand.methods.paper.scores import Counts

State = TypeVar("State")


@dataclass(frozen=True)
class EpochOutcome:
    """What happened in one epoch of n services, in the order in which people were served.

    Attributes:
        reward: service quality, [n].
        x: issues of each service, [n, K]; NaN where an issue does not apply.
        inside: membership, [n, G]; NaN unknown.
        identity: number of the identity that each group belongs to, [G].
        advantage: of the service reward, [n, L].
        mask: 1 for decisions that happened, [n, L].
        score: unevenness that PPO-Lagrangian constrains, a total issue score; NaN if not known.
        cost: what each service adds to ``score``, [n]: its influence times the number of services
            that the score is of, so that the gradient of the score is the mean over services of
            cost ∇ log π(service).
    """

    reward: np.ndarray
    x: np.ndarray
    inside: np.ndarray
    identity: np.ndarray
    advantage: np.ndarray
    mask: np.ndarray
    score: float
    cost: np.ndarray

    def __post_init__(self) -> None:
        n, groups = np.shape(self.inside)
        wanted = {
            "reward": (n,),
            "x": (n, np.shape(self.x)[-1]),
            "identity": (groups,),
            "advantage": np.shape(self.mask),
            "mask": (n, np.shape(self.mask)[-1]),
            "cost": (n,),
        }
        for name, shape in wanted.items():
            found = np.shape(getattr(self, name))
            if found != shape:
                raise InputError(
                    f"{name} of the epoch has shape {found}: give {shape}, for {n} services and "
                    f"{groups} groups"
                )
        happened = self.advantage[self.mask > 0]
        for name, numbers in (
            ("reward", self.reward),
            ("cost", self.cost),
            ("advantage", happened),
        ):
            if not np.isfinite(numbers).all():
                raise InputError(f"{name} of the epoch is not finite: give a number everywhere")


class Rival(Protocol[State]):
    """Settings of a method, which says what an epoch teaches."""

    def begin(self, groups: int, n_issues: int) -> State:
        """What is remembered before the first epoch."""
        ...

    def shape(self, outcome: EpochOutcome, state: State) -> tuple[np.ndarray, State]:
        """The advantages to learn from, [n, L], 0 where masked, and what is remembered then."""
        ...


def to_arrays(state: Any) -> dict[str, np.ndarray]:
    """What a rival remembers, as arrays by name."""
    return {name: np.asarray(value) for name, value in asdict(state).items()}


def from_arrays(like: State, arrays: Mapping[str, Any]) -> State:
    """The inverse of `to_arrays`, also from nested lists, as JSON gives them back.

    Args:
        like: what the same rival remembers at the beginning.
        arrays: by name.

    Raises:
        InputError: when these are not arrays of that rival.
    """
    wanted = to_arrays(like)
    try:
        if set(arrays) != set(wanted):
            raise ValueError
        found = {
            name: np.asarray(arrays[name], float).reshape(old.shape) for name, old in wanted.items()
        }
    except ValueError as error:
        raise InputError(
            f"what was saved of a rival ({', '.join(arrays)}) belongs to other settings: resume "
            "with the settings that it was saved with"
        ) from error
    return type(like)(**found)


@dataclass(frozen=True)
class Past:
    """Counts of the last epochs, which are pooled with the running one.

    Attributes:
        counts: inside_n, inside_x, outside_n, outside_x of `issues.Counts`, [W - 1, 4, G, K],
            oldest first; zeros for epochs that there were not.
        services: their numbers of services, [W - 1].
    """

    counts: np.ndarray
    services: np.ndarray

    @property
    def pooled(self) -> Counts:
        """Counts of all of them."""
        return Counts(*self.counts.sum(axis=0))

    def after(self, now: Counts, services: int) -> Past:
        """With the epoch that just ended in place of the oldest."""
        last = np.stack([now.inside_n, now.inside_x, now.outside_n, now.outside_x])
        return Past(
            np.concatenate([self.counts, last[None]])[1:],
            np.concatenate([self.services, [float(services)]])[1:],
        )

    @staticmethod
    def none(windows: int, groups: int, n_issues: int) -> Past:
        """No epoch yet.

        Args:
            windows: W, epochs that are pooled, the running one included.
            groups: G.
            n_issues: K.
        """
        return Past(np.zeros((windows - 1, 4, groups, n_issues)), np.zeros(windows - 1))
