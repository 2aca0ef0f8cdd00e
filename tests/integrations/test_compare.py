"""The comparison, small: stopped and continued, enlarged, done again, and all it promises."""

import csv
import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

SCENARIOS = ("minority", "tips")
ARMS = ("reference", "untrained", "service", "levelup@2", "elbert")
EPOCHS, SERVICES = 3, 300
SMALL = (
    "--scenarios", *SCENARIOS, "--arms", *ARMS, "--epochs", EPOCHS, "--services", SERVICES,
    "--algorithms", "reinforce",
)  # fmt: skip
METRICS = {
    "corrected_total", "corrected_willingness", "corrected_quality", "corrected_priority",
    "corrected_risk", "raw_total", "perfect_rate", "worst_group_rate", "per_imperfect",
    "biased_epochs",
}  # fmt: skip

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def compare(apart) -> Callable[..., str]:
    """``compare(folder, *words)`` runs it to its end; returns what was announced."""

    def run(out: Path, *words: object) -> str:
        ended = apart("compare", "--out", out, *words)
        assert ended.code == 0, ended.err
        assert ended.out.endswith(f"\n{out / 'report.html'}\n")
        assert ended.err.count("\n") == 1
        return ended.err

    return run


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def values(folder: Path) -> dict[tuple[str, ...], str]:
    """Every number by scenario, algorithm, arm, seed and metric."""
    found = {tuple(row.values())[:-1]: row["value"] for row in rows(folder / "results.csv")}
    assert len(found) == len(rows(folder / "results.csv"))
    return found


def made(folder: Path) -> dict[str, int]:
    """When each run ended."""
    return {str(p.relative_to(folder)): p.stat().st_mtime_ns for p in folder.rglob("done.json")}


@pytest.fixture(scope="module")
def calm(compare, tmp_path_factory) -> Path:
    """One seed, one process, undisturbed."""
    folder = tmp_path_factory.mktemp("calm") / "out"
    said = compare(folder, *SMALL, "--seeds", 1, "--workers", 1)
    assert said.startswith("10 runs, none of them done yet: 6 of 3 epochs and a test of 300 ")
    return folder


@pytest.fixture(scope="module")
def stopped(compare, apart, alive, tmp_path_factory) -> Path:
    """The same with two processes, stopped by Ctrl-C, and continued."""
    folder = tmp_path_factory.mktemp("stopped") / "out"
    words = ("--out", folder, *SMALL, "--seeds", 1, "--workers", 2)
    working = apart.at_work("compare", *words, when=lambda: [*folder.rglob("done.json")])
    with working as process:
        ended = apart.interrupt(process)
        assert (ended.code, ended.out) == (130, "")
        assert ended.err.endswith("the same command goes on from there\n")
        assert alive(process.pid) == []
    kept = made(folder)
    assert not (folder / "results.csv").exists()
    said = compare(folder, *words[2:])
    assert f"10 runs, {10 - len(kept)} to do: " in said
    assert kept.items() <= made(folder).items()  # nothing that was finished was done again
    return folder


def test_processes_and_interruptions_change_nothing(calm, stopped):
    for name in ("results.csv", "summary.csv", "fronts.csv", "figures/compare_reinforce.svg"):
        assert (stopped / name).read_bytes() == (calm / name).read_bytes(), name


def test_results_are_tidy_and_complete(calm):
    found = values(calm)
    assert list(rows(calm / "results.csv")[0]) == [
        "scenario", "algorithm", "arm", "seed", "metric", "value",
    ]  # fmt: skip
    assert set(found) == {
        (scenario, "none" if arm in ARMS[:2] else "reinforce", arm, "0", metric)
        for scenario in SCENARIOS
        for arm in ARMS
        for metric in METRICS
    }
    for (scenario, algorithm, arm, _, metric), value in found.items():
        assert re.fullmatch(r"|-?\d+(\.\d+)?(e-?\d+)?", value), value
        if metric == "biased_epochs":
            assert (value == "") == (algorithm == "none")
        if metric.endswith("_rate"):
            assert 0.0 <= float(value) <= 1.0
        if arm == "reference" and metric == "perfect_rate":
            assert float(value) > 0.9, scenario
        if algorithm != "none" and metric == "biased_epochs":
            log = calm / "runs" / scenario / algorithm / arm / "seed-00" / "epochs.jsonl"
            lines = [json.loads(line) for line in log.read_text().splitlines()]
            assert len(lines) == EPOCHS
            assert int(value) == sum(line["biased_detector"] for line in lines)


def test_every_promised_file_is_there(calm):
    assert sorted(path.name for path in calm.iterdir() if path.name != ".lock") == [
        "experiment.json", "figures", "fronts.csv", "manifest.json", "report.html",
        "results.csv", "runs", "summary.csv",
    ]  # fmt: skip
    assert {path.suffix for path in (calm / "figures").iterdir()} == {".svg", ".pdf", ".csv"}
    assert not [path for path in calm.rglob("*") if path.suffix == ".part"]
    noted = json.loads((calm / "manifest.json").read_text())
    assert noted["command"].startswith(f"evenhand compare --out {calm} --scenarios minority tips")
    assert (noted["seeds"], noted["test_seeds"]) == ([0], [1_000_000])
    assert noted["settings"]["services"] == SERVICES
    assert {"mujoco", "jax", "numpy", "evenhand"} <= set(noted["versions"])
    settings = calm / "runs" / "tips" / "reinforce" / "levelup@2" / "seed-00" / "settings.json"
    assert json.loads(settings.read_text())["settings"]["method"] == {
        "name": "levelup",
        "settings": {
            "strength": 2.0,
            "windows": 8,
            "shrink": 0.5,
            "when": "always",
            "guarded": True,
            "cost": 0.5,
        },
        "source": None,
    }


def test_more_can_be_added_and_what_was_there_stays(compare, calm, stopped):
    before = made(stopped)
    words = ("--epochs", EPOCHS, "--services", SERVICES, "--algorithms", "reinforce")
    said = compare(
        stopped, *words, "--scenarios", "tips", "--arms", "service", "unaware", "--seeds", 2
    )
    assert "4 runs, 3 to do: " in said
    assert before.items() <= made(stopped).items()
    after = values(stopped)
    assert values(calm).items() <= after.items()
    assert ("tips", "reinforce", "unaware", "1", "raw_total") in after
    [row] = [
        row
        for row in rows(stopped / "summary.csv")
        if (row["scenario"], row["arm"], row["metric"]) == ("tips", "service", "raw_total")
    ]
    assert row["seeds"] == "2"
    assert float(row["low"]) <= float(row["iqm"]) <= float(row["high"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--epochs", 4), "holds another experiment (epochs 3 there and 4 here)"),
        (("--services", 301), "holds another experiment (services 300 there and 301 here)"),
        (("--arms", "ggf@2"), "decay is 2.0: give a number from 0.001 to 1"),
        (("--arms", "levlup"), "unknown arm 'levlup': did you mean 'levelup'?"),
        (("--scenarios", "tip"), "unknown scenario 'tip': did you mean 'tips'?"),
        (("--algorithms", "pp"), "unknown algorithms 'pp': did you mean 'ppo'?"),
        (("--seeds", 0), "seeds is 0: give a whole number from 1 to 1000"),
    ],
)
def test_what_cannot_be_meant_is_said_in_one_sentence(cli, calm, words, said):
    before = made(calm)
    assert said in cli("compare", "--out", calm, *SMALL, *words).complaint
    assert made(calm) == before
