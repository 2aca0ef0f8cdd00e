"""Services lane by lane: what is left to chance in them, and running them to their ends.

A robot is a function from what it perceives to the probability of responding; a learned policy
and a scripted robot are the same here. Most callers want ``restaurant.serve_people``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from evenhand.restaurant import floor_plan
from evenhand.restaurant.scenarios import needs, sensing
from evenhand.restaurant.simulation import kernels, layout, recording, task
from evenhand.restaurant.simulation.lanes import Beginning, Facts, Lanes
from evenhand.restaurant.simulation.recording import Recording

Robot = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(observation float32 [n, G + 3], rows int [n]) -> probability of responding now [n].

``rows`` tells which of the services of this call the observations belong to, so that a robot can
hold a plan for each service.
"""


@dataclass(frozen=True)
class Services:
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
    """

    setups: layout.Setups
    beginning: Beginning
    uniform: np.ndarray


def draw(
    lanes: Lanes,
    setups: layout.Setups,
    rng: np.random.Generator,
    sense: sensing.SenseSettings,
    wanted: needs.NeedSettings | None = None,
    also_missed: np.ndarray | None = None,
) -> Drawn:
    """Leave to chance what can be drawn before the services begin.

    Args:
        lanes: prepare the services.
        setups: N services.
        rng: randomness of readings, needs and actions, in this order.
        sense: the distance sensor.
        wanted: who needs another service; nobody by default.
        also_missed: see ``sensing.draw``.
    """
    total, length = len(setups), lanes.settings.decisions
    elapsed = lanes.settings.interval * floor_plan.TIMESTEP
    chances = sensing.draw(sense, setups.asking, length + 1, elapsed, rng, also_missed)
    people_need = needs.draw(wanted or needs.NeedSettings(), setups.asking, rng)
    uniform = rng.random((total, length))
    return Drawn(setups, lanes.prepare(setups, chances, people_need), uniform)


def run(lanes: Lanes, drawn: Drawn, robot: Robot, *, recorded: bool = False) -> Services:
    """Run services that have been drawn to their ends.

    Args:
        lanes: simulations to use; takes ``lanes.n`` services at a time.
        drawn: N services.
        robot: who serves.
        recorded: keep what was to be seen.
    """
    total, length = drawn.uniform.shape
    kept = Kept.empty(drawn, recorded=recorded)
    pose = kept.pose
    arrays = (kept.observation, kept.action, kept.mask)
    parts = []
    for first in range(0, total, lanes.n):
        ids = active = np.arange(min(lanes.n, total - first))
        lanes.begin(ids, drawn.beginning, ids + first)
        for k in range(length):
            known = lanes.observe(active)
            row = active + first
            if pose is not None:
                pose[row, k] = lanes.world.state[active]
            responding, active = kernels.decide(
                active, row, k, known, robot(known, row), drawn.uniform, arrays
            )
            lanes.respond(responding)
            if len(active):
                over = lanes.walk(active)
                if over.any():
                    if pose is not None:
                        pose[active[over] + first, k + 1] = lanes.world.state[active[over]]
                    active = active[~over]
            if not len(active):
                break
        parts.append(lanes.facts(ids))
    facts = Facts(
        **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Facts)}
    )
    return kept.services(drawn.setups, facts, lanes.settings)


@dataclass(frozen=True)
class Kept:
    """What is written down while N services run; see ``Services``.

    Attributes:
        observation: float32 [N, L, G + 3].
        action: int32 [N, L].
        mask: float32 [N, L].
        pose: of the robot at every decision and at a time-out, [N, L + 1, 3], if it is recorded.
    """

    observation: np.ndarray
    action: np.ndarray
    mask: np.ndarray
    pose: np.ndarray | None

    @classmethod
    def empty(cls, drawn: Drawn, *, recorded: bool) -> Kept:
        """Before N services of L decisions at most."""
        total, length = drawn.uniform.shape
        size = task.observation_size(drawn.setups.one_hot.shape[1])
        return cls(
            np.zeros((total, length, size), np.float32),
            np.zeros((total, length), np.int32),
            np.zeros((total, length), np.float32),
            np.full((total, length + 1, 3), np.nan) if recorded else None,
        )

    def services(
        self, setups: layout.Setups, facts: Facts, settings: task.TaskSettings
    ) -> Services:
        """Once they have ended."""
        seen = None
        if self.pose is not None:
            sensed = self.observation[:, :, task.DISTANCE] * task.DISTANCE_UNIT
            sensed = np.where(self.mask == 1.0, sensed, np.nan)
            seen = recording.make(setups, self.pose, sensed, settings.interval)
        return Services(facts, setups.codes, self.observation, self.action, self.mask, seen)
