"""Services lane by lane: what is left to chance in them, and running them to their ends.

A robot is a function from what it perceives to the probability of responding; a learned policy
and a scripted robot are the same here. Most callers want ``restaurant.serve_people``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evenhand.restaurant import floor_plan
from evenhand.restaurant.scenarios import needs, sensing
from evenhand.restaurant.simulation import driving, layout, recording, task
from evenhand.restaurant.simulation.driving import Kept
from evenhand.restaurant.simulation.lanes import Beginning, Facts, Lanes, facts_of
from evenhand.restaurant.simulation.recording import Recording

Robot = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(observation float32 [n, G + 3], rows int [n]) -> probability of responding now [n].

``rows`` tells which of the services of this call the observations belong to, so that a robot can
hold a plan for each service.
"""


@dataclass(frozen=True)
class Trajectories:
    """N finished services and every decision taken in them.

    Attributes:
        facts: what happened.
        codes: identities of the people who asked, int64 [N, D].
        observation: at each decision, float32 [N, L, G + 3]; zero after the end.
        action: codes of ``task.ACTIONS``, int32 [N, L].
        mask: 1 where a decision was taken, float32 [N, L].
        seen: what was to be seen of them, if they were recorded.
    """

    facts: Facts
    codes: np.ndarray
    observation: np.ndarray
    action: np.ndarray
    mask: np.ndarray
    seen: Recording | None = None


@dataclass(frozen=True)
class Drawn:
    """N services with everything in them that is left to chance.

    Attributes:
        setups: who is where.
        beginning: of the services, with every reading of the sensor.
        uniform: decides on every action, [N, L].
        turn: place of each service in its party; 0 for the first, who comes before the others.
    """

    setups: layout.Setups
    beginning: Beginning
    uniform: np.ndarray
    turn: np.ndarray


def draw(
    lanes: Lanes,
    setups: layout.Setups,
    rng: np.random.Generator,
    sense: sensing.SenseSettings,
    wanted: needs.NeedSettings | None = None,
    also_missed: np.ndarray | None = None,
    party: int = 1,
) -> Drawn:
    """Leave to chance what can be drawn before the services begin.

    Args:
        lanes: prepare the services.
        setups: N services.
        rng: randomness of readings, needs and actions, in this order.
        sense: the distance sensor.
        wanted: who needs another service; nobody by default.
        also_missed: see ``sensing.draw``.
        party: so many people in a row ask at the same time and share the time of one service.
    """
    total, length = len(setups), lanes.settings.decisions
    elapsed = lanes.settings.interval * floor_plan.TIMESTEP
    chances = sensing.draw(sense, setups.asking, length + 1, elapsed, rng, also_missed)
    people_need = needs.draw(wanted or needs.NeedSettings(), setups.asking, rng)
    uniform = rng.random((total, length))
    turn = np.arange(total) % party
    return Drawn(setups, lanes.prepare(setups, chances, people_need), uniform, turn)


def run(
    lanes: Lanes, drawn: Drawn, robot: Robot, *, recorded: bool = False, kept: Kept | None = None
) -> Trajectories:
    """Run services that have been drawn to their ends.

    Args:
        lanes: simulations to use; takes ``lanes.n`` services at a time.
        drawn: N services.
        robot: who serves.
        recorded: keep what was to be seen.
        kept: where it is written down; see ``empty``.

    Raises:
        RuntimeError: when a simulation became unstable.
    """
    kept = kept or empty(drawn, recorded=recorded)
    physics, (total, length) = lanes.physics, drawn.uniform.shape
    truth, perceived = np.zeros(total, physics.truth.dtype), np.zeros(total, lanes.perceived.dtype)
    # whose turn comes later begins when the one before has ended
    for turn in range(int(drawn.turn.max()) + 1):
        of_turn = np.flatnonzero(drawn.turn == turn)
        for first in range(0, len(of_turn), lanes.n):
            every = of_turn[first : first + lanes.n]
            ids = np.arange(len(every))
            lanes.begin(ids, drawn.beginning, every)
            if turn:
                lanes.skip(ids, truth["steps"][every - 1])
            for k in range(length):
                rows, seen = every[ids], lanes.observe(ids)
                chance = robot(seen, rows)
                ids = driving.decide(
                    ids, rows, k, seen, chance, drawn.uniform, kept, physics.state, physics.truth,
                    lanes.perceived,
                )  # fmt: skip
                if not len(ids):
                    break
                over = lanes.walk(ids)
                if len(kept.pose):  # of those who ran out of time
                    kept.pose[every[ids[over]], k + 1] = physics.state[ids[over]]
                ids = ids[~over]
                if not len(ids):
                    break
            physics.check()
            there = slice(0, len(every))
            truth[every], perceived[every] = physics.truth[there], lanes.perceived[there]
    return services(drawn, facts_of(truth, perceived), kept, lanes.settings)


def empty(drawn: Drawn, *, recorded: bool, moments: bool = False) -> Kept:
    """What will be written down of services that have been drawn."""
    total, length = drawn.uniform.shape
    size = task.observation_size(drawn.setups.one_hot.shape[1])
    return Kept(
        np.zeros((total, length, size), np.float32),
        np.zeros((total, length), np.int32),
        np.zeros((total, length), np.float32),
        np.full((total if recorded else 0, length + 1, 3), np.nan),
        np.zeros((total if moments else 0, length), driving.MOMENT),
    )


def services(drawn: Drawn, facts: Facts, kept: Kept, settings: task.TaskSettings) -> Trajectories:
    """What was written down, once the services have ended."""
    seen = None
    if len(kept.pose):
        sensed = kept.observation[:, :, task.DISTANCE] * task.DISTANCE_UNIT
        sensed = np.where(kept.mask == 1.0, sensed, np.nan)
        seen = recording.make(drawn.setups, kept.pose, sensed, settings.interval)
    return Trajectories(facts, drawn.setups.codes, kept.observation, kept.action, kept.mask, seen)
