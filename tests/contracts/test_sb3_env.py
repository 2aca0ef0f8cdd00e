"""One vector environment for Stable-Baselines3 does what its own way of many environments does."""

# pyright: reportMissingImports=false
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from evenhand.core.errors import InputError
from evenhand.restaurant.env import RestaurantEnv
from evenhand.restaurant.observation import ScaleObservation, scale
from evenhand.restaurant.vector import RestaurantVectorEnv
from support.extras import wanted
from support.toys import Toy

wanted("stable_baselines3", "the extra sb3")

from stable_baselines3.common.vec_env import (  # noqa: E402
    DummyVecEnv,
    VecMonitor,
    VecNormalize,
)

from evenhand.adapters.sb3 import ServiceVecEnv, restaurant  # noqa: E402

LANES, STEPS = 3, 120


def pairs():
    """A way to make each environment alone, and many of them at once."""
    return {
        "restaurant": (RestaurantEnv, lambda: RestaurantVectorEnv(LANES, AutoresetMode.SAME_STEP)),
        "toy": (
            Toy,
            lambda: SyncVectorEnv([Toy] * LANES, autoreset_mode=AutoresetMode.SAME_STEP),
        ),
        "dict": (
            lambda: Toy("dict"),
            lambda: SyncVectorEnv(
                [lambda: Toy("dict")] * LANES, autoreset_mode=AutoresetMode.SAME_STEP
            ),
        ),
    }


@pytest.mark.parametrize("kind", ["restaurant", "toy", "dict"])
def test_the_same_as_many_single_environments(kind):
    single, many = pairs()[kind]
    ours = ServiceVecEnv(many())
    theirs = DummyVecEnv([single] * LANES)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    rng = np.random.default_rng(0)
    for env in (ours, theirs):
        env.seed(5)
    alike(ours.reset(), theirs.reset())
    alike(ours.reset_infos, theirs.reset_infos)
    ends = cut = 0
    for _ in range(STEPS):
        actions = (rng.random(LANES) < 0.05).astype(int)
        mine, others = ours.step(actions), theirs.step(actions)
        for a, b in zip(mine[:3], others[:3], strict=True):
            alike(a, b)
        for a, b, over in zip(mine[3], others[3], mine[2], strict=True):
            b.setdefault("TimeLimit.truncated", False)
            a.setdefault("TimeLimit.truncated", False)
            alike(a, b)
            cut += a["TimeLimit.truncated"]
            ends += over
        alike(ours.reset_infos, theirs.reset_infos)
    assert ends > 5
    assert (cut > 0) == (kind != "restaurant")


def alike(a, b):
    """The same values in the same places."""
    if isinstance(b, dict):
        assert set(a) == set(b)
        for name in b:
            alike(a[name], b[name])
    elif isinstance(b, list | tuple):
        assert len(a) == len(b)
        for one, other in zip(a, b, strict=True):
            alike(one, other)
    else:
        np.testing.assert_array_equal(a, b)


def test_types_are_those_that_its_learners_want():
    env = restaurant(LANES, seed=0)
    assert isinstance(env, VecMonitor)
    seen: Any = env.reset()
    assert (seen.shape, seen.dtype) == (
        (LANES, env.get_attr("single_observation_space")[0].shape[0]),
        np.float32,
    )
    seen, rewards, dones, infos = env.step(np.ones(LANES, int))
    assert (rewards.dtype, dones.dtype) == (np.float32, bool)
    assert dones.all()
    assert [info["episode"]["l"] for info in infos] == [1] * LANES
    assert [info["episode"]["r"] for info in infos] == pytest.approx(rewards.tolist(), abs=1e-5)


def test_observations_are_scaled_unless_they_are_wanted_plain():
    scaled, plain = restaurant(LANES, seed=0), restaurant(LANES, seed=0, scaled=False)
    assert plain.observation_space == RestaurantEnv().observation_space
    assert scaled.observation_space == ScaleObservation(RestaurantEnv()).observation_space
    seen: Any = plain.reset()
    np.testing.assert_array_equal(scaled.reset(), scale(seen))
    _, _, _, mine = scaled.step(np.ones(LANES, int))
    _, _, _, others = plain.step(np.ones(LANES, int))
    for one, other in zip(mine, others, strict=True):
        last = scale(other["terminal_observation"])
        np.testing.assert_array_equal(one["terminal_observation"], last)


def test_seeds_count_once_and_are_one_a_lane():
    one, other = restaurant(2, seed=7), restaurant(2, seed=8)
    first: Any = one.reset()
    second: Any = other.reset()
    np.testing.assert_array_equal(first[1], second[0])
    again: Any = one.reset()
    assert not np.array_equal(again, first)


def test_its_wrappers_work_on_it():
    env = VecNormalize(ServiceVecEnv(pairs()["toy"][1]()))
    seen: Any = env.reset()
    for _ in range(20):
        seen = env.step(np.zeros(LANES, int))[0]
    assert np.abs(seen).max() < 10


def test_attributes_and_methods_are_shared():
    env = ServiceVecEnv(RestaurantVectorEnv(LANES, AutoresetMode.SAME_STEP, needs=0.5))
    assert [one.needs for one in env.get_attr("settings")] == [0.5] * LANES
    assert len(env.get_attr("settings", [0, 2])) == 2
    assert not env.has_attr("nonsense")
    env.set_attr("mark", 3)
    assert env.get_attr("mark") == [3] * LANES
    assert env.env_is_wrapped(gym.Wrapper) == [False] * LANES
    assert len(env.env_method("reset")) == LANES
    env.close()


@pytest.mark.parametrize("what", ["set_attr", "env_method"])
def test_some_lanes_only_are_refused(what):
    env = ServiceVecEnv(RestaurantVectorEnv(LANES, AutoresetMode.SAME_STEP))
    arguments = ("mark", 3) if what == "set_attr" else ("reset",)
    with pytest.raises(InputError, match=rf"^{what} for environments \[1\]: .* all of them$"):
        getattr(env, what)(*arguments, indices=[1])


@pytest.mark.parametrize(
    ("mode", "said"),
    [(AutoresetMode.NEXT_STEP, "resets NextStep"), (AutoresetMode.DISABLED, "resets Disabled")],
)
def test_another_way_to_reset_is_refused(mode, said):
    with pytest.raises(InputError, match=rf"{said}, and .* AutoresetMode.SAME_STEP$"):
        ServiceVecEnv(RestaurantVectorEnv(LANES, mode))


@pytest.mark.parametrize(
    ("metadata", "said"),
    [
        ({}, "does not say how it resets: set metadata"),
        ({"autoreset_mode": "NextStep"}, "resets NextStep, and .* AutoresetMode.SAME_STEP$"),
        ({"autoreset_mode": "same step"}, "unknown autoreset mode 'same step': did you mean 'Sam"),
    ],
)
def test_environments_that_do_not_say_so_are_refused(metadata, said):
    env = RestaurantVectorEnv(LANES, AutoresetMode.SAME_STEP)
    env.metadata = metadata
    with pytest.raises(InputError, match=said):
        ServiceVecEnv(env)
    env.metadata = {"autoreset_mode": "SameStep"}
    assert ServiceVecEnv(env).num_envs == LANES


def test_statistics_of_gymnasium_stand_with_the_episode_that_ended():
    inner = SyncVectorEnv([Toy] * LANES, autoreset_mode=AutoresetMode.SAME_STEP)
    env = ServiceVecEnv(RecordEpisodeStatistics(inner))
    env.reset()
    total, ends = np.zeros(LANES), 0
    for _ in range(40):
        _, rewards, dones, infos = env.step(np.zeros(LANES, int))
        total += rewards
        for info, begun, over, paid in zip(infos, env.reset_infos, dones, total, strict=True):
            assert ("episode" in info) == over
            assert "episode" not in begun
            if over:
                assert info["episode"]["r"] == pytest.approx(paid, abs=1e-5)
        ends += dones.sum()
        total[dones] = 0.0
    assert ends > 20


def test_what_was_seen_is_not_written_over():
    envs = (
        ServiceVecEnv(SyncVectorEnv([Toy], copy=copy, autoreset_mode=AutoresetMode.SAME_STEP))
        for copy in (False, True)
    )
    found: list[list[Any]] = []
    for env in envs:
        env.seed(3)
        found.append([env.reset(), *(env.step(np.zeros(1, int))[0] for _ in range(9))])
    np.testing.assert_array_equal(found[0], found[1])
