"""A sweep on this machine: stopped, robbed of a worker, hindered; and all it promises."""

import csv
import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from evenhand.core import files
from evenhand.experiments import provenance
from evenhand.experiments.comparison import compare
from evenhand.experiments.comparison.settings import Cell

FILE = """
scenarios = ["tips"]
algorithms = ["reinforce"]
epochs = 600
people = 10
services = 300
[[runs]]
arms = ["reference", "service"]
seeds = 2
[[runs]]
arms = ["levelup@2"]
seeds = [3]
epochs = 3
people = 30
"""
SLOW, QUICK = "epochs=600,people=10,services=300", "epochs=3,services=300"
CLOCKED = ("clock.json", "manifest.json", "report.html", "runs.csv")

pytestmark = [pytest.mark.slow, pytest.mark.long]


def steady(whole: dict[str, bytes]) -> dict[str, bytes]:
    """Without the files that tell how long something took."""
    return {name: what for name, what in whole.items() if not name.endswith(CLOCKED)}


def made(folder: Path) -> dict[str, int]:
    """When each run ended."""
    return {str(p.relative_to(folder)): p.stat().st_mtime_ns for p in folder.rglob("done.json")}


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("file") / "sweep.toml"
    path.write_text(FILE)
    return path


@pytest.fixture(scope="module")
def calm(apart, file, tmp_path_factory) -> Path:
    """One process, undisturbed; no test may change it."""
    folder = tmp_path_factory.mktemp("calm") / "out"
    ended = apart("sweep", file, "--out", folder, "--workers", 1)
    assert (ended.code, ended.err) == (0, "")
    assert ended.out.endswith(f"\n{folder / 'report.html'}\n")
    return folder


def test_every_promised_file_is_there(calm, file):
    assert sorted(path.name for path in calm.iterdir() if path.name != ".lock") == [
        "experiment.json", "fronts.csv", "manifest.json", "report.html", "results.csv",
        "runs.csv", "summary.csv", "sweep.toml", "variants",
    ]  # fmt: skip
    assert (calm / "sweep.toml").read_text() == FILE
    assert sorted(path.name for path in (calm / "variants").iterdir()) == [QUICK, SLOW]
    for variant in (QUICK, SLOW):
        assert (calm / "variants" / variant / "report.html").exists()
    noted = json.loads((calm / "manifest.json").read_text())
    assert (noted["runs"], noted["failed"], noted["workers"]) == (5, 0, 1)
    assert noted["variants"][QUICK] == {"epochs": 3, "people": 30, "services": 300}
    found = rows(calm / "runs.csv")
    assert [row["state"] for row in found] == ["done"] * 5
    assert [(row["variant"], row["arm"], row["seed"]) for row in found] == [
        (SLOW, "reference", "0"), (SLOW, "service", "0"), (SLOW, "reference", "1"),
        (SLOW, "service", "1"), (QUICK, "levelup@2", "3"),
    ]  # fmt: skip
    for row in found:
        seconds = json.loads((calm / row["folder"] / "clock.json").read_text())["seconds"]
        assert float(row["seconds"]) == seconds > 0


def test_a_run_is_the_one_of_a_comparison(calm, tmp_path):
    """The same arm, scenario, seed and settings give the same numbers as `evenhand compare`."""
    cell = Cell("tips", "reinforce", "levelup@2", 3)
    compare.train_and_test(
        tell=lambda *_: None, cell=cell, out=tmp_path, made=provenance.now(), epochs=3, services=300
    )
    theirs = json.loads((cell.folder(tmp_path) / "done.json").read_text())["test"]
    ours = cell.folder(calm / "variants" / QUICK)
    assert json.loads((ours / "done.json").read_text())["test"] == theirs
    for name in ("checkpoint.npz", "epochs.jsonl", "settings.json"):
        assert (ours / name).read_bytes() == (cell.folder(tmp_path) / name).read_bytes()
    table = {
        row["metric"]: float(row["value"])
        for row in rows(calm / "results.csv")
        if row["variant"] == QUICK
    }
    assert table == theirs


def test_processes_interruptions_and_lost_workers_change_nothing(
    apart, alive, calm, file, tmp_path, content
):
    """Two processes: one is killed, all are stopped by Ctrl-C, and the same command goes on."""
    out = tmp_path / "out"
    words = ("sweep", file, "--out", out, "--workers", 2)

    def begun() -> list[Path]:
        return [*out.rglob("settings.json")]

    def workers(parent: int) -> list[int]:
        """Its children that work: not the tracker of resources, which multiprocessing starts."""
        found = []
        for stat in Path("/proc").glob("[0-9]*/stat"):
            command = stat.with_name("cmdline").read_text()
            if int(stat.read_text().rsplit(")", 1)[1].split()[1]) == parent:
                found += [int(stat.parent.name)] if "spawn_main" in command else []
        return found

    with apart.at_work(*words, when=begun) as process:
        at_work = workers(process.pid)
        assert len(at_work) == 2
        os.kill(at_work[0], signal.SIGKILL)
        # until another one is in its place, and something has ended
        while len({*workers(process.pid)} - {at_work[0]}) < 2 or not made(out):
            assert process.poll() is None
            time.sleep(0.02)
        ended = apart.interrupt(process)
        assert (ended.code, ended.out) == (130, "")
        lost, stopped = ended.err.splitlines()
        assert "its process ended with code -9 (out of memory, or killed); tried again" in lost
        assert stopped.endswith("the same command goes on from there")
        assert alive(process.pid) == []
    kept = made(out)
    assert apart(*words).code == 0
    assert kept.items() <= made(out).items()  # nothing that had ended was done again
    wanted, found = steady(content(calm)), steady(content(out))
    assert found.keys() == wanted.keys()
    assert [name for name in wanted if found[name] != wanted[name]] == []
    # once more: nothing is left to do
    kept = made(out)
    assert apart(*words).code == 0
    assert made(out) == kept
    assert {row["attempts"] for row in rows(out / "runs.csv")} == {"0"}


def test_a_run_that_fails_is_told_and_the_others_end(apart, calm, file, tmp_path, content):
    out = tmp_path / "out"
    hindered = out / "variants" / SLOW / "runs" / "tips" / "reinforce" / "service" / "seed-00"
    words = ("sweep", file, "--out", out)
    assert apart(*words, "--workers", 0).code == 2
    out.mkdir(exist_ok=True)
    files.write_json(out / "experiment.json", files.read_json(calm / "experiment.json"))
    hindered.mkdir(parents=True)
    (hindered / "thesis.tex").write_text("years of work")
    ended = apart(*words)
    assert ended.code == 1
    said = f"{hindered} is not empty and holds no run: give another folder"
    assert ended.err.splitlines() == [
        f"evenhand: {SLOW}: tips, reinforce, service, seed 0 failed: {said}",
        f"evenhand: 1 of 5 runs failed, see {out / 'failures.txt'}; the same command tries them "
        "again",
    ]
    assert ended.out.endswith(f"\n{out / 'report.html'}\n")
    states = {row["folder"]: (row["state"], row["reason"]) for row in rows(out / "runs.csv")}
    assert states.pop(str(hindered.relative_to(out))) == ("failed", said)
    assert set(states.values()) == {("done", "")}
    assert said in (out / "failures.txt").read_text()
    assert "Failed runs" in (out / "report.html").read_text()
    kept = made(out)
    (hindered / "thesis.tex").unlink()
    assert apart(*words).code == 0
    assert kept.items() <= made(out).items()
    assert not (out / "failures.txt").exists()
    assert steady(content(out)) == steady(content(calm))


@pytest.fixture
def copy(calm, tmp_path) -> Callable[[], Path]:
    """A folder that belongs to a sweep, without its runs."""

    def make() -> Path:
        out = tmp_path / "copy"
        out.mkdir()
        (out / "experiment.json").write_bytes((calm / "experiment.json").read_bytes())
        return out

    return make


def test_the_second_of_two_is_told(cli, file, copy):
    out = copy()
    with files.locked(out):
        said = cli("sweep", file, "--out", out).complaint
    assert said == f"another process works in {out}: wait for it or give another folder"


def test_a_sweep_of_other_versions_is_left_alone(cli, file, copy, content):
    out = copy()
    noted = files.read_json(out / "experiment.json")
    noted["versions"]["evenhand"] = "0.0.9"
    files.write_json(out / "experiment.json", noted)
    before = content(out)
    assert cli("sweep", file, "--out", out).complaint == (
        f'{out} was begun with other versions (evenhand "0.0.9" there and "0.1.0" here): install '
        "those, or begin anew in another folder"
    )
    assert content(out) == before


def test_a_folder_of_something_else_is_left_alone(cli, file, tmp_path):
    files.write_json(tmp_path / "experiment.json", {"experiment": "compare", "epochs": 3})
    said = cli("sweep", file, "--out", tmp_path).complaint
    assert f"{tmp_path} holds another experiment (" in said
