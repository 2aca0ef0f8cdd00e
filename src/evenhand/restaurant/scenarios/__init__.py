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

from evenhand.core.errors import InputError, unknown
from evenhand.restaurant import people
from evenhand.restaurant.scenarios import needs, sensing, tips


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
        sensing.SenseSettings(perception=self.perception)
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
