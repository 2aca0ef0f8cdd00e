"""The floor plan: where furniture stands and where guests can be. Pure numbers, metres.

Everything that can touch the robot has a round footprint, so planning, placing and physics share
one geometry: discs in the plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

TIMESTEP = 0.02
"""Seconds of one physics step; 200 steps are the four seconds after which a response is late."""
MAX_STEPS = 300
"""Physics steps after which a service without response ends."""
TOP_SPEED = 1.0
"""Metres per second of the robot's drive."""
MAX_ACCELERATION = 2.5
"""Metres per second squared; the force limit of the drive divided by the mass."""
ROBOT_MASS = 40.0
ROBOT_RADIUS = 0.20
STAND_OFF = 0.02
"""Gap at which `walk` stops before the person, so that nobody is pushed."""

ROOM = np.array([7.0, 4.3])
"""Half sizes of the room."""
TABLES = np.array([(x, y) for y in (-2.0, 2.0) for x in (-4.8, -1.6, 1.6, 4.8)])
"""Centres of the eight tables, shape (8, 2)."""
TABLE_RADIUS = 0.40
CHAIR_RADIUS = 0.20
CHAIR_REACH = 0.65
"""Distance of the two fixed chairs from the middle of their table, to its left and right."""
CHAIRS = (TABLES[:, None] + np.array([(-CHAIR_REACH, 0.0), (CHAIR_REACH, 0.0)])).reshape(-1, 2)
"""Centres of the sixteen fixed chairs, shape (16, 2)."""
SEAT_REACH = 0.72
"""Distance of the two guest places from the middle of their table, before and behind it."""
N_GUESTS = 12
START_DISTANCE = (2.0, 4.5)
"""Distance between robot and person when a service begins."""

CLUSTER_RADIUS = 1.27
"""Around a table with chairs and guests: the robot's centre stays outside when driving past."""
CLEARANCE = 0.06
"""Air that driving leaves around a standing guest and along walls."""

SHAPES = ("child", "adult", "elder", "wheelchair")
SHAPE_RADIUS = np.array([0.15, 0.20, 0.20, 0.26])
"""Footprint of each shape."""


@dataclass(frozen=True)
class Anchors:
    """Places a guest can take; jitter keeps every pair of places apart.

    Attributes:
        centre: shape (A, 2).
        jitter: half sizes of the uniform jitter, shape (A, 2).
        table: index of the table of a seat, -1 for a standing place, shape (A,).
        weight: how readily a place is taken, shape (A,).
    """

    centre: np.ndarray
    jitter: np.ndarray
    table: np.ndarray
    weight: np.ndarray


def anchors() -> Anchors:
    """All places: two seats a table, and standing room in the middle aisle and along the walls."""
    seats = (TABLES[:, None] + np.array([(0.0, -SEAT_REACH), (0.0, SEAT_REACH)])).reshape(-1, 2)
    middle = np.array([(x, 0.0) for x in np.linspace(-5.6, 5.6, 9)])
    along = np.array([(x, y) for y in (-3.95, 3.95) for x in np.linspace(-5.9, 5.9, 9)])
    sides = np.array([(x, y) for x in (-6.63, 6.63) for y in (-1.7, 1.7)])
    standing = np.concatenate([middle, along, sides])
    jitter = np.concatenate(
        [
            np.tile((0.06, 0.03), (len(seats), 1)),
            np.tile((0.15, 0.20), (len(middle), 1)),
            np.tile((0.15, 0.06), (len(along), 1)),
            np.tile((0.03, 0.30), (len(sides), 1)),
        ]
    )
    return Anchors(
        centre=np.concatenate([seats, standing]),
        jitter=jitter,
        table=np.concatenate([np.repeat(np.arange(len(TABLES)), 2), np.full(len(standing), -1)]),
        weight=np.concatenate([np.full(len(seats), 4.0), np.full(len(standing), 1.0)]),
    )


ANCHORS = anchors()
