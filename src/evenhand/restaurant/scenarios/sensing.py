"""What the robot perceives of the person: readings of the distance sensor, not the truth.

A reading carries noise and sometimes fails; then the last one is kept and grows old (see
``driving.read``). The randomness of a service is drawn before it begins, so that one simulation,
many simulations and a replay see the same readings.

**Perception** (off by default) makes readings depend on the person, with the sizes of published
measurements at strength 1:

* Missed people. Detectors miss children 20 points more often than adults: 43.9 against 23.7 %
  (arXiv 2308.02935, version 2, later ACM TOSEM; version 1: 19.7 points). Here 0.20 for children, in
  runs of 0.5 s on average, because a person who is missed once is likely to be missed again. Range:
  0.20, the difference, to 0.26, what takes 23.7 to 43.9 % if failures are independent.
* Height. A distance that is taken from a person's apparent height is wrong by the factor of the
  height assumed to the true one. Assumed: the standing adult mean. Eyes are at 1.21 m in a
  wheelchair and at 1.61 m standing, a child is 1.28 m tall and an adult 1.68 m: factors of 1.33 and
  1.31; and adults differ from each other by 5.7 % (standard deviation of both sexes together).

**Skin type is a what-if** (``WHAT_IF_SKIN``, scenario ``what-if-skin``), no part of perception.
Version 1 of arXiv 2308.02935 reported that dark skin is missed 7.5 points more often. Version 2
withdrew it: 29.7 % of dark and 30.1 % of light. Others find lower precision for dark skin (arXiv
1902.11097). The sizes are chosen, so that one can ask what such a gap would do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenhand.core.errors import InputError

_CHILD, _WHEELCHAIR = 0, 0
_CHILD_MISSED = 0.20
WHAT_IF_SKIN = {"skin=IV": 0.06, "skin=V": 0.18, "skin=VI": 0.30}
"""Share of readings that would fail, for ``World(missed=...)``; a what-if without a source."""
_RUN_SECONDS = 0.5
_CHILD_HEIGHT, _WHEELCHAIR_HEIGHT = 1.28 / 1.68, 1.21 / 1.61
_HEIGHT_SPREAD = 0.057


@dataclass(frozen=True)
class SenseSettings:
    """The distance sensor.

    Attributes:
        noise: standard deviation of a reading, metres.
        dropout: probability that a reading fails, the same for every person.
        perception: 0 (the same for everybody) to 1 (sensing depends on the person, see above).
    """

    noise: float = 0.01
    dropout: float = 0.02
    perception: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.noise <= 1.0:
            raise InputError("range noise", f"noise is {self.noise}: give metres between 0 and 1")
        if not 0.0 <= self.dropout < 1.0:
            raise InputError(
                "range dropout", f"dropout is {self.dropout}: give a probability below 1"
            )
        if not 0.0 <= self.perception <= 1.0:
            raise InputError(
                "range perception", f"perception is {self.perception}: give a strength from 0 to 1"
            )


@dataclass(frozen=True)
class Chances:
    """Randomness of the readings of N services with up to K readings each.

    Attributes:
        noise: error that a reading would have, metres, [N, K].
        fails: whether a reading fails, bool [N, K]; the first never does.
        stretch: what the sensor reports of a distance of 1, [N].
    """

    noise: np.ndarray
    fails: np.ndarray
    stretch: np.ndarray


def missed(perception: float, codes: np.ndarray) -> np.ndarray:
    """Share of readings that fail because of who is looked at, in [0, 1), [N].

    Args:
        perception: strength.
        codes: identities, int64 [N, 5].
    """
    return np.where(codes[:, 2] == _CHILD, perception * _CHILD_MISSED, 0.0)


def mean_stretch(perception: float, codes: np.ndarray) -> np.ndarray:
    """What the sensor reports of a distance of 1, for people of mean height of their kind, [N].

    Args:
        perception: strength.
        codes: identities, int64 [N, 5].
    """
    child = np.where(codes[:, 2] == _CHILD, _CHILD_HEIGHT, 1.0)
    height = np.where(codes[:, 3] == _WHEELCHAIR, _WHEELCHAIR_HEIGHT, child)
    return height**-perception


def draw(
    settings: SenseSettings,
    codes: np.ndarray,
    readings: int,
    elapsed: float,
    rng: np.random.Generator,
    also_missed: np.ndarray | None = None,
) -> Chances:
    """Draw the randomness of N services.

    Args:
        settings: the sensor.
        codes: identities of the people who ask, int64 [N, 5].
        readings: most readings of a service, K.
        elapsed: seconds between two readings.
        rng: source of all randomness.
        also_missed: share of readings that fail beside those of perception, in [0, 1), [N].
    """
    n, strength = len(codes), settings.perception
    fails = rng.random((n, readings)) < settings.dropout
    noise = settings.noise * rng.standard_normal((n, readings))
    stretch = np.ones(n)
    if strength > 0.0 or also_missed is not None:
        share = missed(strength, codes)
        if also_missed is not None:
            share = 1.0 - (1.0 - share) * (1.0 - also_missed)
        fails |= _runs(share, readings, elapsed, rng)
    if strength > 0.0:
        spread = np.exp(strength * _HEIGHT_SPREAD * rng.standard_normal(n))
        stretch = mean_stretch(strength, codes) * spread
    fails[:, 0] = False
    return Chances(noise, fails, stretch)


def _runs(share: np.ndarray, readings: int, elapsed: float, rng: np.random.Generator) -> np.ndarray:
    """Runs of failures that fill these shares of the time, bool [N, K].

    A chain of two states: a run ends at each reading with the probability that gives its mean
    length, and begins with the one that gives its share.
    """
    end = min(elapsed / _RUN_SECONDS, 1.0)
    begin = np.minimum(end * share / (1.0 - share), 1.0)
    chance = rng.random((len(share), readings))
    out = np.empty((len(share), readings), bool)
    state = chance[:, 0] < share
    for k in range(readings):
        state = np.where(state, chance[:, k] >= end, chance[:, k] < begin) if k else state
        out[:, k] = state
    return out
