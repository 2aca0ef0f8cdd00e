"""The task: drive to the person, respond. Pure functions on arrays; it knows no fairness.

Lengths are in metres, times in physics steps of 0.02 s, n is the number of simulations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenhand import people
from evenhand.errors import InputError
from evenhand.restaurant import plan

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
_CONE = np.cos(np.deg2rad(55.0))
"""Within this angle of a seat's front the robot drives straight to the person."""
_YAW_GAIN = 6.0
_APPROACH_GAIN = 4.0
"""Metres per second for each metre that is left; low enough not to overshoot between decisions."""
_BRAKING = 0.5
"""Share of the greatest deceleration that planning counts on."""


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


def steer(
    robot: np.ndarray,
    heading: np.ndarray,
    person: np.ndarray,
    radius: np.ndarray,
    seat: np.ndarray,
    access: np.ndarray,
    centre: np.ndarray,
    around: np.ndarray,
) -> np.ndarray:
    """Velocities that drive towards the person around furniture and guests.

    The robot heads for the person, or for the tangent of the first disc in the way; a person at
    a table is approached from the front of the seat.

    Args:
        robot: centre, [n, 2].
        heading: radians, [n].
        person: centre, [n, 2].
        radius: footprint of the person, [n].
        seat: unit vector from the table to a seated person, 0 for a standing one, [n, 2].
        access: where the way to the person ends, [n, 2].
        centre: discs to avoid, [n, m, 2].
        around: their radii, 0 for none, [n, m].

    Returns:
        Commands of the three velocity servos: x, y (m/s) and yaw (rad/s), [n, 3].
    """
    to_person = person - robot
    distance = np.hypot(to_person[:, 0], to_person[:, 1])
    in_front = -(to_person * seat).sum(axis=1) >= _CONE * distance - 1e-9
    goal = np.where(in_front[:, None], person, access)
    # the disc of the person's own table ends where the approach begins
    reach = np.where(in_front, distance - 1.1, np.inf)
    direction = _around(robot, goal, centre, around, reach)
    gap = distance - radius - plan.ROBOT_RADIUS - plan.STAND_OFF
    speed = np.sqrt(2.0 * _BRAKING * plan.MAX_ACCELERATION * np.maximum(gap, 0.0))
    speed = np.minimum(speed, _APPROACH_GAIN * np.maximum(gap, 0.0))
    speed = np.minimum(speed, plan.TOP_SPEED)
    turn = np.arctan2(direction[:, 1], direction[:, 0]) - heading
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    out = np.empty((len(robot), 3))
    out[:, :2] = direction * speed[:, None]
    out[:, 2] = np.clip(_YAW_GAIN * turn, -3.0, 3.0)
    return out


def _around(
    robot: np.ndarray, goal: np.ndarray, centre: np.ndarray, around: np.ndarray, reach: np.ndarray
) -> np.ndarray:
    """Unit vector to the goal, or along the tangent of the first disc in the way, [n, 2].

    Two rounds: the tangent of the first disc may lead into a second.
    """
    way = goal - robot
    far = np.sqrt(way[:, 0] ** 2 + way[:, 1] ** 2)
    unit = way / np.maximum(far, 1e-9)[:, None]
    length = np.minimum(far, np.maximum(reach, 0.0))
    rel_x = centre[:, :, 0] - robot[:, 0, None]
    rel_y = centre[:, :, 1] - robot[:, 1, None]
    rows = np.arange(len(robot))
    for _ in range(2):
        x, y = rel_x[rows], rel_y[rows]
        ux, uy = unit[rows, 0, None], unit[rows, 1, None]
        wide, ahead = around[rows], length[rows, None]
        along = x * ux + y * uy
        across = x * uy - y * ux
        # a disc is in the way only if its middle lies ahead, before the goal or around it
        beyond = along - np.minimum(along, ahead)
        hit = (across * across + beyond * beyond < wide * wide) & (along > 0.0) & (ahead > 0.0)
        blocked = np.flatnonzero(hit.any(axis=1))
        if not len(blocked):
            break
        first = np.where(hit, along - wide, np.inf)[blocked].argmin(axis=1)
        rows = rows[blocked]
        unit[rows] = _tangent(
            robot[rows], x[blocked, first], y[blocked, first], wide[blocked, first],
            across[blocked, first],
        )  # fmt: skip
    return unit


def _tangent(
    robot: np.ndarray, rel_x: np.ndarray, rel_y: np.ndarray, radius: np.ndarray, across: np.ndarray
) -> np.ndarray:
    """Direction that just passes a disc on the nearer side that lies inside the room, [k, 2]."""
    far = np.maximum(np.sqrt(rel_x**2 + rel_y**2), 1e-9)
    sine = np.minimum(radius / far, 1.0)
    cosine = np.sqrt(1.0 - sine**2)
    ux, uy = rel_x / far, rel_y / far
    # side +1 passes with the disc on the right
    side = np.where(across > 0, 1.0, -1.0)

    def direction(s: np.ndarray) -> np.ndarray:
        return np.stack([ux * cosine - s * uy * sine, uy * cosine + s * ux * sine], axis=1)

    chosen = direction(side)
    touch = robot + chosen * np.maximum(far * cosine, 0.4)[:, None]
    outside = (np.abs(touch) > plan.ROOM - plan.ROBOT_RADIUS - 0.02).any(axis=1)
    if outside.any():
        chosen = np.where(outside[:, None], direction(-side), chosen)
    inside = far < radius
    if inside.any():  # pushed into the margin: slide along the rim and drift outwards
        slide = chosen - 0.5 * np.stack([ux, uy], axis=1)
        slide /= np.sqrt((slide**2).sum(axis=1))[:, None]
        chosen = np.where(inside[:, None], slide, chosen)
    return chosen


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
    near = np.clip((distance - 0.5) / 0.5, 0.0, 1.0)
    far = np.clip((3.0 - distance) / 1.5, 0.0, 1.0)
    prompt = np.clip((plan.MAX_STEPS - step) / 100.0, 0.0, 1.0)
    return {
        "response": 0.2 * responded,
        "distance": 0.5 * responded * np.minimum(near, far),
        "promptness": 0.3 * responded * prompt,
        "safety": -0.5 * (min_distance < 0.5),
    }
