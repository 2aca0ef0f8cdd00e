"""What the robot perceives of the person: readings of the distance sensor, not the truth.

A reading carries noise and sometimes fails; then the last one is kept and grows old (see
``kernels.read``). The
randomness of a service is drawn before it begins, so that one simulation, many simulations and a
replay see the same readings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evenhand.errors import InputError


@dataclass(frozen=True)
class SenseSettings:
    """The distance sensor.

    Attributes:
        noise: standard deviation of a reading, metres.
        dropout: probability that a reading fails, the same for every person.
    """

    noise: float = 0.01
    dropout: float = 0.02

    def __post_init__(self) -> None:
        if not 0.0 <= self.noise <= 1.0:
            raise InputError(f"noise is {self.noise}: give metres between 0 and 1")
        if not 0.0 <= self.dropout < 1.0:
            raise InputError(f"dropout is {self.dropout}: give a probability below 1")


@dataclass(frozen=True)
class Chances:
    """Randomness of the readings of N services with up to K readings each.

    Attributes:
        noise: error that a reading would have, metres, [N, K].
        fails: whether a reading fails, bool [N, K]; the first never does.
    """

    noise: np.ndarray
    fails: np.ndarray

    def __getitem__(self, rows: slice | np.ndarray) -> Chances:
        return Chances(self.noise[rows], self.fails[rows])


def draw(settings: SenseSettings, n: int, readings: int, rng: np.random.Generator) -> Chances:
    """Draw the randomness of n services with up to ``readings`` readings each."""
    fails = rng.random((n, readings)) < settings.dropout
    fails[:, 0] = False
    return Chances(noise=settings.noise * rng.standard_normal((n, readings)), fails=fails)
