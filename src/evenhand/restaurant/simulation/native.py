"""Whole services as machine code, for robots that are networks.

``serve`` asks a robot of any kind at every decision; between two of them a policy that is a network
needs Python for nothing. Here each service runs from its beginning to its end in one call of MuJoCo
and the network, and threads take services as they become free. What comes out is what ``serve``
would give, but that a network's products are summed in another order: where a probability and a
random number differ in their last bits only, the decision could be another one.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import count
from typing import Any

import llvmlite.binding as llvm
import mujoco
import numpy as np

from evenhand.core import forks
from evenhand.core.errors import whole
from evenhand.core.processors import THREADS
from evenhand.restaurant import floor_plan
from evenhand.restaurant.simulation import driving, mujoco_library, scene, serve, task, world
from evenhand.restaurant.simulation.lanes import facts_of

_FUNCTIONS = {driving.STEP: "mj_step", driving.SET_STATE: "mj_setState"}
_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


@dataclass(frozen=True)
class Network:
    """A policy of two actions, walk and respond, as numbers; all of them float32.

    Attributes:
        weights: one matrix a layer, [inputs, outputs]; the last has two outputs.
        biases: one vector a layer, [outputs].
        centre: what is taken from an observation, [G + 3].
        scale: what it is multiplied by then, [G + 3].
        relu: the activation of the hidden layers; else tanh.
    """

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    centre: np.ndarray
    scale: np.ndarray
    relu: bool


@functools.cache
def found() -> bool:
    """Whether MuJoCo's functions could be found, and are known to compiled code."""
    for name, function in _FUNCTIONS.items():
        address = mujoco_library.address(function)
        if address is None:
            return False
        llvm.add_symbol(name, address)
    return True


class Engines:
    """One simulation for each thread."""

    def __init__(self, n: int, threads: int) -> None:
        """Make them.

        Args:
            n: services at a time.
            threads: how many; never more than services.

        Raises:
            InputError: for no threads, or more than a machine has.
            RuntimeError: when MuJoCo's functions could not be found; see ``found``.
        """
        if not found():  # compiled code would jump to nowhere
            raise RuntimeError("MuJoCo's functions could not be found")
        whole("threads", threads, *THREADS)
        threads = min(threads, n)
        self._models = [copy.copy(scene.still_model()) for _ in range(threads)]
        self._datas = [mujoco.MjData(model) for model in self._models]
        self._geoms = world.guest_geoms(self._models[0])
        self._fresh = np.empty(mujoco.mj_stateSize(self._models[0], _STATE))
        mujoco.mj_getState(self._models[0], self._datas[0], self._fresh, _STATE)
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None
        self._home = forks.Home("these simulations were made", "make them in the new process, or ")

    def run(
        self,
        drawn: serve.Drawn,
        network: Network,
        settings: task.TaskSettings,
        *,
        recorded: bool = False,
    ) -> serve.Services:
        """Run services that have been drawn to their ends; see ``serve.run``.

        Args:
            drawn: the services.
            network: who serves.
            settings: as they were drawn with.
            recorded: keep what was to be seen.

        Raises:
            InputError: in a process that was forked since, if other threads would have to help.
            RuntimeError: when a simulation became unstable.
        """
        if self._pool is not None:
            self._home.check()
        kept = serve.Kept.empty(drawn, recorded=recorded)
        begun, setups, n = drawn.beginning, drawn.setups, len(drawn.setups)
        truth, perceived = begun.rows.truth.copy(), begun.perceived.copy()
        lanes = (
            setups.position, setups.radius, begun.noise, truth, perceived,
            np.column_stack((setups.start, setups.heading)),
            np.zeros((n, 3)), np.zeros((n, 2)), np.zeros(n),
        )  # fmt: skip
        pose = np.empty((0, 0, 3)) if kept.pose is None else kept.pose
        arrays = (drawn.uniform, kept.observation, kept.action, kept.mask, pose)
        policy = (network.weights, network.biases, network.centre, network.scale, network.relu)
        numbers = (
            settings.interval, world.STEERED, floor_plan.MAX_STEPS, floor_plan.TIMESTEP,
            floor_plan.TOP_SPEED, floor_plan.MAX_ACCELERATION, task.UNITS, task.DISTANCE_LIMIT,
        )  # fmt: skip
        widest = max(w.shape[0] for w in network.weights)
        turns = count()

        def work(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            engine = _engine(model, data, self._fresh, self._geoms)
            wide = np.empty((2, widest), np.float32)
            for i in _below(turns, n):
                driving.serve(i, engine, lanes, policy, wide, arrays, numbers)

        first, *others = zip(self._models, self._datas, strict=True)
        with mujoco_library.untimed():
            pool = self._pool
            helping = [pool.submit(work, *other) for other in others if pool is not None]
            try:
                work(*first)
            finally:
                for one in helping:
                    one.result()
        for data in self._datas:
            if any(warning.number for warning in data.warning):
                raise RuntimeError("a simulation became unstable")
        return kept.services(setups, facts_of(truth, perceived), settings)


def _below(turns: Iterator[int], end: int) -> Iterator[int]:
    """Numbers below an end, of which each is given to one thread."""
    for i in turns:
        if i >= end:
            return
        yield i


def _engine(model: Any, data: Any, fresh: np.ndarray, geoms: np.ndarray) -> driving.Engine:
    sensors = data.sensordata
    return (
        model._address, data._address, fresh, _STATE, geoms,
        model.geom_pos, model.geom_size, data.qpos, data.ctrl,
        sensors[scene.SENSOR_PERSON], sensors[scene.SENSOR_TIMER :],
        sensors[scene.SENSOR_CONTACTS :],
    )  # fmt: skip
