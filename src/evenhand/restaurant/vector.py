"""Many restaurants at once as a Gymnasium vector environment."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from numbers import Integral
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from evenhand.core.errors import InputError, unknown, whole
from evenhand.core.processors import CORES
from evenhand.restaurant import state as states
from evenhand.restaurant.env_base import FACT_NAMES, Source, lanes_of, settings_from
from evenhand.restaurant.observation import observation_space
from evenhand.restaurant.pictures import RENDERING, Pictures, rendering
from evenhand.restaurant.simulation import kernels


class RestaurantVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many restaurants at once; lane i with seed s is ``RestaurantEnv`` with seed s + i.

    Spaces, rewards, facts and pictures are those of the single environment, batched. All three
    autoreset modes of Gymnasium are honoured. Copies and states work as those of ``RestaurantEnv``.
    """

    metadata: dict[str, Any] = RENDERING | {"autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        *,
        render_mode: str | None = None,
        camera: str = "room",
        max_episode_steps: int | None = None,
        **settings: Any,
    ) -> None:
        """Make the environments.

        Args:
            num_envs: how many lanes.
            autoreset_mode: what happens after the end of a service.
            threads: that step the physics, by default one for each processor that this process
                may use. Services are the same on any number, to the last bit.
            render_mode: None or "rgb_array".
            camera: which camera ``render`` shows, see ``dressing.CAMERAS``.
            max_episode_steps: decisions after which a service is truncated, as Gymnasium's
                ``TimeLimit`` does; None or -1 for none.
            **settings: of :class:`RestaurantSettings`.

        Raises:
            InputError: for an unknown setting, population, mode or camera, or fewer than one lane,
                thread or decision.
        """
        if num_envs < 1:
            raise InputError("range num_envs", f"num_envs is {num_envs}: give at least 1")
        self.settings = settings_from(settings)
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError:
            modes = [mode.value for mode in AutoresetMode]
            raise unknown("autoreset mode", str(autoreset_mode), modes, "autoreset_mode") from None
        if max_episode_steps not in (None, -1):
            whole("max_episode_steps", max_episode_steps, 1, sys.maxsize)
        self._limit = None if max_episode_steps == -1 else max_episode_steps
        self._pictures = Pictures(render_mode, camera)
        self.render_mode = render_mode
        self.num_envs = num_envs
        self.metadata = rendering(self.settings) | {"autoreset_mode": self.autoreset_mode}
        self.single_observation_space = observation_space(len(self.settings.world.groups))
        self.single_action_space = gym.spaces.Discrete(2)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._threads = threads
        self._rngs = [seeding.np_random()[0] for _ in range(num_envs)]
        self._begun = False
        self._ended = np.ones(num_envs, bool)
        self._all = np.arange(num_envs)
        self._furnish()

    def _furnish(self) -> None:
        world = self.settings.world
        threads = CORES if self._threads is None else self._threads
        self._lanes = lanes_of(world, self.num_envs, threads)
        self._source = Source(self._lanes, world)

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
        if not self._begun and len(ids) < n:
            raise InputError(
                "range reset_mask",
                "options['reset_mask'] leaves lanes out in which no service has begun yet: "
                "give no mask to the first reset",
            )
        for lane in ids:
            if seeds[lane] is not None:
                self._rngs[lane] = seeding.np_random(seeds[lane])[0]
                self._source.forget(int(lane))
        self._begun = True
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
                "type actions",
                f"actions must be {self.num_envs} numbers, each 0 (walk) or 1 (respond)",
            )
        if not self._begun:
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
        cut = self._truncated(responds, walks)
        if waiting:
            info |= self._begin(idle.nonzero()[0])
        self._ended = over = ended | cut
        done, spread = ended.nonzero()[0], {}
        if not len(done):
            rewards = np.zeros(self.num_envs)
        else:
            facts, rewards = self._source.finished(done)
            spread = {"facts": _masked(facts, ended), "_facts": ended}
        if self.autoreset_mode is not AutoresetMode.SAME_STEP:
            info |= spread
        elif over.any():
            done = over.nonzero()[0]
            final = np.empty(self.num_envs, object)
            final[done] = [*self._lanes.observe(done)]
            info |= {"final_obs": final, "_final_obs": over}
            info |= {"final_info": spread, "_final_info": over}
            info |= self._begin(done)
        return self._lanes.observe(), rewards, ended.copy(), cut, info

    def _truncated(self, responds: np.ndarray, walks: np.ndarray) -> np.ndarray:
        """Which of the lanes that decided something have done so as often as they may, bool [n]."""
        cut = np.zeros(self.num_envs, bool)
        if self._limit is not None:
            walked = self._lanes.physics.truth["steps"] // self.settings.interval
            cut[responds] = walked[responds] + 1 >= self._limit
            cut[walks] = walked[walks] >= self._limit
        return cut

    def render(self) -> tuple[np.ndarray, ...] | None:  # type: ignore[override]
        """A picture of each lane, uint8 [height, width, 3], or None without a render mode."""
        if self.render_mode is None or not self._begun:
            return None
        return tuple(self._pictures.of(self._source, lane) for lane in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Free the renderer."""
        del kwargs
        self._pictures.close()

    def get_state(self) -> dict[str, Any]:
        """The state, see ``RestaurantEnv.get_state``."""
        running = states.Running(self._rngs, self._begun, self._ended)
        return states.save(self._source, self._common(), running)

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from a state, see ``RestaurantEnv.set_state``."""
        running = states.restore(state, self._source, self._common())
        self._rngs, self._begun, self._ended = running.generators, running.begun, running.ended

    def _common(self) -> dict[str, Any]:
        return {
            "environment": type(self).__name__,
            "num_envs": self.num_envs,
            "autoreset_mode": self.autoreset_mode.value,
            "max_episode_steps": self._limit,
            **self.settings.plain(),
        }

    def __getstate__(self) -> dict[str, Any]:
        kept = {k: v for k, v in vars(self).items() if k not in ("_lanes", "_source")}
        return kept | {"state": self.get_state()}

    def __setstate__(self, kept: dict[str, Any]) -> None:
        vars(self).update({name: value for name, value in kept.items() if name != "state"})
        self._furnish()
        self.set_state(kept["state"])

    def _begin(self, ids: np.ndarray) -> dict[str, Any]:
        asking = self._source.begin(ids, self._rngs)
        identities = np.zeros((self.num_envs, asking.shape[1]), np.int64)
        identities[ids] = asking
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
        raise InputError(
            "shape seed", f"{len(each)} seeds for {n} lanes: give one number or one a lane"
        )
    for one in each:
        if one is not None and not isinstance(one, Integral):
            raise InputError(
                "type seed", f"seed {one!r} is no whole number: give one number or one a lane"
            )
    return [None if one is None else int(one) for one in each]


def _reset_mask(mask: Any, n: int) -> np.ndarray:
    if not isinstance(mask, np.ndarray) or mask.dtype != bool or mask.shape != (n,):
        raise InputError(
            "type reset_mask", f"options['reset_mask'] must be a bool array of {n} lanes"
        )
    if not mask.any():
        raise InputError(
            "empty reset_mask", "options['reset_mask'] names no lane: mark at least one"
        )
    return mask
