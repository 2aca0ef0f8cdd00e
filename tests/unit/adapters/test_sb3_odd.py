"""Learning with Stable-Baselines3 that is normalised, goes on, or has many services at once."""

# pyright: reportMissingImports=false
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from evenhand.adapters import Fact, Identity, JudgeSettings, Ledger, Scheme, own_issue
from evenhand.methods.beyond.reflection import ReflectionSettings
from support import ledgers
from support.extras import wanted
from support.refusals import refused

wanted("stable_baselines3", "the extra sb3")

from stable_baselines3 import PPO  # noqa: E402
from stable_baselines3.common.callbacks import BaseCallback, EveryNTimesteps  # noqa: E402
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize  # noqa: E402

from evenhand.adapters.sb3 import EvennessCallback  # noqa: E402

SCHEME = Scheme(
    (Identity("who", ("a", "b")),),
    (
        Fact("total", float),
        Fact("length", int, 1),
        Fact("last", float),
        Fact("battery", float),
        Fact("missed", bool),
    ),
    (own_issue("missed", ["missed"], lambda missed: missed == 1),),
)


class Steady(gym.Env[Any, int]):
    """Services of five steps that pay 10 each and count them; one info for ever."""

    observation_space: gym.Space[Any] = gym.spaces.Box(-1e9, 1e9, (1,))
    action_space: gym.Space[Any] = gym.spaces.Discrete(2)

    def __init__(self, length: int = 5, parts: bool = False):
        self.length, self.parts, self.number = length, parts, 0
        self.info: dict[str, Any] = {}
        if parts:
            self.observation_space = gym.spaces.Dict({"at": self.observation_space})

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.number, self.at = self.number + 1, 0
        self.info |= {"who": "ab"[self.number % 2], "missed": self.number % 4 == 1, "battery": 1.0}
        return self._seen(), self.info

    def step(self, action):
        self.at += 1
        self.info["battery"] -= 0.125
        return self._seen(), 10.0, self.at == self.length, False, self.info

    def _seen(self) -> Any:
        seen = np.array([self.at], np.float32)
        return {"at": seen} if self.parts else seen


def facts_of(ended):
    seen = [one["at"] if isinstance(one, dict) else one for one in ended.observation]
    return {
        "who": ended.first_info("who"),
        "total": ended.reward,
        "length": ended.steps,
        "last": np.array(seen).ravel(),
        "battery": ended.first_info("battery"),
        "missed": ended.info("missed"),
    }


def ppo(env, steps=16, policy="MlpPolicy", **changes):
    chosen = {"n_steps": steps, "batch_size": steps * env.num_envs, "n_epochs": 1}
    small = {"policy_kwargs": {"net_arch": [8]}, "seed": 0, "device": "cpu"}
    return PPO(policy, env, **(chosen | small | changes))


def assert_whole(callback, number):
    """So many services, each of five steps, 50 paid, 5 seen last."""
    services = callback.ledger.services()
    assert services.fact("length").tolist() == [5] * number
    np.testing.assert_allclose(services.fact("total"), 50.0)
    np.testing.assert_allclose(services.fact("last"), 5.0, rtol=1e-5)
    np.testing.assert_array_equal(services.fact("battery"), 1.0)


@pytest.mark.parametrize("parts", [False, True])
def test_facts_are_of_the_environment_where_learning_is_normalised(parts):
    callback = EvennessCallback(SCHEME, facts_of)
    env = VecNormalize(DummyVecEnv([lambda: Steady(parts=parts)] * 2))
    policy = "MultiInputPolicy" if parts else "MlpPolicy"
    ppo(env, policy=policy).learn(96, callback)
    assert_whole(callback, 18)


def test_the_info_that_a_service_began_with_is_kept_as_it_was():
    callback = EvennessCallback(SCHEME, facts_of)
    ppo(DummyVecEnv([Steady] * 2)).learn(64, callback)
    assert_whole(callback, 12)
    who = callback.ledger.services().identity("who")[0]
    assert who.tolist() == [1, 1, 0, 0] * 3


@pytest.mark.parametrize("ways", ["load", "set_env"])
def test_services_that_a_reset_cut_short_are_left_out(ways, tmp_path):
    callback = EvennessCallback(SCHEME, facts_of)
    model = ppo(DummyVecEnv([Steady] * 2)).learn(32, callback)  # ends one step into the fourth
    if ways == "load":
        model.save(tmp_path / "m")
        model = PPO.load(tmp_path / "m", env=DummyVecEnv([Steady] * 2), device="cpu")
    else:
        model.set_env(DummyVecEnv([Steady] * 2))
    model.learn(32, callback, reset_num_timesteps=False)
    assert_whole(callback, 12)


def test_a_service_whose_beginning_was_not_seen_is_left_out():
    model = ppo(DummyVecEnv([Steady] * 2)).learn(32)
    callback = EvennessCallback(SCHEME, facts_of)
    model.learn(32, callback, reset_num_timesteps=False)  # four more steps of the fourth
    assert_whole(callback, 4)
    model.learn(32, reset_num_timesteps=False)
    model.learn(32, callback, reset_num_timesteps=False)
    assert_whole(callback, 8)


def test_decisions_that_were_not_seen_belong_to_no_service():
    from evenhand.adapters.sb3 import callback as room

    model = ppo(DummyVecEnv([Steady])).learn(16)  # one step into the fourth
    callback = EvennessCallback(SCHEME, facts_of)
    found = []

    class Look(BaseCallback):
        def _on_step(self):
            return True

        def _on_rollout_end(self):
            ends = callback._ends
            assert ends is not None
            found.append(room._services(ends, (16, 1))[:, 0].tolist())

    model.learn(32, [callback, Look()], reset_num_timesteps=False)
    # four steps of the fourth, two services of five, two steps of one that goes on
    assert found[0] == [-1] * 4 + [0] * 5 + [1] * 5 + [-1] * 2
    assert found[1] == [0] * 3 + [1] * 5 + [2] * 5 + [-1] * 3


class Leave(BaseCallback):
    """Breaks a rollout off."""

    def __init__(self, step):
        super().__init__()
        self.step = step

    def _on_step(self):
        return self.n_calls != self.step


def test_learning_that_was_broken_off_goes_on_with_its_services():
    callback = EvennessCallback(SCHEME, facts_of)
    model = ppo(DummyVecEnv([Steady]), 10)
    model.learn(20, [callback, Leave(11)])  # one step into the third
    assert_whole(callback, 2)
    model.learn(10, callback, reset_num_timesteps=False)
    assert_whole(callback, 4)


def test_many_services_of_one_rollout_are_paid_by_their_own_windows():
    settings = JudgeSettings(600, "levelup@1")

    def told(ended):
        late = rng.random(len(ended)) < np.where(ended.lane == 0, 0.1, 0.4)
        asked.append(len(ended))
        return {"side": ended.lane, "late": late, "loud": late}

    rng, asked = np.random.default_rng(0), []
    callback = EvennessCallback(ledgers.SCHEME, told, settings=settings, reflect=None)
    ppo(DummyVecEnv([lambda: Steady(1)] * 2), 500).learn(1000, callback)
    found = callback.ledger
    assert asked == [1000]
    x, _ = found.rows()
    alone = Ledger(ledgers.SCHEME, settings)
    side, late = np.arange(1000) % 2, (x[:, 0] == 1).tolist()
    expected = ledgers.add(alone, side.tolist(), late, late, afterwards=True)
    np.testing.assert_array_equal(found.paid, expected)
    # whoever is late on the right, where it is more frequent, is paid for it
    assert (found.paid[:512][(side == 1)[:512] & (x[:512, 0] == 1)] < 0).all()


def test_what_was_examined_comes_with_its_settings():
    chosen = ReflectionSettings(rate=0.5, history=3)
    callback = EvennessCallback(SCHEME, facts_of, reflect=chosen)
    ppo(DummyVecEnv([Steady] * 2)).learn(64, callback)
    assert callback.examined.settings is chosen
    assert callback.examined.updates == callback.reflections
    assert len(callback.reflections) == 2
    with refused("unsupported reflect"):
        _ = EvennessCallback(SCHEME, facts_of, reflect=None).examined


def test_a_callback_that_sees_no_rollouts_says_so():
    callback = EveryNTimesteps(8, EvennessCallback(SCHEME, facts_of))
    with refused("unsupported callback"):
        ppo(DummyVecEnv([Steady] * 2)).learn(32, callback)
