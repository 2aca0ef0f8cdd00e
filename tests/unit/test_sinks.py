"""Epochs in TensorBoard and Weights & Biases: read back, once each, however a run was stopped."""

import contextlib
import json
import logging
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evenhand.core import extras
from evenhand.core.errors import InputError
from evenhand.methods import detector_file
from evenhand.training import loggers, run_folder
from evenhand.training.settings import settings_of
from support import wandb_file
from support.refusals import refused

SETTINGS = replace(settings_of("service", "reinforce", "levelup", epochs=5), people=4)
BOTH = ("tensorboard", "wandb")


class LostError(Exception):
    """What ends a run early."""


def train(folder: Path, names: tuple[str, ...], stop_after: int | None = None) -> None:
    """Train with a checkpoint every second epoch, up to the end or to the loss of the process."""
    with loggers.opened(names, folder) as note:

        def progress(numbers):
            note(numbers)
            if stop_after is not None and numbers.get("epoch") == stop_after:
                raise LostError

        with contextlib.suppress(LostError):
            run_folder.execute(
                folder,
                SETTINGS,
                detector_file.load(detector_file.SHIPPED),
                every=2,
                progress=progress,
            )


MACHINE = "a-machine-that-nobody-has"


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory) -> Path:
    """A run with both sinks that was stopped in epoch 3, after the checkpoint before epoch 2."""
    folder = tmp_path_factory.mktemp("sinks") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("socket.gethostname", lambda: MACHINE)
        patch.setattr("platform.node", lambda: MACHINE)
        train(folder, BOTH, stop_after=3)
        train(folder, BOTH)
    return folder


def events(folder: Path) -> dict[str, list[tuple[int, float]]]:
    """Scalars by tag, (step, value), as TensorBoard itself reads them."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    # purging, which it does, is told as a warning
    logging.getLogger("tensorboard").setLevel(logging.ERROR)
    read = EventAccumulator(str(folder / "tensorboard")).Reload()
    return {
        tag: [(event.step, event.value) for event in read.Scalars(tag)]
        for tag in read.Tags()["scalars"]
    }


def logged(folder: Path) -> list[dict]:
    """Rows that Weights & Biases kept."""
    (path,) = (folder / "wandb").glob("offline-run-*/*.wandb")
    return wandb_file.history(path)


def lines(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "epochs.jsonl").read_text().splitlines()]


EXAMPLES = {
    "issues/total": "total",
    "issues/risk": "risk",
    "issues/total_race": "total_race",
    "verdict/biased_detector": "biased_detector",
    "service/perfect_rate": "perfect_rate",
    "update/policy_loss": "update_policy_loss",
    "reflection/z_age": "reflection_z_age",
    "guard/weight": "guard_weight",
}


@pytest.mark.parametrize(("tag", "name"), EXAMPLES.items())
def test_tensorboard_holds_every_epoch_once(interrupted, tag, name):
    expected = [(i, line[name]) for i, line in enumerate(lines(interrupted))]
    known = [(i, value) for i, value in expected if value is not None]
    found = events(interrupted).get(tag, [])
    assert [step for step, _ in found] == [i for i, _ in known]
    np.testing.assert_array_equal(
        [value for _, value in found], np.array([value for _, value in known], np.float32)
    )


@pytest.mark.parametrize(("tag", "name"), EXAMPLES.items())
def test_wandb_holds_every_epoch_once(interrupted, tag, name):
    rows = logged(interrupted)
    assert [row["_step"] for row in rows] == [0, 1, 2, 3, 4]
    assert [row.get(tag) for row in rows] == [
        None if line[name] is None else float(line[name]) for line in lines(interrupted)
    ]


def test_issues_of_an_own_world_stand_with_the_totals():
    line = {"epoch": 0, "total": 1.0, "Waiting": 0.5, "total_language": 0.25, "perfect_rate": 0.75}
    assert loggers.scalars(line | {"biased_detector": True, "update_clipped": 2}) == {
        "issues/total": 1.0, "issues/Waiting": 0.5, "issues/total_language": 0.25,
        "service/perfect_rate": 0.75, "verdict/biased_detector": 1.0, "update/clipped": 2.0,
    }  # fmt: skip


def test_a_sink_changes_nothing_else(interrupted, tmp_path, content):
    train(tmp_path / "plain", ())
    plain = content(tmp_path / "plain")
    both = content(interrupted)
    assert {name: both[name] for name in plain} == plain
    assert {name.split("/")[0] for name in set(both) - set(plain)} == {"tensorboard", "wandb"}


def test_nothing_of_the_machine_is_kept(interrupted):
    import getpass

    (path,) = (interrupted / "wandb").glob("offline-run-*/*.wandb")
    for private in (MACHINE, sys.prefix, str(Path(__file__).parent)):
        assert private.encode() not in path.read_bytes()
    for record in wandb_file.records(path):
        assert not record.environment.ListFields()
        assert (record.run.host, record.run.git.remote_url) == ("", "")
    assert getpass.getuser()  # there is one, and it could have been noted
    assert not list((interrupted / "wandb").glob("**/requirements.txt"))


def test_weights_and_biases_knows_the_settings(interrupted):
    (path,) = (interrupted / "wandb").glob("offline-run-*/*.wandb")
    (told,) = (r.run for r in wandb_file.records(path) if r.WhichOneof("record_type") == "run")
    assert (told.project, told.display_name) == ("evenhand", "run")
    config = {item.key: json.loads(item.value_json) for item in told.config.update}
    assert (config["epochs"], config["people"], config["method"]["name"]) == (5, 4, "levelup")


def test_the_mode_is_offline_whatever_the_environment_says(interrupted, tmp_path, monkeypatch):
    import wandb

    monkeypatch.setenv("WANDB_MODE", "online")
    folder = tmp_path / "run"
    train(folder, ())
    asked = {}
    real = wandb.init

    def init(**options):
        started = real(**options)
        asked.update(offline=started.offline, error=sys.modules["os"].environ)
        return started

    monkeypatch.setattr(wandb, "init", init)
    assert loggers.write(("wandb",), folder) == 5
    assert asked["offline"] is True
    assert asked["error"]["WANDB_ERROR_REPORTING"] == "false"


def test_sinks_can_be_written_afterwards_and_again(tmp_path):
    folder = tmp_path / "run"
    train(folder, ())
    for files in (1, 2, 2):
        assert loggers.write(("tensorboard",), folder) == 5
        assert len(list((folder / "tensorboard").iterdir())) == files
        assert [step for step, _ in events(folder)["issues/total"]] == [0, 1, 2, 3, 4]


def test_whoever_watches_sees_no_step_twice(tmp_path):
    """TensorBoard has read the events of a run that is then killed and goes on."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    logging.getLogger("tensorboard").setLevel(logging.ERROR)
    folder = tmp_path / "run"
    train(folder, ("tensorboard",), stop_after=3)
    watching = EventAccumulator(str(folder / "tensorboard")).Reload()
    assert [event.step for event in watching.Scalars("issues/total")] == [0, 1, 2, 3]
    train(folder, ("tensorboard",))
    watching.Reload()
    assert [event.step for event in watching.Scalars("issues/total")] == [0, 1, 2, 3, 4]


def test_what_is_missing_or_no_number_is_left_out():
    numbers = {"epoch": 3, "total": None, "biased_detector": True, "reflection_issue": "risk",
               "services": 30, "time_serving": 0.5, "own": 1.5}  # fmt: skip
    assert loggers.scalars(numbers) == {
        "verdict/biased_detector": 1.0,
        "service/services": 30.0,
        "time/serving": 0.5,
        "service/own": 1.5,
    }


def test_names_of_sinks():
    with refused("unknown sink", "'tensorbord'", "'tensorboard'"):
        loggers.check(("tensorbord",))
    with refused("duplicate log"):
        loggers.check(("wandb", "wandb"))


@pytest.mark.parametrize("name", BOTH)
def test_a_missing_extra_is_said_before_anything_is_written(name, tmp_path, monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda package: None)
    with (
        pytest.raises(InputError, match=rf"pip install '\.\[{name}\]'"),
        loggers.opened((name,), tmp_path / "run"),
    ):
        pass
    assert not (tmp_path / "run").exists()


def test_a_folder_without_a_run(tmp_path):
    with refused("missing folder", "settings.json"):
        loggers.write(("tensorboard",), tmp_path)


def test_a_sink_that_cannot_be_written_is_said(interrupted, tmp_path):
    folder = tmp_path / "run"
    train(folder, ())
    (folder / "tensorboard").write_text("a file")
    with pytest.raises(InputError, match="tensorboard is a file, not a folder"):
        loggers.write(("tensorboard",), folder)


def test_a_full_disk_is_said(interrupted, tmp_path, monkeypatch):
    import tensorboardX

    def full(self, data):
        raise OSError(28, "No space left on device")

    folder = tmp_path / "run"
    train(folder, ())
    monkeypatch.setattr(tensorboardX.RecordWriter, "write", full)
    with pytest.raises(InputError, match=r"evenhand cannot be written: No space left on device"):
        loggers.write(("tensorboard",), folder)


def test_nothing_is_imported_unless_asked_for(apart, tmp_path):
    script = (
        "import sys; from evenhand.cli import card, curves, minari, train;"
        "from evenhand.training import loggers; from evenhand.experiments.minari import dataset\n"
        "with loggers.opened((), 'run') as note: note({}); note({'epoch': 0, 'total': 1.0})\n"
        "print(*({'tensorboardX', 'wandb', 'minari', 'h5py'} & set(sys.modules)))"
    )
    shown = apart.of(sys.executable, "-c", script)(cwd=tmp_path)
    assert (shown.code, shown.err, shown.out) == (0, "", "\n")
    assert list(tmp_path.iterdir()) == []
