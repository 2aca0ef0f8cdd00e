"""What a robot observes, and how it is scaled for networks: one way for every learner."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import VectorEnv, VectorObservationWrapper, VectorWrapper
from gymnasium.vector.utils import batch_space

from evenhand.core.errors import InputError
from evenhand.restaurant.simulation import task

_CENTRE, _SCALE = (0.3, 0.3, 0.0), (6.0, 3.0, 1.0)
"""Of distance, time and age, behind the groups. A policy has to tell 1.0 m from 1.5 m, which are
0.2 and 0.3 in an observation. Spread out to 0.6 apart, they are learned from a fraction of the
services. The time likewise."""


def observation_space(groups: int = task.N_GROUPS) -> gym.spaces.Box:
    """What one lane observes of people of so many groups, see ``RestaurantEnv``."""
    high = np.ones(task.observation_size(groups), np.float32)
    high[task.DISTANCE] = task.DISTANCE_LIMIT
    return gym.spaces.Box(np.zeros_like(high), high, dtype=np.float32)


def numbers(groups: int) -> tuple[np.ndarray, np.ndarray]:
    """What is taken from an observation of so many groups, and what it is multiplied by then."""
    return (
        np.array([*np.zeros(groups), *_CENTRE], np.float32),
        np.array([*np.ones(groups), *_SCALE], np.float32),
    )


def scale(observation: np.ndarray) -> np.ndarray:
    """Distance and time centred and spread out, the rest as it is.

    Args:
        observation: float32 [..., G + 3].

    Returns:
        Of the same shape and type.
    """
    centre, factor = numbers(observation.shape[-1] + task.DISTANCE)
    return (observation - centre) * factor


class ScaleObservation(gym.ObservationWrapper[np.ndarray, Any, np.ndarray], RecordConstructorArgs):
    """Scales observations of ``RestaurantEnv`` as Evenhand's own learner takes them.

    The distance, 0.2 to 0.3 where a response is proper, becomes 6 (distance - 0.3); the time
    becomes 3 (time - 0.3). Without it, a network of the usual size needs many times more services
    to learn where to respond.
    """

    def __init__(self, env: gym.Env[np.ndarray, Any]) -> None:
        """Wrap an environment.

        Args:
            env: ``RestaurantEnv``, or a wrapper of one that leaves observations alone.

        Raises:
            InputError: for an environment that observes something else.
        """
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        self.observation_space = _scaled(env.observation_space)

    def observation(self, observation: np.ndarray) -> np.ndarray:
        """An observation, scaled."""
        return scale(observation)


class ScaleVectorObservation(VectorObservationWrapper[np.ndarray, Any, np.ndarray, np.ndarray]):
    """The same for ``RestaurantVectorEnv``, and any other vector environment of restaurants.

    All three autoreset modes are honoured: the last observation of a service that ends, which
    ``SAME_STEP`` puts into ``info["final_obs"]``, is scaled, too.
    """

    def __init__(self, env: VectorEnv[np.ndarray, Any, np.ndarray]) -> None:
        """Wrap a vector environment.

        Args:
            env: ``RestaurantVectorEnv``, Gymnasium's ``SyncVectorEnv`` or ``AsyncVectorEnv`` of
                ``RestaurantEnv``, or a wrapper of one that leaves observations alone.

        Raises:
            InputError: for environments that observe something else.
        """
        # the constructor between refuses SAME_STEP, since ``step`` there forgets final_obs
        VectorWrapper.__init__(self, env)
        self.single_observation_space = _scaled(env.single_observation_space)
        self.observation_space = batch_space(self.single_observation_space, env.num_envs)

    def observations(self, observations: np.ndarray) -> np.ndarray:
        """Observations, scaled."""
        return scale(observations)

    def step(
        self, actions: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One decision in every lane."""
        seen, rewards, terminated, truncated, info = super().step(actions)
        if "final_obs" in info:
            final = info["final_obs"].copy()
            for lane in np.flatnonzero(info["_final_obs"]):
                final[lane] = scale(final[lane])
            info = info | {"final_obs": final}
        return seen, rewards, terminated, truncated, info


def _scaled(space: gym.Space[Any]) -> gym.spaces.Box:
    """The space of scaled observations."""
    plain = observation_space(max(sum(space.shape or ()) + task.DISTANCE, 1))
    if space != plain:
        raise InputError(
            "unsupported environment",
            f"only observations of the restaurant can be scaled, and only once: {space} is "
            f"observed, not {plain}",
        )
    return gym.spaces.Box(scale(plain.low), scale(plain.high), dtype=np.float32)
