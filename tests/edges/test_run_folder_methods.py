"""Runs that remember more than the learner go on bit for bit as well."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evenhand.methods import detector_file
from evenhand.methods.beyond.reflection import ReflectionSettings
from evenhand.training import checkpoint, imitation, run_folder, train
from evenhand.training.checkpoint import State
from evenhand.training.memory import Memory
from evenhand.training.settings import TrainSettings, settings_of

EVERY = 2
BASE = replace(
    settings_of("service", "ppo", "levelup", epochs=4),
    scenario="perception+tips",
    people=4,
    # after three updates the fourth can be an alarm, and is compared with the first
    reflection=ReflectionSettings(rate=0.25, history=3),
)
METHODS: dict[str, TrainSettings] = {
    "levelup": BASE,
    "surgery": replace(BASE, method="surgery"),
    "elbert": replace(BASE, method="elbert"),
    "group_dro": replace(BASE, method="group_dro", scenario="minority"),
    "unaware": replace(BASE, method="unaware", scenario="prejudiced"),
}


@pytest.fixture(scope="module")
def detector():
    return detector_file.load(detector_file.SHIPPED)


@pytest.fixture(autouse=True)
def few_demonstrations(monkeypatch) -> None:
    monkeypatch.setattr(imitation, "SERVICES", 60)


def stopped(folder: Path, settings: TrainSettings, detector, epoch: int) -> None:
    """A run that was stopped when this epoch had run."""

    def stop(numbers: dict[str, Any]) -> None:
        if numbers["epoch"] == epoch:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_folder.execute(folder, settings, detector, every=EVERY, progress=stop)


@pytest.mark.slow
@pytest.mark.parametrize("name", METHODS)
def test_stopped_and_resumed_is_as_undisturbed(name, detector, tmp_path, content):
    settings = METHODS[name]
    run_folder.execute(tmp_path / "calm", settings, detector, every=EVERY)
    calm = content(tmp_path / "calm")
    # in the third epoch, after the checkpoint of two
    stopped(tmp_path / "half", settings, detector, epoch=2)
    lines = (tmp_path / "half" / "epochs.jsonl").read_bytes().splitlines(keepends=True)
    assert len(lines) == 2
    run_folder.execute(tmp_path / "half", settings, detector, every=EVERY)
    resumed = content(tmp_path / "half")
    assert len(calm["epochs.jsonl"].splitlines()) == 4
    assert resumed["epochs.jsonl"] == calm["epochs.jsonl"]
    assert resumed == calm  # checkpoint with its weights and memories, and services, too


@pytest.mark.slow
def test_it_is_the_past_that_makes_it_the_same(detector, tmp_path, monkeypatch):
    """The tests above could not fail if what is remembered did not matter for two more epochs."""
    for name in ("levelup", "elbert"):
        settings = METHODS[name]
        stopped(tmp_path / name, settings, detector, epoch=2)
        empty = Memory.begin(settings)
        kept = checkpoint.load(
            tmp_path / name / "checkpoint.npz",
            State(train.untrained(settings), empty),
            {"detector": checkpoint.fingerprint(run_folder.as_dict(detector))},
        )
        assert kept.state.memory.reflection.filled == 2

        def weights(memory, settings=settings, kept=kept) -> np.ndarray:
            rng = train.stream(settings)
            rng.bit_generator.state = kept.extra["rng"]
            state = kept.state.learner
            going_on = train.train(
                settings, detector, state=state, rng=rng, first_epoch=2, memory=memory
            )
            return np.asarray(list(going_on)[-1].state.policy.actor.weights[0])

        past = kept.state.memory
        assert not np.array_equal(weights(past), weights(empty))
        np.testing.assert_array_equal(weights(past), weights(past))
