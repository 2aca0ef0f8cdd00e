"""Worlds: who is served, how they are sensed, what they need, and what can go wrong.

A world is made once, from the name of a scenario (``scenario``) or by a user. The scenarios of
Evenhand are registered here as any other scenario is (``register_scenario``); this registry is the
only list of them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from evenhand.core import plugins
from evenhand.core.errors import InputError, unknown, whole
from evenhand.methods.paper.issues import PAPER_ISSUES, Issue
from evenhand.methods.scheme import Fact, Scheme, paper_facts
from evenhand.methods.vocabulary import Identity
from evenhand.restaurant import people, robots
from evenhand.restaurant.people import IDENTITIES, Population
from evenhand.restaurant.scenarios import tips
from evenhand.restaurant.scenarios.needs import NeedSettings
from evenhand.restaurant.scenarios.sensing import WHAT_IF_SKIN, SenseSettings
from evenhand.restaurant.simulation import serve
from evenhand.restaurant.simulation.task import TaskSettings, observation_size

GROUP = "evenhand.scenarios"
"""Entry point by which packages bring scenarios."""
HOUSE_FACTS = (
    *paper_facts(),
    Fact("steps", int, least=0),
    Fact("start_distance", float, least=0.0),
    Fact("path_length", float, least=0.0),
    Fact("contact_steps", int, least=0),
    Fact("sensed_error", float),
)
"""Facts of every service; own facts come beside them."""


class Planner(Protocol):
    """A robot that decides for each person what it will do, such as ``robots.ScriptedRobot``."""

    def robot(self, codes: np.ndarray, rng: np.random.Generator) -> serve.Robot:
        """The robot for people with these five identities, int64 [N, 5]."""
        ...


AnyRobot = serve.Robot | Planner


@dataclass(frozen=True)
class World:
    """Where people are served. Everything is even where nothing is said.

    Attributes:
        population: where people are drawn from: one of ``people.POPULATIONS``, or your own.
        perception: strength of ``scenarios.sensing``'s perception, 0 to 1.
        needs: strength of ``scenarios.needs``, 0 to 1.
        tips: strength of ``scenarios.tips``, 0 to 1.
        prejudice: strength of the biased robots that are imitated first, 0 (none) to 1.
        hidden: whether the robot is not told whom it serves.
        party: so many people ask at the same time and share the time of one service: each is
            served when the one before has ended.
        missed: share of readings of the distance sensor that fail because of who is looked at:
            ``{"disability=Yes": 0.3}``. Failures come in runs of 0.5 s on average.
        interval: physics steps from one decision to the next.
        noise: standard deviation of a reading, metres.
        dropout: share of readings that fail, the same for every person.
        shares: identity -> shares of its groups, instead of those of the population.
        identities: of the people: the paper's five, five and more, or others. A group that the
            population does not know is as common as the others, unless ``shares`` says more.
        facts: own facts of a service -> how they are told from finished services, [n] each.
        issues: what can go wrong, the paper's four by default; see ``scheme.own_issue``.
        reference: a robot that makes up for what is uneven, if there is one.
        name: of the scenario.

    Raises:
        InputError: for what is out of range or does not exist.
    """

    population: str | Population = "uniform"
    perception: float = 0.0
    needs: float = 0.0
    tips: float = 0.0
    prejudice: float = 0.0
    hidden: bool = False
    party: int = 1
    missed: Mapping[str, float] = field(default_factory=dict, hash=False)
    interval: int = TaskSettings.interval
    noise: float = SenseSettings.noise
    dropout: float = SenseSettings.dropout
    shares: Mapping[str, tuple[float, ...]] = field(default_factory=dict, hash=False)
    identities: tuple[Identity, ...] = IDENTITIES
    facts: Mapping[Fact, Callable[[serve.Trajectories], np.ndarray]] = field(
        default_factory=dict, hash=False
    )
    issues: tuple[Issue, ...] = PAPER_ISSUES
    reference: AnyRobot | None = field(default=None, compare=False)
    name: str = field(default="own", compare=False)

    def __post_init__(self) -> None:
        _ = self.people, self.task, self.sensor, self.need, self.scheme
        tips.check(self.tips)
        whole("party", self.party, 1, 10)
        if not 0.0 <= self.prejudice <= 1.0:
            raise InputError(
                "range prejudice", f"prejudice is {self.prejudice}: give a strength from 0 to 1"
            )
        for group, share in self.missed.items():
            self._column(group)
            if not 0.0 <= share < 1.0:
                raise InputError(
                    "range missed", f"missed says {share} of {group}: give a share below 1"
                )

    @cached_property
    def people(self) -> Population:
        """Where people are drawn from, with the identities and shares of this world."""
        chosen = self.population
        known = people.population(chosen) if isinstance(chosen, str) else chosen
        if known.identities == self.identities and not self.shares:
            return known
        for name in self.shares:
            if name not in self._names:
                raise unknown("identity in shares", name, self._names, "shares")
        return known.altered(self.identities, self.shares)

    @property
    def _names(self) -> list[str]:
        return [one.name for one in self.identities]

    @cached_property
    def task(self) -> TaskSettings:
        """When the robot decides."""
        return TaskSettings(self.interval)

    @cached_property
    def sensor(self) -> SenseSettings:
        """The distance sensor."""
        return SenseSettings(self.noise, self.dropout, self.perception)

    @cached_property
    def need(self) -> NeedSettings:
        """Who needs another service."""
        return NeedSettings(self.needs)

    @cached_property
    def scheme(self) -> Scheme:
        """Identities, facts and issues as they are counted and scored."""
        return Scheme(self.identities, (*HOUSE_FACTS, *self.facts), self.issues)

    @property
    def groups(self) -> tuple[tuple[str, str], ...]:
        """(identity, group) of each of the G groups."""
        return self.scheme.groups

    @property
    def observation_size(self) -> int:
        """Numbers in an observation."""
        return observation_size(len(self.groups))

    def known(self, codes: np.ndarray) -> np.ndarray:
        """What is known of the five identities of people of this world, int64 [n, 5]."""
        return people.known(codes, self.identities)

    def also_missed(self, codes: np.ndarray) -> np.ndarray | None:
        """Share of readings that ``missed`` makes fail, [n]; None where nobody is missed more."""
        if not self.missed:
            return None
        inside = people.encode(codes, self.identities)
        seen = np.ones(len(codes))
        for group, share in self.missed.items():
            seen *= 1.0 - share * inside[:, self._column(group)]
        return 1.0 - seen

    def _column(self, group: str) -> int:
        names = [f"{identity}={one}" for identity, one in self.groups]
        if group not in names:
            raise unknown("group in missed", group, names, "missed")
        return names.index(group)

    def told(self, done: serve.Trajectories) -> dict[str, np.ndarray]:
        """Own facts of finished services, float64 [n] each.

        Raises:
            InputError: when a fact is not told of every service, or has values that it cannot have.
        """
        found = {}
        for fact, tell in self.facts.items():
            values = np.asarray(tell(done), float)
            if values.shape != done.facts.steps.shape:
                raise InputError(
                    f"shape {fact.name}",
                    f"fact {fact.name!r} came as an array of shape {values.shape} for "
                    f"{len(done.facts.steps)} services: give one number for each",
                )
            if (wrong := fact.wrong(values)).any():
                row = int(np.flatnonzero(wrong)[0])
                raise InputError(
                    f"range {fact.name}",
                    f"fact {fact.name!r} is {values[row]:g} in service {row}: give {fact.wanted()}",
                )
            found[fact.name] = values
        return found

    def indicators(self, done: serve.Trajectories, scheme: Scheme | None = None) -> np.ndarray:
        """Which service has which issue, float64 [n, K], NaN where one does not apply.

        Args:
            done: finished services.
            scheme: with other issues than those of this world.
        """
        return (scheme or self.scheme).indicators(_Told(done.facts, self.told(done)))

    def robot_to_compare_with(self) -> AnyRobot:
        """The reference robot.

        Raises:
            InputError: when there is none.
        """
        if self.reference is None:
            raise InputError(
                "missing reference",
                f"scenario {self.name!r} has no reference robot: give one to register_scenario, or "
                "leave out what compares with it",
            )
        return self.reference

    def described(self) -> dict[str, Any]:
        """What is uneven as JSON holds it: the strengths, and whatever else is not the default."""
        out: dict[str, Any] = {}
        for one in fields(World):
            value = getattr(self, one.name)
            strength = one.name in ("population", "perception", "needs", "tips", "prejudice")
            if one.compare and (strength or value != _default(one)):
                out[one.name] = plain(value)
        return out


@dataclass(frozen=True)
class _Told:
    """Facts of the house and own ones, as rules read them."""

    house: Any
    own: Mapping[str, np.ndarray]

    def __contains__(self, name: str) -> bool:
        return name in self.own or name in self.house

    def fact(self, name: str) -> np.ndarray:
        return self.own[name] if name in self.own else self.house.fact(name)


def _default(one: Any) -> Any:
    return one.default_factory() if callable(one.default_factory) else one.default


def plain(value: Any) -> Any:
    """A field of a world as JSON; a rule is known by its name."""
    if isinstance(value, Population):
        return value.name
    if isinstance(value, Identity):
        return [value.name, *value.groups]
    if isinstance(value, Issue | Fact):
        return value.name
    if isinstance(value, Mapping):
        return {k.name if isinstance(k, Fact) else k: plain(v) for k, v in value.items()}
    if isinstance(value, tuple):
        return [plain(one) for one in value]
    return getattr(value, "__name__", "rule") if callable(value) else value


# --- scenarios by name ---


@dataclass
class _Registered:
    """A scenario, its world made when first asked for."""

    world: World | Callable[[], World]
    reference: AnyRobot | None
    place: str
    source: str | None
    of_session: bool


_SCENARIOS: dict[str, _Registered] = {}


def register_scenario(
    name: str, *, world: World | Callable[[], World], reference: AnyRobot | None = None
) -> None:
    """Add a scenario, which can then be chosen by its name wherever one can be.

    Args:
        name: letters, digits, ``_``, ``-`` and dots.
        world: the world, or a function that makes it.
        reference: a robot that makes up for what is uneven; a comparison shows results as shares
            of what it attains.

    Raises:
        InputError: for a name that is taken or cannot be one, or something that is no world.
    """
    plugins.check_name("scenario", name)
    if not (isinstance(world, World) or callable(world)):
        raise InputError(
            "type world", f"scenario {name!r}: world is {world!r}: give a World or a function"
        )
    frame = sys._getframe(1)
    place, text = plugins.origin(frame, world, reference)
    if name in _SCENARIOS and _SCENARIOS[name].place != place:
        raise InputError(
            "duplicate scenario",
            f"there is a scenario {name!r} already: register yours by another name",
        )
    session = not plugins.reaches_workers(frame.f_globals["__name__"], GROUP)
    _SCENARIOS[name] = _Registered(world, reference, place, text, session)


def names() -> tuple[str, ...]:
    """Of all scenarios, those of Evenhand first."""
    plugins.ready(GROUP)
    return tuple(_SCENARIOS)


def of_session(name: str) -> bool:
    """Whether the running script or session registered a scenario: no other process knows it."""
    return _SCENARIOS[name].of_session


def sources(name: str) -> dict[str, str]:
    """Fingerprints of the files of the scenarios in a name that are not Evenhand's own.

    Raises:
        InputError: as ``scenario``.
    """
    found = {one: _SCENARIOS[one].source for one in ordered(name).split("+")}
    return {f"scenario {one}": text for one, text in found.items() if text is not None}


def _made(name: str) -> World:
    entry = _SCENARIOS[name]
    if not isinstance(entry.world, World):
        made = entry.world()
        if not isinstance(made, World):
            raise InputError(
                "type world",
                f"scenario {name!r}: its function gave {type(made).__name__}: return a World",
            )
        entry.world = made
    return replace(entry.world, reference=entry.reference or entry.world.reference)


def scenario(name: str, population: str | None = None) -> World:
    """The world of a scenario, or of several joined by a plus.

    Args:
        name: of the scenario.
        population: where people are drawn from instead.

    Raises:
        InputError: for an unknown name, or names that contradict each other: they set the same
            thing, or one of them is ``even``.
    """
    parts = name.split("+")
    for one in parts:
        if one not in names():
            raise unknown("scenario", one, names())
    if len(set(parts)) < len(parts):
        raise InputError(
            "duplicate scenario", f"scenario {name!r} names one of them twice: drop one"
        )
    if len(parts) > 1 and "even" in parts:
        raise InputError(
            "conflict scenario",
            f"scenario {name!r} contradicts itself: even is the lack of all others",
        )
    setting: dict[str, Any] = {}
    setter: dict[str, str] = {}
    worlds = {one: _made(one) for one in parts}
    for one, world in worlds.items():
        for each in fields(World):
            value = getattr(world, each.name)
            if each.name == "name" or value is None or value == _default(each):
                continue
            if each.name in setter:
                raise InputError(
                    "conflict scenario",
                    f"scenario {name!r} contradicts itself: {setter[each.name]} and {one} both "
                    f"set {each.name}; choose one of them",
                )
            setter[each.name], setting[each.name] = one, value
    if population is not None:
        setting["population"] = population
    whole = World(**setting, name=name)
    if {*parts} <= {*_OWN}:
        own = robots.reference(whole.perception, whole.needs, whole.identities, whole.hidden)
        return replace(whole, reference=own)
    # what makes up for one cause makes up for no other
    return whole if len(parts) == 1 else replace(whole, reference=None)


def ordered(name: str) -> str:
    """The one way in which a scenario is written: ``tips+perception`` is ``perception+tips``.

    Raises:
        InputError: as ``scenario``.
    """
    scenario(name)
    return "+".join(sorted(name.split("+"), key=list(_SCENARIOS).index))


_OWN: Mapping[str, World] = {
    "even": World(),
    "prejudiced": World(prejudice=1.0),
    "perception": World(perception=1.0),
    "minority": World(population="us", needs=1.0),
    "tips": World(tips=1.0),
    "everyday": World(population="us", perception=0.5, needs=0.5, tips=0.5),
    "hidden": World(perception=1.0, hidden=True),
    "hurry": World(needs=1.0, party=2),
    "what-if-skin": World(missed=WHAT_IF_SKIN),
}
for _name, _world in _OWN.items():
    register_scenario(_name, world=_world)
