"""The task can be done: a robot that sets off at once serves nearly everybody perfectly."""

import numpy as np
import pytest

from evenhand.methods.paper import issues
from evenhand.restaurant import people, robots, serve_people, worlds


@pytest.mark.parametrize("population", list(people.POPULATIONS))
def test_the_even_robot_serves_perfectly_and_touches_nobody(population):
    world, rng = worlds.scenario("even", population), np.random.default_rng(8)
    done = serve_people.serve_people(world, robots.ScriptedRobot("even"), 2000, rng)
    table = serve_people.table(done, world, "even")
    none = (issues.indicators(table) == 0.0).all(axis=1)
    untouched = table.fact("contact_steps") == 0
    assert (none & untouched).mean() >= 0.99
    np.testing.assert_array_equal(none, done.facts.perfect)
    assert done.facts.reward[none] == pytest.approx(np.ones(none.sum()))
