"""What both environments share: settings, where services come from, facts of finished ones."""

from __future__ import annotations

from dataclasses import dataclass, fields
from numbers import Integral, Real
from typing import Any

import gymnasium as gym
import numpy as np

from evenhand.core.errors import InputError, unknown
from evenhand.restaurant import floor_plan, people
from evenhand.restaurant.scenarios import needs, sensing
from evenhand.restaurant.simulation import kernels, layout, task
from evenhand.restaurant.simulation.lanes import Beginning, Lanes
from evenhand.restaurant.simulation.world import Rows

_BLOCK = 64
"""Set-ups that a lane draws at a time from its own generator."""


@dataclass(frozen=True)
class RestaurantSettings:
    """What can be set of the environments.

    Attributes:
        population: where people are drawn from, one of ``people.POPULATIONS``.
        interval: physics steps of 0.02 s from one decision to the next.
        noise: standard deviation of a distance reading, metres.
        dropout: probability that a reading fails, the same for every person.
        perception: 0 to 1, how much sensing depends on the person, see ``senses``.
        needs: 0 to 1, how much some people need another service, see ``needs``.
    """

    population: str = "uniform"
    interval: int = 5
    noise: float = sensing.SenseSettings.noise
    dropout: float = sensing.SenseSettings.dropout
    perception: float = 0.0
    needs: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.population, str):
            raise unknown("population", str(self.population), people.POPULATIONS)
        for name in ("interval", "noise", "dropout", "perception", "needs"):
            kind, words = (Integral, "whole number") if name == "interval" else (Real, "number")
            value = getattr(self, name)
            if not isinstance(value, kind) or isinstance(value, bool):
                raise InputError(f"{name} is {value!r}: give a {words}")
        people.population(self.population)
        task.TaskSettings(self.interval)
        sensing.SenseSettings(self.noise, self.dropout, self.perception)
        needs.NeedSettings(self.needs)


class Source:
    """Services of each lane, drawn a block at a time from a generator of its own."""

    def __init__(self, lanes: Lanes, settings: RestaurantSettings) -> None:
        self._population = people.population(settings.population)
        self._sense = sensing.SenseSettings(settings.noise, settings.dropout, settings.perception)
        self._needs = needs.NeedSettings(settings.needs)
        self._readings = task.TaskSettings(settings.interval).decisions + 1
        self._elapsed = settings.interval * floor_plan.TIMESTEP
        self._lanes = lanes
        self._drawn: list[layout.Setups | None] = [None] * lanes.n
        self._store: Beginning | None = None
        self._asking = np.zeros((lanes.n * _BLOCK, len(people.IDENTITIES)), np.int64)
        self._next = [_BLOCK] * lanes.n

    def forget(self, lane: int) -> None:
        """Drop what was drawn for a lane, which has been given a new seed."""
        self._next[lane] = _BLOCK

    def begin(self, ids: np.ndarray, rngs: list[np.random.Generator]) -> np.ndarray:
        """Begin the next service of each of these lanes; returns who asks in it, int64 [k, 5]."""
        at = np.empty(len(ids), np.int64)
        for row, lane in enumerate(ids.tolist()):
            if self._next[lane] == _BLOCK:
                self._draw(lane, rngs[lane])
            at[row] = lane * _BLOCK + self._next[lane]
            self._next[lane] += 1
        assert self._store is not None
        self._lanes.begin(ids, self._store, at)
        return self._asking[at]

    def current(self, lane: int) -> tuple[layout.Setups, int]:
        """Set-ups drawn for a lane, and which of them is being served."""
        drawn = self._drawn[lane]
        assert drawn is not None
        return drawn, self._next[lane] - 1

    def _draw(self, lane: int, rng: np.random.Generator) -> None:
        setups = layout.draw(self._population, _BLOCK, rng)
        chances = sensing.draw(self._sense, setups.asking, self._readings, self._elapsed, rng)
        wanted = needs.draw(self._needs, setups.asking, rng)
        block = self._lanes.prepare(setups, chances, wanted)
        every = self._lanes.n * _BLOCK
        if self._store is None:
            self._store = Beginning(
                Rows(*(_room(part, every) for part in vars(block.rows).values())),
                _room(block.perceived, every),
                _room(block.noise, every),
            )
        store, rows = self._store, slice(lane * _BLOCK, (lane + 1) * _BLOCK)
        for name, values in vars(block.rows).items():
            getattr(store.rows, name)[rows] = values
        store.perceived[rows], store.noise[rows] = block.perceived, block.noise
        self._asking[rows] = setups.asking
        self._drawn[lane] = setups
        self._next[lane] = 0


def _room(block: np.ndarray, n: int) -> np.ndarray:
    """Room for n rows like those of a block."""
    return np.empty((n, *block.shape[1:]), block.dtype)


def observation_space() -> gym.spaces.Box:
    """What one lane observes, see ``RestaurantEnv``."""
    high = np.ones(task.OBSERVATION_SIZE, np.float32)
    high[task.N_GROUPS] = task.DISTANCE_LIMIT
    return gym.spaces.Box(np.zeros_like(high), high, dtype=np.float32)


FACTS = np.dtype(
    [
        ("responded", bool),
        ("response_step", float),
        ("response_distance", float),
        ("min_distance", float),
        ("steps", np.int64),
        ("start_distance", float),
        ("path_length", float),
        ("contact_steps", np.int64),
        ("sensed_error", float),
        ("perfect", bool),
        *((f"reward_{name}", float) for name in task.REWARD_TERMS),
    ],
    align=True,
)
"""Facts of a finished service and its reward terms, as ``info`` carries them."""
FACT_NAMES = FACTS.names or ()


def finished(lanes: Lanes, ids: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Facts and rewards of the services of these lanes, which have ended.

    Returns:
        ``FACTS`` [n] and float64 [n]; 0 in the other lanes.
    """
    # much faster than zeros of a structured type
    facts = np.zeros((lanes.n, FACTS.itemsize // 8)).view(FACTS)[:, 0]
    reward = np.zeros(lanes.n)
    kernels.finish(ids, lanes.world.truth, lanes.perceived, facts, reward, floor_plan.MAX_STEPS)
    return facts, reward


def settings_from(given: dict[str, Any]) -> RestaurantSettings:
    """Settings from keyword arguments; an unknown name offers the nearest."""
    known = [f.name for f in fields(RestaurantSettings)]
    for name in given:
        if name not in known:
            raise unknown("setting", name, known)
    return RestaurantSettings(**given)
