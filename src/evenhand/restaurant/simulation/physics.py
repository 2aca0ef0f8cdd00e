"""Many restaurants at once: placing, driving, and the true facts of what happened.

One batch of MuJoCo holds all simulations. They do not touch each other, so a service comes out the
same to the last bit on any number of threads.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch

from evenhand.core import forks
from evenhand.core.errors import whole
from evenhand.core.processors import THREADS
from evenhand.restaurant import floor_plan
from evenhand.restaurant.scenarios import needs
from evenhand.restaurant.simulation import clock, driving, kernels, layout, route, scene

STEERED = 5
"""Physics steps between two commands of the drive, whatever the interval of decisions."""
TRUTH = np.dtype(
    [
        ("way", complex, route.POINTS),
        ("front", complex),
        ("robot", complex),
        ("last", np.int64),
        ("next", np.int64),
        ("stop", float),
        ("start_distance", float),
        ("distance", float),
        ("min_distance", float),
        ("path_length", float),
        ("contact_steps", np.int64),
        ("steps", np.int64),
        ("room", float),
        ("reach", float),
        ("signal", float),
        ("responded", bool),
    ],
    align=True,
)
"""One service as it truly is. Lengths are in metres, points of the plane x + iy.

``way``: points to the person, the person last; ``front``: from the table to the person, 0 where no
seat's front is passed; ``robot``: where it was last seen; ``last`` and ``next``: points of the way,
the person and the one driven to; ``stop``: distance at which ``walk`` stops; ``start_distance``,
``distance``, ``min_distance``: of robot and person at the start, now, and at the least;
``path_length``: driven so far; ``contact_steps``: physics steps in which the robot touched
anything; ``steps``: since the service began; ``room``, ``reach``, ``signal``: see ``needs.Needs``;
``responded``: whether a response was noticed.
"""


@dataclass(frozen=True)
class Rows:
    """What begins N services in N simulations; first axis N.

    Attributes:
        state: of a simulation in the batch, [N, nstate].
        place: of the guests, metres, [N, 12, 2].
        radius: of the guests, metres, [N, 12].
        truth: ``TRUTH``, [N].
    """

    state: np.ndarray
    place: np.ndarray
    radius: np.ndarray
    truth: np.ndarray


class Physics:
    """n simulations of the restaurant, each with a service of its own.

    Attributes:
        truth: of every service, ``TRUTH``, [n].
        sensed: place of the person by the distance sensor, x and y in metres, [n, 2]. As MuJoCo
            leaves it after a step, a reading is one physics step old.
        clock: seconds since the service began by the timer, [n]; one physics step old likewise.
        time: column of ``simulation`` that holds the seconds since the service began.
    """

    def __init__(self, n: int, threads: int = 1) -> None:
        """Make the simulations.

        Args:
            n: how many.
            threads: that step them; never more than simulations.

        Raises:
            InputError: for no threads, or more than a machine has.
        """
        whole("threads", threads, *THREADS)
        self.n, threads = n, min(threads, n)
        model = scene.still_model()
        self._batch = Batch(model, n, threads)
        self._batch.reset()
        self._fresh = self._batch.state[:1].copy()
        self._qpos = self._batch.bind("qpos")
        self._ctrl = self._batch.bind("ctrl")
        sensor = self._batch.bind("sensordata")
        self.sensed, self.clock = sensor[:, :2], sensor[:, scene.SENSOR_TIMER]
        self._state = self._batch.state
        first = (self._qpos.ctypes.data - self._state.ctypes.data) // self._qpos.itemsize
        self._pose = slice(first, first + model.nq)
        time = self._batch.bind("time")
        self.time = (time.ctypes.data - self._state.ctypes.data) // time.itemsize
        self._home = None
        if threads > 1:
            self._home = forks.Home("this environment was made", "make it in the new process, or ")
            forks.hold(self._batch)
        self._geoms = self._batch.expand("geom_pos"), self._batch.expand("geom_size")
        self._guest_geoms = guest_geoms(model)
        self._all = np.arange(n)
        self.truth = np.zeros(n, TRUTH)

    @property
    def state(self) -> np.ndarray:
        """Pose of the robot: x, y (m), yaw (rad), [n, 3]."""
        return self._qpos

    @property
    def simulation(self) -> np.ndarray:
        """Everything that MuJoCo integrates, ``mjSTATE_INTEGRATION``, [n, nstate]."""
        return self._state

    @property
    def command(self) -> np.ndarray:
        """Commands of the drives: x, y (m/s), yaw (rad/s), [n, 3]."""
        return self._ctrl

    def prepare(self, setups: layout.Setups, wanted: needs.Needs | None = None) -> Rows:
        """What begins these services, ready to be copied into any simulation.

        Args:
            setups: N services.
            wanted: when the people notice a response; by default always.
        """
        n = len(setups)
        state = np.repeat(self._fresh, n, axis=0)
        state[:, self._pose] = np.column_stack((setups.start, setups.heading))
        truth = np.zeros(n, TRUTH)
        truth["way"], truth["front"], truth["last"] = setups.way, setups.front, setups.last
        truth["stop"] = setups.radius[:, 0] + floor_plan.ROBOT_RADIUS + floor_plan.STAND_OFF
        for name in ("start_distance", "distance", "min_distance"):
            truth[name] = setups.start_distance
        truth["reach"] = np.inf
        if wanted is not None:
            truth["room"], truth["reach"] = wanted.room, wanted.reach
            truth["signal"] = wanted.signal
        return Rows(state, setups.position, setups.radius, truth)

    def place(self, ids: np.ndarray, rows: Rows, at: np.ndarray) -> None:
        """Begin new services.

        Args:
            ids: simulations, sorted, int [k].
            rows: from ``prepare``.
            at: which of the rows, int [k].
        """
        # a state row and where guests are is all that a simulation is, so writing them is a reset
        kernels.place(
            ids,
            at,
            (rows.state, rows.truth, rows.place, rows.radius),
            self._state,
            self.truth,
            self._geoms,
            self._guest_geoms,
        )

    def walk(self, ids: np.ndarray | None, steps: int) -> None:
        """Drive towards the person for some physics steps.

        Args:
            ids: simulations that drive, sorted, int [k]; None for all.
            steps: physics steps.

        Raises:
            InputError: in a process that was forked since, if other threads would have to help.
        """
        if self._home is not None:
            self._home.check()
        moving = self._all if ids is None else ids
        for first in range(0, steps, STEERED):
            driving.follow(
                moving,
                self._qpos,
                self.truth,
                self._ctrl,
                floor_plan.TOP_SPEED,
                floor_plan.MAX_ACCELERATION,
            )
            # recorded after every physics step, so that no moment of coming close is missed
            with clock.untimed():
                seen = self._batch.rollout(
                    min(STEERED, steps - first), record=("qpos", "ncon"), ids=ids
                )
            driving.track(moving, seen["qpos"], seen["ncon"], self.truth)

    def check(self) -> None:
        """Whether all simulations are in order.

        Raises:
            RuntimeError: when one became unstable.
        """
        if self._batch.warning.any():
            raise RuntimeError("a simulation became unstable")


def simulation_of(setups: layout.Setups, row: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """One service before it begins in a simulation of its own, for rendering or for checking.

    Its model is ``scene.model()`` with the radii of these guests. Stepped with the same commands it
    goes as in ``Physics``, to the last bit.
    """
    model = copy.copy(scene.model())
    model.geom_size[guest_geoms(model), 0] = setups.radius[row]
    data = mujoco.MjData(model)
    data.qpos[:] = (*setups.start[row], setups.heading[row])
    data.mocap_pos[:] = _at_height(setups.position[row])
    data.mocap_quat[:] = _yaw_quaternion(setups.facing[row])
    return model, data


def guest_geoms(model: mujoco.MjModel) -> np.ndarray:
    """Numbers of the guests' footprints among the geoms, int [12]."""
    return np.array([model.geom(scene.footprint_name(i)).id for i in range(floor_plan.N_GUESTS)])


def _at_height(points: np.ndarray) -> np.ndarray:
    """Points of the plane [..., 2] at the height of footprints, [..., 3]."""
    height = np.full((*points.shape[:-1], 1), scene.FOOTPRINT_HEIGHT)
    return np.concatenate([points, height], axis=-1)


def _yaw_quaternion(yaw: np.ndarray) -> np.ndarray:
    """Rotation about the vertical, w first, [..., 4]."""
    out = np.zeros((*yaw.shape, 4))
    out[..., 0], out[..., 3] = np.cos(yaw / 2), np.sin(yaw / 2)
    return out
