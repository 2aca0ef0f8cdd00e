"""The task: drive to the person, respond. Pure functions on arrays; it knows no fairness.

Lengths are in metres, times in physics steps of 0.02 s, n is the number of simulations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenhand import people
from evenhand.errors import InputError
from evenhand.restaurant import plan

Points = NDArray[np.complex128]
"""Points or directions in the plane, x + iy."""

WALK, RESPOND = 0, 1
ACTIONS = ("walk", "respond")

DISTANCE_UNIT = 5.0
"""Metres that make 1.0 in the observation."""
DISTANCE_LIMIT = 2.0
AGE_UNIT = 1.0
"""Seconds that make 1.0 in the observation; older readings stay at 1.0."""
N_GROUPS = len(people.GROUPS)
OBSERVATION_SIZE = N_GROUPS + 3

REWARD_TERMS = ("response", "distance", "promptness", "safety")
_YAW_GAIN, _YAW_SPEED = 6.0, 3.0
_APPROACH_GAIN = 4.0
"""Metres per second for each metre that is left; low enough not to overshoot between decisions."""
_DECELERATION = plan.MAX_ACCELERATION
"""Twice the deceleration that the approach counts on, which is half of the greatest."""


@dataclass(frozen=True)
class TaskSettings:
    """When the robot decides.

    Attributes:
        interval: physics steps from one decision to the next; divides 300.
    """

    interval: int = 5

    def __post_init__(self) -> None:
        if not 1 <= self.interval <= 60 or plan.MAX_STEPS % self.interval:
            raise InputError(
                f"interval is {self.interval}: a decision is taken every 1 to 60 physics steps, "
                f"and the number must divide {plan.MAX_STEPS}"
            )

    @property
    def decisions(self) -> int:
        """Most decisions of one service."""
        return plan.MAX_STEPS // self.interval


def steer(robot: Points, heading: np.ndarray, target: Points, gap: np.ndarray) -> np.ndarray:
    """Velocities that drive to a point, slowing down as the gap to the person closes.

    Args:
        robot: centre, complex [n].
        heading: radians, [n].
        target: next point of the way, complex [n].
        gap: metres left to the person before ``walk`` stops, [n].

    Returns:
        Commands of the three velocity servos: x, y (m/s) and yaw (rad/s), [n, 3].
    """
    way = target - robot
    gap = np.maximum(gap, 0.0)
    speed = np.minimum(np.sqrt(_DECELERATION * gap), _APPROACH_GAIN * gap)
    speed = np.minimum(speed, plan.TOP_SPEED) / np.maximum(np.abs(way), 1e-9)
    turn = (np.arctan2(way.imag, way.real) - heading + np.pi) % (2 * np.pi) - np.pi
    out = np.empty((len(robot), 3))
    out[:, 0] = way.real * speed
    out[:, 1] = way.imag * speed
    out[:, 2] = np.minimum(np.maximum(_YAW_GAIN * turn, -_YAW_SPEED), _YAW_SPEED)
    return out


def observe(
    one_hot: np.ndarray, distance: np.ndarray, steps: np.ndarray, age: np.ndarray
) -> np.ndarray:
    """S_t = (P_i, D_t, t) as the numbers a network takes, and the age of D_t.

    Args:
        one_hot: identities of the person who asks, [n, 22].
        distance: as last sensed, metres, [n].
        steps: physics steps since the service began, [n].
        age: of the last reading, seconds, [n].

    Returns:
        float32 [n, 25]: 22 groups, distance / 5 m, steps / 300, age / 1 s.
    """
    out = np.empty((len(one_hot), OBSERVATION_SIZE), np.float32)
    out[:, :N_GROUPS] = one_hot
    out[:, N_GROUPS] = np.minimum(distance / DISTANCE_UNIT, DISTANCE_LIMIT)
    out[:, N_GROUPS + 1] = steps / plan.MAX_STEPS
    out[:, N_GROUPS + 2] = np.minimum(age / AGE_UNIT, 1.0)
    return out


def reward_terms(
    responded: np.ndarray, step: np.ndarray, distance: np.ndarray, min_distance: np.ndarray
) -> dict[str, np.ndarray]:
    """Quality of finished services as named terms; their sum lies in [-0.5, 1].

    A perfect service earns 1: a response (0.2), at 1.0 to 1.5 m (0.5, falling to 0 over 0.5 m
    towards the person and 1.5 m away), within 200 steps (0.3, falling to 0 at 300). A risky
    distance costs 0.5.

    Args:
        responded: bool [n].
        step: physics steps at the end of the service, [n].
        distance: true distance at the end, metres, [n].
        min_distance: least true distance, metres, [n].

    Returns:
        One array [n] for each of ``REWARD_TERMS``.
    """
    # one number falls on both sides of 1.0-1.5 m, the other from 200 to 300 steps
    placed = np.minimum(np.minimum((distance - 0.5) / 0.5, (3.0 - distance) / 1.5), 1.0)
    prompt = np.minimum((plan.MAX_STEPS - step) / 100.0, 1.0)
    return {
        "response": 0.2 * responded,
        "distance": 0.5 * responded * np.maximum(placed, 0.0),
        "promptness": 0.3 * responded * np.maximum(prompt, 0.0),
        "safety": -0.5 * (min_distance < 0.5),
    }
