"""A run folder: stopped anywhere it goes on bit for bit, and what does not fit is refused."""

import json
import os
import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evenhand.core import files
from evenhand.core.errors import InputError
from evenhand.methods import detector_file
from evenhand.training import epoch_log, run_folder
from evenhand.training.settings import TrainSettings, settings_of

SETTINGS = replace(settings_of("service", "reinforce", "penalty", epochs=5), people=3)
EVERY = 2


@pytest.fixture(scope="module")
def detector():
    return detector_file.load(detector_file.SHIPPED)


def execute(folder: Path, detector, settings: TrainSettings = SETTINGS, progress=None) -> None:
    run_folder.execute(folder, settings, detector, every=EVERY, progress=progress, recorded=True)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory, detector) -> Path:
    """A finished run; no test may change it."""
    folder = tmp_path_factory.mktemp("undisturbed") / "run"
    execute(folder, detector)
    return folder


@pytest.fixture
def half(tmp_path, detector) -> Path:
    """A run that was stopped in epoch 4 of 5, after the checkpoint of epoch 4."""
    folder = tmp_path / "half"
    told: list[int] = []

    def stop(numbers) -> None:
        told.append(numbers["epoch"])
        if len(told) == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        execute(folder, detector, progress=stop)
    assert told == [0, 1, 2, 3, 4]
    return folder


class TestFolder:
    def test_threads_change_no_bit(self, tmp_path, undisturbed, detector):
        run_folder.execute(tmp_path, SETTINGS, detector, every=EVERY, recorded=True, threads=2)
        there = [path for path in undisturbed.rglob("[!.]*") if path.is_file()]
        assert len(there) > 6
        for path in there:
            name = path.relative_to(undisturbed)
            assert (tmp_path / name).read_bytes() == path.read_bytes(), name

    def test_what_a_finished_run_holds(self, undisturbed):
        assert sorted(p.name for p in undisturbed.iterdir() if p.name != ".lock") == [
            "checkpoint.npz", "detector.json", "epochs.jsonl", "services", "settings.json",
            "states",
        ]  # fmt: skip
        assert sorted(os.listdir(undisturbed / "services")) == [
            "000000-000002.parquet", "000002-000004.parquet", "000004-000005.parquet",
        ]  # fmt: skip
        assert sorted(os.listdir(undisturbed / "states")) == [
            "000000-000002.npz", "000002-000004.npz", "000004-000005.npz",
        ]  # fmt: skip
        noted = json.loads((undisturbed / "settings.json").read_text())
        assert noted["settings"]["people"] == 3
        assert noted["seed"] == 0
        assert noted["versions"]["mujoco"].startswith("4.")
        assert [line["epoch"] for line in epoch_log.read(undisturbed)] == [0, 1, 2, 3, 4]
        table = run_folder.read_services(undisturbed)
        assert table.fact("service").tolist() == list(range(15))
        assert table.fact("epoch").tolist() == np.repeat(range(5), 3).tolist()
        assert detector_file.load(undisturbed / "detector.json") == detector_file.load(
            detector_file.SHIPPED
        )

    def test_a_finished_run_stays_as_it_is(self, undisturbed, detector, content):
        before = content(undisturbed)
        told: list[dict] = []
        run_folder.execute(undisturbed, SETTINGS, detector, every=EVERY, progress=told.append)
        assert content(undisturbed) == before
        assert told == [{"services": 15, "physics_steps": 0}]

    def test_the_same_seed_gives_the_same_bits(self, undisturbed, detector, tmp_path, content):
        execute(tmp_path / "again", detector)
        assert content(tmp_path / "again") == content(undisturbed)


class Killed(BaseException):
    """The process is gone."""


class TestStoppedAnywhere:
    @pytest.mark.slow
    def test_at_every_write(self, undisturbed, detector, tmp_path, content, monkeypatch):
        """Stopped before and after each file appears: the same command ends with the same bits."""
        wanted, replaced, synced = content(undisturbed), os.replace, os.fsync
        moments = 0
        for after in (False, True):
            for moment in range(100):
                folder = tmp_path / f"{moment}-{after}"
                left = [moment]

                def strike(act, *arguments, left=left, after=after):
                    left[0] -= 1
                    if left[0] == -1 and not after:
                        raise Killed
                    act(*arguments)
                    if left[0] == -1:
                        raise Killed

                with monkeypatch.context() as patch:
                    patch.setattr(os, "replace", lambda *a, s=strike: s(replaced, *a))
                    patch.setattr(os, "fsync", lambda *a, s=strike: s(synced, *a))
                    try:
                        execute(folder, detector)
                    except Killed:
                        moments += 1
                    else:
                        break
                execute(folder, detector)
                assert content(folder) == wanted, (moment, after)
        # 3 files at the start; services, log and checkpoint three times; most are synced first
        assert moments > 2 * (3 + 3 * 3)

    @pytest.mark.slow
    def test_by_a_kill_at_any_moment(self, apart, tmp_path, content):
        words = ("--algorithm", "reinforce", "--epochs", 60, "--people", 3)
        calm, killed = tmp_path / "calm", tmp_path / "killed"
        assert apart("train", "--out", calm, *words).code == 0

        def kill_when(ready) -> int:
            process = apart.start("train", "--out", killed, *words)
            while process.poll() is None and not ready():
                time.sleep(0.01)
            process.send_signal(signal.SIGKILL)
            process.communicate()
            return process.returncode

        kept = killed / "services"
        assert kill_when(lambda: (killed / "epochs.jsonl").exists()) == -signal.SIGKILL
        assert kill_when(lambda: kept.exists() and any(kept.iterdir())) == -signal.SIGKILL
        ended = apart("train", "--out", killed, *words)
        assert (ended.code, ended.err) == (0, "")
        assert content(killed) == content(calm)

    def test_what_was_begun_after_the_checkpoint_is_done_again(
        self, half, undisturbed, detector, content
    ):
        assert len(epoch_log.read(half)) == 4
        with (half / "epochs.jsonl").open("a") as log:
            log.write('{"epoch": 4, "total": 0.1')
        (half / "services" / "000004-000005.parquet").write_bytes(b"PAR1 half")
        (half / "services" / "000004-000006.parquet").write_bytes(b"PAR1 of other steps")
        (half / "services" / "000004-000005.parquet.part").write_bytes(b"PAR1")
        (half / "states" / "000004-000006.npz").write_bytes(b"PK of other steps")
        (half / "states" / ".000004-000005.npz.123.part").write_bytes(b"PK")
        (half / ".checkpoint.npz.123.part").write_bytes(b"PK")
        told: list[dict] = []
        execute(half, detector, progress=told.append)
        assert content(half) == content(undisturbed)
        assert [n["services"] for n in told] == [12, 3]
        assert not list(half.rglob("*.part"))

    def test_before_the_first_checkpoint(self, apart, cli, tmp_path):
        """Ctrl-C: one sentence, and the folder goes on."""
        process = apart.start("train", "--out", tmp_path / "run", "--people", 4, "--epochs", 5000)
        while not (tmp_path / "run" / "epochs.jsonl").exists():
            assert process.poll() is None
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate()
        assert (process.returncode, out) == (130, "")
        assert err == (
            "evenhand: stopped; what was finished is kept, the same command goes on from there\n"
        )
        said = cli("evaluate", tmp_path / "run", "--services", 30).complaint
        assert said == (
            f"{tmp_path / 'run'} has no checkpoint yet, there is one every 50 epochs: "
            "let the run go on"
        )


class TestEvaluate:
    @pytest.mark.slow
    def test_a_finished_and_an_unfinished_run(self, cli, half, undisturbed):
        for folder, epochs in ((undisturbed, 5), (half, 4)):
            shown = cli("evaluate", folder, "--services", 30)
            assert (shown.code, shown.err) == (0, "")
            assert (
                f"after {epochs} of 5 epochs: 30 services, scenario even, seed 1000000"
                in " ".join(shown.out.split())
            )
        found = [
            json.loads(cli("evaluate", undisturbed, "--services", 300, "--json", *more).out)
            for more in ((), (), ("--population", "us"))
        ]
        assert found[0] == found[1] != found[2]

    def test_no_run_at_all(self, cli, tmp_path):
        assert cli("evaluate", "nowhere").complaint == (
            "nowhere holds no run: there is no settings.json in it"
        )


class TestOneAtATime:
    def test_a_folder_in_use(self, cli, half):
        with files.locked(half):
            said = cli("train", "--out", half).complaint
        assert said == f"another process works in {half}: wait for it or give another folder"

    def test_two_commands_at_once(self, apart, tmp_path):
        words = ("train", "--out", tmp_path / "run", "--people", 4, "--epochs", 5000)
        first = apart.start(*words)
        try:
            while not (tmp_path / "run" / "settings.json").exists():
                assert first.poll() is None
                time.sleep(0.01)
            assert apart(*words).complaint.startswith("another process works in ")
        finally:
            first.kill()
            first.communicate()


def spoil_checkpoint(keep: float):
    def spoil(folder: Path) -> None:
        path = folder / "checkpoint.npz"
        path.write_bytes(path.read_bytes()[: int(keep * path.stat().st_size)])

    return spoil


def edit_settings(change):
    def spoil(folder: Path) -> None:
        content = json.loads((folder / "settings.json").read_text())
        change(content)
        (folder / "settings.json").write_text(json.dumps(content))

    return spoil


def edit_log(change):
    def spoil(folder: Path) -> None:
        lines = (folder / "epochs.jsonl").read_text().splitlines(keepends=True)
        (folder / "epochs.jsonl").write_text("".join(change(lines)))

    return spoil


def write(name: str, text: str):
    return lambda folder: (folder / name).write_text(text)


def remove(name: str):
    return lambda folder: (folder / name).unlink()


SPOILT = [
    *((spoil_checkpoint(k), r"checkpoint.npz is cut off or damaged") for k in (0.1, 0.5, 0.999)),
    (spoil_checkpoint(0.0), r"checkpoint.npz is not a checkpoint of Evenhand"),
    (write("settings.json", ""), r"settings.json is no JSON or was cut off \(line 1\)"),
    (write("settings.json", '{"settings": {"seed'), r"settings.json is no JSON or was cut off"),
    (write("settings.json", "[1]"), r"settings.json is no record of fields and values: delete"),
    (write("settings.json", "{}"), r"settings.json is damaged, it needs the fields settings"),
    (
        edit_settings(lambda c: c["settings"].update(seed=7)),
        r"settings.json was changed after the run began: restore it",
    ),
    (
        edit_settings(lambda c: c["settings"].update(colour="red")),
        r"settings.json was changed after the run began: restore it",
    ),
    (edit_settings(lambda c: c.update(fingerprints=3)), r"settings.json was changed after"),
    (
        edit_settings(lambda c: c["versions"].update(mujoco="3.9.9")),
        r'was begun with other versions \(mujoco "3.9.9" there and "4\.[\d.]+" here\)',
    ),
    (remove("epochs.jsonl"), r"epochs.jsonl has 0 lines, but 4 epochs have run: delete"),
    (edit_log(lambda lines: lines[:3]), r"epochs.jsonl has 3 lines, but 4 epochs have run"),
    (
        edit_log(lambda lines: [*lines[:3], lines[3][:40]]),
        r"epochs.jsonl line 4 is cut off or damaged: delete",
    ),
    (edit_log(lambda lines: lines[1:] + lines[:1]), r"epochs.jsonl line 1 is cut off or damaged"),
    (edit_log(lambda lines: ["[]\n", *lines[1:]]), r"epochs.jsonl line 1 is cut off or damaged"),
    (
        remove("services/000000-000002.parquet"),
        r"services lacks the services of epoch 0: delete .* and run the same command again",
    ),
    (remove("services/000002-000004.parquet"), r"services lacks the services of epoch 2"),
]


@pytest.mark.parametrize(("spoil", "said"), SPOILT)
def test_a_damaged_run_is_refused_and_left_alone(half, detector, content, spoil, said):
    spoil(half)
    before = content(half)
    with pytest.raises(InputError, match=said) as refused:
        execute(half, detector)
    assert "\n" not in str(refused.value)
    assert content(half) == before


def test_a_run_of_another_version_cannot_be_evaluated(half):
    def rename(content: dict) -> None:
        content["settings"]["patience"] = content["settings"].pop("threshold")
        content["whole"] = run_folder.checkpoint.fingerprint(content["settings"])

    edit_settings(rename)(half)
    with pytest.raises(InputError, match="differs in patience, threshold: use that version"):
        run_folder.load_policy(half)


def test_a_missing_detector_is_written_again(half, undisturbed, detector, content):
    (half / "detector.json").unlink()
    execute(half, detector)
    assert content(half) == content(undisturbed)


OTHERS = [
    (replace(SETTINGS, seed=1), "seed 0 there and 1 here"),
    (replace(SETTINGS, people=4), "people 3 there and 4 here"),
    (
        replace(SETTINGS, method=replace(SETTINGS.method, lam=0.25)),
        "method.settings.lam 0.5 there and 0.25 here",
    ),
]


@pytest.mark.parametrize(("settings", "said"), OTHERS)
def test_another_run_is_refused(half, detector, content, settings, said):
    before = content(half)
    with pytest.raises(InputError) as refused:
        execute(half, detector, settings)
    assert str(refused.value) == (
        f"{half} holds another run ({said}): give another folder, or delete this one"
    )
    assert content(half) == before


def test_another_detector_is_refused(half, detector):
    with pytest.raises(InputError, match=r"holds another run \(another detector\): give"):
        execute(half, replace(detector, threshold=0.6))


def test_a_checkpoint_of_another_run_is_refused(half, detector, tmp_path):
    execute(tmp_path / "other", detector, replace(SETTINGS, seed=1))
    os.replace(tmp_path / "other" / "checkpoint.npz", half / "checkpoint.npz")
    with pytest.raises(InputError, match=r"belongs to other settings \(settings\); resume with"):
        execute(half, detector)


@pytest.mark.slow
def test_a_full_disk_loses_nothing(apart, undisturbed, half, detector, content, monkeypatch):
    """What was finished before stays, and the same command goes on when there is room."""
    before = content(half)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(InputError, match=r"cannot be written: No space left on device"):
            execute(half, detector)
    assert content(half) == before
    execute(half, detector)
    assert content(half) == content(undisturbed)
