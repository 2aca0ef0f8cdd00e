"""Vector environments of Gymnasium as Stable-Baselines3 wants them."""

# pyright: reportMissingImports=false
from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.vec_env import VecEnv, VecMonitor
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from evenhand.adapters.episodes import FINAL_OBS, of_lane
from evenhand.adapters.lane_log import mode_of, parted, statistics_of
from evenhand.core.errors import InputError
from evenhand.restaurant.observation import ScaleVectorObservation
from evenhand.restaurant.vector import RestaurantVectorEnv


def restaurant(
    num_envs: int = 30, seed: int | None = None, *, scaled: bool = True, **settings: Any
) -> VecMonitor:
    """The restaurant, many at once, with returns and lengths of services noted.

    Args:
        num_envs: how many restaurants.
        seed: of the first one; restaurant i gets ``seed + i``. Without one they are drawn anew.
        scaled: observe what ``ScaleVectorObservation`` gives; what is learned has to be tested so.
        **settings: of ``RestaurantSettings``.

    Raises:
        InputError: for an unknown setting or population, or fewer than one restaurant.
    """
    inner: VectorEnv[Any, Any, np.ndarray]
    inner = RestaurantVectorEnv(num_envs, AutoresetMode.SAME_STEP, **settings)
    env = ServiceVecEnv(ScaleVectorObservation(inner) if scaled else inner)
    if seed is not None:
        env.seed(seed)
    return VecMonitor(env)


class ServiceVecEnv(VecEnv):
    """All environments of one vector environment of Gymnasium, without a process for each.

    Where an episode ends, infos hold ``terminal_observation``, ``TimeLimit.truncated`` and all
    that the environment says of its end; ``reset_infos`` hold what it says of the next beginning.
    """

    def __init__(self, env: VectorEnv[Any, Any, np.ndarray]) -> None:
        """Take over a vector environment.

        Args:
            env: one that resets in the step in which an episode ends.

        Raises:
            InputError: for another autoreset mode, or where the metadata do not say it.
        """
        mode = mode_of(env)
        if mode is not AutoresetMode.SAME_STEP:
            raise InputError(
                "unsupported autoreset_mode",
                f"{env} resets {mode.value}, and Stable-Baselines3 wants the first observation of "
                "the next episode in the step that ends one: make it with AutoresetMode.SAME_STEP",
            )
        self.env = env
        self._statistics = statistics_of(env)
        self._actions: np.ndarray | None = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self) -> VecEnvObs:
        """Begin an episode everywhere, with the seeds and options that were set."""
        options = next((one for one in self._options if one), None)
        seeds: Any = None if all(one is None for one in self._seeds) else list(self._seeds)
        observations, infos = self.env.reset(seed=seeds, options=options)
        self.reset_infos = [of_lane(infos, lane) for lane in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return deepcopy(observations)

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """One step everywhere."""
        observations, rewards, terminated, truncated, told = self.env.step(self._actions)
        ended = terminated | truncated
        final, begun = parted(told, self._statistics)
        own = [of_lane(begun, lane) if begun else {} for lane in range(self.num_envs)]
        seen = told.get(FINAL_OBS, {})
        for lane in np.flatnonzero(ended).tolist():
            # what a lane says in this step is of the episode that begins
            self.reset_infos[lane] = own[lane]
            own[lane] = of_lane(final, lane)
            own[lane]["terminal_observation"] = seen[lane]
            own[lane]["TimeLimit.truncated"] = bool(truncated[lane] and not terminated[lane])
        # learners keep what they saw over the next step, in which it may be written over
        return deepcopy(observations), rewards.astype(np.float32), ended, own

    def close(self) -> None:
        """Close the vector environment."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """What all environments share, once for each."""
        found = getattr(self.env, attr_name)
        return [found for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set what all environments share.

        Raises:
            InputError: for some of them only.
        """
        self._all("set_attr", indices)
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the vector environment; its result stands for each.

        Raises:
            InputError: for some of them only.
        """
        self._all("env_method", indices)
        found = getattr(self.env, method_name)(*method_args, **method_kwargs)
        return [found for _ in range(self.num_envs)]

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No: there are no single environments that could be."""
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[np.ndarray | None]:
        """One picture of each, where the vector environment draws them."""
        drawn: Any = self.env.render()
        return list(drawn) if drawn is not None else [None] * self.num_envs

    def _all(self, what: str, indices: Any) -> None:
        if indices is not None and list(self._get_indices(indices)) != list(range(self.num_envs)):
            raise InputError(
                "unsupported indices",
                f"{what} for environments {indices}: they are one vector environment, so call it "
                "for all of them",
            )
