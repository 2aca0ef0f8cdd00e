"""Facts functions that return nonsense: one sentence names field, value and episode."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

from evenhand.adapters import Ended, JudgeServices, JudgeVectorServices, invented
from evenhand.adapters.check_facts import checked
from evenhand.adapters.sampler import Queue
from evenhand.core.errors import InputError
from support.refusals import refused
from support.toys import SCHEME, Toy, facts_of

N = 3
TOLD = {
    "lane": np.array([0, 1, 2]),
    "steps": [3, 4, 5],
    "total": [0.5, 1.5, 2.5],
    "cut": [True, False, np.True_],
    "seen": np.array([1, 2, 3], np.float32),
    "delay": [0.1, None, np.nan],
    "who": ["a", None, "c"],
    "side": np.array([0, -1, 1]),
}


def ended(people=None):
    return Ended(
        episode=np.array([7, 8, 9]),
        lane=np.array([0, 2, 1]),
        reward=np.zeros(N),
        steps=np.ones(N, np.int64),
        terminated=np.ones(N, bool),
        truncated=np.zeros(N, bool),
        observation=np.zeros((N, 2)),
        people=people,
        raw=[({}, {}, -1)] * N,
    )


def without(name):
    return {key: value for key, value in TOLD.items() if key != name}


def test_what_makes_sense_is_taken():
    codes, facts = checked(SCHEME, ended(), TOLD)
    np.testing.assert_array_equal(codes, [[0, 0], [-1, -1], [2, 1]])
    nan = np.nan
    expected = [[0, 3, 0.5, 1, 1, 0.1], [1, 4, 1.5, 0, 2, nan], [2, 5, 2.5, 1, 3, nan]]
    np.testing.assert_allclose(facts, expected)
    masked = np.ma.array([0.1, 0.2, 0.3], mask=[False, True, False])
    _, facts = checked(SCHEME, ended(), TOLD | {"delay": masked})
    np.testing.assert_array_equal(facts[:, 5], [0.1, nan, 0.3])


@pytest.mark.parametrize(
    ("told", "said"),
    [
        (None, "the facts function gave NoneType for episodes 7 to 9: give a dict"),
        ([TOLD], "the facts function gave list for episodes 7 to 9: give a dict"),
        (without("steps"), "gave no 'steps' for episodes 7 to 9: give all of who, side, lane, st"),
        (without("who"), "gave no 'who' for episodes 7 to 9"),
        (TOLD | {"stpes": [1, 2, 3]}, "unknown field .*, for episodes 7 to 9: 'stpes': did you "),
        (TOLD | {"steps": [1, 2]}, "gave 2 values of 'steps' for episodes 7 to 9: give 3, one an"),
        (TOLD | {"steps": 4}, "gave no list of single values of 'steps' for episodes 7 to 9"),
        (TOLD | {"steps": "abc"}, "gave no list of single values of 'steps'"),
        (TOLD | {"steps": np.zeros((3, 2))}, "gave no list of single values of 'steps'"),
        (TOLD | {"who": ["a", "b"]}, "gave 2 values of 'who' for episodes 7 to 9: give 3"),
        (
            TOLD | {"steps": [3, -4, 5]},
            r"fact 'steps' of episode 8 \(lane 2\) is -4: give a whole number of at least 1",
        ),
        (TOLD | {"steps": [3, 4.5, 5]}, r"'steps' of episode 8 \(lane 2\) is 4.5: give a whole"),
        (TOLD | {"steps": [3, 4, None]}, r"'steps' of episode 9 \(lane 1\) is None: give a who"),
        (TOLD | {"steps": ["3", 4, 5]}, r"'steps' of episode 7 \(lane 0\) is '3': give a whole"),
        (TOLD | {"steps": np.array(["3", "4", "5"])}, r"'steps' of episode 7 .lane 0. is '3'"),
        (TOLD | {"total": [0.0, np.nan, 1.0]}, r"'total' of episode 8 .* is nan: give a finite"),
        (TOLD | {"total": [0.0, 1.0, np.inf]}, r"'total' of episode 9 .* is inf: give a finite"),
        (TOLD | {"total": [0.0, [1.0], 2.0]}, r"'total' of episode 8 .* is .1.0.: give a finite"),
        (TOLD | {"delay": [-0.1, 0.0, 0.0]}, r"'delay' .* is -0.1: give .* at least 0, or None"),
        (TOLD | {"cut": [True, 2, False]}, r"fact 'cut' of episode 8 .* is 2: give True or False"),
        (TOLD | {"total": [0, 10**400, 1]}, r"'total' of episode 8 .* is 1000+: give a finite"),
        (TOLD | {"total": np.array([0, 1j, 1])}, r"'total' of episode 7 .* is 0j: give a finite"),
        (TOLD | {"total": [0.0, np.complex128(1), 1]}, r"'total' of episode 8 .* is .1\+0j.: give"),
        (
            TOLD | {"total": np.array(["2020-01-01"] * N, "M8[ns]")},
            r"'total' of episode 7 .* is 2020-01-01T00:00:00.0+: give a finite number",
        ),
        (TOLD | {"steps": np.array([1, 2, 3], "m8[s]")}, r"'steps' of .* is 1 seconds: give a who"),
        (
            TOLD | {"steps": [1, np.timedelta64(2, "s"), 3]},
            r"episode 8 .* is 2 seconds: give a who",
        ),
        (TOLD | {"who": ["a", "d", "c"]}, r"unknown group of 'who' in episode 8 .lane 2.: 'd'"),
        (TOLD | {"who": ["a", "b", 3.5]}, r"unknown group of 'who' in episode 9 .lane 1.: '3.5'"),
        (TOLD | {"side": ["left", "rihgt", "left"]}, "'rihgt': did you mean 'right'"),
        (TOLD | {"side": [0, 2, 1]}, r"'side' of episode 8 .* is 2: give 0 to 1, or -1"),
        (TOLD | {"side": [0, -2.0, 1]}, r"'side' of episode 8 .* is -2.0: give 0 to 1, or -1"),
        (TOLD | {"side": [0, 10**400, 1]}, r"'side' of episode 8 .* is 1000+: give 0 to 1, or -1"),
        (TOLD | {"side": [0, 0, np.inf]}, "unknown group of 'side' in episode 9 .lane 1.: 'inf'"),
        (TOLD | {"side": [True, 0, 1]}, "'True': .* left, right; or its code, 0 to 1, -1 where"),
        (TOLD | {"side": np.array([0, 1, 0], "m8[ns]")}, "unknown group of 'side' in episode 7"),
        (TOLD | {"side": np.array([0, 2, 1])}, r"'side' of episode 8 .* is 2: give 0 to 1, or -1"),
    ],
)
def test_nonsense(told, said):
    with pytest.raises(InputError, match=said) as raised:
        checked(SCHEME, ended(), told)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("side", "expected"),
    [
        ([0, 1, None], [0, 1, -1]),
        ((np.int64(1), np.uint8(0), -1), [1, 0, -1]),
        (np.array([1.0, np.nan, 0.0]), [1, -1, 0]),
        ([np.float32(1), np.float32("nan"), 0.0], [1, -1, 0]),
        (np.ma.array([1, 1, 0], mask=[False, True, False]), [1, -1, 0]),
        (np.array([1, None, 0], object), [1, -1, 0]),
        (["right", 0, np.str_("left")], [1, 0, 0]),
    ],
)
def test_groups_by_code_in_whatever_holds_them(side, expected):
    codes, _ = checked(SCHEME, ended(), TOLD | {"side": side})
    assert codes[:, 1].tolist() == expected


def test_people_are_drawn_or_told_never_both():
    people = np.zeros((N, 2), np.int64)
    with refused("conflict facts", "'who'", "7", "9"):
        checked(SCHEME, ended(people), without("side"))


def run(env, steps, action):
    """Step, and reset a single environment where an episode ends."""
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(action)
        if isinstance(env, gym.Env) and (terminated or truncated):
            env.reset()


class TestThroughAWrapper:
    def test_the_first_episode_that_ends_is_asked_about_at_once(self):
        env = JudgeVectorServices(SyncVectorEnv([Toy] * 2), SCHEME, lambda ended: {})
        env.reset(seed=0)
        with refused("missing facts", "'who'"):
            run(env, 6, np.zeros(2, int))

    def test_later_nonsense_names_its_episode_and_what_was_before_it_stays(self):
        def odd(ended):
            told = facts_of(ended)
            return told | {"steps": np.where(ended.episode == 20, -1, told["steps"])}

        env = JudgeServices(Toy(), SCHEME, odd)
        env.reset(seed=0)
        with refused("range steps", "'steps'", "20", "0", "-1"):
            run(env, 1000, 0)
        assert len(env.services) == 1

    def test_a_sampler_and_its_randomness_belong_together(self):
        with refused("missing rng"):
            JudgeServices(Toy(), SCHEME, facts_of, sampler=invented(SCHEME))
        with refused("missing sampler"):
            JudgeServices(Toy(), SCHEME, facts_of, rng=np.random.default_rng(0))

    def test_an_environment_of_other_arrays(self):
        class Odd(SyncVectorEnv):
            def step(self, actions):
                seen, rewards, terminated, truncated, info = super().step(actions)
                return seen, rewards, terminated.astype(float), truncated, info

        env = JudgeVectorServices(Odd([Toy]), SCHEME, facts_of)
        env.reset(seed=0)
        with refused("type environment"):
            env.step(np.zeros(1, int))

    def test_no_environment_at_all(self):
        with pytest.raises(TypeError, match="Expected env to be a"):
            JudgeVectorServices(gym.make("CartPole-v1"), SCHEME, facts_of)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("shares", "said"),
    [
        ({"how": [1.0]}, "unknown identity 'how'"),
        ({"side": [0.5, 0.4]}, "shares of 'side' are .*: give 2 numbers of at least 0 that sum"),
        ({"side": [1.5, -0.5]}, "shares of 'side'"),
        ({"who": [0.5, 0.5]}, "shares of 'who' are .*: give 3 numbers .* for a, b, c"),
    ],
)
def test_shares_that_cannot_be(shares, said):
    with pytest.raises(InputError, match=said):
        invented(SCHEME, shares)


@pytest.mark.parametrize(
    ("sampler", "said"),
    [
        (lambda n, rng: np.zeros((n, 1), int), "gave int64 of shape .*: give whole numbers of sh"),
        (lambda n, rng: np.zeros((n, 2)), "gave float64 of shape"),
        (lambda n, rng: np.full((n, 2), 2), "gave 2 for 'side', which takes 0 to 1, or -1"),
        (lambda n, rng: np.full((n, 2), -2), "gave -2 for 'who', which takes 0 to 2"),
    ],
)
def test_samplers_that_draw_nobody(sampler, said):
    with pytest.raises(InputError, match=said):
        Queue(sampler, np.random.default_rng(0), 1, SCHEME)
