"""Set-ups of services: who is where when a service begins. Pure arrays and an explicit rng.

A set-up is drawn so that nobody overlaps, the robot starts 2.0-4.5 m from the person, and the way
is short enough to be served in time by a robot that sets off at once.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np

from evenhand.restaurant import floor_plan, people
from evenhand.restaurant.simulation import route

_TRIES = 8
"""Start positions proposed for each arrangement of guests."""
_SPARE = 1.7
"""Arrangements drawn for each that is needed, since not all have a start for the robot."""
_ACCESS = floor_plan.CLUSTER_RADIUS + route.MARGIN + 0.03
"""From the middle of a table to the front of its seats."""
_LONGEST_WAY = 4.6
"""Metres of way that can be driven before a response at 1.25 m would be late."""


class Places(Protocol):
    """Who is where in N services: as much of ``Setups`` as eyes need."""

    @property
    def people(self) -> np.ndarray:
        """As in ``Setups``."""
        ...

    @property
    def position(self) -> np.ndarray:
        """As in ``Setups``."""
        ...

    @property
    def facing(self) -> np.ndarray:
        """As in ``Setups``."""
        ...

    @property
    def shape(self) -> np.ndarray:
        """As in ``Setups``."""
        ...

    @property
    def table(self) -> np.ndarray:
        """As in ``Setups``."""
        ...

    @property
    def start(self) -> np.ndarray:
        """As in ``Setups``."""
        ...


@dataclass(frozen=True)
class Setups:
    """A batch of N services before they begin; row i of every array is service i.

    Attributes:
        people: codes of the five identities of every guest, int64 [N, 12, 5]; guest 0 asks.
        codes: identities of the person who asks as the population has them, int64 [N, D].
        position: centres of the guests, metres, float64 [N, 12, 2].
        facing: heading of the guests, radians, float64 [N, 12].
        shape: index into ``plan.SHAPES`` of the guests, int64 [N, 12].
        radius: footprint of the guests, metres, float64 [N, 12].
        table: the table where a guest sits, -1 for a standing guest, int64 [N, 12].
        start: robot's centre, metres, float64 [N, 2].
        heading: robot's heading, radians, float64 [N].
        one_hot: the same as the robot is told them, float32 [N, G]; 0 where it is not told.
        front: unit vector from the table to the person where the way leads by the front of a
            seat, 0 elsewhere, complex [N].
        way: points that lead from the start to the person, complex [N, 3], see ``route``.
        last: index of the first point of the way that is the person, int64 [N].
    """

    people: np.ndarray
    codes: np.ndarray
    position: np.ndarray
    facing: np.ndarray
    shape: np.ndarray
    radius: np.ndarray
    table: np.ndarray
    start: np.ndarray
    heading: np.ndarray
    one_hot: np.ndarray
    front: np.ndarray
    way: np.ndarray
    last: np.ndarray

    def __len__(self) -> int:
        return len(self.start)

    def __getitem__(self, rows: slice | np.ndarray) -> Setups:
        return Setups(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    @property
    def asking(self) -> np.ndarray:
        """The five identities of the person who asks, int64 [N, 5]."""
        return self.people[:, 0]

    @property
    def start_distance(self) -> np.ndarray:
        """Distance between robot and person, metres, float64 [N]."""
        return np.hypot(*(self.position[:, 0] - self.start).T)


def shape_of(codes: np.ndarray) -> np.ndarray:
    """Which shape a person has: a disability is shown as a wheelchair, else age decides.

    Args:
        codes: identities, int64 [..., 5].

    Returns:
        Index into ``plan.SHAPES``, int64 [...].
    """
    age, disability = codes[..., 2], codes[..., 3]
    by_age = np.array([0, 1, 1, 1, 2])[age]
    return np.where(disability == 0, 3, by_age)


def draw(
    population: people.Population, n: int, rng: np.random.Generator, hidden: bool = False
) -> Setups:
    """Draw n set-ups.

    Args:
        population: where identities come from; guests are drawn alike and independently.
        n: number of services.
        rng: source of all randomness.
        hidden: do not tell the robot whom it serves.

    Returns:
        Set-ups in which nobody overlaps and the person can be reached in time.
    """
    identities = population.identities
    drawn = people.sample(population, n * floor_plan.N_GUESTS, rng)
    drawn = drawn.reshape(n, floor_plan.N_GUESTS, len(identities))
    codes = people.known(drawn, identities)
    parts: list[dict[str, np.ndarray]] = []
    missing = n
    while missing > 0:  # arrangements without a start for the robot are drawn anew
        part = _places(int(_SPARE * missing) + 4, rng)
        good = np.flatnonzero(part.pop("clear"))[:missing]
        parts.append({name: values[good] for name, values in part.items()})
        missing -= len(good)
    places = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    shape = shape_of(codes)
    position, table = places["position"], places["table"]
    towards_table = np.where(position[..., 1] > floor_plan.TABLES[table, 1], -np.pi / 2, np.pi / 2)
    any_way = rng.uniform(-np.pi, np.pi, (n, floor_plan.N_GUESTS))
    told = people.encode(drawn[:, 0], identities)
    return Setups(
        people=codes,
        codes=drawn[:, 0],
        position=position,
        facing=np.where(table >= 0, towards_table, any_way),
        shape=shape,
        radius=floor_plan.SHAPE_RADIUS[shape],
        table=table,
        start=places["start"],
        heading=rng.uniform(-np.pi, np.pi, n),
        one_hot=np.zeros_like(told) if hidden else told,
        front=places["front"],
        way=places["way"],
        last=places["last"],
    )


def _places(n: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Guests' places, a start for the robot, and its way; ``clear`` says whether one was found."""
    a = floor_plan.ANCHORS
    # weighted draw without replacement (Efraimidis & Spirakis 2006): largest u^(1/w)
    key = np.log(rng.random((n, len(a.weight)))) / a.weight
    chosen = np.argpartition(-key, floor_plan.N_GUESTS, axis=1)[:, : floor_plan.N_GUESTS]
    # argpartition leaves the likeliest first: shuffle, so that any of the twelve may ask
    chosen = rng.permuted(chosen, axis=1)
    jitter = rng.uniform(-1.0, 1.0, (n, floor_plan.N_GUESTS, 2)) * a.jitter[chosen]
    position = a.centre[chosen] + jitter
    table = a.table[chosen]
    person, host = as_complex(position[:, 0]), table[:, 0]
    out = person - as_complex(floor_plan.TABLES)[host]
    seat = np.where(host >= 0, out / np.abs(out), 0.0)
    access = np.where(host >= 0, person - out + seat * _ACCESS, person)
    distance = rng.uniform(*floor_plan.START_DISTANCE, (n, _TRIES))
    angle = rng.uniform(-np.pi, np.pi, (n, _TRIES))
    starts: route.Points = (person[:, None] + distance * np.exp(1j * angle)).astype(complex)
    centre, radius = obstacles(position, table)
    ways = route.find(starts, person, seat, access, host, centre, radius, _LONGEST_WAY)
    start = starts[np.arange(n), ways.tried]
    return {
        "position": position,
        "table": table,
        "start": np.stack([start.real, start.imag], axis=1),
        "front": ways.front,
        "way": ways.points,
        "last": ways.last,
        "clear": ways.tried >= 0,
    }


def as_complex(points: np.ndarray) -> np.ndarray:
    """Points of the plane [..., 2] as x + iy, [...]."""
    return points[..., 0] + 1j * points[..., 1]


def obstacles(position: np.ndarray, table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Discs that the robot's centre must not enter on its way.

    Seated guests lie inside the disc of their table and need none of their own.

    Args:
        position: guests, [n, 12, 2]; guest 0 is the person served and no obstacle.
        table: table of each guest or -1, [n, 12].

    Returns:
        Centres, complex [n, 19], and radii [n, 19]; radius 0 where there is nothing.
    """
    n = len(position)
    standing = table[:, 1:] < 0
    around = floor_plan.SHAPE_RADIUS.max() + floor_plan.ROBOT_RADIUS + floor_plan.CLEARANCE
    tables = np.broadcast_to(as_complex(floor_plan.TABLES), (n, len(floor_plan.TABLES)))
    centre = np.concatenate([tables, as_complex(position[:, 1:])], axis=1)
    radius = np.concatenate(
        [np.full((n, len(floor_plan.TABLES)), floor_plan.CLUSTER_RADIUS), around * standing], axis=1
    )
    return centre, radius
