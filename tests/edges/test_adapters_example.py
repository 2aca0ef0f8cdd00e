"""The examples run, and say that what they show is made up or simulated."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from support.extras import wanted

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def load(name, monkeypatch):
    spec = importlib.util.spec_from_file_location(f"{name}_example", EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)  # dataclasses look there
    spec.loader.exec_module(module)
    return module


def kept(folder):
    return sorted(path.name for path in (folder / "services").iterdir())


def test_cartpole_writes_its_report(monkeypatch, tmp_path):
    example = load("cartpole", monkeypatch)
    monkeypatch.setattr(example, "ROUNDS", 2)
    text = example.main(tmp_path / "out").read_text()
    assert "Passengers and their groups are made up" in text
    assert "simulated respondents" in text
    assert kept(tmp_path / "out") == [
        "reward_alone.parquet",
        "reward_alone_tested.parquet",
        "with_level_up.parquet",
        "with_level_up_tested.parquet",
    ]


class TestOneFile:
    def test_it_writes_its_report(self, monkeypatch, tmp_path):
        example = load("ppo_single_file", monkeypatch)
        args = example.Args(out=tmp_path / "out", rollouts=3, num_envs=16, services=60)
        text = example.main(args).read_text()
        assert "needs are simulated" in text
        assert kept(tmp_path / "out") == ["levelup.parquet", "levelup_tested.parquet"]

    def test_its_advantages_by_hand(self, monkeypatch):
        example = load("ppo_single_file", monkeypatch)
        args = example.Args(gamma=0.5, gae_lambda=0.5)
        reward, value = np.array([[1.0], [2.0]]), np.array([[0.0], [1.0], [4.0]])
        # δ: 1 + 0.5·1 − 0 and 2 + 0.5·4 − 1; the first adds 0.25 times the second
        found, target = example.advantages(reward, value, np.zeros((2, 1)), args)
        assert found.ravel().tolist() == [1.5 + 0.75, 3.0]
        assert target.ravel().tolist() == [2.25, 4.0]
        # nothing follows an end: δ are 1 − 0 and 3
        found, _ = example.advantages(reward, value, np.array([[1.0], [0.0]]), args)
        assert found.ravel().tolist() == [1.0, 3.0]

    @pytest.mark.slow
    def test_it_learns(self, monkeypatch):
        example = load("ppo_single_file", monkeypatch)
        args = example.Args(rollouts=60, guidance="service", needs=0.0, num_steps=24)
        _, envs = example.train(args)
        x, _ = envs.ledger.rows()
        clean = (x != 1.0).all(axis=1)
        # an untrained robot has hardly any service without an issue
        assert clean[-200:].mean() > clean[:200].mean() + 0.2


@pytest.mark.parametrize("algorithm", ["ppo", "a2c"])
def test_stable_baselines_learns_guided(algorithm, monkeypatch):
    wanted("stable_baselines3", "the extra sb3")
    example = load("sb3_restaurant", monkeypatch)
    model, callback = example.learn(algorithm, "levelup", 6, 0)
    assert type(model).__name__ == algorithm.upper()
    assert len(callback.reflections) == 6
    assert callback.ledger.paid.min() < 0 == callback.ledger.paid.max()  # no issue is paid for


def test_stable_baselines_writes_its_report(monkeypatch, tmp_path):
    wanted("stable_baselines3", "the extra sb3")
    example = load("sb3_restaurant", monkeypatch)
    text = example.main(tmp_path / "out", "ppo", 3, 60, 0).read_text()
    assert "needs are simulated" in text
    assert "Self-reflection: updates along the bias gradient" in text
    assert "service alone, none could be raised" in text
    assert kept(tmp_path / "out") == [
        "service_alone.parquet",
        "service_alone_tested.parquet",
        "with_level_up.parquet",
        "with_level_up_tested.parquet",
    ]


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.name)
def test_an_example_is_short_enough_to_read(path):
    assert len(path.read_text().splitlines()) < 220


class TestOwnParts:
    """A method, a scenario and an environment of a user's own, and how short they are."""

    @pytest.mark.parametrize(
        ("name", "most"), [("own_method", 40), ("own_scenario", 25), ("own_environment", 60)]
    )
    def test_it_is_short(self, name, most):
        assert len((EXAMPLES / f"{name}.py").read_text().splitlines()) <= most

    def test_a_method_is_compared(self, monkeypatch):
        example = load("own_method", monkeypatch)
        result = example.main(epochs=2, seeds=1, services=300)
        assert {*result.frame["arm"]} == {"service", "levelup", "mine", "mine@0.1"}

    def test_an_environment_is_guided(self, monkeypatch):
        example = load("own_environment", monkeypatch)
        env, odds = example.main("levelup", services=300)
        env.write()
        assert len(env.services) == 300
        assert env.services.identity("pace")[1] == ("brisk", "slow")
        assert odds.sum() == pytest.approx(1.0)
