"""A comparison's folder: what made its runs, and what else lies in it."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from evenhand.core import files
from evenhand.experiments import provenance
from evenhand.experiments.comparison import compare
from evenhand.experiments.comparison.settings import Cell, CompareSettings
from evenhand.training import run_folder
from support.refusals import refused

REFERENCE = Cell("tips", "none", "reference", 0)


def go(out: Path, **settings: Any) -> list[str]:
    """A comparison of the reference robot, quick; what was announced."""
    said: list[str] = []
    given = {"scenarios": ("tips",), "arms": ("reference",), "seeds": 1, "services": 300}
    chosen = CompareSettings(out=out, workers=1, epochs=2, **(given | settings))
    compare.compare(chosen, lambda name, units: lambda n, numbers: None, said.append, "the command")
    return said


def edit(path: Path, **changes: Any) -> None:
    files.write_json(path, files.read_json(path) | changes)


def older(**changes: str) -> dict[str, str]:
    return run_folder.versions() | changes


@pytest.fixture
def folder(tmp_path) -> Path:
    assert len(go(tmp_path / "out")) == 1
    return tmp_path / "out"


def manifest(folder: Path) -> dict[str, Any]:
    return files.read_json(folder / "manifest.json")


def test_runs_note_what_made_them_and_other_versions_are_not_mixed(folder):
    note = REFERENCE.folder(folder) / "done.json"
    done = files.read_json(note)
    assert done["versions"] == run_folder.versions()
    assert done["commit"] == provenance.commit()
    assert done["world"]["tips"] == 1.0
    assert manifest(folder)["made_with"] == [provenance.now() | {"runs": 1}]
    edit(note, versions=older(mujoco="3.9.9"))
    with refused("changed file", "00", "3.9"):
        go(folder, seeds=2)
    assert not Cell("tips", "none", "reference", 1).folder(folder).exists()
    edit(note, versions=older(python="3.0"), commit={"hash": "ab" * 20, "changed": False})
    go(folder, seeds=2)
    versions = [one["versions"]["python"] for one in manifest(folder)["made_with"]]
    assert versions == ["3.0", run_folder.versions()["python"]]
    edit(note, world=done["world"] | {"tips": 0.5})
    with refused("changed folder", "0.5", "1.0"):
        go(folder)


def test_a_run_from_before_versions_were_noted_goes_on_counting(folder):
    note = REFERENCE.folder(folder) / "done.json"
    done = files.read_json(note)
    files.write_json(note, {name: done[name] for name in ("key", "test", "seconds")})
    go(folder)
    assert manifest(folder)["made_with"] == [{"versions": None, "commit": None, "runs": 1}]


def test_a_run_that_only_lacks_its_test_is_of_its_versions_too(folder):
    begun = Cell("tips", "ppo", "service", 0).folder(folder)
    begun.mkdir(parents=True)
    noted = {"versions": older(mujoco="3.9.9"), "fingerprints": {}}
    files.write_json(begun / "settings.json", noted)
    with refused("changed file", "00"):
        go(folder, arms=("service",), algorithms=("ppo",))


def test_what_is_no_run_is_named_and_left_out(folder):
    copied = REFERENCE.folder(folder)
    for name in ("seed-00 old", "seed-0", "../oldarm/seed-00", "../../ppo/reference/seed-00"):
        shutil.copytree(copied, copied.parent / name)
    [_, *odd] = go(folder)
    assert len(odd) == 4
    assert all("is left out: it has not the name of a run" in sentence for sentence in odd)
    assert "seed-00 old" in " ".join(odd)
    assert manifest(folder)["runs"] == 1


def test_a_joined_scenario_counts_once_in_whichever_order_it_was_written(tmp_path):
    old = Cell("tips+perception", "none", "reference", 0)
    for cell in (old, Cell("tips", "none", "reference", 0)):
        cell.folder(tmp_path).mkdir(parents=True)
        run_folder.finish(cell.folder(tmp_path), compare.key_of(cell, 2, 300), {"test": {}})
    assert [cell.scenario for cell in compare.finished(tmp_path, 2, 300)] == [
        "tips", "perception+tips",
    ]  # fmt: skip


def test_other_versions_of_an_earlier_comparison_are_told(folder, tmp_path):
    edit(folder / "manifest.json", versions=older(mujoco="3.9.9"), made_with=[])
    said = go(tmp_path / "next", earlier=folder / "results.csv", seeds=2)
    assert len(said) == 2
    assert 'was made with other versions (mujoco "3.9.9" there' in said[1]
    page = (tmp_path / "next" / "report.html").read_text()
    assert "Earlier runs were made with other versions than the last call" in page
    assert json.loads((tmp_path / "next" / "manifest.json").read_text())["seeds"] == [0, 1]
    edit(folder / "manifest.json", versions=run_folder.versions())
    assert len(go(tmp_path / "third", earlier=folder / "results.csv")) == 1
    assert "Earlier runs were made" not in (tmp_path / "third" / "report.html").read_text()
