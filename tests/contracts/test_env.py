"""The environments keep Gymnasium's contract, and refuse wrong use."""

import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import evenhand.restaurant  # noqa: F401 - registers the environment
from evenhand.core.errors import InputError
from evenhand.restaurant import people
from evenhand.restaurant.env import RestaurantEnv
from evenhand.restaurant.vector import RestaurantVectorEnv
from support.refusals import refused

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

    def test_services_are_the_same_on_any_number_of_threads(self):
        told = []
        for threads in (1, 3):
            envs = gym.make_vec(ID, num_envs=4, threads=threads)
            told.append([envs.reset(seed=5)])
            for k in range(80):
                told[-1].append(envs.step(np.full(4, k % 20 == 19)))
            envs.close()
        np.testing.assert_equal(told[1], told[0])
        ends = sum(int(step[2].sum()) for step in told[0][1:])
        assert ends >= 8  # what was compared holds whole services

    @pytest.mark.parametrize("mode", ["vector_entry_point", "sync"])
    def test_make_vec_takes_what_gymnasium_gives_it(self, mode, opengl):
        given = {"render_mode": "rgb_array", "camera": "guest", "max_episode_steps": 2}
        envs = gym.make_vec(ID, 2, vectorization_mode=mode, **given)
        again = gym.make_vec(envs.spec)  # type: ignore[arg-type]
        drawn = []
        for made in (envs, again):
            assert made.render_mode == "rgb_array"
            assert made.metadata["render_modes"] == ["rgb_array"]
            made.reset(seed=0)
            cut = [made.step(np.zeros(2, int))[3].tolist() for _ in range(2)]
            assert cut == [[False, False], [True, True]]
            drawn.append(made.render())
            made.close()
            made.close()
        single = RestaurantEnv("rgb_array", "guest")
        single.reset(seed=1)
        for _ in range(2):
            single.step(0)
        for pictures in drawn:
            assert isinstance(pictures, tuple)
            np.testing.assert_array_equal(pictures[1], single.render())
        single.close()

    def test_many_without_a_render_mode_draw_nothing(self):
        envs = RestaurantVectorEnv(2)
        envs.reset(seed=0)
        assert envs.render() is None
        assert envs.render_mode is None

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

    @pytest.mark.parametrize(
        "seed", [np.int64(0), [0, 1, 2], (0, 1, 2), np.arange(3), [np.int64(0), np.int8(1), 2]]
    )
    def test_a_seed_counts_whatever_kind_of_number_it_is(self, seed):
        envs = RestaurantVectorEnv(3)
        envs.reset(seed=5)
        plain = RestaurantVectorEnv(3).reset(seed=0)
        for made in (RestaurantVectorEnv(3), envs):
            observation, info = made.reset(seed=seed)
            np.testing.assert_array_equal(observation, plain[0])
            np.testing.assert_array_equal(info["identities"], plain[1]["identities"])

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
        from evenhand.restaurant.registration import register

        before = gym.registry[ID]
        register()
        assert gym.registry[ID] is before


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
            ({"population": 3}, "unknown population '3'"),
            ({"interval": 5.0}, "interval is 5.0: give a whole number"),
            ({"interval": True}, "interval is True: give a whole number"),
            ({"noise": "a"}, "noise is 'a': give a number"),
        ],
    )
    def test_settings(self, make, settings, said):
        with pytest.raises(InputError, match=said):
            make(**settings)

    def test_settings_through_make(self):
        with refused("unknown setting", "'population'"):
            gym.make(ID, populaton="us")

    @pytest.mark.parametrize("make", [RestaurantEnv, RestaurantVectorEnv])
    def test_render_mode(self, make):
        with refused("unknown render_mode", "'human'"):
            make(render_mode="human")

    @pytest.mark.parametrize("make", [RestaurantEnv, RestaurantVectorEnv])
    def test_camera(self, make):
        with refused("unknown camera", "'rom'", "'room'"):
            make(camera="rom")

    @pytest.mark.parametrize("limit", [0, -2, 1.5, "9"])
    def test_limits_that_are_none(self, limit):
        with pytest.raises(InputError, match=f"max_episode_steps is {limit}: give a whole number"):
            gym.make_vec(ID, 2, max_episode_steps=limit)

    @pytest.mark.parametrize("action", [2, -1, 0.0, None, "walk", np.array([0])])
    def test_actions_of_one(self, action):
        env = RestaurantEnv()
        env.reset(seed=0)
        with refused("range action", "0"):
            env.step(action)

    @pytest.mark.parametrize(
        "actions", [[0, 2, 0], [0, 0], [0, -1, 0], [0.5, 0, 0], [[0, 0, 0]], 0, [NAN, 0, 0]]
    )
    def test_actions_of_many(self, actions):
        envs = RestaurantVectorEnv(3)
        envs.reset(seed=0)
        with refused("type actions", "3", "0"):
            envs.step(np.array(actions))

    def test_a_wrong_action_changes_nothing(self):
        env, other = RestaurantEnv(), RestaurantEnv()
        env.reset(seed=0)
        other.reset(seed=0)
        with refused("range action"):
            env.step(2)
        np.testing.assert_array_equal(env.step(0)[0], other.step(0)[0])

    def test_step_before_reset_and_after_the_end(self):
        env = RestaurantEnv()
        with pytest.raises(RuntimeError, match=r"^call reset\(\) before step"):
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

    @pytest.mark.parametrize("mode", list(AutoresetMode))
    def test_the_first_reset_begins_every_lane(self, mode):
        mask = np.array([True, False, False])
        envs, single = RestaurantVectorEnv(3, mode), [RestaurantEnv] * 3
        with pytest.raises(ValueError):  # noqa: PT011 - so does Gymnasium, of arrays that lack
            gym.vector.SyncVectorEnv(single).reset(seed=1, options={"reset_mask": mask})
        with refused("range reset_mask"):
            envs.reset(seed=1, options={"reset_mask": mask})
        with pytest.raises(RuntimeError, match="call reset"):
            envs.step(np.zeros(3, int))
        whole = envs.reset(seed=1, options={"reset_mask": np.ones(3, bool)})[0]
        np.testing.assert_array_equal(whole, RestaurantVectorEnv(3).reset(seed=1)[0])

    @pytest.mark.parametrize(
        ("seed", "said"),
        [
            ([1, 2], "2 seeds for 3 lanes"),
            ([], "0 seeds for 3 lanes"),
            (np.arange(4), "4 seeds for 3 lanes"),
            ([1, 2.0, 3], "seed 2.0 is no whole number"),
            (np.array([0.5, 1.0, 2.0]), "seed 0.5 is no whole number"),
        ],
    )
    def test_seeds_that_are_none(self, seed, said):
        with pytest.raises(InputError, match=said):
            RestaurantVectorEnv(3).reset(seed=seed)

    def test_no_lanes(self):
        with refused("range num_envs", "0"):
            RestaurantVectorEnv(0)

    @pytest.mark.parametrize("threads", [0, -1, 257, 1.5])
    def test_no_threads_or_too_many(self, threads):
        said = f"threads is {threads}: give a whole number from 1 to 256"
        with pytest.raises(InputError, match=said):
            RestaurantVectorEnv(2, threads=threads)

    def test_an_unknown_autoreset_mode(self):
        with refused("unknown autoreset_mode", "'Same'"):
            RestaurantVectorEnv(1, "Same")
