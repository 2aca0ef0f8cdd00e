"""The callback for Stable-Baselines3: what it writes down, pays and finds abnormal."""

# pyright: reportMissingImports=false
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from evenhand.adapters import (
    Fact,
    Identity,
    JudgeSettings,
    Scheme,
    invented,
    own_issue,
)
from evenhand.methods import registry
from evenhand.methods.beyond.reflection import ReflectionSettings
from evenhand.methods.epoch import Epoch
from evenhand.statistics.chance import corrected_scores
from support import toys
from support.extras import wanted
from support.refusals import refused

wanted("stable_baselines3", "the extra sb3")

import torch  # noqa: E402
from stable_baselines3 import A2C, DQN, PPO  # noqa: E402
from stable_baselines3.common.callbacks import BaseCallback, CallbackList  # noqa: E402
from stable_baselines3.common.vec_env import (  # noqa: E402
    DummyVecEnv,
    SubprocVecEnv,
    VecNormalize,
)

from evenhand.adapters.restaurant import SCHEME, facts_of  # noqa: E402
from evenhand.adapters.sb3 import EvennessCallback, ServiceVecEnv, restaurant  # noqa: E402
from evenhand.restaurant.env import RestaurantEnv  # noqa: E402

SMALL = {"policy_kwargs": {"net_arch": [8]}, "seed": 0, "device": "cpu"}


def ppo(env, steps=16, **changes):
    chosen = {"n_steps": steps, "batch_size": steps * env.num_envs, "n_epochs": 2} | SMALL
    return PPO("MlpPolicy", env, **(chosen | changes))


class Beside(BaseCallback):
    """Keeps what rollouts held when it was its turn."""

    def __init__(self):
        super().__init__()
        self.kept = []

    def _on_step(self):
        return True

    def _on_rollout_end(self):
        model: Any = self.model
        buffer = model.rollout_buffer
        names = ("rewards", "advantages", "returns", "values", "episode_starts")
        self.kept.append({name: getattr(buffer, name).copy() for name in names})
        self.kept[-1]["last"] = (
            self.locals["values"].numpy().ravel().copy(),
            self.locals["dones"].copy(),
        )


def advantages(kept, gamma, trace):
    """Generalised advantage estimates by their definition, a sum over later steps."""
    steps, lanes = kept["rewards"].shape
    values = np.vstack([kept["values"], kept["last"][0]]).astype(float)
    ends = np.vstack([kept["episode_starts"][1:], kept["last"][1]]).astype(bool)
    delta = kept["rewards"] + gamma * values[1:] * ~ends - values[:-1]
    out = np.zeros((steps, lanes))
    for t in range(steps):
        for lane in range(lanes):
            weight = 1.0
            for later in range(t, steps):
                out[t, lane] += weight * delta[later, lane]
                if ends[later, lane]:
                    break
                weight *= gamma * trace
    return out


def test_it_writes_down_what_a_plain_loop_sees():
    lanes, steps = 3, 64
    env = DummyVecEnv([toys.Toy] * lanes)
    callback = EvennessCallback(toys.SCHEME, toys.facts_of)
    ppo(env, learning_rate=0.0).learn(steps * lanes, callback)
    rows = [row for lane in range(lanes) for row in toys.plainly(lane, lane, steps)]
    rows.sort(key=lambda row: (row[1], row[2]))  # by step, then by lane
    table = callback.ledger.services()
    assert len(table) == len(rows) > 40
    for place, name in enumerate(("lane", "steps", "total", "cut", "seen", "delay"), 2):
        wanted_values = [np.nan if row[place] is None else float(row[place]) for row in rows]
        np.testing.assert_allclose(table.fact(name), wanted_values, rtol=1e-6)
    codes, groups = table.identity("who")
    assert [groups[code] for code in codes] == [row[0] for row in rows]


@pytest.mark.parametrize("algorithm", [PPO, A2C])
def test_learning_is_the_same_on_one_vector_environment_as_on_many_single_ones(algorithm):
    found = []
    for env in (restaurant(3, scaled=False), DummyVecEnv([RestaurantEnv] * 3)):
        callback = EvennessCallback(SCHEME, facts_of, settings=JudgeSettings(5, "score@1"))
        chosen: dict[str, Any] = {"n_steps": 40} | SMALL
        if algorithm is PPO:
            chosen |= {"batch_size": 60, "n_epochs": 2}
        model = algorithm("MlpPolicy", env, **chosen).learn(480, callback)
        weights = [one.detach().numpy() for one in model.policy.parameters()]
        found.append((weights, callback))
    (mine, ours), (others, theirs) = found
    for a, b in zip(mine, others, strict=True):
        np.testing.assert_array_equal(a, b)
    assert len(ours.ledger) == len(theirs.ledger) > 30
    np.testing.assert_array_equal(ours.ledger.paid, theirs.ledger.paid)
    assert np.abs(ours.ledger.paid).max() > 0
    assert len(ours.reflections) == len(theirs.reflections) == 4
    for a, b in zip(ours.reflections, theirs.reflections, strict=True):
        np.testing.assert_array_equal(a.cosine, b.cosine)


@pytest.mark.parametrize("kind", ["score", "levelup"])
def test_what_evenness_pays_stands_at_the_ends_of_services_and_in_their_advantages(kind):
    before, after = Beside(), Beside()
    callback = EvennessCallback(toys.SCHEME, toys.facts_of, settings=JudgeSettings(4, f"{kind}@1"))
    env = DummyVecEnv([toys.Toy] * 3)
    model = ppo(env, gamma=0.9, gae_lambda=0.8)
    model.learn(16 * 3 * 4, CallbackList([before, callback, after]))
    at = 0
    for a, b in zip(before.kept, after.kept, strict=True):
        added = b["rewards"] - a["rewards"]
        ends = np.vstack([b["episode_starts"][1:], b["last"][1]]).astype(bool)
        assert not added[~ends].any()
        n = int(ends.sum())
        np.testing.assert_allclose(added[ends], callback.ledger.paid[at : at + n], atol=1e-5)
        at += n
        expected = advantages(b, 0.9, 0.8)
        np.testing.assert_allclose(b["advantages"], expected, atol=1e-5)
        np.testing.assert_allclose(b["returns"], expected + b["values"], atol=1e-5)
    assert at == len(callback.ledger)
    assert np.abs(callback.ledger.paid).max() > 0.05


@pytest.mark.parametrize("name", ["a_ppo", "elbert", "group_dro", "lagrangian"])
def test_a_published_method_gives_the_advantages_of_a_rollout(name):
    before, after = Beside(), Beside()
    callback = EvennessCallback(toys.SCHEME, toys.facts_of, settings=JudgeSettings(4, name))
    env = DummyVecEnv([toys.Toy] * 3)
    ppo(env, gamma=0.9, gae_lambda=0.8).learn(16 * 3 * 3, CallbackList([before, callback, after]))
    changed, first = 0.0, 0
    method = registry.create(name)
    memory = method.begin(toys.SCHEME)
    for number, (a, b) in enumerate(zip(before.kept, after.kept, strict=True)):
        np.testing.assert_array_equal(a["rewards"], b["rewards"])
        np.testing.assert_array_equal(a["returns"], b["returns"])
        starts = np.vstack([a["episode_starts"], a["last"][1]]).astype(bool)
        # decisions of each service that ended here, in the order of step and lane
        ends = [(t, lane) for t in range(16) for lane in range(3) if starts[t + 1, lane]]
        decisions = []
        for t, lane in ends:
            begin = t
            while begin > 0 and not starts[begin, lane]:
                begin -= 1
            decisions.append((np.arange(begin, t + 1), lane))
        x, inside = callback.ledger.rows(first)
        x, inside = x[: len(ends)], inside[: len(ends)]
        length = max(len(rows) for rows, _ in decisions)
        advantage, mask = np.zeros((2, len(ends), length))
        for s, (rows, lane) in enumerate(decisions):
            advantage[s, : len(rows)] = a["advantages"][rows, lane]
            mask[s, : len(rows)] = 1.0
        epoch = Epoch(
            x=x, inside=inside, mask=mask, tau=np.ones(x.shape[1]), number=number,
            reward=callback.ledger.services().fact("total")[first : first + len(ends)],
            groups=toys.SCHEME.groups, issues=toys.SCHEME.issue_names,
            advantages_of=lambda rewards, advantage=advantage: advantage,
            corrected_of=lambda counts: float(
                corrected_scores(counts, toys.SCHEME.groups, toys.SCHEME.issue_names).total
            ),
        )  # fmt: skip
        wanted, memory = method.teach(epoch, memory)
        expected = a["advantages"].copy()
        for s, (rows, lane) in enumerate(decisions):
            expected[rows, lane] = wanted[s, : len(rows)]
        np.testing.assert_allclose(b["advantages"], expected, rtol=1e-5, atol=1e-5)
        changed += float(np.abs(b["advantages"] - a["advantages"]).sum())
        first += len(ends)
    assert first == len(callback.ledger)
    assert changed > 0.1
    assert (callback.ledger.paid == 0.0).all()


def test_rewards_of_an_own_method_are_paid_at_the_ends(registered):
    class Mine:
        def begin(self, scheme):
            return 0

        def teach(self, epoch, memory):
            return epoch.reward - 0.5 * np.arange(1, len(epoch) + 1), memory + 1

    registered("mine")(Mine)
    before, after = Beside(), Beside()
    callback = EvennessCallback(toys.SCHEME, toys.facts_of, settings=JudgeSettings(4, "mine"))
    ppo(DummyVecEnv([toys.Toy] * 3)).learn(96, CallbackList([before, callback, after]))
    at = 0
    for a, b in zip(before.kept, after.kept, strict=True):
        ends = np.vstack([b["episode_starts"][1:], b["last"][1]]).astype(bool)
        n = int(ends.sum())
        added = b["rewards"] - a["rewards"]
        np.testing.assert_allclose(added[ends], -0.5 * np.arange(1, n + 1), atol=1e-5)
        assert not added[~ends].any()
        np.testing.assert_allclose(callback.ledger.paid[at : at + n], added[ends], atol=1e-5)
        at += n
    assert callback.ledger.guide.past.memory == len(before.kept) == 2


@pytest.mark.parametrize("name", ["levelup", "elbert"])
def test_its_state_goes_on_in_another_callback(name, tmp_path):
    """The same rollouts after it are guided and examined alike."""

    def made() -> EvennessCallback:
        return EvennessCallback(toys.SCHEME, toys.facts_of, settings=JudgeSettings(4, name))

    first = made()
    model = ppo(DummyVecEnv([toys.Toy] * 3))
    model.learn(96, first)
    np.savez(tmp_path / "state.npz", allow_pickle=False, **first.state())
    model.save(tmp_path / "model.zip")
    resumed = made()
    with np.load(tmp_path / "state.npz") as saved:
        resumed.restore(saved)
    kept = []
    for callback in (first, resumed):
        env = DummyVecEnv([toys.Toy] * 3)
        again = PPO.load(tmp_path / "model.zip", env=env)
        env.seed(5)
        torch.manual_seed(3)
        beside = Beside()
        again.learn(96, CallbackList([callback, beside]), reset_num_timesteps=True)
        kept.append((beside.kept, callback))
    (one, a), (other, b) = kept
    for x, y in zip(one, other, strict=True):
        for what in ("rewards", "advantages"):
            np.testing.assert_array_equal(x[what], y[what])
    assert a.state().keys() == b.state().keys()
    for path, leaf in a.state().items():
        np.testing.assert_array_equal(leaf, b.state()[path], err_msg=path)
    assert len(b.ledger) > 40


def test_without_guidance_learning_stays_as_it_is():
    plain = ppo(DummyVecEnv([toys.Toy] * 3)).learn(192)
    callback = EvennessCallback(toys.SCHEME, toys.facts_of)
    watched = ppo(DummyVecEnv([toys.Toy] * 3)).learn(192, callback)
    for a, b in zip(plain.policy.parameters(), watched.policy.parameters(), strict=True):
        assert torch.equal(a, b)
    assert len(callback.ledger) > 30


def test_learning_that_goes_on_goes_on_with_its_services():
    once = EvennessCallback(toys.SCHEME, toys.facts_of)
    ppo(DummyVecEnv([toys.Toy] * 3), learning_rate=0.0).learn(192, once)
    twice = EvennessCallback(toys.SCHEME, toys.facts_of)
    model = ppo(DummyVecEnv([toys.Toy] * 3), learning_rate=0.0)
    model.learn(96, twice)
    model.learn(96, twice, reset_num_timesteps=False)
    assert len(once.ledger) == len(twice.ledger) > 30
    for a, b in zip(once.ledger.rows(), twice.ledger.rows(), strict=True):
        np.testing.assert_array_equal(a, b)


def test_people_are_drawn_for_environments_that_know_nobody():
    scheme = Scheme(
        (Identity("hat", ("none", "red")),),
        (Fact("steps", int, 1),),
        (own_issue("long", ["steps"], lambda steps: steps > 3),),
    )
    callback = EvennessCallback(
        scheme,
        lambda ended: {"steps": ended.steps},
        sampler=invented(scheme, {"hat": (0.25, 0.75)}),
        rng=np.random.default_rng(0),
    )
    # more episodes of one lane in a rollout than people are drawn at a time
    ppo(DummyVecEnv([toys.Toy]), 4096, n_epochs=1).learn(4096, callback)
    codes, _ = callback.ledger.services().identity("hat")
    assert len(codes) > 1024
    assert 0.70 < codes.mean() < 0.80


class Alike(gym.Env):
    """One step: who asks is seen, and whether the action was 1 is all that happens."""

    observation_space = gym.spaces.Box(0.0, 1.0, (2,))
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.who = int(self.np_random.integers(0, 2))
        return np.eye(2, dtype=np.float32)[self.who], {"who": self.who}

    def step(self, action):
        reward = float(self.np_random.normal())
        return np.zeros(2, np.float32), reward, True, False, {"failed": bool(action)}


ALIKE = Scheme(
    (Identity("who", ("left", "right")),),
    (Fact("failed", bool),),
    (own_issue("failure", ["failed"], lambda failed: failed == 1),),
)


def alike_facts(ended):
    return {"failed": ended.info("failed"), "who": ended.first_info("who")}


class Plant(BaseCallback):
    """Lets one update make failure of those on the right likelier."""

    def __init__(self, number):
        super().__init__()
        self.number, self.rollouts = number, 0

    def _on_step(self):
        return True

    def _on_rollout_start(self):
        if self.rollouts == self.number:
            with torch.no_grad():
                policy: Any = self.model.policy
                net = policy.action_net.weight
                net[1] += torch.tensor([-0.3, 0.3])
                net[0] -= torch.tensor([-0.3, 0.3])
        self.rollouts += 1


def examined(plant, updates=80):
    env = ServiceVecEnv(SyncVectorEnv([Alike] * 8, autoreset_mode=AutoresetMode.SAME_STEP))
    model = ppo(env, 8, learning_rate=3e-4, policy_kwargs={"net_arch": []}, n_epochs=1)
    callback = EvennessCallback(
        ALIKE, alike_facts, reflect=ReflectionSettings(rate=0.02, history=60), verbose=1
    )
    model.learn(64 * updates, CallbackList([plant, callback]))
    assert len(callback.reflections) == updates
    return callback


def test_a_planted_biased_update_is_found(capsys):
    callback = examined(Plant(70))
    found = callback.reflections[69]  # of the update after the 70th rollout
    assert found.alarm
    assert (found.identity, found.issue) == ("who", "failure")
    assert found.favoured == ("left",)
    assert found.cosine[0, 0] > 0.5
    # points of the score to first order: the gap grows, for its rate on the right does
    assert found.projection[0, 0] > 0.1
    others = [one.alarm for number, one in enumerate(callback.reflections) if number != 69]
    assert sum(others) <= 3
    assert "update 70 is abnormal: it raises failure by who, in favour of left (p = 0.0" in (
        capsys.readouterr().out
    )


def test_rewards_that_know_no_group_raise_few_alarms():
    callback = examined(Plant(-1))
    # 0.02 of 80 updates are 1.6; 7 and more have a chance below 0.002
    assert sum(one.alarm for one in callback.reflections) < 7


class Counted(toys.Toy):
    """Sees a number alone."""

    observation_space = gym.spaces.Discrete(10)

    def _seen(self):
        return self.at


class Several(toys.Toy):
    """Takes two actions at once."""

    action_space = gym.spaces.MultiDiscrete([2, 3])


class Free(toys.Toy):
    """Takes any number as its action."""

    action_space = gym.spaces.Box(-1.0, 1.0, (2,))


SHORT = Scheme(toys.SCHEME.identities, (Fact("steps", int, 1),), toys.SCHEME.issues[:1])


def short_facts(ended):
    side = np.where(ended.lane % 2 == 0, "left", "right").tolist()
    return {"steps": ended.steps, "who": ended.first_info("who"), "side": side}


@pytest.mark.parametrize(
    ("env", "policy", "options"),
    [
        (lambda: toys.Toy("dict"), "MultiInputPolicy", {}),
        (Counted, "MlpPolicy", {}),
        (Several, "MlpPolicy", {}),
        (Free, "MlpPolicy", {}),
        (Free, "MlpPolicy", {"use_sde": True}),
    ],
    ids=["dict", "discrete", "several", "continuous", "noise that depends on the state"],
)
def test_other_observations_and_actions(env, policy, options):
    callback = EvennessCallback(SHORT, short_facts, settings=JudgeSettings(4, "score@1"))
    model = A2C(policy, DummyVecEnv([env] * 3), n_steps=16, **(SMALL | options))
    model.learn(16 * 3 * 4, callback)
    assert len(callback.reflections) == 4
    assert len(callback.ledger) > 30
    cosines = [one.cosine[-1, -1] for one in callback.reflections]
    assert np.isfinite(cosines).any()


@pytest.mark.parametrize("wrapped", ["normalised", "processes"])
def test_other_ways_of_many_environments(wrapped):
    plain = EvennessCallback(toys.SCHEME, toys.facts_of)
    A2C("MlpPolicy", DummyVecEnv([toys.Toy] * 2), n_steps=16, **SMALL).learn(96, plain)
    envs = (
        VecNormalize(DummyVecEnv([toys.Toy] * 2), norm_reward=False)
        if wrapped == "normalised"
        else SubprocVecEnv([toys.Toy] * 2, start_method="spawn")  # a fork server would stay
    )
    callback = EvennessCallback(toys.SCHEME, toys.facts_of)
    A2C("MlpPolicy", envs, n_steps=16, **SMALL).learn(96, callback)
    envs.close()
    assert len(callback.ledger) == len(plain.ledger) > 15
    for a, b in zip(callback.ledger.rows(), plain.ledger.rows(), strict=True):
        np.testing.assert_array_equal(a, b)


def test_numbers_go_where_its_own_go(tmp_path):
    from stable_baselines3.common.logger import configure

    model = ppo(DummyVecEnv([toys.Toy] * 3))
    model.set_logger(configure(str(tmp_path), ["csv"]))
    model.learn(96, EvennessCallback(toys.SCHEME, toys.facts_of))
    model.logger.close()
    header, _, second = (tmp_path / "progress.csv").read_text().splitlines()
    for name in ("total", "without_issue", "services", "paid", "reflection_cosine"):
        assert f"evenness/{name}" in header.split(",")
    row = dict(zip(header.split(","), second.split(","), strict=True))
    assert float(row["evenness/services"]) > 20


class TestWrongInput:
    def test_a_learner_without_rollouts(self):
        env = DummyVecEnv([toys.Toy])
        model = DQN("MlpPolicy", env, buffer_size=100, device="cpu")
        with refused("unsupported model"):
            model.learn(10, EvennessCallback(toys.SCHEME, toys.facts_of))

    def test_another_number_of_environments(self):
        callback = EvennessCallback(toys.SCHEME, toys.facts_of)
        ppo(DummyVecEnv([toys.Toy] * 3)).learn(48, callback)
        with refused("changed callback", "3", "2"):
            ppo(DummyVecEnv([toys.Toy] * 2)).learn(48, callback)

    def test_surgery_and_a_penalty_without_a_detector(self):
        with refused("unsupported method"):
            JudgeSettings(method="surgery")
        with refused("missing detector"):
            EvennessCallback(toys.SCHEME, toys.facts_of, settings=JudgeSettings(method="penalty"))

    def test_facts_that_make_no_sense_are_named(self):
        def wrong(ended):
            return toys.facts_of(ended) | {"steps": -ended.steps}

        with refused("range steps", "'steps'"):
            ppo(DummyVecEnv([toys.Toy])).learn(32, EvennessCallback(toys.SCHEME, wrong))


def test_nothing_is_warned_of():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ppo(restaurant(2)).learn(64, EvennessCallback(SCHEME, facts_of))
