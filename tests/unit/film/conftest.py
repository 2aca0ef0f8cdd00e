"""Services to film, and whether this machine can draw."""

import numpy as np
import pytest

from evenhand.experiments import footage as sources
from evenhand.restaurant import robots
from evenhand.restaurant.worlds import World


@pytest.fixture(scope="session")
def footage():
    """Service i is served in manner i of ``robots.MANNERS``."""
    robot = robots.Mannered(lambda codes, rng: np.arange(len(codes)))
    return sources.recorded(World(name="even"), robot, len(robots.MANNERS), 3, "scripted")
