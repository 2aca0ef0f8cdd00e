"""Where unevenness comes from: named settings, each with its mechanism in one place.

| scenario | what is uneven | mechanism |
|---|---|---|
| ``even`` | nothing | |
| ``prejudiced`` | the policy first imitates biased robots | ``learn.imitate`` |
| ``perception`` | sensing depends on skin type and height | ``restaurant.senses`` |
| ``minority`` | few elders and wheelchair users (``us``) with other needs | ``restaurant.needs`` |
| ``tips`` | the operator's reward pays by age | ``restaurant.tips`` |
| ``everyday`` | the last three at half strength | all of them |

Sources and ranges stand with the mechanisms. Scenarios combine with a plus, ``perception+tips``.

Each has a scripted reference robot that makes up for the mechanism by what it observes. What it
attains can be attained, and results are shares of that; where mechanisms combine, a robot may do
better (with ``perception+minority`` it leaves 8 % of services imperfect).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from evenhand import people
from evenhand.errors import InputError, unknown
from evenhand.restaurant import needs, plan, senses, serve, task, tips


@dataclass(frozen=True)
class Scenario:
    """How uneven the world is.

    Attributes:
        population: where people are drawn from.
        perception: strength of ``restaurant.senses``' perception, 0 to 1.
        needs: strength of ``restaurant.needs``, 0 to 1.
        tips: strength of ``restaurant.tips``, 0 to 1.
        prejudice: strength of the biased robots that are imitated first, 0 (none) to 1.
    """

    population: str = "uniform"
    perception: float = 0.0
    needs: float = 0.0
    tips: float = 0.0
    prejudice: float = 0.0

    def __post_init__(self) -> None:
        people.population(self.population)
        senses.SenseSettings(perception=self.perception)
        needs.NeedSettings(self.needs)
        tips.check(self.tips)
        if not 0.0 <= self.prejudice <= 1.0:
            raise InputError(f"prejudice is {self.prejudice}: give a strength from 0 to 1")


SCENARIOS: Mapping[str, Scenario] = {
    "even": Scenario(),
    "prejudiced": Scenario(prejudice=1.0),
    "perception": Scenario(perception=1.0),
    "minority": Scenario(population="us", needs=1.0),
    "tips": Scenario(tips=1.0),
    "everyday": Scenario(population="us", perception=0.5, needs=0.5, tips=0.5),
}


def scenario(name: str) -> Scenario:
    """A scenario, or several joined by a plus.

    Raises:
        InputError: for an unknown name, or names that contradict each other: they set the same
            thing, or one of them is ``even``.
    """
    names = name.split("+")
    for one in names:
        if one not in SCENARIOS:
            raise unknown("scenario", one, SCENARIOS)
    if len(set(names)) < len(names):
        raise InputError(f"scenario {name!r} names one of them twice: drop one")
    if len(names) > 1 and "even" in names:
        raise InputError(f"scenario {name!r} contradicts itself: even is the lack of all others")
    whole, none = Scenario(), Scenario()
    setter: dict[str, str] = {}
    for one in names:
        for field in fields(Scenario):
            value = getattr(SCENARIOS[one], field.name)
            if value == getattr(none, field.name):
                continue
            if field.name in setter:
                raise InputError(
                    f"scenario {name!r} contradicts itself: {setter[field.name]} and {one} both "
                    f"set {field.name}; choose one of them"
                )
            setter[field.name] = one
            whole = replace(whole, **{field.name: value})
    return whole


def ordered(name: str) -> str:
    """The one way in which a scenario is written: ``tips+perception`` is ``perception+tips``.

    Raises:
        InputError: as ``scenario``.
    """
    scenario(name)
    return "+".join(sorted(name.split("+"), key=list(SCENARIOS).index))


_FIRST_AGE = [group[0] for group in people.GROUPS].index("age")
_FIRST_DISABILITY = [group[0] for group in people.GROUPS].index("disability")
_RUN_UP = plan.TOP_SPEED / plan.MAX_ACCELERATION
"""Seconds until the robot has its top speed."""


def reference(chosen: Scenario) -> serve.Robot:
    """The scripted robot that makes up for a scenario.

    It divides a reading by what the sensor makes of people of that height, adds what it has driven
    since the reading, and responds in the middle of the person's own window: 1.0-1.5 m, or what
    ``restaurant.needs`` leaves of it. It sees what a policy sees, and nothing else.

    Args:
        chosen: the scenario.
    """

    def respond(observation: np.ndarray, rows: np.ndarray) -> np.ndarray:
        del rows
        child = observation[:, _FIRST_AGE] > 0.5
        elder = observation[:, _FIRST_AGE + 4] > 0.5
        wheelchair = observation[:, _FIRST_DISABILITY] > 0.5
        codes = np.zeros((len(observation), len(people.IDENTITIES)), np.int64)
        codes[:, 2] = np.where(child, 0, np.where(elder, 4, 2))
        codes[:, 3] = np.where(wheelchair, 0, 1)
        reading = observation[:, task.N_GROUPS] * task.DISTANCE_UNIT
        now = observation[:, task.N_GROUPS + 1] * plan.MAX_STEPS * plan.TIMESTEP
        age = observation[:, task.N_GROUPS + 2] * task.AGE_UNIT
        distance = reading / senses.mean_stretch(chosen.perception, codes)
        distance = distance - (_driven(now) - _driven(now - age))
        # nobody else is special: draws of the windows are the same for all of a kind
        own = needs.draw(needs.NeedSettings(chosen.needs), codes, np.random.default_rng(0))
        least, most = np.maximum(own.room, 1.0), np.minimum(own.reach, 1.5)
        # it decides ten times a second and drives 0.1 m in between: half of that to either side
        return (distance <= (least + most) / 2 + 0.05).astype(float)

    return respond


def _driven(seconds: np.ndarray) -> np.ndarray:
    """Metres that the robot has driven at a time, without braking."""
    seconds = np.maximum(seconds, 0.0)
    starting = 0.5 * plan.MAX_ACCELERATION * np.minimum(seconds, _RUN_UP) ** 2
    return starting + plan.TOP_SPEED * np.maximum(seconds - _RUN_UP, 0.0)
