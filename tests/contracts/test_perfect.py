"""The task can be done: a robot that sets off at once serves nearly everybody perfectly."""

import numpy as np
import pytest

from evenhand.methods.paper import issues
from evenhand.restaurant import people, robots
from evenhand.restaurant.scenarios import sensing
from evenhand.restaurant.simulation import layout, serve, task
from evenhand.restaurant.simulation.lanes import Lanes


@pytest.mark.parametrize("population", list(people.POPULATIONS))
def test_the_even_robot_serves_perfectly_and_touches_nobody(population):
    rng = np.random.default_rng(8)
    setups = layout.draw(people.population(population), 2000, rng)
    robot = robots.ScriptedRobot("even").robot(setups.asking, rng)
    lanes = Lanes(200, task.TaskSettings())
    done = serve.serve(lanes, setups, robot, rng, sensing.SenseSettings())
    table = serve.record(done.facts, setups.asking, epoch=0, scenario="even", robot="even")
    none = (issues.indicators(table) == 0.0).all(axis=1)
    untouched = table.fact("contact_steps") == 0
    assert (none & untouched).mean() >= 0.99
    np.testing.assert_array_equal(none, done.facts.perfect)
    assert done.facts.reward[none] == pytest.approx(np.ones(none.sum()))
