"""The environments keep Gymnasium's contract, agree with each other, and tell the truth."""

import re
import subprocess
import sys
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import evenhand.restaurant  # noqa: F401 - registers the environment
from evenhand import people
from evenhand.errors import InputError
from evenhand.interactions import FACTS, Interactions
from evenhand.restaurant.env import RestaurantEnv
from evenhand.restaurant.vector import RestaurantVectorEnv

ID = "evenhand/Restaurant-v0"
NAN = np.nan
SETTINGS = [
    {},
    *({"interval": interval} for interval in (1, 10, 60)),
    *({"population": name} for name in people.POPULATIONS),
    {"noise": 0.0, "dropout": 0.0},
    {"noise": 1.0, "dropout": 0.9},
    {"interval": 1, "population": "us", "noise": 1.0, "dropout": 0.9},
]


def some_actions(rng: np.random.Generator, n: int) -> np.ndarray:
    """Mostly walking, so that some services run out of time."""
    return (rng.random(n) < 0.03).astype(np.int64)


class TestGymnasium:
    @pytest.mark.parametrize("settings", SETTINGS, ids=str)
    def test_the_checker_of_gymnasium(self, settings):
        env = gym.make(ID, **settings)
        check_env(env.unwrapped, skip_render_check=True)
        env.close()

    def test_make_with_all_its_wrappers(self):
        env = gym.make(ID, interval=10)
        observation, _ = env.reset(seed=1)
        assert env.observation_space.contains(observation)
        ends = []
        for _ in range(30):
            *_, ended, truncated, _ = env.step(0)
            assert not truncated  # the time is part of the state: an end, not a cut
            ends.append(ended)
        assert ends == [False] * 29 + [True]
        again = gym.make(env.spec)  # type: ignore[arg-type]
        assert again.unwrapped.settings == env.unwrapped.settings  # type: ignore[attr-defined]
        env.close()

    def test_make_vec_takes_the_batch_by_itself(self):
        envs = gym.make_vec(ID, num_envs=3, population="us")
        assert isinstance(envs.unwrapped, RestaurantVectorEnv)
        assert envs.unwrapped.settings.population == "us"
        observation, info = envs.reset(seed=0)
        assert envs.observation_space.contains(observation)
        assert info["identities"].shape == (3, 5)
        envs.close()

    def test_make_vec_of_single_environments(self):
        envs = gym.make_vec(ID, num_envs=2, vectorization_mode="sync")
        envs.reset(seed=0)
        observation, *_ = envs.step(np.zeros(2, np.int64))
        assert envs.observation_space.contains(observation)
        envs.close()

    def test_spaces_of_the_batch_are_those_of_one(self):
        one, many = RestaurantEnv(), RestaurantVectorEnv(3)
        assert many.single_observation_space == one.observation_space
        assert many.single_action_space == one.action_space
        assert many.observation_space.shape == (3, 25)
        assert many.action_space.shape == (3,)

    @pytest.mark.parametrize(("interval", "fps"), [(1, 50), (5, 10), (10, 5), (50, 1)])
    def test_pictures_a_second_follow_the_interval(self, interval, fps):
        assert RestaurantEnv(interval=interval).metadata["render_fps"] == fps
        assert RestaurantEnv.metadata["render_fps"] == 10

    def test_without_a_render_mode_there_is_no_picture(self):
        env = RestaurantEnv()
        assert env.render() is None
        env.reset(seed=0)
        assert env.render() is None

    @pytest.mark.parametrize("mode", list(AutoresetMode))
    def test_the_autoreset_mode_is_declared(self, mode):
        assert RestaurantVectorEnv(1, mode).metadata["autoreset_mode"] is mode
        assert RestaurantVectorEnv(1, mode.value).metadata["autoreset_mode"] is mode


class TestRegistration:
    def run(self, code: str) -> str:
        command = [sys.executable, "-W", "error", "-c", code]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    def test_importing_the_restaurant_is_enough(self):
        made = self.run(
            "import gymnasium, evenhand.restaurant\n"
            f"print(gymnasium.make('{ID}').spec.id, gymnasium.make_vec('{ID}', 2).num_envs)"
        )
        assert made == f"{ID} 2"

    def test_gymnasium_can_import_it_by_name(self):
        made = self.run(
            f"import gymnasium\nprint(gymnasium.make('evenhand.restaurant:{ID}').spec.id)"
        )
        assert made == ID

    def test_registration_loads_no_physics(self):
        loaded = self.run(
            "import sys, evenhand.restaurant\n"
            "print([name for name in ('mujoco', 'jax', 'sklearn') if name in sys.modules])"
        )
        assert loaded == "[]"

    def test_importing_evenhand_loads_nothing_heavy(self):
        loaded = self.run(
            "import sys, evenhand\n"
            "heavy = ('gymnasium', 'jax', 'matplotlib', 'mujoco', 'numpy', 'pyarrow', 'sklearn')\n"
            "print([name for name in heavy if name in sys.modules])"
        )
        assert loaded == "[]"

    def test_registering_twice_changes_nothing(self):
        from evenhand.registration import register

        before = gym.registry[ID]
        register()
        assert gym.registry[ID] is before


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
        [{}, {"interval": 15, "dropout": 0.3}, {"population": "fairface", "noise": 0.2}],
        ids=str,
    )
    @pytest.mark.parametrize("mode", list(AutoresetMode))
    def test_step_by_step(self, mode, settings):
        n = 4
        ours = gym.make_vec(ID, n, autoreset_mode=mode, **settings)
        theirs = SyncVectorEnv([lambda: RestaurantEnv(**settings)] * n, autoreset_mode=mode)
        rng = np.random.default_rng(0)
        seen = np.zeros(2, int)
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
            ended = pair[0][2]
            seen += [ended.sum(), (ended & (actions == 0)).sum()]
        assert seen[0] > n  # lanes were reset
        assert seen[1] > 0  # and services ran out of time

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


class TestWrongUse:
    @pytest.mark.parametrize("make", [RestaurantEnv, RestaurantVectorEnv])
    @pytest.mark.parametrize(
        ("settings", "said"),
        [
            ({"populaton": "us"}, "unknown setting 'populaton': did you mean 'population'"),
            ({"population": "unifrm"}, "unknown population 'unifrm': did you mean 'uniform'"),
            ({"interval": 7}, "interval is 7: .* must divide 300"),
            ({"interval": 0}, "interval is 0: .* every 1 to 60 physics steps"),
            ({"interval": 75}, "interval is 75: .* every 1 to 60 physics steps"),
            ({"noise": -0.1}, "noise is -0.1: give metres between 0 and 1"),
            ({"noise": NAN}, "noise is nan"),
            ({"dropout": 1.0}, "dropout is 1.0: give a probability below 1"),
            ({"dropout": -0.1}, "dropout is -0.1"),
        ],
    )
    def test_settings(self, make, settings, said):
        with pytest.raises(InputError, match=said):
            make(**settings)

    def test_settings_through_make(self):
        with pytest.raises(InputError, match="did you mean 'population'"):
            gym.make(ID, populaton="us")

    def test_render_mode(self):
        with pytest.raises(InputError, match=r"unknown render mode 'human': .*rgb_array"):
            RestaurantEnv(render_mode="human")

    @pytest.mark.parametrize("action", [2, -1, 0.0, None, "walk", np.array([0])])
    def test_actions_of_one(self, action):
        env = RestaurantEnv()
        env.reset(seed=0)
        with pytest.raises(InputError, match=r"action is .*: give 0"):
            env.step(action)

    @pytest.mark.parametrize(
        "actions", [[0, 2, 0], [0, 0], [0, -1, 0], [0.5, 0, 0], [[0, 0, 0]], 0, [NAN, 0, 0]]
    )
    def test_actions_of_many(self, actions):
        envs = RestaurantVectorEnv(3)
        envs.reset(seed=0)
        with pytest.raises(InputError, match="actions must be 3 numbers, each 0"):
            envs.step(np.array(actions))

    def test_a_wrong_action_changes_nothing(self):
        env, other = RestaurantEnv(), RestaurantEnv()
        env.reset(seed=0)
        other.reset(seed=0)
        with pytest.raises(InputError):
            env.step(2)
        np.testing.assert_array_equal(env.step(0)[0], other.step(0)[0])

    def test_step_before_reset_and_after_the_end(self):
        env = RestaurantEnv()
        with pytest.raises(RuntimeError, match="call reset"):
            env.step(0)
        env.reset(seed=0)
        env.step(1)
        with pytest.raises(RuntimeError, match="the service has ended: call reset"):
            env.step(0)

    def test_step_of_many_before_reset(self):
        with pytest.raises(RuntimeError, match="call reset"):
            RestaurantVectorEnv(2).step(np.zeros(2, int))

    def test_lanes_that_have_ended_without_autoreset(self):
        envs = RestaurantVectorEnv(3, AutoresetMode.DISABLED)
        envs.reset(seed=0)
        envs.step(np.array([1, 0, 1]))
        with pytest.raises(RuntimeError, match=r"lanes \[0, 2\] have ended: reset these"):
            envs.step(np.zeros(3, int))
        envs.reset(options={"reset_mask": np.array([True, False, False])})
        with pytest.raises(RuntimeError, match=r"lanes \[2\] have ended"):
            envs.step(np.zeros(3, int))

    @pytest.mark.parametrize(
        ("mask", "said"),
        [
            ([True, False], "must be a bool array of 2 lanes"),
            (np.array([1, 0]), "must be a bool array of 2 lanes"),
            (np.array([True]), "must be a bool array of 2 lanes"),
            (np.zeros(2, bool), "names no lane"),
        ],
    )
    def test_reset_masks(self, mask, said):
        envs = RestaurantVectorEnv(2, AutoresetMode.DISABLED)
        envs.reset(seed=0)
        with pytest.raises(InputError, match=said):
            envs.reset(options={"reset_mask": mask})

    def test_seeds_for_another_number_of_lanes(self):
        with pytest.raises(InputError, match="2 seeds for 3 lanes"):
            RestaurantVectorEnv(3).reset(seed=[1, 2])

    def test_no_lanes(self):
        with pytest.raises(InputError, match="num_envs is 0"):
            RestaurantVectorEnv(0)

    def test_an_unknown_autoreset_mode(self):
        with pytest.raises(InputError, match="unknown autoreset mode 'Same': did you mean"):
            RestaurantVectorEnv(1, "Same")


def by_hand(facts: dict[str, Any]) -> float:
    """The reward as the environment's documentation says it, from the facts alone."""
    reward = -0.5 if facts["min_distance"] < 0.5 else 0.0
    if facts["responded"]:
        reward += 0.2
        d, t = facts["response_distance"], facts["response_step"]
        if 1.0 <= d <= 1.5:
            reward += 0.5
        elif 0.5 < d < 1.0:
            reward += 0.5 * (d - 0.5) / 0.5
        elif 1.5 < d < 3.0:
            reward += 0.5 * (3.0 - d) / 1.5
        reward += 0.3 if t <= 200 else 0.3 * (300 - t) / 100
    return reward


class TestFacts:
    """One physics step a decision, so that every step can be watched from outside."""

    @pytest.fixture(scope="class")
    @staticmethod
    def services() -> list[tuple[dict[str, Any], dict[str, Any]]]:
        """(facts, what was seen from outside) of services that end in all sorts of ways."""
        env = RestaurantEnv(interval=1, noise=0.05, dropout=0.1)
        out = []
        for service, end in enumerate([0, 3, 90, 160, 201, 240, 299, None, None]):
            observation, _ = env.reset(seed=100 + service)
            world = env._lanes.world

            person = world.snapshot(0)[1].mocap_pos[0, :2].copy()
            places = [world.state[0, :2].copy()]
            ended, step, reward, info = False, 0, 0.0, {}
            while not ended:
                responds = step == end
                observation, reward, ended, _, info = env.step(int(responds))
                if not responds:
                    step += 1
                    places.append(world.state[0, :2].copy())
                assert ended or reward == 0.0
            legs = np.diff(np.array(places), axis=0)
            out.append(
                (
                    info["facts"],
                    {
                        "steps": step,
                        "responded": end is not None,
                        "distances": np.hypot(*(np.array(places) - person).T),
                        "path": float(np.hypot(legs[:, 0], legs[:, 1]).sum()),
                        "sensed": float(observation[22]) * 5.0,
                        "reward": reward,
                    },
                )
            )
        return out

    def test_all_facts_are_told(self, services):
        for facts, _ in services:
            assert set(facts) == {
                *(set(FACTS) - {"epoch", "service", "scenario", "robot"}),
                "perfect",
                *(f"reward_{name}" for name in ("response", "distance", "promptness", "safety")),
            }
            for name, value in facts.items():
                yes_or_no, whole = ("responded", "perfect"), ("steps", "contact_steps")
                assert type(value) is (
                    bool if name in yes_or_no else int if name in whole else float
                ), name

    def test_they_are_true(self, services):
        for facts, seen in services:
            distances = seen["distances"]
            assert facts["steps"] == seen["steps"]
            assert facts["responded"] is seen["responded"]
            assert facts["start_distance"] == pytest.approx(distances[0], abs=1e-9)
            assert facts["min_distance"] == pytest.approx(distances.min(), abs=1e-9)
            assert facts["path_length"] == pytest.approx(seen["path"], abs=1e-9)
            error = seen["sensed"] - distances[-1]
            assert facts["sensed_error"] == pytest.approx(error, abs=1e-5)  # seen as float32
            if seen["responded"]:
                assert facts["response_step"] == seen["steps"]
                assert facts["response_distance"] == pytest.approx(distances[-1], abs=1e-9)
            else:
                assert facts["steps"] == 300
                assert np.isnan(facts["response_step"])
                assert np.isnan(facts["response_distance"])

    def test_the_reward_follows_from_them(self, services):
        rewards = []
        for facts, seen in services:
            assert seen["reward"] == pytest.approx(by_hand(facts), abs=1e-9)
            terms = [value for name, value in facts.items() if name.startswith("reward_")]
            assert seen["reward"] == pytest.approx(sum(terms), abs=1e-9)
            assert facts["perfect"] is (seen["reward"] == pytest.approx(1.0))
            rewards.append(seen["reward"])
        assert min(rewards) == -0.5  # walked up to the person and never responded
        assert len({round(reward, 6) for reward in rewards}) > 4

    def test_they_make_interactions(self, services):
        named = [{k: v for k, v in facts.items() if k in FACTS} for facts, _ in services]
        table = Interactions.build({}, {name: [one[name] for one in named] for name in named[0]})
        ended = [seen["responded"] for _, seen in services]
        assert np.isnan(table.fact("response_step")).tolist() == [not one for one in ended]
        assert table.to_arrow()["response_step"].null_count == ended.count(False)


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
            size = len(identity.categories)
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
            last = first + len(identity.categories) - 1
            assert index == f"{first}-{last}"
            named, categories = meaning.split(": ")
            assert named.split()[0] == identity.name
            given = "I to VI" if identity.name == "skin" else ", ".join(identity.categories)
            assert categories == given
            assert unit == "one-hot"
            first = last + 1
        assert [row[0] for row in rows[5:]] == ["22", "23", "24"]
        assert [row[2] for row in rows[5:]] == ["5 m", "300", "1 s"]
        actions = re.findall(r"^ *\| (\d) \| (\w+): .+ \|$", text, re.MULTILINE)
        assert actions == [("0", "walk"), ("1", "respond")]
        assert RestaurantEnv().observation_space.shape == (25,)
        assert int(RestaurantEnv().action_space.n) == 2  # type: ignore[attr-defined]
