"""Serve people: draw them, let a robot serve them to the end, and write down what happened."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evenhand.methods.services import Services
from evenhand.restaurant.simulation import layout, serve
from evenhand.restaurant.simulation.engine import LANES, Engine
from evenhand.restaurant.worlds import AnyRobot, World

WINDOW = 30
"""Services in a window of the paper: an epoch of 30 people."""


class Ahead(NamedTuple):
    """Services that can begin.

    Attributes:
        drawn: everything in them that is left to chance.
        robot: who serves them.
        following: people who come after them and are not served.
    """

    drawn: serve.Drawn
    robot: serve.Robot
    following: layout.Setups


def nobody(observation: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """A robot that never responds."""
    del rows
    return np.zeros(len(observation))


def engine(world: World, at_once: int, threads: int = 1) -> Engine:
    """What steps the services of a world; see ``Engine``."""
    return Engine(world.task, at_once, len(world.groups), threads)


def draw(
    world: World,
    n: int,
    rng: np.random.Generator,
    made_for: Engine,
    robot: AnyRobot = nobody,
    following: int = 0,
) -> Ahead:
    """Leave to chance what can be drawn before services begin.

    Args:
        world: where.
        n: how many services.
        rng: people and places, the robot's plans, readings, needs, actions, in this order.
        made_for: the engine that will run them.
        robot: who serves.
        following: people who are drawn after them and not served.
    """
    setups = layout.draw(world.people, n + following, rng, world.hidden)
    served = setups[:n] if following else setups
    plan = getattr(robot, "robot", None)
    chosen: serve.Robot = robot if plan is None else plan(served.asking, rng)  # type: ignore[assignment]
    missed = world.also_missed(served.codes)
    drawn = serve.draw(made_for.one, served, rng, world.sensor, world.need, missed, world.party)
    return Ahead(drawn, chosen, setups[n:])


def serve_people(
    world: World,
    robot: AnyRobot,
    n: int,
    rng: np.random.Generator,
    *,
    recorded: bool = False,
    threads: int = 1,
) -> serve.Trajectories:
    """Serve people of a world.

    Args:
        world: who is served, and how.
        robot: a function from observations to probabilities of responding (see
            ``serve.Robot``), or a robot with a plan for everybody, such as ``ScriptedRobot``.
        n: how many people.
        rng: source of all randomness; the same state gives the same services to the last bit.
        recorded: keep what was to be seen, for clips and replay.
        threads: that step the physics; results are the same on any number.

    Raises:
        InputError: for no people or no threads.
    """
    made = engine(world, min(LANES, n), threads)
    ahead = draw(world, n, rng, made, robot)
    return made.run(ahead.drawn, ahead.robot, recorded=recorded)


def table(
    done: serve.Trajectories,
    world: World,
    robot: str | Sequence[str],
    *,
    epoch: np.ndarray | int | None = None,
    first: int = 0,
) -> Services:
    """Finished services as one row each, which is what all judgement takes.

    Args:
        done: N services.
        world: where they were.
        robot: who served: one for all, or one each.
        epoch: one for all, or one each; by default every ``WINDOW`` services are one.
        first: number of the first row.
    """
    facts, n = done.facts, len(done.facts.steps)
    none = ~facts.responded
    if epoch is None:
        epoch = np.arange(n) // WINDOW
    return Services.build(
        identities={
            one.name: (done.codes[:, d], one.groups) for d, one in enumerate(world.identities)
        },
        facts={
            "epoch": np.broadcast_to(epoch, n),
            "service": np.arange(first, first + n),
            "scenario": [world.name] * n,
            "robot": [robot] * n if isinstance(robot, str) else list(robot),
            "responded": facts.responded,
            "response_step": np.ma.array(facts.steps, mask=none),
            "response_distance": np.ma.array(facts.distance, mask=none),
            **{
                name: getattr(facts, name)
                for name in ("min_distance", "steps", "start_distance", "path_length")
            },
            "contact_steps": facts.contact_steps,
            "sensed_error": facts.sensed_error,
            **world.told(done),
        },
        own=world.scheme.own,
    )
