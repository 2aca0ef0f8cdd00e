"""What both environments share: settings, where services come from, facts of finished ones."""

from __future__ import annotations

import functools
import hashlib
import zlib
from dataclasses import dataclass, field, fields, replace
from numbers import Integral, Real
from typing import Any

import numpy as np

from evenhand.core.errors import InputError, unknown
from evenhand.methods.paper.issues import PAPER_ISSUES
from evenhand.restaurant import floor_plan, people, worlds
from evenhand.restaurant.scenarios import needs, sensing, tips
from evenhand.restaurant.simulation import kernels, layout, task
from evenhand.restaurant.simulation.lanes import Beginning, Lanes
from evenhand.restaurant.simulation.physics import Rows
from evenhand.restaurant.worlds import World

BLOCK = 64
"""Set-ups that a lane draws at a time from its own generator."""


@dataclass(frozen=True)
class RestaurantSettings:
    """What can be set of the environments: a scenario, and what differs from it.

    What is not given is that of the scenario. ``prejudice`` of a world is about robots that are
    imitated before training, and changes nothing in an environment.

    Attributes:
        population: where people are drawn from, one of ``people.POPULATIONS``.
        interval: physics steps of 0.02 s from one decision to the next.
        noise: standard deviation of a distance reading, metres.
        dropout: probability that a reading fails, the same for every person.
        perception: 0 to 1, how much sensing depends on the person, see ``sensing``.
        needs: 0 to 1, how much some people need another service, see ``needs``.
        tips: 0 to 1, how much less the reward is for some people, see ``tips``.
        scenario: the name of one, or of several joined by a plus, or a ``World``.
        world: where people are served, which follows from all of these.
    """

    population: str | people.Population | None = None
    interval: int | None = None
    noise: float | None = None
    dropout: float | None = None
    perception: float | None = None
    needs: float | None = None
    tips: float | None = None
    scenario: str | World = field(default="even", kw_only=True)
    world: World = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        given = {name: v for name in _REPLACING if (v := getattr(self, name)) is not None}
        for name, value in given.items():
            if name == "population":
                if not isinstance(value, str | people.Population):
                    raise unknown("population", str(value), people.POPULATIONS)
                continue
            kind, words = (Integral, "whole number") if name == "interval" else (Real, "number")
            if not isinstance(value, kind) or isinstance(value, bool):
                raise InputError(f"type {name}", f"{name} is {value!r}: give a {words}")
        if not isinstance(self.scenario, str | World):
            raise InputError(
                "type scenario", f"scenario is {self.scenario!r}: give the name of one, or a World"
            )
        chosen = worlds.scenario(self.scenario) if isinstance(self.scenario, str) else self.scenario
        if chosen.facts:
            names = ", ".join(fact.name for fact in chosen.facts)
            raise InputError(
                "unsupported facts",
                f"scenario {chosen.name!r} has facts of its own ({names}), which are computed when "
                "many services have ended: train there with evenhand.train, or make a World "
                "without them",
            )
        if chosen.party > 1:
            raise InputError(
                "unsupported party",
                f"scenario {chosen.name!r} serves parties of {chosen.party} who share their time, "
                "and an episode is one service: train there with evenhand.train, or make a World "
                "with party=1",
            )
        # an environment needs no more of it, and can be pickled whatever the rest holds
        world = replace(chosen, issues=PAPER_ISSUES, reference=None, **given)
        object.__setattr__(self, "world", world)
        for name in _REPLACING:
            object.__setattr__(self, name, getattr(world, name))

    def plain(self) -> dict[str, Any]:
        """By name, as plain text, numbers and lists."""
        world, out = self.world, {"scenario": self.world.name}
        for one in fields(World):
            if one.compare and one.name not in ("issues", "facts"):
                out[one.name] = worlds.plain(getattr(world, one.name))
        if isinstance(world.population, people.Population):
            shares = hashlib.sha256(repr(world.population).encode()).hexdigest()
            out["population"] += f" ({shares[:16]})"
        return out


_REPLACING = tuple(
    one.name for one in fields(RestaurantSettings) if one.init and one.name != "scenario"
)


@dataclass(frozen=True)
class Block:
    """Services that were drawn at a time.

    Attributes:
        origin: state of the generator before they were drawn.
        setups: who is where, ``BLOCK`` of them.
        beginning: of the services.
    """

    origin: dict[str, Any]
    setups: layout.Setups
    beginning: Beginning

    def checksum(self) -> int:
        """A number that differs when anything was drawn differently."""
        begun = self.beginning
        parts = [
            *vars(self.setups).values(),
            begun.noise,
            *(begun.perceived[name] for name in ("reading", "stretch")),
            *(begun.rows.truth[name] for name in ("room", "reach", "signal")),
        ]
        return functools.reduce(lambda so_far, part: zlib.crc32(part.tobytes(), so_far), parts, 0)


class Source:
    """Services of each lane, drawn a block at a time from a generator of its own.

    Attributes:
        lanes: where they are served.
    """

    def __init__(self, lanes: Lanes, world: World) -> None:
        self._world = world
        self._readings = world.task.decisions + 1
        self._elapsed = world.interval * floor_plan.TIMESTEP
        self.lanes = lanes
        self._blocks: list[Block | None] = [None] * lanes.n
        self._store: Beginning | None = None
        self._asking = np.zeros((lanes.n * BLOCK, len(world.identities)), np.int64)
        self._next = [BLOCK] * lanes.n

    def forget(self, lane: int) -> None:
        """Drop what was drawn for a lane, which has been given a new seed."""
        self._next[lane] = BLOCK

    def begin(self, ids: np.ndarray, rngs: list[np.random.Generator]) -> np.ndarray:
        """Begin the next service of each of these lanes; returns who asks in it, int64 [k, D]."""
        at = np.empty(len(ids), np.int64)
        for row, lane in enumerate(ids.tolist()):
            if self._next[lane] == BLOCK:
                self._keep(lane, self.draw(rngs[lane]))
                self._next[lane] = 0
            at[row] = lane * BLOCK + self._next[lane]
            self._next[lane] += 1
        assert self._store is not None
        self.lanes.begin(ids, self._store, at)
        return self._asking[at]

    def current(self, lane: int) -> tuple[layout.Setups, int]:
        """Set-ups drawn for a lane, and which of them is being served."""
        return self.block(lane).setups, self._next[lane] - 1

    def known(self, lane: int) -> Block | None:
        """What was drawn last for a lane, None before its first service."""
        return self._blocks[lane]

    def block(self, lane: int) -> Block:
        """The same for a lane in which a service has begun."""
        block = self._blocks[lane]
        assert block is not None
        return block

    def draw(self, rng: np.random.Generator) -> Block:
        """Draw a block."""
        origin = dict(rng.bit_generator.state)
        world = self._world
        setups = layout.draw(world.people, BLOCK, rng, world.hidden)
        missed = world.also_missed(setups.codes)
        chances = sensing.draw(
            world.sensor, setups.asking, self._readings, self._elapsed, rng, missed
        )
        wanted = needs.draw(world.need, setups.asking, rng)
        return Block(origin, setups, self.lanes.prepare(setups, chances, wanted))

    def resume(self, blocks: list[Block], rows: np.ndarray) -> None:
        """Begin one certain service in every lane.

        Args:
            blocks: of each lane.
            rows: which service of the block, int [n].
        """
        for lane, block in enumerate(blocks):
            if block is not self._blocks[lane]:
                self._keep(lane, block)
        assert self._store is not None
        ids = np.arange(self.lanes.n)
        self.lanes.begin(ids, self._store, ids * BLOCK + rows)
        self._next = (rows + 1).tolist()

    def finished(self, ids: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Facts and rewards of the services of these lanes, which have ended.

        Returns:
            ``FACTS`` [n] and float64 [n]; 0 in the other lanes.
        """
        lanes, paid = self.lanes, self._world.tips
        # much faster than zeros of a structured type
        facts = np.zeros((lanes.n, FACTS.itemsize // 8)).view(FACTS)[:, 0]
        reward = np.zeros(lanes.n)
        truth, most = lanes.physics.truth, floor_plan.MAX_STEPS
        kernels.finish(ids, truth, lanes.perceived, facts, reward, most)
        if paid:
            done = facts[ids]
            terms = np.stack([done[f"reward_{name}"] for name in task.REWARD_TERMS], axis=1)
            codes = self._asking[ids * BLOCK + np.array(self._next)[ids] - 1]
            reward[ids] = tips.reward(paid, self._world.known(codes), terms, done["steps"])
        return facts, reward

    def _keep(self, lane: int, block: Block) -> None:
        begun = block.beginning
        every = self.lanes.n * BLOCK
        if self._store is None:
            self._store = Beginning(
                Rows(*(_room(part, every) for part in vars(begun.rows).values())),
                _room(begun.perceived, every),
                _room(begun.noise, every),
            )
        store, rows = self._store, slice(lane * BLOCK, (lane + 1) * BLOCK)
        for name, values in vars(begun.rows).items():
            getattr(store.rows, name)[rows] = values
        store.perceived[rows], store.noise[rows] = begun.perceived, begun.noise
        self._asking[rows] = block.setups.codes
        parts = Rows(*(part[rows] for part in vars(store.rows).values()))
        kept = Beginning(parts, store.perceived[rows], store.noise[rows])
        self._blocks[lane] = replace(block, beginning=kept)


def _room(block: np.ndarray, n: int) -> np.ndarray:
    """Room for n rows like those of a block."""
    return np.empty((n, *block.shape[1:]), block.dtype)


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


def lanes_of(world: World, n: int, threads: int = 1) -> Lanes:
    """Lanes, n of them, for services of a world."""
    return Lanes(n, world.task, threads, len(world.groups))


def settings_from(given: dict[str, Any]) -> RestaurantSettings:
    """Settings from keyword arguments; an unknown name offers the nearest."""
    known = [f.name for f in fields(RestaurantSettings) if f.init]
    for name in given:
        if name not in known:
            raise unknown("setting", name, known)
    return RestaurantSettings(**given)
