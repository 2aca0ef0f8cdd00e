"""Services to film are those that are evaluated, row by row."""

import numpy as np

from evenhand.experiments import footage as sources
from evenhand.restaurant import worlds
from evenhand.restaurant.robots import ScriptedRobot
from evenhand.training import evaluate


def test_a_scripted_robot_serves_as_when_it_is_evaluated():
    film = sources.from_robot("ageist", 0.7, "us", 11, services=60)
    assert film.facts == evaluate.serve_scripted(
        ScriptedRobot("ageist", 0.7), worlds.scenario("even", "us"), 60, 11
    )


def test_poses_and_facts_are_of_the_same_services(footage):
    distance = footage.seen.distance[np.arange(len(footage)), footage.seen.frames - 1]
    answered = footage.facts.fact("responded") == 1.0
    assert 0 < answered.sum() < len(footage)
    np.testing.assert_allclose(
        distance[answered], footage.facts.fact("response_distance")[answered], atol=1e-3
    )


def test_services_come_in_the_order_wanted(footage):
    taken = footage.take([4, 0])
    assert taken.seen.number.tolist() == [4, 0]
    assert taken.facts.fact("service").tolist() == [4, 0]
