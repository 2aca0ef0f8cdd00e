"""Services in progress: one lane a simulation. What the environments and the trainer share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evenhand.restaurant import floor_plan
from evenhand.restaurant.scenarios import needs, sensing
from evenhand.restaurant.simulation import driving, kernels, layout, task
from evenhand.restaurant.simulation.physics import Physics, Rows


def perceived_type(groups: int) -> np.dtype:
    """One service as the robot knows it.

    ``one_hot``: identities of the person who asks, over so many groups; ``reading``: distance as
    last sensed, metres; ``age``: of that reading, seconds; ``steps``: physics steps since the
    service began, by the timer; ``stretch``: what its sensor makes of a distance of 1, which it
    does not know.
    """
    return np.dtype(
        [
            ("one_hot", np.float32, groups),
            ("reading", float),
            ("age", float),
            ("steps", np.int64),
            ("stretch", float),
        ],
        align=True,
    )


PERCEIVED = perceived_type(task.N_GROUPS)


@dataclass(frozen=True)
class Facts:
    """True facts of N finished services, one entry each.

    Attributes:
        responded: bool; a response that was not noticed is none.
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

    def __contains__(self, name: str) -> bool:
        return name in self.__dataclass_fields__ or name in _OF_RESPONSES

    def fact(self, name: str) -> np.ndarray:
        """A fact as rules read it, float64 [N], NaN where a service lacks it; see ``columns``."""
        if name in _OF_RESPONSES:
            return np.where(self.responded, getattr(self, _OF_RESPONSES[name]), np.nan)
        return getattr(self, name).astype(float)

    @cached_property
    def _quality(self) -> tuple[np.ndarray, np.ndarray]:
        return task.quality(self.responded, self.steps, self.distance, self.min_distance)

    @property
    def perfect(self) -> np.ndarray:
        """Services with a response in time and in place, and never too close; bool [N]."""
        return self._quality[1]

    @property
    def terms(self) -> np.ndarray:
        """Service quality by ``task.REWARD_TERMS``, see ``task.quality``; [N, 4]."""
        return self._quality[0]

    @property
    def reward(self) -> np.ndarray:
        """Service quality: the sum of the terms, in [-0.5, 1], [N]."""
        return self.terms.sum(axis=1)


_OF_RESPONSES = {"response_step": "steps", "response_distance": "distance"}
"""Facts that only a service with a response has."""


@dataclass(frozen=True)
class Beginning:
    """N services before they begin, first axis N.

    Attributes:
        rows: for the simulations.
        perceived: ``PERCEIVED``, [N].
        noise: of every reading, metres, NaN for one that fails, [N, K].
    """

    rows: Rows
    perceived: np.ndarray
    noise: np.ndarray


class Lanes:
    """n lanes; each serves one person at a time.

    Attributes:
        physics: the simulations.
        perceived: what the robots know, ``PERCEIVED``, [n].
    """

    def __init__(
        self,
        n: int,
        settings: task.TaskSettings,
        threads: int = 1,
        groups: int = task.N_GROUPS,
    ) -> None:
        self.n = n
        self.settings = settings
        self.physics = Physics(n, threads)
        self.perceived = np.zeros(n, perceived_type(groups))
        self._all = np.arange(n)
        self._noise = np.zeros((n, settings.decisions + 1))

    def prepare(
        self, setups: layout.Setups, chances: sensing.Chances, wanted: needs.Needs | None = None
    ) -> Beginning:
        """What begins N services, ready to be copied into lanes; see ``begin``."""
        perceived = np.zeros(len(setups), self.perceived.dtype)
        perceived["one_hot"] = setups.one_hot
        # of a robot at rest, so that the sensor's age of one step makes no difference
        seen = setups.start_distance * chances.stretch + chances.noise[:, 0]
        perceived["reading"] = np.maximum(seen, 0.0)
        perceived["stretch"] = chances.stretch
        noise = np.where(chances.fails, np.nan, chances.noise)
        return Beginning(self.physics.prepare(setups, wanted), perceived, noise)

    def begin(self, ids: np.ndarray, services: Beginning, at: np.ndarray) -> None:
        """Begin a service in each of these lanes.

        Args:
            ids: lanes, sorted, int [k].
            services: with ``settings.decisions + 1`` readings each.
            at: which of the services, int [k].
        """
        self.physics.place(ids, services.rows, at)
        kernels.meet(ids, at, (services.perceived, services.noise), self.perceived, self._noise)

    def skip(self, ids: np.ndarray, before: np.ndarray) -> None:
        """Begin services so late: people of a party asked when its first service began.

        Args:
            ids: lanes, int [k].
            before: physics steps at which the service before ended, [k].
        """
        most, interval = floor_plan.MAX_STEPS, self.settings.interval
        for lane, steps in zip(ids.tolist(), before.tolist(), strict=True):
            used = driving.spent(steps, most, interval)
            self.physics.truth["steps"][lane] = self.perceived["steps"][lane] = used
            self.physics.simulation[lane, self.physics.time] = used * floor_plan.TIMESTEP

    def observe(self, ids: np.ndarray | None = None) -> np.ndarray:
        """What the robot goes by in these lanes, or in all, float32 [k, 25]."""
        known = self.perceived
        return task.observe(
            self._all if ids is None else ids,
            known["one_hot"],
            known["reading"],
            known["steps"],
            known["age"],
        )

    def respond(self, ids: np.ndarray) -> None:
        """End the services of these lanes with a response, which may go unnoticed (``needs``)."""
        driving.answer(ids, self.physics.truth)

    def walk(self, ids: np.ndarray) -> np.ndarray:
        """Drive until the next decision.

        Args:
            ids: lanes that walk, sorted, int [k].

        Returns:
            Which of them have run out of time, bool [k].
        """
        world, interval = self.physics, self.settings.interval
        world.walk(None if len(ids) == self.n else ids, interval)
        return driving.read(
            ids,
            world.sensed,
            world.clock,
            self._noise,
            self.perceived,
            floor_plan.TIMESTEP,
            interval,
            floor_plan.MAX_STEPS,
        )

    def facts(self, ids: np.ndarray) -> Facts:
        """Facts of the services of these lanes, which have ended."""
        return facts_of(self.physics.truth[ids], self.perceived[ids])


def facts_of(truth: np.ndarray, perceived: np.ndarray) -> Facts:
    """Facts of N services that have ended.

    Args:
        truth: ``physics.TRUTH``, [N].
        perceived: ``PERCEIVED``, [N].
    """
    return Facts(
        responded=truth["responded"],
        steps=truth["steps"],
        distance=truth["distance"],
        min_distance=truth["min_distance"],
        start_distance=truth["start_distance"],
        path_length=truth["path_length"],
        contact_steps=truth["contact_steps"],
        sensed_error=perceived["reading"] - truth["distance"],
    )
