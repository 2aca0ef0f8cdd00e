"""Many restaurants at once: placing, driving, and the true facts of what happened.

One batch of MuJoCo holds all simulations on one thread; processes are for seeds.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from evenhand.restaurant import layout, plan, scene, task

_VEL = int(mujoco.mjtStage.mjSTAGE_VEL)


class World:
    """n simulations of the restaurant, each with a service of its own.

    Attributes:
        steps: physics steps since the service began, int64 [n].
        distance: true distance of robot and person, metres, [n].
        min_distance: least true distance so far, metres, [n].
        path_length: metres driven so far, [n].
        contact_steps: physics steps in which the robot touched anything, int64 [n].
    """

    def __init__(self, n: int) -> None:
        self.n = n
        self._batch = Batch(scene.model(), n, 1)
        self._batch.reset()
        self._fresh = self._batch.state[:1].copy()
        self._qpos = self._batch.bind("qpos")
        self._ctrl = self._batch.bind("ctrl")
        self._mocap = self._batch.bind("mocap_pos")
        self._quat = self._batch.bind("mocap_quat")
        self._sensor = self._batch.bind("sensordata")
        sizes = self._batch.expand("geom_size")
        names = [f"{scene.guest_name(i)}_footprint" for i in range(plan.N_GUESTS)]
        self._guest_geoms = np.array([scene.model().geom(name).id for name in names])
        self._sizes = sizes
        self._person = np.zeros((n, 2))
        self._radius = np.zeros(n)
        self._seat = np.zeros((n, 2))
        self._access = np.zeros((n, 2))
        self._discs = np.zeros((n, len(plan.TABLES) + plan.N_GUESTS - 1, 2))
        self._around = np.zeros((n, len(plan.TABLES) + plan.N_GUESTS - 1))
        self.steps = np.zeros(n, np.int64)
        self.distance = np.zeros(n)
        self.min_distance = np.zeros(n)
        self.path_length = np.zeros(n)
        self.contact_steps = np.zeros(n, np.int64)

    @property
    def position(self) -> np.ndarray:
        """Centre of the robot, metres, [n, 2]."""
        return self._qpos[:, :2]

    @property
    def state(self) -> np.ndarray:
        """Pose of the robot: x, y (m), yaw (rad), [n, 3]."""
        return self._qpos

    @property
    def command(self) -> np.ndarray:
        """Commands of the drives: x, y (m/s), yaw (rad/s), [n, 3]."""
        return self._ctrl

    @property
    def sensed(self) -> np.ndarray:
        """What the distance sensor measures now, metres, [n]."""
        return np.hypot(self._sensor[:, 0], self._sensor[:, 1])

    @property
    def timer(self) -> np.ndarray:
        """What the timer shows, physics steps, int64 [n]."""
        return np.rint(self._sensor[:, scene.SENSOR_TIMER] / plan.TIMESTEP).astype(np.int64)

    def place(self, ids: np.ndarray, setups: layout.Setups) -> None:
        """Begin new services.

        Args:
            ids: simulations, sorted, int [k].
            setups: one set-up each, k rows.
        """
        # a state row is all that a simulation is, so a fresh one is a reset
        self._batch.state[ids] = self._fresh
        self._qpos[ids, :2] = setups.start
        self._qpos[ids, 2] = setups.heading
        self._mocap[ids, :, :2] = setups.position
        self._mocap[ids, :, 2] = scene.FOOTPRINT_HEIGHT
        self._quat[ids] = _yaw_quaternion(setups.facing)
        self._sizes[ids[:, None], self._guest_geoms, 0] = setups.radius
        self._batch.forward(ids, stage=_VEL)
        self._person[ids] = setups.position[:, 0]
        self._radius[ids] = setups.radius[:, 0]
        self._seat[ids] = setups.seat
        self._access[ids] = setups.access
        self._discs[ids] = setups.discs
        self._around[ids] = setups.around
        self.steps[ids] = 0
        self.distance[ids] = self.min_distance[ids] = setups.start_distance
        self.path_length[ids] = 0.0
        self.contact_steps[ids] = 0

    def walk(self, ids: np.ndarray | None, steps: int) -> None:
        """Drive towards the person for some physics steps.

        Args:
            ids: simulations that drive, sorted, int [k]; None for all.
            steps: physics steps.
        """
        pick: Any = slice(None) if ids is None else ids
        person = self._person[pick]
        self._ctrl[pick] = task.steer(
            self._qpos[pick, :2],
            self._qpos[pick, 2],
            person,
            self._radius[pick],
            self._seat[pick],
            self._access[pick],
            self._discs[pick],
            self._around[pick],
        )
        before = self._qpos[pick, None, :2].copy()
        # recorded after every physics step, so that no moment of coming close is missed
        seen = self._batch.rollout(steps, record=("qpos", "ncon"), ids=ids)
        self._batch.forward(ids, stage=_VEL)  # sensors at the new state, not a step behind
        track = seen["qpos"][:, :, :2]
        gap = person[:, None] - track
        distance = np.sqrt(gap[..., 0] ** 2 + gap[..., 1] ** 2)
        move = np.diff(track, axis=1, prepend=before)
        self.distance[pick] = distance[:, -1]
        self.min_distance[pick] = np.minimum(self.min_distance[pick], distance.min(axis=1))
        self.path_length[pick] += np.sqrt(move[..., 0] ** 2 + move[..., 1] ** 2).sum(axis=1)
        self.contact_steps[pick] += (seen["ncon"] > 0).sum(axis=1)
        self.steps[pick] += steps

    def snapshot(self, sim: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one simulation, for rendering or for checking."""
        return self._batch.get_model(sim), self._batch.get_data(sim)


def _yaw_quaternion(yaw: np.ndarray) -> np.ndarray:
    """Rotation about the vertical, w first, [..., 4]."""
    out = np.zeros((*yaw.shape, 4))
    out[..., 0], out[..., 3] = np.cos(yaw / 2), np.sin(yaw / 2)
    return out
