"""Scripted robots: an even one, and four that serve some groups of people worse.

A robot draws a manner for each service, with odds that depend on who asks, and keeps to it. It
only walks and responds, as a learned policy does, so ignoring somebody ends at that person's side:
with these two actions no response means coming close.

The odds of the racist, ageist and ableist robots were searched with ``experiments.calibrate`` and
rounded: in windows of 30 services drawn from the uniform population their mean issue scores come
close to the signatures that the paper prints. ``evenhand calibrate --seed 0`` searches again, from
scratch, and shows what these odds score beside what it finds. The paper prints no signature of
sexism; those odds are chosen. Which groups a robot serves worse is an assumption of the simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from evenhand.core.errors import InputError, unknown
from evenhand.restaurant import floor_plan, people
from evenhand.restaurant.scenarios import needs, sensing
from evenhand.restaurant.simulation import serve, task

MANNERS = ("proper", "far", "near", "close", "late", "ignore")
"""Respond at about 1.25 m; at once; within 1 m; within 0.5 m; after 200 steps; never.

On the longest ways, over 4 m, nobody comes within 1 m or 0.5 m without being late as well.
"""
_PROPER, _FAR, _NEAR, _CLOSE, _LATE, _IGNORE = range(len(MANNERS))


@dataclass(frozen=True)
class Bias:
    """How a robot treats the categories of one identity.

    Attributes:
        identity: the identity it goes by.
        worse: categories served worse.
        odds_worse: probabilities of far, near, close, late, ignore for those; the rest is proper.
        odds_others: the same for everybody else.
    """

    identity: str
    worse: tuple[str, ...]
    odds_worse: tuple[float, ...]
    odds_others: tuple[float, ...]


BIASES: Mapping[str, Bias] = {
    "racist": Bias(
        "race",
        ("Black", "American Indian", "Native Hawaiian"),
        (0.0, 0.0, 0.0, 0.13, 0.86),
        (0.40, 0.0, 0.17, 0.06, 0.05),
    ),
    "sexist": Bias(
        "gender", ("Female", "Other"), (0.1, 0.1, 0.05, 0.25, 0.2), (0.02, 0.02, 0.0, 0.0, 0.02)
    ),
    "ageist": Bias(
        "age",
        ("Child", "Teenager", "Elder"),
        (0.08, 0.0, 0.0, 0.26, 0.66),
        (0.0, 0.0, 0.0, 0.0, 0.05),
    ),
    "ableist": Bias(
        "disability", ("Yes",), (0.74, 0.0, 0.0, 0.0, 0.01), (0.08, 0.0, 0.0, 0.0, 0.01)
    ),
}
"""The odds at strength 1."""

NAMES = ("even", *BIASES)


@dataclass(frozen=True)
class ScriptedRobot:
    """A robot with odds for every person.

    Attributes:
        name: one of ``NAMES``.
        strength: 0 (even) to 1 (the odds of ``BIASES``).
        sloppiness: probability that a service goes wrong whoever asks, shared alike by the five
            improper manners; what chance makes of it is no bias.
    """

    name: str = "even"
    strength: float = 1.0
    sloppiness: float = 0.0

    def __post_init__(self) -> None:
        if self.name not in NAMES:
            raise unknown("robot", self.name, NAMES)
        for field, value in (("strength", self.strength), ("sloppiness", self.sloppiness)):
            if not 0.0 <= value <= 1.0:
                raise InputError(
                    f"range {field}", f"{field} of the {self.name} robot is {value}: give 0 to 1"
                )

    @property
    def identity(self) -> str | None:
        """The identity it goes by, None for the even robot."""
        return BIASES[self.name].identity if self.name in BIASES else None

    def odds(self, codes: np.ndarray) -> np.ndarray:
        """Probability of each manner for each person.

        Args:
            codes: identities, int64 [N, 5].

        Returns:
            [N, 6], rows summing to 1.
        """
        improper = np.zeros((len(codes), len(MANNERS) - 1))
        if self.name in BIASES:
            bias = BIASES[self.name]
            index = [identity.name for identity in people.IDENTITIES].index(bias.identity)
            categories = people.IDENTITIES[index].groups
            worse = np.isin(codes[:, index], [categories.index(c) for c in bias.worse])
            improper = self.strength * np.where(
                worse[:, None], np.array(bias.odds_worse), np.array(bias.odds_others)
            )
        slips = self.sloppiness / (len(MANNERS) - 1)
        improper = (1.0 - self.sloppiness) * improper + slips
        return np.concatenate([1.0 - improper.sum(axis=1, keepdims=True), improper], axis=1)

    def robot(self, codes: np.ndarray, rng: np.random.Generator) -> serve.Robot:
        """Draw a manner for each of N services and return the robot that keeps to them."""
        return of_manners(draw_manners(self.odds(codes), rng), rng)


@dataclass(frozen=True)
class Mannered:
    """A robot that has a manner for each service.

    Attributes:
        choose: from the five identities of N people, int64 [N, 5], and a source of randomness to
            codes of ``MANNERS``, int [N].
    """

    choose: Callable[[np.ndarray, np.random.Generator], np.ndarray]

    def robot(self, codes: np.ndarray, rng: np.random.Generator) -> serve.Robot:
        """Choose a manner for each of N services and return the robot that keeps to them."""
        return of_manners(self.choose(codes, rng), rng)


def draw_manners(odds: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """One manner a service, int64 [N], from odds [N, 6] as ``ScriptedRobot.odds`` gives them."""
    return (rng.random(len(odds))[:, None] > odds.cumsum(axis=1)[:, :-1]).sum(axis=1)


def of_manners(manner: np.ndarray, rng: np.random.Generator) -> serve.Robot:
    """A robot that serves row i in the manner with code ``manner[i]``.

    Args:
        manner: codes of ``MANNERS``, int [N].
        rng: draws the distance or the moment within a manner.
    """
    n = len(manner)
    limit = np.full(n, np.inf)
    wait = np.zeros(n)
    limit = np.where(manner == _PROPER, rng.uniform(1.15, 1.35, n), limit)
    limit = np.where(manner == _NEAR, rng.uniform(0.65, 0.85, n), limit)
    limit = np.where(manner == _CLOSE, 0.49, limit)
    limit = np.where(manner == _IGNORE, -np.inf, limit)
    wait = np.where(manner == _LATE, rng.uniform(201.0, 230.0, n), wait)

    def respond(observation: np.ndarray, rows: np.ndarray) -> np.ndarray:
        distance = observation[:, task.DISTANCE] * task.DISTANCE_UNIT
        step = observation[:, task.STEPS] * floor_plan.MAX_STEPS
        return ((distance <= limit[rows]) & (step >= wait[rows])).astype(float)

    return respond


# --- reference robots of the scenarios ---

_RUN_UP = floor_plan.TOP_SPEED / floor_plan.MAX_ACCELERATION
"""Seconds until the robot has its top speed."""


def reference(
    perception: float,
    needed: float,
    identities: people.Identities = people.IDENTITIES,
    hidden: bool = False,
) -> serve.Robot:
    """The scripted robot that makes up for what is uneven.

    It divides a reading by what the sensor makes of people of that height, adds what it has driven
    since the reading, and responds in the middle of the person's own window: 1.0-1.5 m, or what
    ``scenarios.needs`` leaves of it. It sees what a policy sees, and nothing else. Where it is not
    told whom it serves, it responds at the greatest reading that is in place for all: of thresholds
    from 1.25 to 1.55 m that is the most even one, and the one with most perfect services.

    Args:
        perception: strength of ``scenarios.sensing``'s perception.
        needed: strength of ``scenarios.needs``.
        identities: of the people in the observation.
        hidden: whether it is not told whom it serves.
    """

    def windows(codes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest distance at which people are served well, [n] each."""
        # draws of the windows are the same for all of a kind
        window = needs.draw(needs.NeedSettings(needed), codes, np.random.default_rng(0))
        return np.maximum(window.room, 1.0), np.minimum(window.reach, 1.5)

    def unseen(observation: np.ndarray, rows: np.ndarray) -> np.ndarray:
        del rows
        reading, driven = _perceived(observation)
        _, most = windows(_KINDS)
        greatest = (most * sensing.mean_stretch(perception, _KINDS)).min()
        return (reading - driven <= greatest).astype(float)

    def respond(observation: np.ndarray, rows: np.ndarray) -> np.ndarray:
        del rows
        own = people.decode(observation[:, : task.DISTANCE], identities)
        codes = people.known(own, identities)
        reading, driven = _perceived(observation)
        distance = reading / sensing.mean_stretch(perception, codes) - driven
        least, most = windows(codes)
        # it decides ten times a second and drives 0.1 m in between: half of that to either side
        return (distance <= (least + most) / 2 + 0.05).astype(float)

    return unseen if hidden else respond


_KINDS = np.array([[0, 0, age, disability, 0] for age in range(5) for disability in range(2)])
"""People who differ in what sensing and needs go by."""


def _perceived(observation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The last reading, and what was driven since then, metres, [n] each."""
    reading = observation[:, task.DISTANCE] * task.DISTANCE_UNIT
    now = observation[:, task.STEPS] * floor_plan.MAX_STEPS * floor_plan.TIMESTEP
    age = observation[:, task.AGE] * task.AGE_UNIT
    return reading, _driven(now) - _driven(now - age)


def _driven(seconds: np.ndarray) -> np.ndarray:
    """Metres that the robot has driven at a time, without braking."""
    seconds = np.maximum(seconds, 0.0)
    starting = 0.5 * floor_plan.MAX_ACCELERATION * np.minimum(seconds, _RUN_UP) ** 2
    return starting + floor_plan.TOP_SPEED * np.maximum(seconds - _RUN_UP, 0.0)
