"""Set-ups of services: who is where when a service begins. Pure arrays and an explicit rng.

A set-up is drawn so that nobody overlaps, the robot starts 2.0-4.5 m from the person, and the way
is short enough to be served in time by a robot that sets off at once.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from evenhand import people
from evenhand.restaurant import plan

_TRIES = 10
"""Start positions proposed for each service in one round of rejection sampling."""
_LONGEST_DETOUR = 1.0
"""Metres by which the way may exceed the straight line."""
_LONGEST_WAY = 4.45
"""Metres of way that can be driven before a response at 1.25 m would be late."""


@dataclass(frozen=True)
class Setups:
    """A batch of N services before they begin; row i of every array is service i.

    Attributes:
        people: codes of the identities of every guest, int64 [N, 12, 5]; guest 0 asks.
        position: centres of the guests, metres, float64 [N, 12, 2].
        facing: heading of the guests, radians, float64 [N, 12].
        shape: index into ``plan.SHAPES`` of the guests, int64 [N, 12].
        radius: footprint of the guests, metres, float64 [N, 12].
        table: the table where a guest sits, -1 for a standing guest, int64 [N, 12].
        start: robot's centre, metres, float64 [N, 2].
        heading: robot's heading, radians, float64 [N].
        one_hot: identities of the person who asks as the robot is told them, float32 [N, 22].
        seat: unit vector from the table to the person, 0 for a standing one, [N, 2].
        access: where the way to the person ends, metres, [N, 2].
        discs: centres of what the robot must drive around, metres, [N, 19, 2].
        around: radii of these discs, 0 for none, metres, [N, 19].
    """

    people: np.ndarray
    position: np.ndarray
    facing: np.ndarray
    shape: np.ndarray
    radius: np.ndarray
    table: np.ndarray
    start: np.ndarray
    heading: np.ndarray
    one_hot: np.ndarray
    seat: np.ndarray
    access: np.ndarray
    discs: np.ndarray
    around: np.ndarray

    def __len__(self) -> int:
        return len(self.start)

    def __getitem__(self, rows: slice | np.ndarray) -> Setups:
        return Setups(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    @property
    def asking(self) -> np.ndarray:
        """Identities of the person who asks, int64 [N, 5]."""
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


def draw(population: people.Population, n: int, rng: np.random.Generator) -> Setups:
    """Draw n set-ups.

    Args:
        population: where identities come from; guests are drawn alike and independently.
        n: number of services.
        rng: source of all randomness.

    Returns:
        Set-ups in which nobody overlaps and the person can be reached in time.
    """
    codes = people.sample(population, n * plan.N_GUESTS, rng).reshape(n, plan.N_GUESTS, 5)
    position, table, start = _places(n, rng)
    undecided = np.flatnonzero(~np.isfinite(start[:, 0]))
    while len(undecided):  # no start fits this arrangement of guests: arrange anew
        position[undecided], table[undecided], start[undecided] = _places(len(undecided), rng)
        undecided = undecided[~np.isfinite(start[undecided, 0])]
    shape = shape_of(codes)
    towards_table = np.where(position[..., 1] > plan.TABLES[table, 1], -np.pi / 2, np.pi / 2)
    any_way = rng.uniform(-np.pi, np.pi, (n, plan.N_GUESTS))
    person, seated = position[:, 0], table[:, 0] >= 0
    out = person - plan.TABLES[table[:, 0]]
    discs, around = obstacles(position, table)
    return Setups(
        people=codes,
        position=position,
        facing=np.where(table >= 0, towards_table, any_way),
        shape=shape,
        radius=plan.SHAPE_RADIUS[shape],
        table=table,
        start=start,
        heading=rng.uniform(-np.pi, np.pi, n),
        one_hot=people.encode(codes[:, 0]),
        seat=np.where(seated[:, None], out / np.hypot(out[:, 0], out[:, 1])[:, None], 0.0),
        access=access_point(person, table[:, 0]),
        discs=discs,
        around=around,
    )


def _places(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Guests' positions [n, 12, 2], their tables [n, 12], robot's start [n, 2] (NaN: none fits)."""
    a = plan.ANCHORS
    # weighted draw without replacement (Efraimidis & Spirakis 2006): largest u^(1/w)
    key = np.log(rng.random((n, len(a.weight)))) / a.weight
    chosen = np.argpartition(-key, plan.N_GUESTS, axis=1)[:, : plan.N_GUESTS]
    # argpartition leaves the likeliest first: shuffle, so that any of the twelve may ask
    chosen = rng.permuted(chosen, axis=1)
    jitter = rng.uniform(-1.0, 1.0, (n, plan.N_GUESTS, 2)) * a.jitter[chosen]
    position = a.centre[chosen] + jitter
    table = a.table[chosen]
    person = position[:, 0]
    distance = rng.uniform(*plan.START_DISTANCE, (n, _TRIES))
    angle = rng.uniform(-np.pi, np.pi, (n, _TRIES))
    ray = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    tries = person[:, None] + distance[..., None] * ray
    good = _start_fits(tries, person, table[:, 0], *obstacles(position, table))
    pick = good.argmax(axis=1)
    rows = np.arange(n)
    start = np.where(good[rows, pick, None], tries[rows, pick], np.nan)
    return position, table, start


def obstacles(position: np.ndarray, table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Discs that the robot's centre must not enter on its way.

    Seated guests lie inside the disc of their table and need none of their own.

    Args:
        position: guests, [n, 12, 2]; guest 0 is the person served and no obstacle.
        table: table of each guest or -1, [n, 12].

    Returns:
        Centres [n, 19, 2] and radii [n, 19]; radius 0 where there is nothing.
    """
    n = len(position)
    standing = table[:, 1:] < 0
    around = plan.SHAPE_RADIUS.max() + plan.ROBOT_RADIUS + plan.CLEARANCE
    centre = np.concatenate(
        [np.broadcast_to(plan.TABLES, (n, *plan.TABLES.shape)), position[:, 1:]], axis=1
    )
    radius = np.concatenate(
        [np.full((n, len(plan.TABLES)), plan.CLUSTER_RADIUS), around * standing], axis=1
    )
    return centre, radius


def access_point(person: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Where the way to a person ends: in front of the seat, or at the person who stands.

    Args:
        person: [..., 2].
        table: table of the person or -1, [...].

    Returns:
        Points [..., 2].
    """
    out = person - plan.TABLES[table]
    front = plan.TABLES[table] + out / np.hypot(out[..., 0], out[..., 1])[..., None] * (
        plan.CLUSTER_RADIUS + 0.03
    )
    return np.where((table >= 0)[..., None], front, person)


def _start_fits(
    tries: np.ndarray,
    person: np.ndarray,
    table: np.ndarray,
    centre: np.ndarray,
    radius: np.ndarray,
) -> np.ndarray:
    """Whether a start lies free, inside the room, and near enough on its way; [n, K] bool."""
    inside = (np.abs(tries) < plan.ROOM - plan.ROBOT_RADIUS - plan.CLEARANCE).all(axis=-1)
    rel_x = centre[:, None, :, 0] - tries[:, :, 0, None]
    rel_y = centre[:, None, :, 1] - tries[:, :, 1, None]
    square = rel_x**2 + rel_y**2
    wide = radius[:, None]
    free = (square > wide**2).all(axis=-1)
    goal = access_point(person, table)
    way = goal[:, None] - tries
    length = np.sqrt(way[..., 0] ** 2 + way[..., 1] ** 2)
    unit = way / length[..., None]
    along = rel_x * unit[..., 0, None] + rel_y * unit[..., 1, None]
    across = rel_x * unit[..., 1, None] - rel_y * unit[..., 0, None]
    ahead = (along > 0) & (along < length[..., None])
    depth = np.where(ahead, np.maximum(wide - np.abs(across), 0.0), 0.0)
    last_leg = np.sqrt(((goal - person) ** 2).sum(axis=1))[:, None]
    # going round a disc whose chord is entered to depth h costs about h at these sizes
    detour = 1.2 * depth.sum(axis=-1)
    fits = (length + last_leg + detour < _LONGEST_WAY) & ((depth > 0).sum(axis=-1) <= 2)
    return inside & free & fits & (detour <= _LONGEST_DETOUR)
