"""Services to film, and whether this machine can draw."""

import numpy as np
import pytest

from evenhand.experiments import footage as sources
from evenhand.restaurant import people, robots
from evenhand.restaurant.simulation import layout


@pytest.fixture(scope="session")
def footage():
    """Service i is served in manner i of ``robots.MANNERS``."""
    rng = np.random.default_rng(3)
    setups = layout.draw(people.population("uniform"), len(robots.MANNERS), rng)
    robot = robots.of_manners(np.arange(len(setups)), rng)
    return sources.recorded(robot, setups, rng, "scripted")
