"""Scaled observations: one way for everybody, by hand and in every kind of vector environment."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeAwareObservation

import evenhand
from evenhand.restaurant.env import RestaurantEnv
from evenhand.restaurant.observation import ScaleObservation, ScaleVectorObservation, scale
from evenhand.restaurant.vector import RestaurantVectorEnv
from evenhand.training.observation import view
from evenhand.training.settings import TrainSettings
from support.refusals import refused

MODES = list(AutoresetMode)


def test_by_hand():
    # 1.0 m, 1.5 m and 10 m of 5 m; step 90 and 300 of 300; 0.5 s
    plain = np.zeros((3, 25), np.float32)
    plain[:, 3] = 1.0
    plain[:, 22:] = [[0.2, 0.3, 0.5], [0.3, 1.0, 0.0], [2.0, 0.0, 1.0]]
    scaled = scale(plain)
    assert scaled.dtype == np.float32
    np.testing.assert_array_equal(scaled[:, :22], plain[:, :22])
    by_hand = [[-0.6, 0.0, 0.5], [0.0, 2.1, 0.0], [10.2, -0.9, 1.0]]
    np.testing.assert_allclose(scaled[:, 22:], by_hand, atol=1e-6)


def test_it_is_what_evenhands_own_learner_takes():
    plain = RestaurantVectorEnv(20)
    env = ScaleVectorObservation(RestaurantVectorEnv(20))
    seen = plain.reset(seed=0)[0], env.reset(seed=0)[0]
    for _ in range(30):
        np.testing.assert_array_equal(view(TrainSettings(), seen[0]), seen[1])
        actions = np.zeros(20, int)
        seen = plain.step(actions)[0], env.step(actions)[0]


@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
def test_the_checker_of_gymnasium():
    check_env(ScaleObservation(RestaurantEnv()), skip_render_check=True)


def test_many_are_as_one_alone():
    one, many = ScaleObservation(RestaurantEnv()), ScaleVectorObservation(RestaurantVectorEnv(3))
    assert many.single_observation_space == one.observation_space
    assert many.observation_space.shape == (3, 25)
    np.testing.assert_array_equal(many.reset(seed=4)[0][1], one.reset(seed=5)[0])
    np.testing.assert_array_equal(many.step(np.zeros(3, int))[0][1], one.step(0)[0])


@pytest.mark.parametrize("mode", MODES)
def test_every_observation_lies_in_the_space_even_the_last_of_a_service(mode):
    kinds: dict[str, Any] = {"noise": 1.0, "dropout": 0.9}
    env = ScaleVectorObservation(RestaurantVectorEnv(3, mode, **kinds))
    plain = RestaurantVectorEnv(3, mode, **kinds)
    seen = env.reset(seed=1)[0], plain.reset(seed=1)[0]
    ends = 0
    for _ in range(150):
        assert env.observation_space.contains(seen[0])
        np.testing.assert_array_equal(seen[0], scale(seen[1]))
        told = env.step(np.zeros(3, int)), plain.step(np.zeros(3, int))
        ended = told[0][2]
        if mode is AutoresetMode.SAME_STEP and ended.any():
            for scaled, other in zip(*(one[4]["final_obs"] for one in told), strict=True):
                assert (scaled is None) == (other is None)
                if scaled is not None:
                    np.testing.assert_array_equal(scaled, scale(other))
                    assert env.single_observation_space.contains(scaled)
        ends += ended.sum()
        if mode is AutoresetMode.DISABLED and ended.any():
            for one in (env, plain):
                told[one is plain][0][:] = one.reset(options={"reset_mask": ended})[0]
        seen = told[0][0], told[1][0]
    assert ends > 3


@pytest.mark.parametrize("mode", MODES)
def test_around_gymnasiums_own_vector_environments(mode):
    inside = gym.make_vec(
        "evenhand/Restaurant-v0",
        2,
        vectorization_mode="sync",
        wrappers=[ScaleObservation],
        vector_kwargs={"autoreset_mode": mode},
    )
    outside = ScaleVectorObservation(SyncVectorEnv([RestaurantEnv] * 2, autoreset_mode=mode))
    for a, b in zip(inside.reset(seed=2)[0], outside.reset(seed=2)[0], strict=True):
        np.testing.assert_array_equal(a, b)
    one, other = inside.step(np.ones(2, int)), outside.step(np.ones(2, int))
    np.testing.assert_array_equal(one[0], other[0])
    if mode is AutoresetMode.SAME_STEP:
        for a, b in zip(one[4]["final_obs"], other[4]["final_obs"], strict=True):
            np.testing.assert_array_equal(a, b)


def test_it_is_public_and_made_again_from_its_spec():
    assert evenhand.ScaleObservation is ScaleObservation
    assert evenhand.ScaleVectorObservation is ScaleVectorObservation
    env = ScaleObservation(gym.make("evenhand/Restaurant-v0", interval=10))
    assert env.spec is not None
    again = gym.make(env.spec)
    np.testing.assert_array_equal(again.reset(seed=1)[0], env.reset(seed=1)[0])


@pytest.mark.parametrize(
    "env",
    [
        lambda: ScaleObservation(RestaurantEnv()),
        lambda: TimeAwareObservation(gym.make("evenhand/Restaurant-v0", max_episode_steps=9)),
        lambda: gym.make("CartPole-v1"),
    ],
)
def test_other_observations_are_refused(env):
    with refused("unsupported environment"):
        ScaleObservation(env())


def test_those_of_many_are_refused_alike():
    with refused("unsupported environment"):
        ScaleVectorObservation(ScaleVectorObservation(RestaurantVectorEnv(2)))
    with pytest.raises(TypeError, match=r"gymnasium\.vector\.VectorEnv"):
        ScaleVectorObservation(RestaurantEnv())  # type: ignore[arg-type]
