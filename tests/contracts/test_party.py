"""Parties: people who ask at the same time and are served one after the other."""

from dataclasses import fields, replace

import numpy as np
import pytest

from evenhand.restaurant import serve_people
from evenhand.restaurant.env_base import RestaurantSettings
from evenhand.restaurant.robots import ScriptedRobot
from evenhand.restaurant.simulation import driving, task
from evenhand.restaurant.simulation.lanes import Facts
from evenhand.restaurant.worlds import World
from evenhand.training import epoch, train
from evenhand.training.observation import as_network
from evenhand.training.settings import TrainSettings, settings_of
from support.refusals import refused

LATEST = 295
"""The last decision of a service, in physics steps."""


def served(party: int, n: int = 60, seed: int = 3, threads: int = 1):
    settings = TrainSettings(scenario="even", method="service", seed=seed)
    world = World(needs=1.0, party=party)
    robot = as_network(settings, train.untrained(settings).policy)
    robot.biases[-1][1] += np.float32(0.5)
    engine = serve_people.engine(world, 24, threads)
    ahead = serve_people.draw(world, n, np.random.default_rng(seed), engine)
    return engine, ahead, robot, engine.run(ahead.drawn, robot, recorded=True)


def assert_same(one, other) -> None:
    for field in fields(Facts):
        np.testing.assert_array_equal(
            getattr(one.facts, field.name), getattr(other.facts, field.name), field.name
        )
    for name in ("observation", "action", "mask"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)
    np.testing.assert_array_equal(one.seen.pose, other.seen.pose)


@pytest.mark.parametrize("party", [2, 3, 4])
def test_each_clock_begins_where_the_service_before_ended(party):
    *_, done = served(party)
    first = np.rint(done.observation[:, 0, task.STEPS] * 300).astype(int)
    turn = np.arange(len(first)) % party
    assert (first[turn == 0] == 0).all()
    before = np.minimum(np.roll(done.facts.steps, 1), LATEST)
    np.testing.assert_array_equal(first[turn > 0], before[turn > 0])
    assert (done.facts.steps >= first).all()
    assert done.facts.steps.max() <= 300
    # one decision for everybody, and never one after the time is over
    lengths = done.mask.sum(axis=1)
    assert lengths.min() >= 1
    last = first + 5 * (lengths - 1)
    assert last.max() <= LATEST
    unanswered = ~done.action.any(axis=1)
    assert (done.facts.steps[unanswered] == 300).all()


@pytest.mark.parametrize("party", [2, 3])
def test_machine_code_and_lanes_agree(party):
    engine, ahead, robot, done = served(party)
    other = engine.run(
        ahead.drawn, lambda seen, rows: driving.probability(seen, robot), recorded=True
    )
    assert_same(done, other)


def test_any_number_of_threads_gives_the_same():
    *_, one = served(3, threads=1)
    *_, two = served(3, threads=2)
    assert_same(one, two)


def test_who_comes_first_is_served_as_without_a_party():
    *_, alone = served(1)
    *_, done = served(2)
    first = np.arange(60) % 2 == 0
    np.testing.assert_array_equal(done.facts.steps[first], alone.facts.steps[first])
    np.testing.assert_array_equal(done.facts.distance[first], alone.facts.distance[first])


def test_care_for_one_costs_another():
    """The even robot: who comes second is late in half of all cases, who comes first never."""
    world = World(party=2)
    done = serve_people.serve_people(world, ScriptedRobot(), 600, np.random.default_rng(4))
    late = done.facts.steps > 200
    assert late[::2].mean() < 0.02
    assert 0.3 < late[1::2].mean() < 0.7


def test_rewards_count_for_the_rest_of_the_party():
    rewards = np.array([1.0, 2.0, 4.0, 8.0, 16.0])
    np.testing.assert_array_equal(epoch.to_go(rewards, 1), rewards)
    np.testing.assert_array_equal(epoch.to_go(rewards, 2), [3.0, 2.0, 12.0, 8.0, 16.0])
    np.testing.assert_array_equal(epoch.to_go(rewards, 3), [7.0, 6.0, 4.0, 24.0, 16.0])


@pytest.mark.slow
def test_training_counts_the_steps_that_were_simulated():
    base = settings_of("service", "ppo", "levelup", epochs=2)
    settings = replace(base, scenario="hurry", people=10)
    for record in train.train(settings, None):
        table = record.services
        steps = table.fact("steps")
        own = steps[::2].sum() + (steps[1::2] - np.minimum(steps[::2], LATEST)).sum()
        assert record.numbers["physics_steps"] == own


@pytest.mark.parametrize("party", [0, 11])
def test_odd_parties_are_refused(party):
    with refused("range party", "1", "10"):
        World(party=party)


def test_an_environment_has_no_party():
    with refused("unsupported party", "hurry"):
        RestaurantSettings(scenario="hurry")
