"""The way to the person: planned when a service begins, for nothing but the robot moves; followed.

Points and directions of the plane are complex numbers, x + iy, in metres. What must be driven
around are discs; the way touches them along tangents.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenhand.core.machine_code import compiled
from evenhand.restaurant import floor_plan

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
        tried: index of the start that was taken, -1 where none has a clear way, int64 [n].
        points: complex [n, 3]; the person's place fills up the end.
        last: index of the first point that is the person, int64 [n].
        front: unit vector from the table to the person where the way leads by the front of a
            seat, 0 elsewhere, complex [n].
        length: from start to person, metres, [n].
    """

    tried: np.ndarray
    points: Points
    last: np.ndarray
    front: Points
    length: np.ndarray


def find(
    starts: Points,
    person: Points,
    seat: Points,
    access: Points,
    host: np.ndarray,
    centre: Points,
    around: np.ndarray,
    longest: float = np.inf,
) -> Ways:
    """Plan n ways, each from the first of its starts from which there is a clear one.

    A way is clear if it begins and stays inside the room and outside all discs.

    Args:
        starts: of the robot, T proposals each, complex [n, T].
        person: complex [n].
        seat: unit vector from the table to the person, 0 for a standing one, complex [n].
        access: in front of the seat, outside the table's disc, complex [n].
        host: index of the disc around the person's own table, -1 for none, int [n].
        centre: discs, complex [n, m].
        around: their radii, 0 for none, [n, m].
        longest: metres that a way may have.
    """
    n = len(person)
    ways = Ways(
        tried=np.full(n, -1),
        points=np.repeat(person[:, None], POINTS, axis=1),
        last=np.zeros(n, np.int64),
        front=np.zeros(n, complex),
        length=np.zeros(n),
    )
    room = floor_plan.ROOM - floor_plan.ROBOT_RADIUS - floor_plan.CLEARANCE
    _find(
        starts, person, seat, access, host, centre, around, (room[0], room[1]), longest,
        (ways.tried, ways.points, ways.last, ways.front, ways.length),
    )  # fmt: skip
    return ways


@compiled
def in_front(position: complex, person: complex, seat: complex) -> bool:
    """Whether a person is approached from the front of the seat; always true without a table.

    Args:
        position: of the robot.
        person: where it goes.
        seat: unit vector from the table to the person, 0 for a standing one.
    """
    to_person = person - position
    return seat == 0 or -(to_person * seat.conjugate()).real >= _FRONT * abs(to_person)


@compiled
def _find(
    starts: Points,
    person: Points,
    seat: Points,
    access: Points,
    host: np.ndarray,
    centre: Points,
    around: np.ndarray,
    room: tuple[float, float],
    longest: float,
    out: tuple[np.ndarray, Points, np.ndarray, Points, np.ndarray],
) -> None:
    tried, points, last, front, length = out
    for i in range(len(person)):
        for j in range(starts.shape[1]):
            start = starts[i, j]
            if _outside(start, room) or _crowded(start, centre[i], around[i]):
                continue
            direct = in_front(start, person[i], seat[i])
            goal = person[i] if direct else access[i]
            # who approaches from the front enters the disc of the person's own table
            entered = host[i] if direct else -1
            clear, bent, corner = _bend(start, goal, centre[i], around[i], entered, room)
            # a corner must not lead away from the front of a seat whose table's disc is entered
            if bent and direct:
                clear = clear and in_front(corner, person[i], seat[i])
            whole = abs(goal - corner) + abs(corner - start) if bent else abs(goal - start)
            whole += abs(person[i] - goal)
            if not clear or whole > longest:
                continue
            k = 0
            if bent:
                points[i, k] = corner
                k += 1
            points[i, k] = goal
            tried[i], length[i] = j, whole
            last[i] = k if direct else k + 1
            front[i] = 0.0 if direct else seat[i]
            break


@compiled
def _outside(point: complex, room: tuple[float, float]) -> bool:
    return abs(point.real) >= room[0] or abs(point.imag) >= room[1]


@compiled
def _crowded(point: complex, centre: Points, around: np.ndarray) -> bool:
    """Whether a point is too near to a disc to start there."""
    return bool((np.abs(centre - point) <= around + MARGIN).any())


@compiled
def _first_hit(
    a: complex, b: complex, centre: Points, around: np.ndarray, entered: int
) -> tuple[int, float]:
    """The disc that the straight line from a to b enters, and is nearest to a; -1 for none."""
    way = b - a
    length = abs(way)
    unit = way / length if length > 0 else 1.0 + 0.0j
    first, nearest = -1, np.inf
    for k in range(len(centre)):
        c, r = centre[k], around[k]
        if k == entered:
            continue
        turned = (c - a) * unit.conjugate()
        beyond = turned.real - min(max(turned.real, 0.0), length)
        if turned.imag**2 + beyond**2 < r**2 and abs(c - a) - r < nearest:
            first, nearest = k, abs(c - a) - r
    return first, nearest


@compiled
def _bend(
    a: complex,
    b: complex,
    centre: Points,
    around: np.ndarray,
    entered: int,
    room: tuple[float, float],
) -> tuple[bool, bool, complex]:
    """The way from a to b with at most one corner.

    Returns:
        Whether it is clear, whether it has a corner, and the corner: where the tangents from a
        and b to the first disc between them meet, on the nearer side that lies inside the room.
    """
    first, _ = _first_hit(a, b, centre, around, entered)
    if first < 0:
        return True, False, b
    c, r = centre[first], around[first] + MARGIN
    # a disc on the right is gone round clockwise
    side = -1.0 if ((c - a) * (b - a).conjugate()).imag < 0 else 1.0
    corner, turn = _meet(a, b, c, r, side)
    if _outside(corner, room):
        corner, turn = _meet(a, b, c, r, -side)
    clear = turn <= _WIDEST_TURN and not _outside(corner, room)
    clear = clear and _first_hit(a, corner, centre, around, entered)[0] < 0
    return clear and _first_hit(corner, b, centre, around, entered)[0] < 0, True, corner


@compiled
def _meet(a: complex, b: complex, c: complex, r: float, side: float) -> tuple[complex, float]:
    """Meeting point of two tangents on one side of a disc, and the angle between them."""
    from_a, from_b = a - c, b - c
    lean_a = np.arccos(min(r / max(abs(from_a), 1e-9), 1.0))
    lean_b = np.arccos(min(r / max(abs(from_b), 1e-9), 1.0))
    touch_a = np.arctan2(from_a.imag, from_a.real) + side * lean_a
    touch_b = np.arctan2(from_b.imag, from_b.real) - side * lean_b
    turn = (side * (touch_b - touch_a)) % (2 * np.pi)
    half = min(turn / 2, 1.4)
    middle = touch_a + side * turn / 2
    return c + r / np.cos(half) * complex(np.cos(middle), np.sin(middle)), turn
