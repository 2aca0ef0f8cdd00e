"""Training with all answers: whole epochs of it, and what refuses it."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from evenhand.methods import registry
from evenhand.training import learners, train
from evenhand.training.settings import TrainSettings, settings_of
from evenhand.training.update import ALGORITHMS, CREDITS, UpdateSettings
from support.refusals import refused

ALL = [name for name, (_, credit) in learners.LEARNERS.items() if credit == "all_answers"]


def chosen(learner: str, method: str = "levelup", **changes) -> TrainSettings:
    base = settings_of("service", learner, method, seed=3, epochs=3)
    return replace(base, scenario="everyday", people=12, **changes)


def records(settings: TrainSettings, **more) -> list[train.EpochRecord]:
    return list(train.train(settings, train.shipped_detector(settings), **more))


def weights(record: train.EpochRecord) -> np.ndarray:
    return np.concatenate([np.ravel(x) for x in jax.tree.leaves(record.state.policy.actor)])


def test_every_algorithm_has_every_credit():
    assert set(learners.LEARNERS.values()) == {(a, c) for a in ALGORITHMS for c in CREDITS}
    assert learners.LABELS.keys() == learners.LEARNERS.keys()


@pytest.mark.slow
@pytest.mark.parametrize("learner", ALL)
def test_the_first_services_are_those_of_sampled_training(learner):
    sampled = learner.removesuffix("-all")
    (ours, *_), (theirs, *_) = records(chosen(learner)), records(chosen(sampled))
    assert ours.services == theirs.services
    assert not np.array_equal(weights(ours), weights(theirs))
    assert ours.numbers["physics_steps"] == 12 * 300
    assert theirs.numbers["physics_steps"] < 12 * 300


@pytest.mark.slow
@pytest.mark.parametrize("learner", ALL)
def test_it_goes_on_where_it_stood(learner):
    settings = chosen(learner)
    first, second, third = records(settings)
    rng = np.random.default_rng()
    rng.bit_generator.state = first.rng
    again = records(settings, state=first.state, rng=rng, first_epoch=1, memory=first.memory)
    for one, other in zip(again, (second, third), strict=True):
        np.testing.assert_array_equal(weights(one), weights(other))
        assert one.services == other.services
    np.testing.assert_array_equal(weights(records(settings, threads=2)[-1]), weights(third))


@pytest.mark.slow
@pytest.mark.parametrize("method", registry.BUILT_IN)
def test_every_method_learns_from_all_answers(method):
    found = records(chosen("ppo-all", method))
    assert all(np.isfinite(weights(one)).all() for one in found)
    assert not np.array_equal(weights(found[0]), weights(found[-1]))
    assert found[-1].numbers["update_value_loss"] is None
    assert np.isfinite(found[-1].numbers["update_policy_loss"])


@pytest.mark.slow
def test_a_prejudiced_start_is_held_near():
    base = replace(chosen("reinforce-all"), scenario="prejudiced")
    found = records(base)
    assert np.isfinite(weights(found[-1])).all()


def test_where_it_cannot_be_it_is_refused():
    with refused("conflict credit", "all_answers", "sampled"):
        settings_of("paper", "ppo-all", "penalty")

    @registry.method("of_the_past")
    class Past:
        def begin(self, scheme):
            return None

        def teach(self, epoch, memory):
            return epoch.reward, memory

    with refused("conflict credit", "of_the_past", "worth"):
        settings_of("service", "ppo-all", "of_the_past")
    assert settings_of("service", "ppo", "of_the_past").update == UpdateSettings(
        "ppo", gamma=1.0, anneal_updates=300
    )
    with refused("unknown algorithm", "ppo-all"):
        settings_of("service", "ppo-al", "service")


def test_where_an_answer_takes_time_from_others_it_is_refused():
    with refused("conflict credit", "hurry", "sampled"):
        replace(settings_of("service", "ppo-all", "levelup"), scenario="hurry")
