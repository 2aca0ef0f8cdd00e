"""The whole experiment, small: stopped and continued, enlarged, done again, and all it promises."""

import csv
import json
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from evenhand.experiments.paper.report.results import STATUSES

EPOCHS, WINDOWS, SERVICES = 40, 100, 300
SMALL = ("--epochs", EPOCHS, "--windows", WINDOWS, "--services", SERVICES)
FIRST = (*SMALL, "--preset", "paper", "--seeds", 1)
PRINTED = ("reinforce", "reinforce+guidance", "ppo", "ppo+guidance")
ARMS = {"paper": PRINTED, "service": (*PRINTED, "reinforce+levelup", "ppo+levelup")}

CLAIMS = {
    "detector_agreement", "detector_accuracy", "total_score_reduction_reinforce",
    "total_score_reduction_ppo", "biased_epochs_reduction_ppo", "signature_racism",
    "signature_ageism", "signature_ableism", "farthest_is_ableism", "slowest_is_ageism",
    "most_ignored_is_racism", "study_race_willingness", "study_disability_scenario4",
}  # fmt: skip
"""Claims of the paper that have to be answered."""


@pytest.fixture(scope="module")
def reproduce(apart) -> Callable[..., None]:
    """``reproduce(folder, *words)`` runs it to its end; it says nothing but where the report is."""

    def run(out: Path, *words: object) -> None:
        ended = apart("reproduce", "--out", out, *words)
        assert (ended.code, ended.err) == (0, "")
        assert ended.out == f"{out / 'report.html'}\n"

    return run


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def results(content) -> Callable[[Path], dict[str, bytes]]:
    """What came out: claims, results, tables, figures and runs, without clocks."""
    clocks = ("stages.json", "manifest.json", "report.html")

    def read(folder: Path) -> dict[str, bytes]:
        return {
            name: there for name, there in content(folder).items() if Path(name).name not in clocks
        }

    return read


def made(folder: Path) -> dict[str, int]:
    """When each file of services, in demonstrations and runs, was written."""
    return {
        str(path.relative_to(folder)): path.stat().st_mtime_ns for path in folder.rglob("*.parquet")
    }


@pytest.fixture(scope="module")
def calm(reproduce, tmp_path_factory) -> Path:
    """One preset, one seed, one process, undisturbed."""
    folder = tmp_path_factory.mktemp("calm") / "out"
    reproduce(folder, *FIRST, "--workers", 1)
    return folder


@pytest.fixture(scope="module")
def stopped(reproduce, apart, alive, tmp_path_factory) -> Path:
    """The same with two processes, stopped by Ctrl-C in training, and continued."""
    folder = tmp_path_factory.mktemp("stopped") / "out"
    words = ("reproduce", "--out", folder, *FIRST, "--workers", 2)
    training = apart.at_work(*words, when=lambda: [*folder.glob("runs/*/*/*/epochs.jsonl")])
    with training as process:
        ended = apart.interrupt(process)
        assert (ended.code, ended.out) == (130, "")
        assert ended.err == (
            "evenhand: stopped; what was finished is kept, the same command goes on from there\n"
        )
        assert alive(process.pid) == []
    kept = made(folder)
    assert len([name for name in kept if "demonstrations" in name]) == WINDOWS / 25
    assert not (folder / "report.html").exists()
    reproduce(folder, *FIRST, "--workers", 2)
    assert kept.items() <= made(folder).items()  # nothing that was finished was done again
    return folder


@pytest.fixture(scope="module")
def whole(reproduce, stopped) -> Path:
    """The same folder with the other preset and another seed added."""
    reproduce(stopped, *SMALL, "--seeds", 2, "--workers", 2)
    return stopped


# the order matters: `whole` goes on in the folder of `stopped`


def test_processes_and_interruptions_change_nothing(calm, stopped, results):
    assert results(stopped) == results(calm)


def test_another_experiment_does_not_mix_in(apart, stopped):
    ended = apart("reproduce", "--out", stopped, *FIRST, "--population", "us")
    assert ended.complaint == (
        f'{stopped} holds another experiment (population "uniform" there and "us" here): give '
        "another folder, or delete this one"
    )


def test_what_was_added_leaves_what_was_there(calm, whole):
    before, after = (
        {
            (r["preset"], r["arm"], r["seed"], r["metric"]): r["value"]
            for r in rows(f / "results.csv")
        }
        for f in (calm, whole)
    )
    assert before.items() <= after.items()
    # the paper's four arms with one seed; then these, and the six of the other preset, with two
    assert len(after) == (4 + 6) * 2 / 4 * len(before)


def test_every_promised_file_is_there(whole):
    assert (whole / "report.html").read_text().startswith("<!")
    drawn = Counter(path.suffix for path in (whole / "figures").iterdir())
    assert set(drawn) == {".svg", ".pdf", ".csv"}
    assert min(drawn.values()) == max(drawn.values()) >= 8
    links = re.findall(r'href="(replays/[^"]+)"', (whole / "report.html").read_text())
    assert len(links) == 2  # one a preset
    assert all((whole / link).read_text().startswith("<!") for link in links)
    assert sorted(path.name for path in whole.iterdir() if path.name != ".lock") == [
        "claims.json", "data", "experiment.json", "figures", "manifest.json", "replays",
        "report.html", "results.csv", "runs",
    ]  # fmt: skip
    assert not [path for path in whole.rglob("*") if path.suffix == ".part"]


def test_every_claim_is_answered(whole):
    claims = json.loads((whole / "claims.json").read_text())
    assert {claim["id"] for claim in claims} >= CLAIMS
    assert len({claim["id"] for claim in claims}) == len(claims)
    for claim in claims:
        assert set(claim) == {
            "id", "claim", "paper", "ours", "ci95", "seeds", "status", "evidence",
        }  # fmt: skip
        assert claim["status"] in STATUSES
        assert len(claim["claim"]) > 20
        assert len(claim["evidence"]) > 20
    page = (whole / "report.html").read_text()
    assert all(f"{claim['status']}" in page for claim in claims)


def test_results_are_tidy_and_complete(whole):
    found = rows(whole / "results.csv")
    assert list(found[0]) == ["preset", "arm", "seed", "metric", "value"]
    cells = [(row["preset"], row["arm"], row["seed"], row["metric"]) for row in found]
    assert len(set(cells)) == len(cells)
    metrics = {cell[3] for cell in cells}
    assert {"total", "willingness", "quality", "priority", "risk", "perfect_rate"} <= metrics
    assert {"biased_epochs_detector", "biased_epochs_threshold"} <= metrics
    assert set(cells) == {
        (preset, arm, seed, metric)
        for preset in ("paper", "service")
        for arm in ARMS[preset]
        for seed in "01"
        for metric in metrics
    }
    for row in found:
        assert re.fullmatch(r"|-?\d+(\.\d+)?(e-?\d+)?", row["value"]), row
        if row["metric"].startswith("biased_epochs_"):
            log = whole / "runs" / row["preset"] / row["arm"] / f"seed-0{row['seed']}"
            lines = (log / "epochs.jsonl").read_text().splitlines()
            name = row["metric"].replace("biased_epochs_", "biased_")
            assert int(row["value"]) == sum(json.loads(line)[name] for line in lines)


def test_every_run_keeps_every_service(whole):
    runs = sorted(whole.glob("runs/*/*/*"))
    assert len(runs) == 2 * (4 + 6)
    for folder in runs:
        services = [pq.read_table(path) for path in sorted((folder / "services").iterdir())]
        assert sum(map(len, services)) == EPOCHS * 30
        numbers = [number for table in services for number in table["service"].to_pylist()]
        assert numbers == list(range(EPOCHS * 30))
        assert len((folder / "epochs.jsonl").read_text().splitlines()) == EPOCHS
        noted = json.loads((folder / "settings.json").read_text())
        assert noted["seed"] == noted["settings"]["seed"] == int(folder.name[-2:])
        assert {"mujoco", "jax", "numpy", "evenhand"} <= set(noted["versions"])
        done = json.loads((folder / "done.json").read_text())
        assert done["test"]["services"] == SERVICES


def test_the_manifest_says_how_it_was_made(whole):
    manifest = json.loads((whole / "manifest.json").read_text())
    assert manifest["command"].startswith(f"evenhand reproduce --out {whole} --epochs 40")
    assert (manifest["seeds"], manifest["test_seeds"]) == ([0, 1], [1_000_000, 1_000_001])
    assert len(manifest["made_with"]) == 1
    # the clock goes on over all calls that it took
    assert manifest["elapsed_s"] == pytest.approx(sum(manifest["stages"].values()))
    assert manifest["stages"]["training and test"] > 0


def test_a_finished_experiment_is_not_done_again_nor_made_less(whole, reproduce, results):
    before, when = results(whole), made(whole)
    reproduce(whole, *FIRST, "--workers", 2)  # one preset of two, and one seed of two
    assert results(whole) == before
    assert made(whole) == when
    manifest = json.loads((whole / "manifest.json").read_text())
    assert manifest["seeds_of"] == {"paper": [0, 1], "service": [0, 1]}
    assert manifest["settings"]["preset"] == ["paper", "service"]
    assert sum(one["runs"] for one in manifest["made_with"]) == (4 + 6) * 2


def test_runs_of_other_versions_do_not_mix_in(apart, whole):
    folder = whole / "runs" / "paper" / "ppo" / "seed-01"
    note = folder / "done.json"
    right = note.read_text()
    other = json.loads(right)
    other["versions"]["mujoco"] = "3.9.9"
    note.write_text(json.dumps(other))
    complaint = apart("reproduce", "--out", whole, *FIRST).complaint
    assert complaint.startswith(f'{folder} was begun with other versions (mujoco "3.9.9" there')
    note.write_text(right)


def test_a_detector_is_fitted_again_from_the_judgements(apart, whole, tmp_path):
    words = ("--answers", whole / "data" / "judgements.csv", "--source", "simulated respondents",
             "--out", tmp_path / "again.json", "--seed", 2_000_000)  # fmt: skip
    assert apart("detect", "fit", *words).code == 0
    assert (tmp_path / "again.json").read_bytes() == (whole / "data" / "detector.json").read_bytes()


def test_a_damaged_run_is_named_and_nothing_is_lost(apart, whole):
    folder = whole / "runs" / "paper" / "ppo" / "seed-01"
    log = folder / "epochs.jsonl"
    right = log.read_bytes()
    log.write_bytes(right[:-100])
    ended = apart("reproduce", "--out", whole, *SMALL, "--seeds", 2)
    assert ended.complaint == (
        f"{log} line 40 is cut off or damaged: delete {folder} and run the same command again"
    )
    log.write_bytes(right)
