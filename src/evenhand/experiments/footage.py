"""Services that can be filmed: what was to be seen of them, and what happened in them."""

import os
from collections.abc import Sequence

import numpy as np

from evenhand.core.errors import InputError
from evenhand.restaurant import people, robots
from evenhand.restaurant.film.clip import Footage
from evenhand.restaurant.scenarios import sensing
from evenhand.restaurant.simulation import layout, serve, task
from evenhand.restaurant.simulation.lanes import Lanes
from evenhand.training import recordings, run_folder
from evenhand.training.evaluate import LANES, WINDOW

SERVED = 3000
"""Services of a scripted robot, as many as `evenhand evaluate` lets it serve by default: the same
seed gives the same services there and here."""


def from_run(folder: str | os.PathLike[str], services: Sequence[int]) -> Footage:
    """Services of a run.

    Raises:
        InputError: when the run has no states, lacks one of the services, or is damaged.
    """
    seen = recordings.read(folder, services)
    facts = run_folder.read_services(folder)
    row_of = {int(number): row for row, number in enumerate(facts.fact("service"))}
    for number in services:
        if number not in row_of:
            raise InputError(
                f"{folder} holds no facts of service {number} yet: let the run go on to its next "
                "checkpoint"
            )
    return Footage(seen, facts.take(np.array([row_of[number] for number in services])))


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
    scripted = robots.ScriptedRobot(name, strength)
    rng = np.random.default_rng(seed)
    setups = layout.draw(people.population(population), services, rng)
    return recorded(scripted.robot(setups.asking, rng), setups, rng, name)


def recorded(
    robot: serve.Robot, setups: layout.Setups, rng: np.random.Generator, name: str
) -> Footage:
    """Let a robot serve everybody once, and record it."""
    lanes = Lanes(min(LANES, len(setups)), task.TaskSettings())
    done = serve.serve(lanes, setups, robot, rng, sensing.SenseSettings(), recorded=True)
    facts = serve.record(
        done.facts,
        setups.asking,
        epoch=np.arange(len(setups)) // WINDOW,
        scenario="even",
        robot=name,
    )
    assert done.seen is not None
    return Footage(done.seen, facts)
