"""Services that can be filmed: what was to be seen of them, and what happened in them."""

import os
from collections.abc import Sequence

import numpy as np

from evenhand.core import extras
from evenhand.core.errors import InputError
from evenhand.restaurant import robots, serve_people, worlds
from evenhand.restaurant.film.clip import Footage
from evenhand.restaurant.worlds import AnyRobot, World
from evenhand.training import recordings

SERVED = 3000
"""Services of a scripted robot, as many as `evenhand evaluate` lets it serve by default: the same
seed gives the same services there and here."""


def from_run(folder: str | os.PathLike[str], services: Sequence[int]) -> Footage:
    """Services of a run.

    Args:
        folder: of the run.
        services: their numbers, in the order wanted.

    Raises:
        InputError: when the run has no states, lacks one of the services, or is damaged, or when
            its scenario is not known.
    """
    extras.require("train", "the folder of a run")
    from evenhand.training import run_folder

    seen = recordings.read(folder, services)
    facts = run_folder.read_services(folder)
    row_of = {int(number): row for row, number in enumerate(facts.fact("service"))}
    for number in services:
        if number not in row_of:
            raise InputError(
                "missing service",
                f"{folder} holds no facts of service {number} yet: let the run go on to its next "
                "checkpoint",
            )
    rows = np.array([row_of[number] for number in services])
    return Footage(seen, facts.take(rows), run_folder.world_of(folder).issues)


def from_robot(
    name: str, strength: float, population: str, seed: int, services: int = SERVED
) -> Footage:
    """All services of a scripted robot, those of `evenhand evaluate` with the same settings.

    Args:
        name: of the robot.
        strength: of its bias, 0 to 1.
        population: where people are drawn from.
        seed: of people, places and chances.
        services: how many people it serves.

    Raises:
        InputError: for an unknown robot or population, or a strength outside 0 to 1.
    """
    world = worlds.scenario("even", population)
    return recorded(world, robots.ScriptedRobot(name, strength), services, seed, name)


def recorded(world: World, robot: AnyRobot, services: int, seed: int, name: str) -> Footage:
    """Let a robot serve, and record it; the same seed gives the same people at the same places.

    Args:
        world: where.
        robot: who serves.
        services: how many people.
        seed: of people, places and chances.
        name: of the robot.
    """
    rng = np.random.default_rng(seed)
    done = serve_people.serve_people(world, robot, services, rng, recorded=True)
    assert done.seen is not None
    return Footage(done.seen, serve_people.table(done, world, name), world.issues)
