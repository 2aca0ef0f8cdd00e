"""What both environments share: settings, where services come from, facts of finished ones."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import gymnasium as gym
import numpy as np

from evenhand import people
from evenhand.errors import unknown
from evenhand.restaurant import layout, senses, task
from evenhand.restaurant.lanes import Beginning, Lanes

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
    """

    population: str = "uniform"
    interval: int = 5
    noise: float = senses.SenseSettings.noise
    dropout: float = senses.SenseSettings.dropout

    def __post_init__(self) -> None:
        people.population(self.population)
        task.TaskSettings(self.interval)
        senses.SenseSettings(self.noise, self.dropout)


class Source:
    """Services of each lane, drawn a block at a time from a generator of its own."""

    def __init__(self, lanes: Lanes, settings: RestaurantSettings) -> None:
        self._population = people.population(settings.population)
        self._sense = senses.SenseSettings(settings.noise, settings.dropout)
        self._readings = task.TaskSettings(settings.interval).decisions + 1
        self._lanes = lanes
        self._drawn: list[layout.Setups | None] = [None] * lanes.n
        self._store: Beginning | None = None
        self._asking = np.zeros((lanes.n, _BLOCK, len(people.IDENTITIES)), np.int64)
        self._next = np.full(lanes.n, _BLOCK)

    def forget(self, lane: int) -> None:
        """Drop what was drawn for a lane, which has been given a new seed."""
        self._next[lane] = _BLOCK

    def take(
        self, ids: np.ndarray, rngs: list[np.random.Generator]
    ) -> tuple[Beginning, np.ndarray]:
        """The next service of each of these lanes, and who asks in it, int64 [k, 5]."""
        for lane in ids[self._next[ids] == _BLOCK]:
            self._draw(lane, rngs[lane])
        at = ids, self._next[ids]
        self._next[ids] += 1
        assert self._store is not None
        return self._store.take(at), self._asking[at]

    def current(self, lane: int) -> tuple[layout.Setups, int]:
        """Set-ups drawn for a lane, and which of them is being served."""
        drawn = self._drawn[lane]
        assert drawn is not None
        return drawn, int(self._next[lane]) - 1

    def _draw(self, lane: int, rng: np.random.Generator) -> None:
        setups = layout.draw(self._population, _BLOCK, rng)
        chances = senses.draw(self._sense, _BLOCK, self._readings, rng)
        block = self._lanes.prepare(setups, chances)
        if self._store is None:
            index = np.zeros((self._lanes.n, _BLOCK), np.int64)  # room for a block of every lane
            self._store = block.take(index)
        for name, values in vars(block.rows).items():
            getattr(self._store.rows, name)[lane] = values
        for name in ("one_hot", "noise", "fails"):
            getattr(self._store, name)[lane] = getattr(block, name)
        self._asking[lane] = setups.asking
        self._drawn[lane] = setups
        self._next[lane] = 0


def observation_space() -> gym.spaces.Box:
    """What one lane observes, see ``RestaurantEnv``."""
    high = np.ones(task.OBSERVATION_SIZE, np.float32)
    high[task.N_GROUPS] = task.DISTANCE_LIMIT
    return gym.spaces.Box(np.zeros_like(high), high, dtype=np.float32)


def finished(lanes: Lanes, ids: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Facts and named reward terms of finished services, and the rewards, each [k]."""
    facts = lanes.facts(ids)
    terms = facts.terms
    out = {
        "responded": facts.responded,
        "response_step": np.where(facts.responded, facts.steps, np.nan),
        "response_distance": np.where(facts.responded, facts.distance, np.nan),
        "min_distance": facts.min_distance,
        "steps": facts.steps,
        "start_distance": facts.start_distance,
        "path_length": facts.path_length,
        "contact_steps": facts.contact_steps,
        "sensed_error": facts.sensed_error,
        "perfect": facts.perfect,
    }
    out |= {f"reward_{name}": terms[name] for name in task.REWARD_TERMS}
    return out, sum(terms.values(), start=np.zeros(len(ids)))


def settings_from(given: dict[str, Any]) -> RestaurantSettings:
    """Settings from keyword arguments; an unknown name offers the nearest."""
    known = [f.name for f in fields(RestaurantSettings)]
    for name in given:
        if name not in known:
            raise unknown("setting", name, known)
    return RestaurantSettings(**given)
