"""Services in progress: one lane a simulation. What the environments and the trainer share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.restaurant import layout, plan, senses, task
from evenhand.restaurant.world import Rows, World


@dataclass(frozen=True)
class Facts:
    """True facts of N finished services, one entry each.

    Attributes:
        responded: bool.
        steps: physics steps until the end, int64.
        distance: true distance at the end, metres.
        min_distance: least true distance at any step, metres.
        start_distance: when the service began, metres.
        path_length: driven, metres.
        contact_steps: physics steps in contact with anything, int64.
        sensed_error: what the robot took for the distance at the end, minus the truth, metres.
    """

    responded: np.ndarray
    steps: np.ndarray
    distance: np.ndarray
    min_distance: np.ndarray
    start_distance: np.ndarray
    path_length: np.ndarray
    contact_steps: np.ndarray
    sensed_error: np.ndarray

    @property
    def perfect(self) -> np.ndarray:
        """Services with a response in time and in place, and never too close; bool [N]."""
        placed = (self.distance >= 1.0) & (self.distance <= 1.5)
        return self.responded & placed & (self.steps <= 200) & (self.min_distance >= 0.5)

    @property
    def terms(self) -> dict[str, np.ndarray]:
        """Service quality by name, see ``task.reward_terms``; each [N]."""
        return task.reward_terms(self.responded, self.steps, self.distance, self.min_distance)

    @property
    def reward(self) -> np.ndarray:
        """Service quality: the sum of the terms, in [-0.5, 1], [N]."""
        return sum(self.terms.values(), start=np.zeros(len(self.steps)))


@dataclass(frozen=True)
class Beginning:
    """N services before they begin, first axis N.

    Attributes:
        rows: for the simulations.
        one_hot: identities of the person who asks, float32 [N, 22].
        noise: of every reading, metres, [N, K].
        fails: whether a reading fails, bool [N, K].
    """

    rows: Rows
    one_hot: np.ndarray
    noise: np.ndarray
    fails: np.ndarray

    def take(self, at: Any) -> Beginning:
        """Some of them, by index, mask or slice of the first axis or axes."""
        rows = Rows(**{name: values[at] for name, values in vars(self.rows).items()})
        return Beginning(rows, self.one_hot[at], self.noise[at], self.fails[at])


class Lanes:
    """n lanes; each serves one person at a time.

    Attributes:
        world: the simulations.
        reading: distance as last sensed, metres, [n].
        age: of that reading, seconds, [n].
    """

    def __init__(self, n: int, settings: task.TaskSettings) -> None:
        self.n = n
        self.settings = settings
        self.world = World(n)
        self.reading = np.zeros(n)
        self.age = np.zeros(n)
        self._all = np.arange(n)
        self._one_hot = np.zeros((n, task.N_GROUPS), np.float32)
        self._start = np.zeros(n)
        self._responded = np.zeros(n, bool)
        self._noise = np.zeros((n, settings.decisions + 1))
        self._fails = np.zeros((n, settings.decisions + 1), bool)

    def prepare(self, setups: layout.Setups, chances: senses.Chances) -> Beginning:
        """What begins N services, ready to be copied into lanes; see ``begin``."""
        return Beginning(self.world.prepare(setups), setups.one_hot, chances.noise, chances.fails)

    def begin(self, ids: np.ndarray, services: Beginning) -> None:
        """Begin a service in each of these lanes.

        The first reading is of a robot at rest: the sensor's age of one step makes no difference.

        Args:
            ids: lanes, sorted, int [k].
            services: k of them, with ``settings.decisions + 1`` readings each.
        """
        self.world.place(ids, services.rows)
        self._one_hot[ids] = services.one_hot
        self._start[ids] = services.rows.distance
        self._responded[ids] = False
        self._noise[ids], self._fails[ids] = services.noise, services.fails
        self.reading[ids] = np.maximum(services.rows.distance + services.noise[:, 0], 0.0)
        self.age[ids] = 0.0

    def observe(self, ids: np.ndarray | slice) -> np.ndarray:
        """What the robot goes by in these lanes, float32 [k, 25]."""
        return task.observe(
            self._one_hot[ids], self.reading[ids], self.world.timer(ids), self.age[ids]
        )

    def respond(self, ids: np.ndarray) -> None:
        """End the services of these lanes with a response."""
        self._responded[ids] = True

    def walk(self, ids: np.ndarray) -> np.ndarray:
        """Drive until the next decision.

        Args:
            ids: lanes that walk, sorted, int [k].

        Returns:
            Which of them have run out of time, bool [k].
        """
        everyone = len(ids) == self.n
        self.world.walk(None if everyone else ids, self.settings.interval)
        self._read(slice(None) if everyone else ids)
        return self.world.steps[ids] >= plan.MAX_STEPS

    def facts(self, ids: np.ndarray) -> Facts:
        """Facts of the services of these lanes, which have ended."""
        world = self.world
        return Facts(
            responded=self._responded[ids],
            steps=world.steps[ids].astype(np.int64),
            distance=world.distance[ids],
            min_distance=world.min_distance[ids],
            start_distance=self._start[ids],
            path_length=world.path_length[ids],
            contact_steps=world.contact_steps[ids].astype(np.int64),
            sensed_error=self.reading[ids] - world.distance[ids],
        )

    def _read(self, ids: np.ndarray | slice) -> None:
        k = self.world.steps[ids].astype(np.int64) // self.settings.interval
        rows = self._all[ids]
        self.reading[ids], self.age[ids] = senses.read(
            self.world.sensed(ids),
            self._noise[rows, k],
            self._fails[rows, k],
            self.reading[ids],
            self.age[ids],
            self.settings.interval * plan.TIMESTEP,
        )
