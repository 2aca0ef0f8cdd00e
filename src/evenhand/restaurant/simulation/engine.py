"""What steps services to their ends: whole services as machine code, or lane by lane.

``serve.run`` asks a robot of any kind at every decision, on ``mujoco.batch.Batch``. A network needs
no Python between two of them: then every thread runs one service after the other, with MuJoCo's
``mj_step`` called from compiled code. The results are those of ``serve.run``, to the last bit.

It stays because ``Batch`` needs a call from Python for every command, five physics steps: with it a
whole training took 1.16 (one thread) to 1.18 times (two threads) the processor time.
"""

from __future__ import annotations

import copy
import ctypes
import functools
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numba import types
from numba.experimental import function_type  # noqa: F401 (makes _Function known to Numba)

from evenhand.core import forks
from evenhand.core.errors import whole
from evenhand.core.processors import THREADS
from evenhand.restaurant import floor_plan
from evenhand.restaurant.simulation import clock, driving, physics, scene, serve, task
from evenhand.restaurant.simulation.lanes import Lanes, facts_of

LANES = 240
"""Most services at a time, lane by lane."""
_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


class _Function(types.WrapperAddressProtocol):
    """A function of MuJoCo as an argument of compiled code; pointers are addresses."""

    def __init__(self, address: int, *arguments: types.Type) -> None:
        self._address, self._signature = address, types.void(*arguments)

    def __wrapper_address__(self) -> int:
        return self._address

    def signature(self) -> Any:
        return self._signature


@functools.cache
def found() -> tuple[Any, Any] | None:
    """``mj_step`` and ``mj_setState``, or None where MuJoCo's library cannot be found."""
    pointer = types.intp
    folder = Path(mujoco.__file__).parent
    for path in (*folder.glob("libmujoco*"), *folder.glob("mujoco.dll")):
        try:
            library = ctypes.CDLL(str(path))
            step, set_state = (
                ctypes.cast(function, ctypes.c_void_p).value or 0
                for function in (library.mj_step, library.mj_setState)
            )
        except (OSError, AttributeError):
            continue
        return (
            _Function(step, pointer, pointer),
            _Function(set_state, pointer, pointer, types.uintp, types.int32),
        )
    return None


class Engine:
    """Serves with any robot; simulations are made when they are first needed, and kept."""

    def __init__(
        self, settings: task.TaskSettings, at_once: int, groups: int, threads: int = 1
    ) -> None:
        """Choose.

        Args:
            settings: when robots decide.
            at_once: most services at a time, lane by lane.
            groups: of people, as the robot is told them.
            threads: that step the physics; results are the same on any number.

        Raises:
            InputError: for no threads, or more than a machine has.
        """
        whole("threads", threads, *THREADS)
        self.settings, self._at_once, self._threads = settings, at_once, threads
        self._groups = groups
        self.one = Lanes(1, settings, 1, groups)
        """Prepares services; see ``serve.draw``."""
        self._home = forks.Home("these simulations were made", "make them in the new process, or ")
        self._pool = ThreadPoolExecutor(threads)

    @cached_property
    def _lanes(self) -> Lanes:
        return Lanes(self._at_once, self.settings, self._threads, self._groups)

    @cached_property
    def _simulations(self) -> list[tuple[mujoco.MjModel, mujoco.MjData]]:
        """One for each thread."""
        models = (copy.copy(scene.still_model()) for _ in range(min(self._threads, self._at_once)))
        return [(model, mujoco.MjData(model)) for model in models]

    def run(
        self,
        drawn: serve.Drawn,
        robot: serve.Robot,
        *,
        recorded: bool = False,
        kept: driving.Kept | None = None,
    ) -> serve.Trajectories:
        """Run services that have been drawn to their ends.

        Args:
            drawn: the services.
            robot: who serves.
            recorded: keep what was to be seen.
            kept: where it is written down; see ``serve.empty``.

        Raises:
            InputError: in a process that was forked since, if other threads would have to help.
            RuntimeError: when a simulation became unstable.
        """
        functions = found()
        if functions is None or not isinstance(robot, driving.Network):
            return serve.run(self._lanes, drawn, robot, recorded=recorded, kept=kept)
        simulations, n = self._simulations, len(drawn.setups)
        if len(simulations) > 1:
            self._home.check()
        rows, beginning = drawn.beginning.rows, drawn.beginning
        services = driving.ServiceArrays(
            rows.state, rows.place, rows.radius, drawn.uniform, beginning.noise,
            rows.truth.copy(), beginning.perceived.copy(), drawn.turn,
        )  # fmt: skip
        kept = kept or serve.empty(drawn, recorded=recorded)
        # a call costs as much as a few decisions, and several for each thread even out their work
        parties = np.flatnonzero(drawn.turn == 0)
        calls = 1 if len(simulations) == 1 else min(3 * len(simulations), len(parties))
        starts = [part[0] for part in np.array_split(parties, calls)]
        turns = iter(np.split(np.arange(n), starts[1:]))
        geoms = physics.guest_geoms(scene.still_model())
        pace = driving.Pace(
            self.settings.interval, physics.STEERED, floor_plan.MAX_STEPS, floor_plan.TIMESTEP,
            floor_plan.TOP_SPEED, floor_plan.MAX_ACCELERATION, task.UNITS, task.DISTANCE_LIMIT,
            self.one.physics.time,
        )  # fmt: skip

        def work(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            sensors = data.sensordata[None]
            simulation = driving.Simulation(
                model._address, data._address, _STATE, geoms, model.geom_pos,
                model.geom_size, data.qpos[None], data.ctrl[None], sensors[:, :2],
                sensors[:, scene.SENSOR_TIMER], sensors[:, scene.SENSOR_CONTACTS],
            )  # fmt: skip
            for ids in turns:
                driving.serve(ids, *functions, simulation, services, robot, pace, kept)

        first, *others = simulations
        with clock.untimed():
            helping = [self._pool.submit(work, *other) for other in others]
            try:
                work(*first)
            finally:
                for helper in helping:
                    helper.result()
        if any(warning.number for _, data in simulations for warning in data.warning):
            raise RuntimeError("a simulation became unstable")
        facts = facts_of(services.truth, services.perceived)
        return serve.services(drawn, facts, kept, self.settings)
