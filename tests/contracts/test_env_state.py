"""Copies and saved states go on bit for bit like the original, and refuse what does not fit."""

import copy
import json
import pickle
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, VectorEnv

import evenhand.restaurant  # noqa: F401 - registers the environment
from evenhand.adapters import JudgeServices, JudgeVectorServices
from evenhand.adapters.restaurant import SCHEME, facts_of
from evenhand.core.errors import InputError
from evenhand.restaurant.env import RestaurantEnv
from evenhand.restaurant.env_base import BLOCK
from evenhand.restaurant.observation import ScaleObservation, ScaleVectorObservation
from evenhand.restaurant.vector import RestaurantVectorEnv
from support.refusals import refused

ID = "evenhand/Restaurant-v0"
SETTINGS = [{}, {"interval": 15, "needs": 1.0}, {"interval": 10, "perception": 1.0, "noise": 0.1}]
LANES = 3


def running(env: Any = None, seed: int = 3) -> Any:
    env = env or RestaurantEnv()
    env.reset(seed=seed)
    many = isinstance(env, RestaurantVectorEnv)
    env.step(np.zeros(env.num_envs, int) if many else 0)
    return env


def through_state(env: Any) -> Any:
    """Another environment, used before, in a state that went through JSON."""
    given = {f.name: getattr(env.settings, f.name) for f in fields(env.settings) if f.init}
    if isinstance(env, RestaurantVectorEnv):
        given |= {"num_envs": env.num_envs, "autoreset_mode": env.autoreset_mode}
    other: Any = running(type(env)(**given), 99)
    other.set_state(json.loads(json.dumps(env.get_state())))
    return other


def pickled(env: Any) -> Any:
    return pickle.loads(pickle.dumps(env))


WAYS: list[Callable[[Any], Any]] = [copy.deepcopy, pickled, through_state]


def steps(env: gym.Env[Any, Any], rng: np.random.Generator, n: int) -> list[Any]:
    """What n calls of a single environment give."""
    told: list[Any] = []
    for _ in range(n):
        told.append(env.step(int(rng.random() < 0.1)))
        if told[-1][2] or told[-1][3]:
            told.append(env.reset())
    return told


def many_steps(envs: VectorEnv[Any, Any, Any], rng: np.random.Generator, n: int) -> list[Any]:
    """The same of many environments; a lane that has ended is reset, where it has to be."""
    told: list[Any] = []
    for _ in range(n):
        told.append(envs.step((rng.random(envs.num_envs) < 0.1).astype(int)))
        if "final_obs" in told[-1][4]:
            told[-1][4]["final_obs"] = list(told[-1][4]["final_obs"])
        ended = told[-1][2] | told[-1][3]
        if envs.metadata["autoreset_mode"] is AutoresetMode.DISABLED and ended.any():
            told.append(envs.reset(options={"reset_mask": ended}))
    return told


def assert_go_on_alike(one: Any, other: Any, n: int = 150) -> None:
    go_on: Any = many_steps if isinstance(one, VectorEnv) else steps
    mine = go_on(one, np.random.default_rng(7), n)
    np.testing.assert_equal(go_on(other, np.random.default_rng(7), n), mine)
    states = [each.get_state() for each in (one.unwrapped, other.unwrapped)]  # type: ignore[attr-defined]
    assert states[0] == states[1]


class TestOneRestaurant:
    @pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
    @pytest.mark.parametrize("settings", SETTINGS, ids=str)
    def test_in_the_middle_of_a_service(self, settings, way):
        env = RestaurantEnv(**settings)
        env.reset(seed=3)
        steps(env, np.random.default_rng(0), 43)
        assert_go_on_alike(env, way(env))

    @pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
    def test_before_any_service_and_without_a_seed(self, way):
        env = RestaurantEnv()
        other = way(env)
        with pytest.raises(RuntimeError, match="call reset"):
            other.step(0)
        np.testing.assert_equal(other.reset(), env.reset())
        assert_go_on_alike(env, other)

    @pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
    def test_after_the_end_of_a_service(self, way):
        env = RestaurantEnv()
        env.reset(seed=3)
        env.step(1)
        other = way(env)
        with pytest.raises(RuntimeError, match="the service has ended"):
            other.step(0)
        np.testing.assert_equal(other.reset(), env.reset())
        assert_go_on_alike(env, other)

    @pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
    @pytest.mark.parametrize("service", [BLOCK - 1, BLOCK, BLOCK + 1])
    def test_where_services_are_drawn_anew(self, service, way):
        env = RestaurantEnv()
        env.reset(seed=3)
        for _ in range(service - 1):
            env.step(1)
            env.reset()
        assert_go_on_alike(env, way(env))

    def test_back_to_the_same_state_again_and_again(self):
        env = RestaurantEnv()
        env.reset(seed=3)
        steps(env, np.random.default_rng(0), 10)
        state = env.get_state()
        kept = copy.deepcopy(state)
        first = steps(env, np.random.default_rng(1), 2 * BLOCK * 10)
        for _ in range(2):
            env.set_state(state)
            again = steps(env, np.random.default_rng(1), 2 * BLOCK * 10)
            np.testing.assert_equal(again, first)
        assert state == kept  # nothing was written into it

    def test_what_a_copy_does_leaves_the_original_alone(self):
        env, twin = RestaurantEnv(), RestaurantEnv()
        for one in (env, twin):
            one.reset(seed=3)
            one.step(0)
        steps(copy.deepcopy(env), np.random.default_rng(0), 100)
        assert_go_on_alike(env, twin)

    def test_a_seed_counts_after_a_state(self):
        env, other = RestaurantEnv(), RestaurantEnv()
        env.reset(seed=3)
        other.set_state(env.get_state())
        np.testing.assert_equal(other.reset(seed=4), env.reset(seed=4))
        assert other.np_random_seed == 4

    def test_copies_keep_the_seed_and_the_actions_that_are_sampled(self):
        env = RestaurantEnv()
        env.reset(seed=3)
        env.action_space.seed(5)
        for way in (copy.deepcopy, pickled):
            other = way(env)
            assert other.np_random_seed == 3
            mine = copy.deepcopy(env.action_space)
            assert [other.action_space.sample() for _ in range(9)] == [
                mine.sample() for _ in range(9)
            ]

    def test_of_its_own_wrappers_too(self):
        env = ScaleObservation(gym.make(ID, max_episode_steps=7))
        env.reset(seed=3)
        for _ in range(4):
            env.step(0)
        assert env.spec is not None
        for way in (copy.deepcopy, pickled):
            other = way(env)
            assert other.spec == env.spec
            ends = [other.step(0)[3] for _ in range(3)]
            assert ends == [False, False, True]  # the limit has counted on

    def test_of_the_wrapper_that_judges(self):
        env = JudgeServices(RestaurantEnv(), SCHEME, facts_of)
        env.reset(seed=3)
        steps(env, np.random.default_rng(0), 100)
        other, before = copy.deepcopy(env), len(env.ledger)
        assert_go_on_alike(env, other)
        assert other.ledger.services() == env.ledger.services()
        assert len(other.ledger) > before

    def test_pictures_go_on(self, opengl):
        env = RestaurantEnv(render_mode="rgb_array", camera="guest")
        env.reset(seed=3)
        env.step(0)
        before = env.render()
        other = pickled(env)
        np.testing.assert_array_equal(other.render(), before)
        other.step(0)
        assert not np.array_equal(other.render(), before)  # type: ignore[arg-type]
        np.testing.assert_array_equal(env.render(), before)
        for one in (env, other):
            one.close()


class TestManyRestaurants:
    @pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
    @pytest.mark.parametrize("mode", list(AutoresetMode))
    def test_in_the_middle_of_services(self, mode, way):
        envs = RestaurantVectorEnv(LANES, mode, interval=10, needs=1.0)
        envs.reset(seed=3)
        many_steps(envs, np.random.default_rng(0), 40)
        assert_go_on_alike(envs, way(envs), 20 * BLOCK)

    @pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED])
    def test_with_lanes_that_have_ended(self, mode):
        envs = RestaurantVectorEnv(LANES, mode)
        envs.reset(seed=3)
        envs.step(np.array([0, 1, 0]))
        other = through_state(envs)
        if mode is AutoresetMode.DISABLED:
            with pytest.raises(RuntimeError, match=r"lanes \[1\] have ended"):
                other.step(np.zeros(LANES, int))
            mask = {"reset_mask": np.array([False, True, False])}
            np.testing.assert_equal(other.reset(options=mask), envs.reset(options=mask))
        assert_go_on_alike(envs, other)

    @pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
    def test_before_any_service_and_without_a_seed(self, way):
        envs = RestaurantVectorEnv(LANES)
        other = way(envs)
        with refused("range reset_mask"):
            other.reset(options={"reset_mask": np.array([True, False, False])})
        np.testing.assert_equal(other.reset(), envs.reset())
        assert_go_on_alike(envs, other)

    def test_on_another_number_of_threads(self):
        envs = RestaurantVectorEnv(LANES, threads=1)
        other = RestaurantVectorEnv(LANES, threads=2)
        envs.reset(seed=3)
        many_steps(envs, np.random.default_rng(0), 20)
        other.set_state(envs.get_state())
        assert_go_on_alike(envs, other)
        assert_go_on_alike(other, copy.deepcopy(other))

    def test_with_a_limit(self):
        envs = gym.make_vec(ID, LANES, max_episode_steps=7)
        envs.reset(seed=3)
        for _ in range(4):
            envs.step(np.zeros(LANES, int))
        other = copy.deepcopy(envs)
        assert [other.step(np.zeros(LANES, int))[3].all() for _ in range(3)] == [False, False, True]

    def test_of_wrappers(self):
        scaled = ScaleVectorObservation(RestaurantVectorEnv(LANES, AutoresetMode.SAME_STEP))
        scaled.reset(seed=3)
        assert_go_on_alike(pickled(scaled), scaled)
        envs = JudgeVectorServices(scaled, SCHEME, facts_of)
        envs.reset(seed=4)
        many_steps(envs, np.random.default_rng(0), 50)
        other, before = copy.deepcopy(envs), len(envs.ledger)
        assert_go_on_alike(envs, other)
        assert other.ledger.services() == envs.ledger.services()
        assert len(other.ledger) > before


def changed(state: dict[str, Any], name: str, value: Any) -> dict[str, Any]:
    return state | {name: value}


class TestWrongStates:
    def refused(self, state: Any, said: str, env: Any = None) -> None:
        """A state is refused, and the environment goes on as if nothing had been tried."""
        env, twin = running(env), running(copy.deepcopy(env))
        with pytest.raises(InputError, match=said):
            env.set_state(state)
        assert_go_on_alike(twin, env)

    @pytest.mark.parametrize("state", [None, [], "state", 3])
    def test_no_state(self, state):
        self.refused(state, "a state is a dictionary, not")

    @pytest.mark.parametrize("version", [0, 1, "2", None])
    def test_of_another_version(self, version):
        state = changed(running().get_state(), "version", version)
        self.refused(state, f"the state has version {version}, and this Evenhand reads version 2")

    @pytest.mark.parametrize(
        ("settings", "said"),
        [
            ({"interval": 10}, "interval=10, and here it is 5"),
            ({"population": "us"}, "population='us', and here it is 'uniform'"),
            ({"needs": 0.5}, "needs=0.5, and here it is 0.0"),
        ],
    )
    def test_of_other_settings(self, settings, said):
        self.refused(running(RestaurantEnv(**settings)).get_state(), said)

    def test_of_many_for_one_and_of_one_for_many(self):
        one, many = RestaurantEnv(), RestaurantVectorEnv(1)
        self.refused(running(many).get_state(), "environment='RestaurantVectorEnv'", one)
        self.refused(running(one).get_state(), "environment='RestaurantEnv'", many)

    @pytest.mark.parametrize(
        ("others", "said"),
        [
            ({"num_envs": 4}, "num_envs=4, and here it is 3"),
            ({"autoreset_mode": "Disabled"}, "autoreset_mode='Disabled'"),
            ({"max_episode_steps": 9}, "max_episode_steps=9, and here it is None"),
        ],
    )
    def test_of_other_lanes(self, others, said):
        state = running(RestaurantVectorEnv(**{"num_envs": 3} | others)).get_state()
        self.refused(state, said, RestaurantVectorEnv(3))

    @pytest.mark.parametrize("name", sorted(running().get_state()))
    @pytest.mark.parametrize("value", [None, [], {}, [None], "", [[1.0]], [float("nan")], ["x"]])
    def test_that_is_damaged(self, name, value):
        self.refused(changed(running().get_state(), name, value), "state")

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("steps", [295]),  # not what the timer shows
            ("steps", [-5]),
            ("next", [3]),  # beyond the way
            ("next", [-1]),
            ("next", [2**70]),
            ("rows", [BLOCK]),
            ("rows", [-1]),
            ("responded", [1]),
            ("reading", [float("inf")]),
            ("generators", [{"bit_generator": "MT19937"}]),
            ("generators", [{"bit_generator": "PCG64", "state": {"state": -1, "inc": 1}}]),
            ("origins", [{"bit_generator": ["PCG64"]}]),
        ],
    )
    def test_with_numbers_that_cannot_be(self, name, value):
        self.refused(changed(running().get_state(), name, value), f"damaged at '{name}'")

    def test_that_lacks_something(self):
        state = running().get_state()
        for name in state:
            self.refused({k: v for k, v in state.items() if k != name}, "state")

    def test_drawn_differently_elsewhere(self):
        state = running().get_state()
        state["checksums"] = [state["checksums"][0] ^ 1]
        self.refused(state, "the services of this state come out differently here")

    def test_of_a_generator_that_is_more_than_two_numbers(self):
        env = RestaurantEnv()
        env.np_random = np.random.Generator(np.random.MT19937(0))
        env.reset()
        with refused("unsupported np_random"):
            env.get_state()
