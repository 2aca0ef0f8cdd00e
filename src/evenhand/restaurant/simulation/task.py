"""The task: drive to the person, respond. Pure functions on arrays; it knows no fairness.

Lengths are in metres, times in physics steps of 0.02 s, n is the number of simulations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenhand.core.errors import InputError
from evenhand.restaurant import floor_plan, people
from evenhand.restaurant.simulation import driving, kernels

WALK, RESPOND = 0, 1
ACTIONS = ("walk", "respond")

DISTANCE_UNIT = 5.0
"""Metres that make 1.0 in the observation."""
DISTANCE_LIMIT = 2.0
AGE_UNIT = 1.0
"""Seconds that make 1.0 in the observation; older readings stay at 1.0."""
UNITS = (DISTANCE_UNIT, float(floor_plan.MAX_STEPS), AGE_UNIT)
"""Of distance, time and age."""
N_GROUPS = len(people.GROUPS)
"""Of the five identities; a world with own ones has others."""
DISTANCE, STEPS, AGE = -3, -2, -1
"""Places in an observation, behind the groups."""


def observation_size(groups: int = N_GROUPS) -> int:
    """Numbers in an observation of people with so many groups."""
    return groups + 3


OBSERVATION_SIZE = observation_size()

REWARD_TERMS = ("response", "distance", "promptness", "safety")


@dataclass(frozen=True)
class TaskSettings:
    """When the robot decides.

    Attributes:
        interval: physics steps from one decision to the next; divides 300.
    """

    interval: int = 5

    def __post_init__(self) -> None:
        if not 1 <= self.interval <= 60 or floor_plan.MAX_STEPS % self.interval:
            raise InputError(
                "range interval",
                f"interval is {self.interval}: a decision is taken every 1 to 60 physics steps, "
                f"and the number must divide {floor_plan.MAX_STEPS}",
            )

    @property
    def decisions(self) -> int:
        """Most decisions of one service."""
        return floor_plan.MAX_STEPS // self.interval


def observe(
    ids: np.ndarray, one_hot: np.ndarray, distance: np.ndarray, steps: np.ndarray, age: np.ndarray
) -> np.ndarray:
    """S_t = (P_i, D_t, t) as the numbers a network takes, and the age of D_t.

    Args:
        ids: which of the n services, int [k].
        one_hot: identities of the person who asks, float32 [n, G]; G is 22 by default.
        distance: as last sensed, metres, [n].
        steps: physics steps since the service began, [n].
        age: of the last reading, seconds, [n].

    Returns:
        float32 [k, G + 3]: groups, distance / 5 m (at most 2), steps / 300, age / 1 s (at most 1).
    """
    return driving.observe(ids, one_hot, distance, steps, age, UNITS, DISTANCE_LIMIT)


def quality(
    responded: np.ndarray, steps: np.ndarray, distance: np.ndarray, min_distance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Quality of finished services as named terms; their sum lies in [-0.5, 1].

    A perfect service earns 1: a response (0.2), at 1.0 to 1.5 m (0.5, falling to 0 over 0.5 m
    towards the person and 1.5 m away), within 200 steps (0.3, falling to 0 at 300). A risky
    distance costs 0.5.

    Args:
        responded: bool [n].
        steps: physics steps at the end of the service, [n].
        distance: true distance at the end, metres, [n].
        min_distance: least true distance, metres, [n].

    Returns:
        Terms [n, 4], in the order of ``REWARD_TERMS``; and services with a response in time and in
        place, and never too close, bool [n].
    """
    return kernels.quality(responded, steps, distance, min_distance, floor_plan.MAX_STEPS)
