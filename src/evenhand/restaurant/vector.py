"""Many restaurants at once as a Gymnasium vector environment."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from evenhand.core.errors import InputError, unknown
from evenhand.core.processors import CORES
from evenhand.restaurant import people
from evenhand.restaurant.env_base import (
    FACT_NAMES,
    Source,
    finished,
    observation_space,
    settings_from,
)
from evenhand.restaurant.simulation import kernels, task
from evenhand.restaurant.simulation.lanes import Lanes


class RestaurantVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many restaurants at once; lane i with seed s is ``RestaurantEnv`` with seed s + i.

    Spaces, rewards and facts are those of the single environment, batched. All three autoreset
    modes of Gymnasium are honoured.
    """

    def __init__(
        self,
        num_envs: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        **settings: Any,
    ) -> None:
        """Make the environments.

        Args:
            num_envs: how many lanes.
            autoreset_mode: what happens after the end of a service.
            threads: that step the physics, by default one for each processor that this process
                may use. Services are the same on any number, to the last bit.
            **settings: of :class:`RestaurantSettings`.

        Raises:
            InputError: for an unknown setting, population or mode, or fewer than one lane or
                thread.
        """
        if num_envs < 1:
            raise InputError(f"num_envs is {num_envs}: give at least 1")
        self.settings = settings_from(settings)
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            modes = [mode.value for mode in AutoresetMode]
            raise unknown("autoreset mode", str(autoreset_mode), modes) from None
        self.num_envs = num_envs
        self.metadata = {"autoreset_mode": self.autoreset_mode, "render_modes": []}
        self.single_observation_space = observation_space()
        self.single_action_space = gym.spaces.Discrete(2)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        decide = task.TaskSettings(self.settings.interval)
        self._lanes = Lanes(num_envs, decide, CORES if threads is None else threads)
        self._source = Source(self._lanes, self.settings)
        self._rngs: list[np.random.Generator] = []
        self._ended = np.ones(num_envs, bool)
        self._all = np.arange(num_envs)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | np.ndarray | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin the next service in every lane, or in those of ``options["reset_mask"]``.

        Raises:
            InputError: for seeds that are no whole numbers or not one a lane, or a mask that is
                none, or that leaves a lane out in which no service has begun yet.
        """
        n = self.num_envs
        seeds = _seeds(seed, n)
        ids = self._all
        if options is not None and "reset_mask" in options:
            ids = np.flatnonzero(_reset_mask(options["reset_mask"], n))
        if not self._rngs:
            if len(ids) < n:
                raise InputError(
                    "options['reset_mask'] leaves lanes out in which no service has begun yet: "
                    "give no mask to the first reset"
                )
            self._rngs = [seeding.np_random(one)[0] for one in seeds]
        else:
            for lane in ids:
                if seeds[lane] is not None:
                    self._rngs[lane] = seeding.np_random(seeds[lane])[0]
                    self._source.forget(int(lane))
        info = self._begin(ids)
        return self._lanes.observe(), info

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One decision in every lane.

        Raises:
            InputError: for actions of the wrong shape or other than 0 and 1.
            RuntimeError: before the first reset, or, without autoreset, when a lane has ended.
        """
        actions = np.asarray(actions)
        valid = actions.shape == (self.num_envs,) and actions.dtype.kind in "biuf"
        if valid:
            valid, responds, walks = kernels.sort_out(actions, self._ended)
        if not valid:
            raise InputError(
                f"actions must be {self.num_envs} numbers, each 0 (walk) or 1 (respond)"
            )
        if not self._rngs:
            raise RuntimeError("call reset() before step()")
        idle = self._ended
        waiting = self.autoreset_mode is not AutoresetMode.SAME_STEP and idle.any()
        if waiting and self.autoreset_mode is AutoresetMode.DISABLED:
            lanes = np.flatnonzero(idle).tolist()
            raise RuntimeError(f"the services of lanes {lanes} have ended: reset these lanes first")
        info: dict[str, Any] = {}
        ended = np.zeros(self.num_envs, bool)
        if len(responds):
            self._lanes.respond(responds)
            ended[responds] = True
        if len(walks):
            ended[walks] = self._lanes.walk(walks)
        if waiting:
            info |= self._begin(idle.nonzero()[0])
        self._ended = ended
        done = ended.nonzero()[0]
        if not len(done):
            rewards = np.zeros(self.num_envs)
        else:
            facts, rewards = finished(self._lanes, done)
            spread = {"facts": _masked(facts, ended), "_facts": ended}
            if self.autoreset_mode is AutoresetMode.SAME_STEP:
                final = np.empty(self.num_envs, object)
                final[done] = [*self._lanes.observe(done)]
                info |= {"final_obs": final, "_final_obs": ended}
                info |= {"final_info": spread, "_final_info": ended}
                info |= self._begin(done)
            else:
                info |= spread
        never = np.zeros(self.num_envs, bool)
        return self._lanes.observe(), rewards, ended.copy(), never, info

    def _begin(self, ids: np.ndarray) -> dict[str, Any]:
        identities = np.zeros((self.num_envs, len(people.IDENTITIES)), np.int64)
        identities[ids] = self._source.begin(ids, self._rngs)
        begun = np.zeros(self.num_envs, bool)
        begun[ids] = True
        self._ended = self._ended & ~begun
        return {"identities": identities, "_identities": begun}


def _masked(facts: np.ndarray, ended: np.ndarray) -> dict[str, np.ndarray]:
    """Facts by name, each with the mask of the lanes that it is of."""
    out = {}
    for name in FACT_NAMES:
        out[name], out[f"_{name}"] = facts[name], ended
    return out


def _seeds(seed: int | Sequence[int | None] | np.ndarray | None, n: int) -> list[int | None]:
    """A seed for each lane: from one number s, s + 1, ..."""
    if seed is None:
        return [None] * n
    if isinstance(seed, int | Integral):
        return [int(seed) + i for i in range(n)]
    each = np.ravel(seed).tolist() if isinstance(seed, np.ndarray) else list(seed)
    if len(each) != n:
        raise InputError(f"{len(each)} seeds for {n} lanes: give one number or one a lane")
    for one in each:
        if one is not None and not isinstance(one, Integral):
            raise InputError(f"seed {one!r} is no whole number: give one number or one a lane")
    return [None if one is None else int(one) for one in each]


def _reset_mask(mask: Any, n: int) -> np.ndarray:
    if not isinstance(mask, np.ndarray) or mask.dtype != bool or mask.shape != (n,):
        raise InputError(f"options['reset_mask'] must be a bool array of {n} lanes")
    if not mask.any():
        raise InputError("options['reset_mask'] names no lane: mark at least one")
    return mask
