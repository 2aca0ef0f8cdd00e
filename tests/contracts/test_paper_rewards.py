"""What the services of an epoch are worth, from the robot to the update: Eq. 4 to 6 put together.

The parts are held by unit tests; here their order is: an epoch is run, what reaches the update is
caught, and the same numbers are worked out one by one from the services that the epoch recorded.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evenhand.methods import detector_file
from evenhand.methods.paper import scores
from evenhand.methods.paper.rewards import person_rewards
from evenhand.methods.paper.scores import score
from evenhand.restaurant import people
from evenhand.restaurant.simulation import layout, task
from evenhand.training import train
from evenhand.training.observation import view
from evenhand.training.policy import state_values
from evenhand.training.settings import TrainSettings, settings_of

PEOPLE = 12


def one_epoch(settings: TrainSettings, monkeypatch) -> tuple[train.EpochRecord, Any]:
    """The record of the first epoch, and what its update was given."""
    caught: list[Any] = []
    update = train.update

    def catch(state, trajectories, advantage, target, chosen, rng, fair, anchor):
        caught.append((trajectories, np.asarray(advantage), np.asarray(target)))
        return update(state, trajectories, advantage, target, chosen, rng, fair, anchor)

    monkeypatch.setattr(train, "update", catch)
    detector = detector_file.load(detector_file.SHIPPED)
    return next(train.train(settings, detector)), caught[0]


def settings(preset: str, **changes: Any) -> TrainSettings:
    chosen = settings_of(preset, "ppo", "penalty", seed=3, epochs=1)
    return replace(chosen, people=PEOPLE, **changes)


def evenness(record: train.EpochRecord, chosen: TrainSettings) -> np.ndarray:
    """Eq. 4 and 5 for each person."""
    table = record.services
    rewards = person_rewards(
        scores.score(table), scores.membership(table).inside, chosen.tau, "own_groups"
    )
    return 0.5 * rewards if record.numbers["biased_detector"] else rewards


def test_preset_paper_pays_for_evenness_alone_and_looks_on_over_people(monkeypatch):
    chosen = settings("paper")
    record, (trajectories, advantage, target) = one_epoch(chosen, monkeypatch)
    policy = train.begin(chosen).policy
    # one more person than is served is drawn first of all
    following = layout.draw(people.population("uniform"), PEOPLE + 1, train.stream(chosen))[-1:]
    none = np.zeros(1, np.int64)
    seen = task.observe(none, following.one_hot, following.start_distance, none, np.zeros(1))
    seen = view(chosen, seen)
    value_next = float(np.asarray(state_values(policy, seen))[0])
    reward = evenness(record, chosen)
    expected = [
        sum(0.99 ** (k - t) * reward[k] for k in range(t, PEOPLE))
        + 0.99 ** (PEOPLE - t) * value_next
        for t in range(PEOPLE)
    ]
    happened = np.asarray(trajectories.mask) > 0
    wanted = np.broadcast_to(np.array(expected)[:, None], happened.shape)
    np.testing.assert_allclose(target[happened], wanted[happened], rtol=1e-5)
    value = np.asarray(state_values(policy, trajectories.obs))
    np.testing.assert_allclose(
        advantage[happened], (wanted - value)[happened], rtol=1e-4, atol=1e-4
    )


@pytest.mark.parametrize("weight", [0.0, 1.0, 2.5])
def test_preset_service_adds_evenness_to_the_quality_of_service(weight, monkeypatch):
    base = settings("service", method=f"penalty@{weight}")
    # with full traces the target is the reward-to-go, and all reward comes at the end
    chosen = replace(base, update=replace(base.update, gae_lambda=1.0))
    record, (trajectories, _, target) = one_epoch(chosen, monkeypatch)
    table = record.services
    answered = table.fact("responded") == 1.0
    terms, _ = task.quality(
        answered,
        table.fact("steps"),
        np.nan_to_num(table.fact("response_distance")),  # nothing is paid without a response
        table.fact("min_distance"),
    )
    quality = terms.sum(axis=1)
    earned = quality + weight * evenness(record, chosen) / 4.0  # Eq. 4 is at most 4
    happened = np.asarray(trajectories.mask) > 0
    wanted = np.broadcast_to(earned[:, None], happened.shape)
    np.testing.assert_allclose(target[happened], wanted[happened], rtol=1e-4, atol=1e-5)


def test_only_what_the_detector_was_taught_is_judged(monkeypatch):
    record, _ = one_epoch(settings("paper"), monkeypatch)
    detector = detector_file.load(detector_file.SHIPPED)
    assert detector.identities == ("race", "gender", "age", "disability")
    scores = score(record.services).by_identity
    each = [float(detector.probability(scores[name])) for name in detector.identities]
    assert record.numbers["probability"] == pytest.approx(np.nanmax(each))
    assert record.numbers["biased_detector"] == (np.nanmax(each) > 0.5)
