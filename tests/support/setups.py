"""Set-ups of services, drawn by chance; in some of them the robot is bumped into."""

from dataclasses import replace

import numpy as np

from evenhand import people
from evenhand.restaurant import layout, plan


def drawn(n: int, seed: int, population: str = "uniform") -> layout.Setups:
    return layout.draw(people.population(population), n, np.random.default_rng(seed))


def bumping(n: int, seed: int) -> layout.Setups:
    """Set-ups in which another guest pushes into the robot from the start of the first service."""
    setups = drawn(n, seed)
    position = setups.position.copy()
    position[0, 5] = setups.start[0] + (setups.radius[0, 5] + plan.ROBOT_RADIUS - 0.03, 0.01)
    return replace(setups, position=position)
