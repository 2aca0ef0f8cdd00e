"""One service after another without end, one physics step at a time.

The physics is a plain loop of MuJoCo with the commands, readings and chances of
``simulation.serve``, so the facts are those of the same services served many at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from evenhand.core.errors import InputError
from evenhand.methods.scheme import Scheme
from evenhand.restaurant import floor_plan, people, robots, worlds
from evenhand.restaurant.scheme import SCHEME
from evenhand.restaurant.serve_people import draw, engine
from evenhand.restaurant.simulation import driving, serve
from evenhand.restaurant.simulation.lanes import Facts
from evenhand.restaurant.simulation.physics import simulation_of
from evenhand.restaurant.worlds import AnyRobot, World

BATCH = 30
"""Services drawn at once, as many as ``evenhand evaluate --services 30`` draws."""
_STEERED = 5
"""Physics steps between two commands of the drive, as in ``simulation.physics``."""
_ONE = np.zeros(1, np.int64)
"""The only lane there is."""


@dataclass(frozen=True)
class Cast:
    """Who serves whom, and where.

    Attributes:
        name: of the robot, as it is shown.
        world: where it serves.
        robot: who serves.
    """

    name: str
    world: World
    robot: AnyRobot


def scripted(name: str, strength: float, scenario: str) -> Cast:
    """A scripted robot in a scenario.

    Args:
        name: one of ``robots.NAMES``.
        strength: of its bias, 0 to 1.
        scenario: see ``worlds.scenario``.

    Raises:
        InputError: for an unknown robot or scenario, a strength out of range, or scenarios that
            contradict each other.
    """
    shown = name if name == "even" else f"{name}, strength {strength:g}"
    return Cast(shown, worlds.scenario(scenario), robots.ScriptedRobot(name, strength))


@dataclass(frozen=True)
class Service:
    """A service that can begin.

    Attributes:
        number: from 1.
        drawn: the services that were drawn with it.
        row: which of them it is.
        robot: who serves them.
    """

    number: int
    drawn: serve.Drawn
    row: int
    robot: serve.Robot

    @property
    def codes(self) -> np.ndarray:
        """Identities of the person who asks, those of the world, int64 [D]."""
        return self.drawn.setups.codes[self.row]


@dataclass(frozen=True)
class Outcome:
    """How a service ended.

    Attributes:
        number: of the service, from 1.
        codes: identities of the person, int64 [D].
        facts: of this one service.
        issues: 1 (issue), 0 (none), a severity between them, NaN (does not apply), [K].
    """

    number: int
    codes: np.ndarray
    facts: Facts
    issues: np.ndarray


@dataclass(frozen=True)
class Tally:
    """What has been counted so far; one entry for each of the G groups, and last for everybody.

    Attributes:
        services: int64 [G + 1].
        applies: services to which an issue applies, int64 [G + 1, K].
        found: those of them that have it, or have half its severity or more, int64 [G + 1, K].
    """

    services: np.ndarray
    applies: np.ndarray
    found: np.ndarray

    @classmethod
    def empty(cls, scheme: Scheme = SCHEME) -> Tally:
        """Nothing counted yet."""
        rows, kinds = len(scheme.groups) + 1, len(scheme.issues)
        return cls(*(np.zeros(shape, np.int64) for shape in (rows, (rows, kinds), (rows, kinds))))

    def plus(self, outcome: Outcome, scheme: Scheme = SCHEME) -> Tally:
        """With one more service."""
        encoded = people.encode(outcome.codes[None], scheme.identities)
        inside = np.append(encoded[0] > 0.5, True)
        return Tally(
            self.services + inside,
            self.applies + np.outer(inside, ~np.isnan(outcome.issues)),
            self.found + np.outer(inside, outcome.issues >= 0.5),
        )


@dataclass(frozen=True)
class Moment:
    """A service as it stands.

    Attributes:
        number: of the service, from 1.
        codes: identities of the person who asks, int64 [D].
        steps: physics steps since it began.
        distance: true distance of robot and person, metres.
        least: least true distance so far, metres.
        reading: distance as the robot last sensed it, metres.
        age: of that reading, seconds.
        chance: probability that the robot responded at its last decision.
        outcome: how it ended, None while it goes on.
        last: how the service before ended, None in the first.
        tally: of all that have ended.
    """

    number: int
    codes: np.ndarray
    steps: int
    distance: float
    least: float
    reading: float
    age: float
    chance: float
    outcome: Outcome | None
    last: Outcome | None
    tally: Tally


class Shift:
    """A robot at work.

    Attributes:
        cast: who serves whom.
        now: the service that is shown.
        coming: the next one.
        data: state of the simulation.
        outcome: how the present service ended, None while it goes on.
    """

    def __init__(self, cast: Cast, seed: int) -> None:
        """Begin the first service.

        Args:
            cast: who serves whom.
            seed: of people, places and chances; the first 30 services are those that
                ``experiments.measure`` serves with it when it is asked for 30.

        Raises:
            InputError: for a world of parties.
        """
        if cast.world.party > 1:
            raise InputError(
                "unsupported party",
                f"scenario {cast.world.name!r} serves parties who share their time, and one "
                "service at a time is shown here: choose another scenario, or film it",
            )
        self.cast = cast
        self._engine = engine(cast.world, 1)
        self._lanes = self._engine.one
        self._drawn = self._draw(np.random.default_rng(seed))
        self._tally, self._last = Tally.empty(cast.world.scheme), None
        self.now, self.coming = next(self._drawn), next(self._drawn)
        self._begin()

    def _draw(self, rng: np.random.Generator) -> Iterator[Service]:
        cast, number = self.cast, 0
        while True:
            drawn, robot, _ = draw(cast.world, BATCH, rng, self._engine, cast.robot)
            for row in range(BATCH):
                number += 1
                yield Service(number, drawn, row, robot)

    def _begin(self) -> None:
        drawn, row = self.now.drawn, self.now.row
        self._lanes.begin(_ONE, drawn.beginning, np.array([row]))
        self._model, self.data = simulation_of(drawn.setups, row)
        self.outcome: Outcome | None = None
        self._kept = serve.empty(drawn, recorded=False)
        self._decide()

    def proceed(self) -> None:
        """Begin the next service."""
        self._last = self.outcome
        self.now, self.coming = self.coming, next(self._drawn)
        self._begin()

    def restart(self) -> None:
        """Begin the present service again, unless it has ended: what was counted stays counted."""
        if self.outcome is None:
            self._begin()

    def step(self) -> None:
        """One physics step, and the robot's decision if one is due then; nothing after the end."""
        if self.outcome is not None:
            return
        data, truth, interval = self.data, self._lanes.physics.truth, self.cast.world.interval
        if self._steps % interval % _STEERED == 0:
            driving.follow(
                _ONE,
                data.qpos[None],
                truth,
                data.ctrl[None],
                floor_plan.TOP_SPEED,
                floor_plan.MAX_ACCELERATION,
            )
        mujoco.mj_step(self._model, data)
        driving.track(_ONE, data.qpos[None, None], np.array([[data.ncon]]), truth)
        if self._steps % interval == 0:
            over = driving.read(
                _ONE,
                data.sensordata[None, :2],
                data.sensordata[3:4],
                self.now.drawn.beginning.noise[self.now.row][None],
                self._lanes.perceived,
                floor_plan.TIMESTEP,
                interval,
                floor_plan.MAX_STEPS,
            )
            if over[0]:
                self._end()
            else:
                self._decide()

    @property
    def _steps(self) -> int:
        return int(self._lanes.physics.truth["steps"][0])

    def _decide(self) -> None:
        known = self._lanes.observe()
        self._chance = float(self.now.robot(known, np.array([self.now.row]))[0])
        row, decision = self.now.row, self._steps // self.cast.world.interval
        responds = self.now.drawn.uniform[row, decision] < self._chance
        self._kept.observation[row, decision] = known[0]
        self._kept.action[row, decision] = responds
        self._kept.mask[row, decision] = 1.0
        if responds:
            self._lanes.respond(_ONE)
            self._end()

    def _end(self) -> None:
        facts, codes, world = self._lanes.facts(_ONE), self.now.codes, self.cast.world
        kept = (part[self.now.row][None] for part in self._kept[:3])
        found = world.indicators(serve.Trajectories(facts, codes[None], *kept))[0]
        self.outcome = Outcome(self.now.number, codes, facts, found)
        self._tally = self._tally.plus(self.outcome, world.scheme)

    @property
    def moment(self) -> Moment:
        """What can be told of the service as it stands."""
        truth, known = self._lanes.physics.truth[0], self._lanes.perceived[0]
        return Moment(
            number=self.now.number,
            codes=self.now.codes,
            steps=self._steps,
            distance=float(truth["distance"]),
            least=float(truth["min_distance"]),
            reading=float(known["reading"]),
            age=float(known["age"]),
            chance=self._chance,
            outcome=self.outcome,
            last=self._last,
            tally=self._tally,
        )
