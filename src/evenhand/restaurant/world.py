"""Many restaurants at once: placing, driving, and the true facts of what happened.

One batch of MuJoCo holds all simulations on one thread; processes are for seeds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from evenhand.restaurant import layout, plan, route, scene, task

_PLACED = ("qpos", "mocap_pos", "mocap_quat")
_STEERED = 5
"""Physics steps between two commands of the drive, whatever the interval of decisions."""
_REACHED = 0.20
"""Metres from a corner of the way at which the robot turns to the next point."""


@dataclass(frozen=True)
class Rows:
    """What begins N services in N simulations; first axis N.

    Attributes:
        state: integration state of MuJoCo, [N, nstate].
        radius: of the guests, metres, [N, 12].
        way: points to the person, complex [N, 3].
        front: from the table to the person, 0 where no seat's front is passed, complex [N].
        last: index of the person in the way, int64 [N].
        stop: distance at which ``walk`` stops, metres, [N].
        distance: true distance at the start, metres, [N].
    """

    state: np.ndarray
    radius: np.ndarray
    way: np.ndarray
    front: np.ndarray
    last: np.ndarray
    stop: np.ndarray
    distance: np.ndarray


class World:
    """n simulations of the restaurant, each with a service of its own.

    Attributes:
        steps: physics steps since the service began, [n].
        distance: true distance of robot and person, metres, [n].
        min_distance: least true distance so far, metres, [n].
        path_length: metres driven so far, [n].
        contact_steps: physics steps in which the robot touched anything, [n].
    """

    def __init__(self, n: int) -> None:
        self.n = n
        self._batch = Batch(scene.model(), n, 1)
        self._batch.reset()
        self._fresh = self._batch.state[:1].copy()
        self._component = {name: self._columns(name) for name in _PLACED}
        self._qpos = self._batch.bind("qpos")
        self._ctrl = self._batch.bind("ctrl")
        self._sensor = self._batch.bind("sensordata")
        sizes = self._batch.expand("geom_size")
        names = [f"{scene.guest_name(i)}_footprint" for i in range(plan.N_GUESTS)]
        self._guest_geoms = np.array([scene.model().geom(name).id for name in names])
        self._sizes = sizes
        self._way = np.zeros((n, route.POINTS), complex)
        self._person = self._way[:, -1]
        self._front = np.zeros(n, complex)
        self._next = np.zeros(n, np.int64)
        self._last = np.zeros(n, np.int64)
        self._stop = np.zeros(n)
        self._all = np.arange(n)
        # one table, so that one look-up fetches all that a lane has gathered
        self._gathered = np.zeros((n, 5))
        (
            self.distance,
            self.min_distance,
            self.path_length,
            self.contact_steps,
            self.steps,
        ) = self._gathered.T

    def _columns(self, name: str) -> tuple[int, int]:
        """First column and number of columns of a field in the state rows."""
        view = self._batch.bind(name)
        first = (view.ctypes.data - self._batch.state.ctypes.data) // view.itemsize
        return first, view[0].size

    @property
    def state(self) -> np.ndarray:
        """Pose of the robot: x, y (m), yaw (rad), [n, 3]."""
        return self._qpos

    @property
    def command(self) -> np.ndarray:
        """Commands of the drives: x, y (m/s), yaw (rad/s), [n, 3]."""
        return self._ctrl

    def sensed(self, ids: np.ndarray | slice) -> np.ndarray:
        """What the distance sensor of these simulations reports, metres, [k].

        As MuJoCo leaves it after a step, a reading is one physics step old.
        """
        seen = self._sensor[ids]
        return np.sqrt(seen[:, 0] ** 2 + seen[:, 1] ** 2)

    def timer(self, ids: np.ndarray | slice) -> np.ndarray:
        """Physics steps since the service began, by the timer of these simulations, [k].

        Like every sensor it shows the moment before the last step, which is added; before the
        first step it has not been read.
        """
        shown = np.rint(self._sensor[ids, scene.SENSOR_TIMER] / plan.TIMESTEP) + 1.0
        return np.where(self.steps[ids] > 0, shown, 0.0)

    def prepare(self, setups: layout.Setups) -> Rows:
        """What begins these services, ready to be copied into any simulation."""
        n = len(setups)
        state = np.repeat(self._fresh, n, axis=0)
        for name, values in (
            ("qpos", np.concatenate([setups.start, setups.heading[:, None]], axis=1)),
            ("mocap_pos", _at_height(setups.position)),
            ("mocap_quat", _yaw_quaternion(setups.facing)),
        ):
            first, size = self._component[name]
            state[:, first : first + size] = values.reshape(n, -1)
        stop = setups.radius[:, 0] + plan.ROBOT_RADIUS + plan.STAND_OFF
        return Rows(
            state, setups.radius, setups.way, setups.front, setups.last, stop, setups.start_distance
        )

    def place(self, ids: np.ndarray, rows: Rows) -> None:
        """Begin new services.

        Args:
            ids: simulations, sorted, int [k].
            rows: from ``prepare``, k of them.
        """
        # a state row is all that a simulation is, so writing one is a reset
        self._batch.state[ids] = rows.state
        self._sizes[ids[:, None], self._guest_geoms, 0] = rows.radius
        self._way[ids], self._front[ids] = rows.way, rows.front
        self._next[ids], self._last[ids], self._stop[ids] = 0, rows.last, rows.stop
        self._gathered[ids] = 0.0
        self.distance[ids] = self.min_distance[ids] = rows.distance

    def walk(self, ids: np.ndarray | None, steps: int) -> None:
        """Drive towards the person for some physics steps.

        Args:
            ids: simulations that drive, sorted, int [k]; None for all.
            steps: physics steps.
        """
        pick: Any = slice(None) if ids is None else ids
        for first in range(0, steps, _STEERED):
            self._drive(ids, pick, min(_STEERED, steps - first))

    def _drive(self, ids: np.ndarray | None, pick: Any, steps: int) -> None:
        """Steer once, then step."""
        # commands for every lane cost less than picking some out; idle lanes do not move
        robot = self._qpos[:, 0] + 1j * self._qpos[:, 1]
        self._ctrl[:] = task.steer(
            robot, self._qpos[:, 2], self._target(robot), self.distance - self._stop
        )
        # recorded after every physics step, so that no moment of coming close is missed
        seen = self._batch.rollout(steps, record=("qpos", "ncon"), ids=ids)
        track = np.empty((len(seen["qpos"]), steps + 1), complex)
        track[:, 0] = robot[pick]
        track[:, 1:] = seen["qpos"][:, :, 0]
        track[:, 1:] += 1j * seen["qpos"][:, :, 1]
        distance = np.abs(track[:, 1:] - self._person[pick, None])
        gathered = self._gathered[pick]
        gathered[:, 0] = distance[:, -1]
        gathered[:, 1] = np.minimum(gathered[:, 1], distance.min(axis=1))
        gathered[:, 2] += np.abs(track[:, 1:] - track[:, :-1]).sum(axis=1)
        gathered[:, 3] += (seen["ncon"] > 0).sum(axis=1)
        gathered[:, 4] += steps
        self._gathered[pick] = gathered

    def _target(self, robot: np.ndarray) -> np.ndarray:
        """Next point of every way, complex [n]."""
        target = self._way[self._all, self._next]
        near = np.abs(target - robot) < _REACHED
        # the point before a seat may be skipped once the robot is in front of it
        ahead = route.in_front(robot, self._person, self._front) & (self._front != 0)
        near |= ahead & (self._next == self._last - 1)
        near &= self._next < self._last
        if near.any():
            self._next += near
            target = self._way[self._all, self._next]
        return target

    def snapshot(self, sim: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one simulation, for rendering or for checking."""
        return self._batch.get_model(sim), self._batch.get_data(sim)


def _at_height(points: np.ndarray) -> np.ndarray:
    """Points of the plane [..., 2] at the height of footprints, [..., 3]."""
    height = np.full((*points.shape[:-1], 1), scene.FOOTPRINT_HEIGHT)
    return np.concatenate([points, height], axis=-1)


def _yaw_quaternion(yaw: np.ndarray) -> np.ndarray:
    """Rotation about the vertical, w first, [..., 4]."""
    out = np.zeros((*yaw.shape, 4))
    out[..., 0], out[..., 3] = np.cos(yaw / 2), np.sin(yaw / 2)
    return out
