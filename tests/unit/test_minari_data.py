"""A Minari dataset, read back by Minari itself, beside the environment stepped by its own."""

import os
import shutil
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import minari
import numpy as np
import pytest

from evenhand.experiments.minari import dataset as minari_data
from evenhand.experiments.minari import episodes
from evenhand.restaurant import people, worlds
from evenhand.training import train
from evenhand.training.settings import TrainSettings, settings_of
from support.refusals import refused

SEED, SERVICES = 77, 12
RUN = replace(
    settings_of("service", "ppo", "levelup", population="us"), scenario="perception+minority"
)
FACTS = ("responded", "response_distance", "min_distance", "steps", "start_distance")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Datasets of a robot that has learned nothing yet, and of a scripted one."""
    out = tmp_path_factory.mktemp("datasets")
    server = episodes.trained(train.untrained(RUN), RUN)
    name = minari_data.Dataset("restaurant-test-v3", ("A. Ünal", "B"), ("a@b.example",))
    minari_data.write(out, name, server, SERVICES, SEED)
    ageist = episodes.scripted("ageist", 1.0, "uniform")
    minari_data.write(out, minari_data.Dataset("ageist-v0"), ageist, SERVICES, SEED)
    return out


@pytest.fixture
def load(folder, monkeypatch):
    """``minari.load_dataset`` in that folder, and nothing in the user's own."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(folder))
    return minari.load_dataset


@pytest.mark.parametrize("name", ["restaurant-test-v3", "ageist-v0"])
def test_the_environment_gives_the_same_when_it_is_stepped_again(load, name):
    """``reset`` with the seed that the dataset holds, in the environment that it holds."""
    dataset = load(name)
    env = dataset.recover_environment()
    known = list(dataset.storage.get_episode_metadata(range(SERVICES)))
    assert [one["seed"] for one in known] == list(range(SEED, SEED + SERVICES))
    for one, noted in zip(dataset.iterate_episodes(), known, strict=True):
        observation, info = env.reset(seed=noted["seed"])
        seen, rewards, ends = [observation], [], []
        for action in one.actions:
            observation, reward, terminated, truncated, last = env.step(int(action))
            seen.append(observation)
            rewards.append(reward)
            ends.append((terminated, truncated))
        np.testing.assert_array_equal(one.observations, np.array(seen))
        np.testing.assert_array_equal(one.rewards, rewards)
        np.testing.assert_array_equal(np.stack([one.terminations, one.truncations], axis=1), ends)
        assert one.terminations.tolist() == [False] * (len(one) - 1) + [True]
        codes = [int(one.infos["identities"][identity.name]) for identity in people.IDENTITIES]
        assert codes == info["identities"].tolist()
        assert set(one.infos["facts"]) == set(last["facts"])
        for fact, value in last["facts"].items():
            np.testing.assert_equal(one.infos["facts"][fact].item(), value, fact)


def test_the_world_of_the_training_is_that_of_the_dataset(load):
    spec = load("restaurant-test-v3").spec.env_spec
    assert spec.id == "evenhand/Restaurant-v0"
    assert spec.kwargs == {
        "population": "us", "interval": 5, "noise": 0.01, "dropout": 0.02, "perception": 1.0,
        "needs": 1.0,
    }  # fmt: skip


def test_the_policy_acts_by_its_own_probabilities(load):
    """Of 12 services by a policy that responds with about 4 % a decision, none knows another."""
    dataset = load("restaurant-test-v3")
    robot = train.robot(RUN, train.untrained(RUN).policy)
    for one in dataset.iterate_episodes():
        chances = np.random.default_rng([SEED + one.id, 1]).random(len(one))
        likely = robot(one.observations[:-1], np.arange(len(one)))
        np.testing.assert_array_equal(one.actions, (chances < likely).astype(int))


def test_an_episode_does_not_depend_on_those_beside_it():
    server = episodes.scripted("racist", 1.0, "uniform")
    several, alone = list(episodes.episodes(server, 6, 40)), list(episodes.episodes(server, 1, 44))
    np.testing.assert_array_equal(several[4].observations, alone[0].observations)
    np.testing.assert_array_equal(several[4].actions, alone[0].actions)
    assert several[4].facts == pytest.approx(alone[0].facts, nan_ok=True)


def test_the_same_seeds_give_the_same_dataset(folder, load, tmp_path):
    server = episodes.scripted("ageist", 1.0, "uniform")
    minari_data.write(tmp_path, minari_data.Dataset("ageist-v0"), server, SERVICES, SEED)
    again = minari.MinariDataset(tmp_path / "ageist-v0" / "data")
    for one, other in zip(load("ageist-v0").iterate_episodes(), again, strict=True):
        np.testing.assert_array_equal(one.observations, other.observations)
        np.testing.assert_array_equal(one.actions, other.actions)


def test_what_the_dataset_says_of_itself(load):
    told = load("restaurant-test-v3").storage.metadata
    assert told["author"] == {"A. Ünal", "B"}
    assert told["author_email"] == {"a@b.example"}
    assert told["algorithm_name"] == "ppo"
    assert told["seeds"] == [SEED, SEED + SERVICES - 1]
    assert told["synthetic"] is True
    assert told["identities"]["disability"] == ["Yes", "No"]
    assert told["robot"]["scenario"] == "perception+minority"
    assert "The people are synthetic" in told["description"]
    assert "code_permalink" not in told
    anonymous = load("ageist-v0").storage.metadata
    assert "author" not in anonymous
    assert anonymous["robot"] == {"strength": 1.0}


def test_minari_lists_filters_and_splits_it(load, folder):
    assert list(minari.list_local_datasets()) == ["ageist-v0", "restaurant-test-v3"]
    dataset = load("ageist-v0")
    assert (dataset.total_episodes, dataset.spec.action_space) == (12, gym.spaces.Discrete(2))
    assert dataset.total_steps == sum(len(one) for one in dataset)
    few = dataset.filter_episodes(lambda one: bool(one.infos["facts"]["responded"]))
    assert 0 < few.total_episodes <= 12
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        parts = minari.split_dataset(dataset, sizes=[8, 4], seed=1)
    assert [part.total_episodes for part in parts] == [8, 4]


def test_nothing_is_left_of_a_dataset_that_could_not_be_written(tmp_path, monkeypatch):
    def full(name, *_, **__):
        begun = Path(os.environ["MINARI_DATASETS_PATH"]) / name / "data"
        begun.mkdir(parents=True)
        (begun / "main_data.hdf5").write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(minari, "create_dataset_from_buffers", full)
    monkeypatch.setenv("MINARI_DATASETS_PATH", "elsewhere")
    server = episodes.scripted("even", 1.0, "uniform")
    with refused("unavailable file"):
        minari_data.write(tmp_path, minari_data.Dataset("x-v0"), server, 1, 0)
    assert list(tmp_path.iterdir()) == []
    assert os.environ["MINARI_DATASETS_PATH"] == "elsewhere"


def test_a_dataset_is_never_replaced(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "kept")
    server = episodes.scripted("even", 1.0, "uniform")
    with refused("duplicate file"):
        minari_data.write(tmp_path / "kept", minari_data.Dataset("ageist-v0"), server, 1, 0)


@pytest.mark.parametrize("name", ["x", "../x-v0", "a/b-v0", "x v0", "", "-x-v0", "é-v0"])
def test_names_that_minari_or_a_folder_would_not_take(name):
    with refused("format name"):
        minari_data.Dataset(name)


def test_the_missing_extra_is_said(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "minari", None)
    server = episodes.scripted("even", 1.0, "uniform")
    with refused("unavailable minari", "'.[minari]'"):
        minari_data.write(tmp_path / "new", minari_data.Dataset("x-v0"), server, 1, 0)
    assert not (tmp_path / "new").exists()


def test_a_world_that_the_environment_does_not_know(monkeypatch):
    monkeypatch.setattr(worlds, "_SCENARIOS", dict(worlds._SCENARIOS))
    worlds.register_scenario("missed", world=worlds.World(missed={"disability=Yes": 0.3}))
    settings = TrainSettings("service", scenario="missed")
    with refused("unsupported scenario", "'missed'"):
        episodes.trained(train.untrained(settings), settings)
