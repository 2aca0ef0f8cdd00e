"""Runs taken from the table of an earlier comparison."""

import csv
import json
from pathlib import Path

import pytest

from evenhand.core.errors import InputError
from evenhand.experiments.comparison import earlier
from evenhand.experiments.comparison.settings import Cell
from evenhand.experiments.comparison.tables import METRICS, RESULTS
from support.refusals import refused

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
        **{name: f"some {name}" for name in earlier.NOTED},
    }


def written(folder: Path, lines: list[list[str]], noted: dict[str, object]) -> Path:
    path = folder / "compare.csv"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([RESULTS, *lines])
    path.with_suffix(".json").write_text(json.dumps(noted))
    return path


def load(path: Path) -> earlier.Earlier:
    return earlier.load(path, EPOCHS, SERVICES, prints, "judge")


def test_it_is_said_where_all_runs_come_from(tmp_path):
    noted = manifest() | {"created": "2026-11-22", "run_seconds": 35610.1}
    noted["commit"] = {"hash": "b75a81a022fed6", "changed": False}
    path = written(tmp_path, rows(), noted)
    assert earlier.all_of_it(path, load(path)) == (
        f"nothing to run: all runs are taken from {path}, written 2026-11-22 by commit b75a81a022, "
        "after 9.9 h of computing"
    )


def test_what_runs_of_yet_earlier_ones_took_counts_too(tmp_path):
    before = {"run_seconds": 3600.0, "earlier": {"run_seconds": 7200, "earlier": None}}
    noted = manifest() | {"created": "2026-11-22", "run_seconds": 1800.0, "earlier": before}
    path = written(tmp_path, rows(), noted)
    assert "after 3.5 h of computing" in earlier.all_of_it(path, load(path))


def test_every_run_is_taken(tmp_path):
    found = load(written(tmp_path, rows(), manifest()))
    assert set(found.results) == set(CELLS)
    assert found.results[CELLS[0]] == {name: float(k) for k, name in enumerate(METRICS)}
    assert found.results[CELLS[1]]["biased_epochs"] is None
    assert found.manifest == {name: f"some {name}" for name in earlier.NOTED}


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
        (1, 3, "1_0", "line 3: seed '1_0' or value '1.0' is no number"),
        (0, 0, "tip", "line 2: unknown scenario 'tip': did you mean 'tips'"),
        (0, 1, "pppo", "line 2: unknown algorithm of arm levelup 'pppo': did you mean 'ppo'"),
        (0, 1, "none", "line 2: unknown algorithm of arm levelup 'none'"),
        (-1, 1, "ppo", "unknown algorithm of arm reference 'ppo': choose one of none"),
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
    with refused("format file", "21", "6"):
        load(written(tmp_path, [*rows()[:-1], rows()[-1][:-2]], manifest()))
    with refused("missing file", "1"):
        load(written(tmp_path, rows()[:-1], manifest()))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"settings": {"epochs": 200, "services": SERVICES}}, "another comparison (epochs"),
        ({"fingerprints": {"levelup": "other"}}, "levelup had other settings in that comparison"),
        ({"detector": "another"}, "another detector judged in that comparison"),
        ({"worlds": {"tips": {"tips": 0.5}}}, "scenario tips was another one in that comparison"),
        ({"fingerprints": None}, "fingerprints is None, and has to be a record: restore the file"),
        ({"fingerprints": []}, "fingerprints is [], and has to be a record: restore the file"),
        ({"settings": []}, "settings is [], and has to be a record: restore the file"),
    ],
)
def test_another_comparison_is_refused(tmp_path, changes, said):
    with pytest.raises(InputError) as caught:
        load(written(tmp_path, rows(), manifest() | changes))
    assert said in str(caught.value)


def test_what_is_noted_of_scenarios_and_the_detector_may_be_the_same(tmp_path):
    tips = {"population": "uniform", "perception": 0.0, "needs": 0.0, "tips": 1.0, "prejudice": 0.0}
    noted = manifest() | {"detector": "judge", "worlds": {"tips": tips}, "made_with": ["a"]}
    found = load(written(tmp_path, rows(), noted))
    assert set(found.results) == set(CELLS)
    assert found.manifest["made_with"] == ["a"]


def test_names_are_written_in_one_way(tmp_path):
    lines = rows()
    for line in lines[: len(METRICS)]:
        line[0], line[2] = "tips+perception", "levelup@5.0"
    noted = manifest() | {
        "fingerprints": {"levelup@5.0": prints("levelup@5"), "reference": prints("reference")}
    }
    found = load(written(tmp_path, lines, noted))
    assert set(found.results) == {Cell("perception+tips", "ppo", "levelup@5", 0), CELLS[1]}
    both = lines + [[*line[:2], "levelup@5", *line[3:]] for line in lines[: len(METRICS)]]
    with refused("duplicate file"):
        load(written(tmp_path, both, noted))


def test_a_table_of_nothing_and_a_sweep_are_refused(tmp_path):
    with refused("empty file"):
        load(written(tmp_path, [], manifest()))
    # a sweep's manifest has none of a comparison's settings, and nothing of it is damaged
    path = written(tmp_path, rows(), dict.fromkeys(earlier.NOTED, 1))
    with refused("format file") as caught:
        load(path)
    assert str(caught.value) == (
        f"{path.with_suffix('.json')} is no manifest of a comparison: give results.csv of a folder "
        "of `evenhand compare`, with its manifest beside it"
    )


@pytest.mark.parametrize("name", ["", "nothing.csv"])
def test_a_folder_and_no_file_are_no_tables(tmp_path, name):
    with refused("missing file") as caught:
        load(tmp_path / name)
    assert str(caught.value) == (
        f"{tmp_path / name} is no file: give results.csv of an earlier comparison"
    )


def test_other_versions_are_found_along_all_earlier_comparisons():
    here = {"python": "3.12", "numpy": "2"}
    old = {"versions": {"python": "3.11", "numpy": "1"}, "earlier": None}
    same = {"versions": {"python": "3.11", "numpy": "2"}, "earlier": old}
    for noted in (old, same):
        [differs] = earlier.other_versions(earlier.Earlier({}, noted), here)
        assert differs == 'numpy "1" there and "2" here'
    same["earlier"] = None
    assert earlier.other_versions(earlier.Earlier({}, same), here) == []
    assert earlier.other_versions(None, here) == []


def test_a_table_without_manifest_or_of_something_else_is_refused(tmp_path):
    path = written(tmp_path, rows(), manifest())
    path.write_text("a,b\n1,2\n")
    with refused("format file"):
        load(path)
    path.write_bytes(b"\xff")
    with pytest.raises(InputError, match="cannot be read"):
        load(path)
    path.with_suffix(".json").unlink()
    with pytest.raises(InputError, match=r"manifest\.json"):
        load(path)
