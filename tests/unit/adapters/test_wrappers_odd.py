"""Environments that go on with the arrays and dicts that they gave, and other ways of their own."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import RecordEpisodeStatistics
from gymnasium.wrappers.vector import RecordEpisodeStatistics as RecordVectorStatistics

from evenhand.adapters import (
    Fact,
    Identity,
    JudgeServices,
    JudgeSettings,
    JudgeVectorServices,
    Scheme,
    own_issue,
)
from support import toys
from support.refusals import refused
from support.toys import plainly

MODES = list(AutoresetMode)
SCHEME = Scheme(
    (Identity("who", ("a", "b")),),
    (Fact("first", float, may_miss=True), Fact("last", float, may_miss=True)),
    (own_issue("late", ["last"], lambda last: last > 2),),
)


def facts_of(first, last):
    """A facts function from what to read at the beginning and at the end; everybody is an a."""

    def told(ended):
        return {"who": ["a"] * len(ended), "first": first(ended), "last": last(ended)}

    return told


class Own(gym.Env[Any, int]):
    """Services of three steps, numbered from 1, in one array and one dict for ever."""

    observation_space: gym.Space[Any] = gym.spaces.Box(-1e9, 1e9, (1,), np.float64)
    action_space: gym.Space[Any] = gym.spaces.Discrete(2)

    def __init__(self):
        self.state, self.info, self.number = np.zeros(1), {"inner": {}}, 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.number, self.at = self.number + 1, 0
        self.state[0] = 100 * self.number
        self.info["inner"] |= {"battery": 1.0, "who": "ab"[self.number % 2]}
        return self.state, self.info

    def step(self, action):
        self.at += 1
        self.state += 1
        self.info["inner"]["battery"] -= 0.25
        return self.state, 1.0, self.at == 3, False, self.info


@pytest.mark.parametrize("kind", ["service", "levelup"])
def test_one_environment_that_goes_on_with_its_array_and_dict(kind):
    def told(ended):
        first, last = ended.first_info("inner.battery"), ended.observation[:, 0]
        return {"who": ended.info("inner.who"), "first": first, "last": last}

    env = JudgeServices(Own(), SCHEME, told, settings=JudgeSettings(method=kind))
    for _ in range(5):
        env.reset()
        while not env.step(0)[2]:
            pass
    services = env.services
    assert services.fact("last").tolist() == [103, 203, 303, 403, 503]
    assert services.fact("first").tolist() == [1.0] * 5
    assert services.identity("who")[0].tolist() == [1, 0, 1, 0, 1]


class Reusing(SyncVectorEnv):
    """Hands out its own arrays and dicts, and writes into them in every step."""

    def __init__(self, envs, mode):
        super().__init__(envs, copy=False, autoreset_mode=mode)
        self.own: dict[str, Any] = {}

    def step(self, actions):
        *given, infos = super().step(actions)
        return *given, self._into(infos, "infos")

    def reset(self, **options):
        seen, infos = super().reset(**options)
        return seen, self._into(infos, "infos")

    def _into(self, value: Any, place: str) -> Any:
        if isinstance(value, dict):
            mine = self.own.setdefault(place, {})
            mine.clear()
            mine |= {name: self._into(one, f"{place}.{name}") for name, one in value.items()}
            return mine
        mine = self.own.setdefault(place, value)
        mine[:] = value
        return mine


@pytest.mark.parametrize("mode", MODES)
def test_many_environments_that_go_on_with_their_arrays_and_dicts(mode):
    lanes, steps = 3, 120
    env = JudgeVectorServices(Reusing([toys.Toy] * lanes, mode), toys.SCHEME, toys.facts_of)
    env.reset(seed=2)
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(np.zeros(lanes, int))
        over = terminated | truncated
        if mode is AutoresetMode.DISABLED and over.any():
            env.reset(options={"reset_mask": over})
    services = env.services
    codes, groups = services.identity("who")
    who = np.array(groups)[codes]
    for lane in range(lanes):
        part = services.fact("lane") == lane
        expected = plainly(2 + lane, lane, steps)[: part.sum()]
        assert part.sum() > 15
        assert who[part].tolist() == [row[0] for row in expected]
        for place, name in ((3, "steps"), (4, "total"), (6, "seen"), (7, "delay")):
            values = [np.nan if row[place] is None else row[place] for row in expected]
            np.testing.assert_allclose(services.fact(name)[part], values, rtol=1e-6)


def vector(make, mode, facts, lanes=2, wrap=lambda env: env, **options):
    envs = wrap(SyncVectorEnv([make] * lanes, autoreset_mode=mode, **options))
    return JudgeVectorServices(envs, SCHEME, facts)


def run(env, steps):
    env.reset(seed=1)
    for _ in range(steps):
        env.step(np.zeros(env.num_envs, int))
    return env.services


@pytest.mark.parametrize("mode", MODES[:2])
@pytest.mark.parametrize("around", ["each", "all"])
def test_statistics_of_gymnasium_are_of_the_episode_that_ended(mode, around):
    told = facts_of(
        lambda ended: ended.first_info("episode.r"),
        lambda ended: ended.info("episode.r") - ended.reward,
    )
    if around == "each":
        env = vector(lambda: RecordEpisodeStatistics(toys.Toy()), mode, told)
    else:
        env = vector(toys.Toy, mode, told, wrap=lambda one: RecordVectorStatistics(one))
    services = run(env, 60)
    assert len(services) > 20
    np.testing.assert_allclose(services.fact("last"), 0.0, atol=1e-6)
    assert np.isnan(services.fact("first")).all()


def test_rewards_that_begin_as_whole_numbers():
    class Paid(SyncVectorEnv):
        def step(self, actions):
            seen, _, *rest = super().step(actions)
            self.at = getattr(self, "at", 0) + 1
            rewards = np.array([0, 0]) if self.at % 3 == 1 else np.array([0.5, 0.25])
            return seen, rewards, *rest

    told = facts_of(lambda ended: ended.steps, lambda ended: ended.reward)
    env = JudgeVectorServices(Paid([Own] * 2, autoreset_mode=AutoresetMode.SAME_STEP), SCHEME, told)
    assert run(env, 6).fact("last").tolist() == [1.0, 0.5, 1.0, 0.5]


class Growing(gym.Env[Any, int]):
    """Sees one number more in every service; three steps each."""

    observation_space: gym.Space[Any] = gym.spaces.Sequence(gym.spaces.Box(0, 9, ()), stack=True)
    action_space: gym.Space[Any] = gym.spaces.Discrete(2)

    def __init__(self):
        self.number = 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.number, self.at = self.number + 1, 0
        return np.zeros(self.number, np.float32), {}

    def step(self, action):
        self.at += 1
        return np.zeros(self.number, np.float32), 1.0, self.at == 3, False, {}


LENGTHS = facts_of(
    lambda ended: np.full(len(ended), np.nan), lambda ended: [len(one) for one in ended.observation]
)


def test_observations_of_several_shapes_are_a_list():
    env = JudgeServices(Growing(), SCHEME, LENGTHS)
    for _ in range(4):
        env.reset()
        while not env.step(0)[2]:
            pass
    assert env.services.fact("last").tolist() == [1, 2, 3, 4]


@pytest.mark.parametrize("mode", MODES[:2])
def test_observations_of_several_shapes_of_many_environments(mode):
    env = vector(Growing, mode, LENGTHS, observation_mode="different")
    assert run(env, 16).fact("last").tolist()[:8] == [1, 1, 2, 2, 3, 3, 4, 4]


class Numbered(Own):
    """Says which service it is, in both infos; the lane's own lengths."""

    def reset(self, *, seed=None, options=None):
        seen, _ = super().reset(seed=seed)
        self.length = 1 + (self.number + (seed or 0)) % 3
        return seen.copy(), {"number": self.number}

    def step(self, action):
        self.at += 1
        return self.state.copy(), 1.0, self.at >= self.length, False, {"number": self.number}


@pytest.mark.parametrize("kind", ["service", "levelup"])
@pytest.mark.parametrize("mode", MODES[:2])
def test_a_reset_of_some_lanes_leaves_the_beginnings_of_the_others(mode, kind):
    told = facts_of(lambda ended: ended.first_info("number"), lambda ended: ended.info("number"))
    envs = SyncVectorEnv([Numbered] * 3, autoreset_mode=mode)
    settings = JudgeSettings(5, kind)
    env = JudgeVectorServices(envs, SCHEME, told, settings=settings)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(300):
        env.step(np.zeros(3, int))
        mask = rng.random(3) < 0.2
        if mask.any():
            env.reset(options={"reset_mask": mask})
    services = env.services
    assert len(services) > 100
    np.testing.assert_array_equal(services.fact("first"), services.fact("last"))


@pytest.mark.parametrize("kind", ["service", "levelup"])
def test_a_reward_in_an_array_is_a_number(kind):
    class Listed(Own):
        def step(self, action):
            seen, reward, *rest = super().step(action)
            return seen, np.full(self.number and 1, reward), *rest  # type: ignore[return-value]

    totals = facts_of(lambda ended: ended.steps, lambda ended: ended.reward)
    env = JudgeServices(Listed(), SCHEME, totals, settings=JudgeSettings(2, kind))
    for _ in range(6):
        env.reset()
        while not env.step(0)[2]:
            pass
    assert env.services.fact("last").tolist() == [3.0] * 6


def test_several_rewards_at_once_are_refused():
    class Both(Own):
        def step(self, action):
            seen, reward, *rest = super().step(action)
            return seen, np.array([reward, reward]), *rest  # type: ignore[return-value]

    totals = facts_of(lambda ended: ended.steps, lambda ended: ended.reward)
    env = JudgeServices(Both(), SCHEME, totals)
    env.reset()
    env.step(0)
    env.step(0)
    with refused("shape environment", "2"):
        env.step(0)
