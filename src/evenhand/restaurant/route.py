"""The way to the person, planned when a service begins: nothing but the robot moves.

Points of the plane are complex numbers, x + iy, in metres. What must be driven around are discs;
the way touches them along tangents. Pure functions on arrays; n ways at once, m discs each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenhand.restaurant import plan

Points = NDArray[np.complex128]

POINTS = 3
"""Points of a way after its start: at most one corner, the front of a seat, the person."""
MARGIN = 0.05
"""Metres by which corners keep away from the discs, so that turns may be cut."""
_FRONT = np.cos(np.deg2rad(55.0))
"""Within this angle of a seat's front the way leads straight to the person."""
_WIDEST_TURN = 2.4
"""Radians that a way may follow one disc."""


@dataclass(frozen=True)
class Ways:
    """n planned ways.

    Attributes:
        points: complex [n, 3]; the person's place fills up the end.
        last: index of the first point that is the person, int64 [n].
        front: unit vector from the table to the person where the way leads by the front of a
            seat, 0 elsewhere, complex [n].
        length: from start to person, metres, [n].
        clear: whether the way keeps out of all discs and inside the room, bool [n].
    """

    points: Points
    last: np.ndarray
    front: Points
    length: np.ndarray
    clear: np.ndarray


def in_front(position: Points, person: Points, seat: Points) -> np.ndarray:
    """Whether a person is approached from the front of the seat; always true without a table.

    Args:
        position: of the robot, complex [n].
        person: complex [n].
        seat: unit vector from the table to the person, 0 for a standing one, complex [n].
    """
    to_person = person - position
    return -(to_person * seat.conj()).real >= _FRONT * np.abs(to_person) * (seat != 0)


def find(
    start: Points,
    person: Points,
    seat: Points,
    access: Points,
    host: np.ndarray,
    centre: Points,
    around: np.ndarray,
) -> Ways:
    """Plan n ways.

    Args:
        start: of the robot, complex [n].
        person: complex [n].
        seat: unit vector from the table to the person, 0 for a standing one, complex [n].
        access: in front of the seat, outside the table's disc, complex [n].
        host: index of the disc around the person's own table, -1 for none, int [n].
        centre: discs, complex [n, m].
        around: their radii, 0 for none, [n, m].

    Returns:
        The ways; one that is not clear is to be discarded.
    """
    direct = in_front(start, person, seat)
    goal = np.where(direct, person, access)
    around = around.copy()
    # who approaches from the front enters the disc of the person's own table
    entered = np.flatnonzero(direct & (host >= 0))
    around[entered, host[entered]] = 0.0
    hits = _hits(start, goal, centre, around)
    bent = np.flatnonzero(hits.any(axis=1))
    last = (~direct).astype(np.int64)
    last[bent] += 1
    points = np.repeat(person[:, None], POINTS, axis=1)
    points[~direct, 0] = access[~direct]
    points[bent, 1] = goal[bent]
    clear = np.ones(len(start), bool)
    corner, clear[bent] = _corner(start[bent], goal[bent], centre[bent], around[bent], hits[bent])
    points[bent, 0] = corner
    # a corner must not lead away from the front of a seat whose table's disc is entered
    clear[bent] &= ~direct[bent] | in_front(corner, person[bent], seat[bent])
    clear[bent] &= ~_hits(start[bent], corner, centre[bent], around[bent]).any(axis=1)
    clear[bent] &= ~_hits(corner, goal[bent], centre[bent], around[bent]).any(axis=1)
    legs = np.abs(np.diff(np.concatenate([start[:, None], points], axis=1), axis=1))
    return Ways(points, last, np.where(direct, 0.0, seat), legs.sum(axis=1), clear)


def _hits(a: Points, b: Points, centre: Points, radius: np.ndarray) -> np.ndarray:
    """Which discs the straight line from a to b enters, bool [n, m]."""
    way = b - a
    length = np.abs(way)
    unit = np.where(length > 0, way, 1.0) / np.where(length > 0, length, 1.0)
    turned = (centre - a[:, None]) * unit.conj()[:, None]
    beyond = turned.real - np.clip(turned.real, 0.0, length[:, None])
    return turned.imag**2 + beyond**2 < radius**2


def _corner(
    a: Points, b: Points, centre: Points, radius: np.ndarray, hits: np.ndarray
) -> tuple[Points, np.ndarray]:
    """Where the tangents from a and b to the first disc between them meet.

    Returns:
        Corner on the nearer side that lies inside the room, complex [k], and whether there is
        one, bool [k].
    """
    entry = np.where(hits, np.abs(centre - a[:, None]) - radius, np.inf)
    at = np.arange(len(a)), entry.argmin(axis=1)
    c, r = centre[at], radius[at] + MARGIN
    across = ((c - a) * (b - a).conj()).imag
    side = np.where(across < 0, -1.0, 1.0)  # a disc on the right is gone round clockwise
    found, turn = _meet(a, b, c, r, side)
    other, other_turn = _meet(a, b, c, r, -side)
    out, other_out = _outside(found), _outside(other)
    return np.where(out, other, found), np.where(
        out, (other_turn <= _WIDEST_TURN) & ~other_out, turn <= _WIDEST_TURN
    )


def _outside(points: Points) -> np.ndarray:
    room = plan.ROOM - plan.ROBOT_RADIUS - plan.CLEARANCE
    return (np.abs(points.real) > room[0]) | (np.abs(points.imag) > room[1])


def _meet(
    a: Points, b: Points, c: Points, r: np.ndarray, side: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Meeting point of two tangents on one side of a disc, and the angle between them."""
    from_a, from_b = a - c, b - c
    lean_a = np.arccos(np.minimum(r / np.maximum(np.abs(from_a), 1e-9), 1.0))
    lean_b = np.arccos(np.minimum(r / np.maximum(np.abs(from_b), 1e-9), 1.0))
    touch_a = np.angle(from_a) + side * lean_a
    touch_b = np.angle(from_b) - side * lean_b
    turn = (side * (touch_b - touch_a)) % (2 * np.pi)
    half = np.minimum(turn / 2, 1.4)
    return c + r / np.cos(half) * np.exp(1j * (touch_a + side * turn / 2)), turn
