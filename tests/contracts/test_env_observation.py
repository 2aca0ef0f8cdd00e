"""What the environments show: alike alone and in a batch, alike from a seed, and within bounds."""

import re
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import evenhand.restaurant  # noqa: F401 - registers the environment
from evenhand.restaurant import people
from evenhand.restaurant.env import RestaurantEnv
from evenhand.restaurant.vector import RestaurantVectorEnv

ID = "evenhand/Restaurant-v0"


def some_actions(rng: np.random.Generator, n: int) -> np.ndarray:
    """Mostly walking, so that some services run out of time."""
    return (rng.random(n) < 0.03).astype(np.int64)


def assert_same(ours: Any, theirs: Any, where: str) -> None:
    """Same keys, types, dtypes and values, all the way down."""
    if isinstance(theirs, dict):
        assert isinstance(ours, dict)
        assert ours.keys() == theirs.keys(), where
        for key in theirs:
            assert_same(ours[key], theirs[key], f"{where}/{key}")
    elif theirs.dtype == object:
        assert ours.dtype == object, where
        for i, (a, b) in enumerate(zip(ours, theirs, strict=True)):
            assert (a is None) == (b is None), f"{where}/{i}"
            if b is not None:
                assert_same(a, b, f"{where}/{i}")
    else:
        assert ours.dtype == theirs.dtype, where
        np.testing.assert_array_equal(ours, theirs, err_msg=where, strict=True)


class TestBatchAndSingle:
    @pytest.mark.parametrize(
        "settings",
        [
            {},
            {"interval": 15, "dropout": 0.3},
            {"population": "fairface", "noise": 0.2},
            {"max_episode_steps": 12},
            {"max_episode_steps": 60},  # where a service runs out of time, too
            {"max_episode_steps": -1},
        ],
        ids=str,
    )
    @pytest.mark.parametrize("mode", list(AutoresetMode))
    def test_step_by_step(self, mode, settings):
        n = 4
        ours = gym.make_vec(ID, n, autoreset_mode=mode, **settings)
        theirs = SyncVectorEnv([lambda: gym.make(ID, **settings)] * n, autoreset_mode=mode)
        limit = settings.get("max_episode_steps", -1)
        rng = np.random.default_rng(0)
        seen, cut = np.zeros(2, int), False
        ended = np.zeros(n, bool)
        pair = ours.reset(seed=7), theirs.reset(seed=7)
        for name, a, b in zip(("seen", "info"), *pair, strict=True):
            assert_same(a, b, f"reset/{name}")
        for t in range(200):
            if mode is AutoresetMode.DISABLED and ended.any():
                options = {"reset_mask": ended.copy()}
                pair = ours.reset(options=options), theirs.reset(options=options)
                for name, a, b in zip(("seen", "info"), *pair, strict=True):
                    assert_same(a, b, f"{t}/reset/{name}")
            actions = some_actions(rng, n)
            pair = ours.step(actions), theirs.step(actions)
            for name, a, b in zip(("seen", "reward", "ended", "cut", "info"), *pair, strict=True):
                assert_same(a, b, f"{t}/{name}")
            ended = pair[0][2] | pair[0][3]
            seen += [ended.sum(), (ended & (actions == 0)).sum()]
            cut |= pair[0][3].any()
        assert seen[0] > n  # lanes were reset
        assert seen[1] > 0  # and services ran out of time
        assert cut == (limit > 0)

    def test_a_lane_is_the_single_environment_with_the_seed_after(self):
        many, one = RestaurantVectorEnv(3), RestaurantEnv()
        together, info = many.reset(seed=40)
        alone, single = one.reset(seed=42)
        np.testing.assert_array_equal(together[2], alone)
        np.testing.assert_array_equal(info["identities"][2], single["identities"])

    def test_beyond_the_services_drawn_at_a_time(self):
        # many more services than a lane draws at once
        ours = RestaurantVectorEnv(2, AutoresetMode.SAME_STEP)
        theirs = SyncVectorEnv([RestaurantEnv] * 2, autoreset_mode=AutoresetMode.SAME_STEP)
        ours.reset(seed=3)
        theirs.reset(seed=3)
        for t in range(80):
            pair = ours.step(np.ones(2, np.int64)), theirs.step(np.ones(2, np.int64))
            for name, a, b in zip(("seen", "reward", "ended", "cut", "info"), *pair, strict=True):
                assert_same(a, b, f"{t}/{name}")

    @pytest.mark.parametrize("seed", [[5, 5, 9], [None, 4, None]])
    def test_a_seed_for_each_lane(self, seed):
        many = RestaurantVectorEnv(3)
        together, _ = many.reset(seed=seed)
        for lane, one in enumerate(seed):
            if one is not None:
                np.testing.assert_array_equal(together[lane], RestaurantEnv().reset(seed=one)[0])

    def test_a_new_seed_for_lanes_that_are_reset(self):
        ours = RestaurantVectorEnv(3, AutoresetMode.DISABLED)
        theirs = SyncVectorEnv([RestaurantEnv] * 3, autoreset_mode=AutoresetMode.DISABLED)
        mask = np.array([True, False, True])
        for envs in (ours, theirs):
            envs.reset(seed=1)
            envs.step(np.ones(3, np.int64))
        options = {"reset_mask": mask}
        pair = ours.reset(seed=90, options=options), theirs.reset(seed=90, options=options)
        for a, b in zip(*pair, strict=True):
            assert_same(a, b, "reset")


def trace(env: RestaurantEnv, seed: int) -> list[Any]:
    """Everything an environment says in five services."""
    rng = np.random.default_rng(seed)
    said: list[Any] = []
    for service in range(5):
        observation, info = env.reset(seed=seed if service == 0 else None)
        said += [observation.tolist(), info["identities"].tolist()]
        ended = False
        while not ended:
            observation, reward, ended, _, info = env.step(int(rng.random() < 0.05))
            said += [observation.tolist(), reward, sorted(info.get("facts", {}).items())]
    return said


class TestDeterminism:
    def test_same_seed_same_bits(self):
        one, other = RestaurantEnv(), RestaurantEnv()
        first = trace(one, 5)
        assert repr(trace(other, 5)) == repr(first)
        assert repr(trace(one, 5)) == repr(first)  # whatever it did before
        assert repr(trace(one, 6)) != repr(first)

    def test_without_a_seed_two_environments_differ(self):
        seen = [RestaurantEnv().reset()[0].tolist() for _ in range(3)]
        assert len({tuple(one) for one in seen}) == 3

    def test_reset_without_a_seed_goes_on(self):
        env = RestaurantEnv()
        first, second = env.reset(seed=5)[0], env.reset()[0]
        assert (first != second).any()
        np.testing.assert_array_equal(env.reset(seed=5)[0], first)
        np.testing.assert_array_equal(env.reset()[0], second)


class TestObservation:
    def test_within_the_space_and_never_constant(self):
        envs = RestaurantVectorEnv(20, AutoresetMode.SAME_STEP)
        rng = np.random.default_rng(2)
        seen = [envs.reset(seed=0)[0]]
        services = 0
        while services < 400:
            observation, _, ended, _, _ = envs.step(some_actions(rng, 20))
            assert envs.observation_space.contains(observation)
            seen.append(observation)
            services += ended.sum()
        every = np.concatenate(seen)
        assert every.shape[1] == 25
        assert (every.min(axis=0) < every.max(axis=0)).all()
        # one of the categories of each identity
        first = 0
        for identity in people.IDENTITIES:
            size = len(identity.groups)
            assert (every[:, first : first + size].sum(axis=1) == 1.0).all()
            first += size

    def test_extreme_noise_stays_within_the_space(self):
        envs = RestaurantVectorEnv(10, AutoresetMode.SAME_STEP, noise=1.0, dropout=0.9)
        rng = np.random.default_rng(2)
        observation, _ = envs.reset(seed=0)
        oldest = 0.0
        for _ in range(200):
            assert envs.observation_space.contains(observation)
            oldest = max(oldest, float(observation[:, 24].max()))
            observation, *_ = envs.step(some_actions(rng, 10))
        assert oldest == 1.0  # older readings stay at 1

    def test_the_first_observation_by_hand(self):
        env = RestaurantEnv(noise=0.0, dropout=0.0)
        observation, info = env.reset(seed=4)
        expected = np.zeros(22)
        for code, first in zip(info["identities"], (0, 6, 9, 14, 16), strict=True):
            expected[first + code] = 1.0
        np.testing.assert_array_equal(observation[:22], expected)
        assert 2.0 <= observation[22] * 5.0 <= 4.5
        assert observation[23:].tolist() == [0.0, 0.0]

    def test_time_and_distance_go_on_by_hand(self):
        env = RestaurantEnv(interval=10, noise=0.0, dropout=0.0)
        before, _ = env.reset(seed=4)
        for decision in range(1, 30):
            after, *_ = env.step(0)
            assert after[23] == np.float32(decision * 10 / 300)
            assert after[24] == 0.0
            # at most 1.08 m/s for 0.2 s, and one step of 0.02 s of age
            assert abs(after[22] - before[22]) * 5.0 < 1.09 * 0.22
            before = after

    def test_the_tables_of_the_documentation(self):
        text = str(RestaurantEnv.__doc__)
        rows = re.findall(r"^ *\| ([\d-]+) \| (.+?) \| (.+?) \|$", text, re.MULTILINE)
        first = 0
        for identity, (index, meaning, unit) in zip(people.IDENTITIES, rows[:5], strict=True):
            last = first + len(identity.groups) - 1
            assert index == f"{first}-{last}"
            named, categories = meaning.split(": ")
            assert named.split()[0] == identity.name
            given = "I to VI" if identity.name == "skin" else ", ".join(identity.groups)
            assert categories == given
            assert unit == "one-hot"
            first = last + 1
        assert [row[0] for row in rows[5:]] == ["22", "23", "24"]
        assert [row[2] for row in rows[5:]] == ["5 m", "300", "1 s"]
        actions = re.findall(r"^ *\| (\d) \| (\w+): .+ \|$", text, re.MULTILINE)
        assert actions == [("0", "walk"), ("1", "respond")]
        assert RestaurantEnv().observation_space.shape == (25,)
        assert int(RestaurantEnv().action_space.n) == 2  # type: ignore[attr-defined]
