"""Set-ups of services, drawn by chance; in some of them guests are where they should not be."""

from dataclasses import replace

import numpy as np

from evenhand.restaurant import floor_plan, people
from evenhand.restaurant.simulation import layout


def drawn(n: int, seed: int, population: str = "uniform") -> layout.Setups:
    return layout.draw(people.population(population), n, np.random.default_rng(seed))


def bumping(n: int, seed: int) -> layout.Setups:
    """Set-ups in which another guest pushes into the robot from the start of the first service."""
    setups = drawn(n, seed)
    position = setups.position.copy()
    position[0, 5] = setups.start[0] + (setups.radius[0, 5] + floor_plan.ROBOT_RADIUS - 0.03, 0.01)
    return replace(setups, position=position)


def crowded(n: int, seed: int) -> layout.Setups:
    """Set-ups in which other guests stand in most robots' ways."""
    setups, rng = drawn(n, seed), np.random.default_rng(seed)
    position = setups.position.copy()
    for guest in (5, 8):
        share = rng.uniform(0.1, 0.6, (n, 1))
        position[:, guest] = setups.start * (1 - share) + position[:, 0] * share
        position[:, guest] += rng.normal(0, 0.2, (n, 2))
    return replace(setups, position=position)
