"""The environments serve in any world, as ``serve_people`` and the trainer do."""

import copy
import json
import pickle
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

import evenhand as ev
from evenhand.restaurant import people, worlds
from evenhand.restaurant.env import RestaurantEnv
from evenhand.restaurant.env_base import RestaurantSettings
from evenhand.restaurant.observation import ScaleObservation, scale
from evenhand.restaurant.serve_people import serve_people
from evenhand.restaurant.vector import RestaurantVectorEnv
from support.refusals import refused

TONGUE = ev.Identity("language", ("local", "foreign"))
LANES = 64


def served(n: int, respond_at: float, **settings) -> tuple[np.ndarray, dict, np.ndarray]:
    """Codes, facts and rewards of n services whose robot responds within so many metres."""
    envs = RestaurantVectorEnv(LANES, "SameStep", threads=1, **settings)
    seen, info = envs.reset(seed=7)
    who, codes, facts, rewards = info["identities"], [], [], []
    while len(codes) < n:
        seen, reward, ended, _, info = envs.step((seen[:, -3] * 5 < respond_at).astype(int))
        for lane in np.flatnonzero(ended):
            told = info["final_info"]["facts"]
            codes.append(who[lane])
            facts.append({k: v[lane] for k, v in told.items() if not k.startswith("_")})
            rewards.append(reward[lane])
        who = np.where(ended[:, None], info.get("identities", who), who)
    return (
        np.array(codes),
        {k: np.array([f[k] for f in facts]) for k in facts[0]},
        np.array(rewards),
    )


def same(one: gym.Env, other: gym.Env) -> None:
    """Two environments serve alike, to the bit."""
    for action in [0] * 12 + [1]:
        for a, b in zip(one.step(action)[:2], other.step(action)[:2], strict=True):
            np.testing.assert_array_equal(np.asarray(a), np.asarray(b))


class TestScenarios:
    """By name, or as a ``World``."""

    @pytest.mark.parametrize(
        ("scenario", "settings"),
        [
            ("even", {}),
            ("perception", {"perception": 1.0}),
            ("minority", {"population": "us", "needs": 1.0}),
            ("perception+minority", {"perception": 1.0, "population": "us", "needs": 1.0}),
        ],
    )
    def test_a_name_stands_for_its_settings(self, scenario, settings):
        one = gym.make("evenhand/Restaurant-v0", scenario=scenario)
        other = gym.make("evenhand/Restaurant-v0", **settings)
        assert np.array_equal(one.reset(seed=3)[0], other.reset(seed=3)[0])
        same(one, other)

    def test_what_is_given_replaces_what_the_scenario_says(self):
        settings = RestaurantSettings(scenario="minority", needs=0.5)
        assert settings.world == replace(worlds.scenario("minority"), needs=0.5)

    def test_one_of_ones_own(self):
        worlds.register_scenario("blurred", world=ev.World(noise=0.4))
        one = RestaurantEnv(scenario="blurred")
        other = RestaurantEnv(noise=0.4)
        assert np.array_equal(one.reset(seed=0)[0], other.reset(seed=0)[0])
        same(one, other)

    def test_the_readings_that_a_world_misses(self):
        """Without a reading its age grows by the steps of a decision: 5 of 50 to the second."""
        world = ev.World(
            missed={"disability=Yes": 0.3}, shares={"disability": (0.5, 0.5)}, dropout=0.0
        )
        envs = RestaurantVectorEnv(200, threads=1, scenario=world)
        _, info = envs.reset(seed=0)
        wheelchair = info["identities"][:, 3] == 0
        assert wheelchair.mean() == pytest.approx(0.5, abs=0.11)
        failed = []
        for _ in range(20):
            failed.append(envs.step(np.zeros(200, int))[0][:, -1] > 0.0)
        rate = np.mean(failed, axis=0)
        assert rate[wheelchair].mean() == pytest.approx(0.3, abs=0.08)
        assert rate[~wheelchair].max() == 0.0

    def test_facts_are_those_of_serve_people(self):
        """The same world, served one way and the other: rates and means within three errors."""
        world = ev.World(noise=0.3, population="us", needs=1.0)
        _, facts, _ = served(1500, 1.4, scenario=world)
        done = serve_people(
            world, lambda seen, rows: (seen[:, -3] * 5 < 1.4).astype(float), 1500,
            np.random.default_rng(1),
        ).facts  # fmt: skip
        for ours, theirs in [
            (facts["responded"], done.responded),
            (facts["min_distance"] < 1.0, done.min_distance < 1.0),
            (facts["steps"] / 300, done.steps / 300),
        ]:
            spread = np.sqrt((ours.var() + theirs.var()) / 1500)
            assert ours.mean() == pytest.approx(theirs.mean(), abs=3 * spread + 1e-9)


class TestIdentities:
    """Worlds with identities of their own."""

    world = ev.World(identities=(TONGUE,), shares={"language": (0.8, 0.2)})

    def test_they_are_seen_and_told(self):
        env = RestaurantEnv(scenario=self.world)
        seen, info = env.reset(seed=0)
        assert env.observation_space.shape == (5,)
        assert env.observation_space.contains(seen)
        assert info["identities"].shape == (1,)
        assert seen[info["identities"][0]] == 1.0
        assert seen[:2].sum() == 1.0

    def test_they_come_as_often_as_the_world_says(self):
        codes, _, _ = served(1000, 1.3, scenario=self.world)
        assert (codes[:, 0] == 0).mean() == pytest.approx(0.8, abs=0.05)

    def test_they_are_scaled(self):
        env = ScaleObservation(RestaurantEnv(scenario=self.world))
        seen, _ = env.reset(seed=0)
        assert np.array_equal(seen, scale(env.unwrapped.reset(seed=0)[0]))
        assert env.observation_space.contains(seen)

    def test_many_at_once_are_one_each(self):
        envs = RestaurantVectorEnv(3, threads=1, scenario=self.world)
        seen, info = envs.reset(seed=5)
        for lane in range(3):
            one, told = RestaurantEnv(scenario=self.world).reset(seed=5 + lane)
            assert np.array_equal(seen[lane], one)
            assert np.array_equal(info["identities"][lane], told["identities"])

    def test_the_checker_of_gymnasium(self):
        from gymnasium.utils.env_checker import check_env

        check_env(RestaurantEnv(scenario=self.world), skip_render_check=True)


class TestTips:
    """The reward is what the operator makes of the service."""

    def test_by_hand(self):
        codes, facts, rewards = served(400, 1.4, scenario="tips")
        share = np.array([0.3, 0.5, 1.0, 1.0, 1.0])[codes[:, 2]]
        terms = {k: v for k, v in facts.items() if k.startswith("reward_")}
        quality = sum(v for k, v in terms.items() if k != "reward_safety")
        expected = share * quality + terms["reward_safety"] - 0.25 * facts["steps"] / 300
        assert rewards == pytest.approx(expected)
        assert len({*codes[:, 2]}) == 5

    def test_even_people_pay_alike(self):
        _, facts, rewards = served(200, 1.4, scenario="even")
        assert rewards == pytest.approx(sum(v for k, v in facts.items() if k.startswith("reward_")))


class TestStates:
    """States, copies and pickles."""

    @pytest.mark.parametrize("scenario", ["tips", TestIdentities.world], ids=["tips", "own"])
    @pytest.mark.parametrize(
        "way", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"]
    )
    def test_copies_go_on_alike(self, scenario, way):
        env = RestaurantEnv(scenario=scenario)
        env.reset(seed=0)
        env.step(0)
        same(env, way(env))

    def test_a_state_goes_through_json(self):
        env, other = (RestaurantEnv(scenario="everyday") for _ in range(2))
        env.reset(seed=0)
        env.step(0)
        other.set_state(json.loads(json.dumps(env.get_state())))
        same(env, other)

    @pytest.mark.parametrize(
        "scenario", ["perception", ev.World(shares={"disability": (1.0, 0.0)})]
    )
    def test_of_another_world(self, scenario):
        env = RestaurantEnv(scenario=scenario)
        env.reset(seed=0)
        with refused("changed state"):
            RestaurantEnv(scenario="even").set_state(env.get_state())

    def test_a_name_of_another_process(self, tmp_path):
        """What a script registers is unknown elsewhere, but goes along."""
        worlds.register_scenario("blurred", world=ev.World(noise=0.4))
        env = RestaurantEnv(scenario="blurred")
        env.reset(seed=0)
        kept = pickle.dumps(env)
        del worlds._SCENARIOS["blurred"]
        same(env, pickle.loads(kept))

    def test_of_another_population_of_the_same_name(self):
        one = people.population("us")
        other = one.altered(one.identities, {"disability": (1.0, 0.0)})
        assert one.name == other.name
        with refused("changed state"):
            RestaurantEnv(population=one).set_state(RestaurantEnv(population=other).get_state())


class TestRefused:
    """What an environment cannot serve in."""

    def test_an_unknown_scenario(self):
        with refused("unknown scenario", "'minoritty'", "'minority'"):
            gym.make("evenhand/Restaurant-v0", scenario="minoritty")

    def test_no_scenario(self):
        with refused("type scenario", "3"):
            RestaurantEnv(scenario=3)

    def test_facts_of_its_own(self):
        fact = ev.Fact("spilled", bool)
        world = ev.World(facts={fact: lambda done: np.zeros(len(done.facts.steps))})
        with refused("unsupported facts", "spilled"):
            RestaurantEnv(scenario=world)

    def test_people_keep_their_groups(self):
        assert RestaurantSettings().world == ev.World()
        assert RestaurantSettings().population == "uniform"
        assert len(people.GROUPS) == 22
