"""A walk to the end holds every service that a robot could have given, to the last bit."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from evenhand.restaurant import serve_people, walks, worlds
from evenhand.restaurant.simulation import driving
from evenhand.restaurant.simulation.lanes import Facts
from evenhand.training.observation import as_network
from evenhand.training.settings import TrainSettings
from evenhand.training.train import untrained

SCENARIOS = ("even", "perception", "everyday")


def both(scenario: str, seed: int, *, recorded: bool = False, bend: float = 0.0):
    """The services of one robot: sampled as they go, and taken from walks; and these."""
    settings = TrainSettings(scenario=scenario, seed=seed, method="service")
    world, robot = settings.world, as_network(settings, untrained(settings).policy)
    robot.biases[-1][1] += np.float32(bend)
    engine = serve_people.engine(world, 40)
    ahead = serve_people.draw(world, 40, np.random.default_rng(seed), engine)
    sampled = engine.run(ahead.drawn, robot, recorded=recorded)
    walked = walks.walk(engine, ahead, recorded=recorded)
    return sampled, walked.given(walked.answers(robot)), walked


@pytest.mark.parametrize("bend", [-4.0, 0.0, 2.0])
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_services_are_those_of_a_sampled_run(scenario: str, bend: float) -> None:
    sampled, taken, _ = both(scenario, 3, bend=bend)
    for one in fields(Facts):
        assert np.array_equal(getattr(sampled.facts, one.name), getattr(taken.facts, one.name))
    for name in ("observation", "action", "mask", "codes"):
        assert np.array_equal(getattr(sampled, name), getattr(taken, name)), name


def test_so_is_what_was_to_be_seen() -> None:
    sampled, taken, _ = both("everyday", 5, recorded=True)
    assert sampled.seen is not None
    assert taken.seen is not None
    for name in ("pose", "sensed", "position", "people"):
        ours, theirs = getattr(taken.seen, name), getattr(sampled.seen, name)
        assert np.array_equal(ours, theirs, equal_nan=name in ("pose", "sensed")), name


def test_lane_by_lane_is_the_same_walk() -> None:
    world = worlds.scenario("everyday")
    engine = serve_people.engine(world, 12)
    ahead = serve_people.draw(world, 12, np.random.default_rng(2), engine)
    quick = walks.walk(engine, ahead)
    kept = quick.kept._replace(
        **{name: np.zeros_like(getattr(quick.kept, name)) for name in quick.kept._fields}
    )
    silent = serve_people.Ahead(
        drawn=replace(ahead.drawn, uniform=ahead.drawn.uniform + 1),
        robot=ahead.robot,
        following=ahead.following,
    )
    slow = engine.run(silent.drawn, serve_people.nobody, kept=kept)
    for name in driving.MOMENT.names or ():
        assert np.array_equal(kept.moment[name], quick.kept.moment[name]), name
    assert np.array_equal(kept.observation, quick.kept.observation)
    assert np.array_equal(slow.facts.steps, quick.unanswered.steps)


def test_the_last_of_each_service_has_no_response() -> None:
    _, _, walked = both("even", 1)
    n, length = walked.kept.mask.shape
    responded = walked.facts.responded.reshape(n, length + 1)
    assert not responded[:, -1].any()
    assert responded[:, :-1].all()  # in this world every response is noticed
    steps = walked.facts.steps.reshape(n, length + 1)
    assert np.array_equal(steps, np.broadcast_to(5 * np.arange(length + 1), steps.shape))
    assert walked.every.codes.shape == (n * (length + 1), 5)
