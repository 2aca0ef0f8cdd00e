"""Runs taken from the table of an earlier comparison."""

import csv
import json
from pathlib import Path

import pytest

from evenhand.errors import InputError
from evenhand.experiments import compare_earlier
from evenhand.experiments.compare_settings import Cell
from evenhand.experiments.compare_tables import METRICS, RESULTS

EPOCHS, SERVICES = 300, 5000
CELLS = (Cell("tips", "ppo", "levelup", 0), Cell("tips", "none", "reference", 1))


def prints(arm: str) -> str:
    return f"print of {arm}"


def rows() -> list[list[str]]:
    """Values 0, 1, 2 ... over the cells' metrics; the reference robot has no biased epochs."""
    out = []
    for i, cell in enumerate(CELLS):
        for k, metric in enumerate(METRICS):
            missing = cell.arm == "reference" and metric == "biased_epochs"
            value = "" if missing else str(float(i * len(METRICS) + k))
            out.append([cell.scenario, cell.algorithm, cell.arm, str(cell.seed), metric, value])
    return out


def manifest() -> dict[str, object]:
    return {
        "settings": {"epochs": EPOCHS, "services": SERVICES},
        "fingerprints": {cell.arm: prints(cell.arm) for cell in CELLS},
        **{name: f"some {name}" for name in compare_earlier.NOTED},
    }


def written(folder: Path, lines: list[list[str]], noted: dict[str, object]) -> Path:
    path = folder / "compare.csv"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([RESULTS, *lines])
    path.with_suffix(".json").write_text(json.dumps(noted))
    return path


def load(path: Path) -> compare_earlier.Earlier:
    return compare_earlier.load(path, EPOCHS, SERVICES, prints)


def test_every_run_is_taken(tmp_path):
    found = load(written(tmp_path, rows(), manifest()))
    assert set(found.results) == set(CELLS)
    assert found.results[CELLS[0]] == {name: float(k) for k, name in enumerate(METRICS)}
    assert found.results[CELLS[1]]["biased_epochs"] is None
    assert found.manifest == {name: f"some {name}" for name in compare_earlier.NOTED}


def test_a_manifest_may_stand_beside_under_its_usual_name(tmp_path):
    path = written(tmp_path, rows(), manifest())
    path.with_suffix(".json").rename(tmp_path / "manifest.json")
    assert set(load(path).results) == set(CELLS)


@pytest.mark.parametrize(
    ("line", "column", "value", "said"),
    [
        (0, 4, "corected_total", "line 2: unknown metric 'corected_total'"),
        (0, 2, "levlup", "unknown arm 'levlup': did you mean 'levelup'"),
        (1, 5, "inf", "line 3: seed '0' or value 'inf' is no number"),
        (1, 3, "x", "line 3: seed 'x' or value '1.0' is no number"),
        (1, 3, "-1", "line 3: seed '-1' or value '1.0' is no number"),
        (1, 4, METRICS[0], f"line 3: {METRICS[0]} of tips, ppo, levelup, seed 0 stands there"),
    ],
)
def test_a_broken_row_is_named(tmp_path, line, column, value, said):
    lines = rows()
    lines[line][column] = value
    with pytest.raises(InputError) as caught:
        load(written(tmp_path, lines, manifest()))
    assert said in str(caught.value)


def test_a_short_row_and_a_cut_table_are_named(tmp_path):
    with pytest.raises(InputError, match="line 19: give 6 columns"):
        load(written(tmp_path, [*rows()[:-1], rows()[-1][:-2]], manifest()))
    with pytest.raises(InputError, match="lacks biased_epochs of tips, none, reference, seed 1"):
        load(written(tmp_path, rows()[:-1], manifest()))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"settings": {"epochs": 200, "services": SERVICES}}, "another comparison (epochs"),
        ({"fingerprints": {"levelup": "other"}}, "levelup had other settings in that comparison"),
    ],
)
def test_another_comparison_is_refused(tmp_path, changes, said):
    with pytest.raises(InputError) as caught:
        load(written(tmp_path, rows(), manifest() | changes))
    assert said in str(caught.value)


def test_a_table_without_manifest_or_of_something_else_is_refused(tmp_path):
    path = written(tmp_path, rows(), manifest())
    path.write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="is no table of a comparison"):
        load(path)
    path.unlink()
    with pytest.raises(InputError, match="cannot be read"):
        load(path)
    path.with_suffix(".json").unlink()
    with pytest.raises(InputError, match=r"manifest\.json"):
        load(path)
