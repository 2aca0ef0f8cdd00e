"""Tables, manifest and pages of a sweep."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evenhand.core import files
from evenhand.core.processes import Task, Tell, run_all
from evenhand.experiments import provenance
from evenhand.experiments.comparison import page as comparison_page
from evenhand.experiments.comparison import tables
from evenhand.experiments.comparison.settings import place
from evenhand.experiments.paper.tables import Row
from evenhand.experiments.settings import TEST_SEED
from evenhand.experiments.sweep import page
from evenhand.experiments.sweep.runs import row_of
from evenhand.experiments.sweep.settings import Variant
from evenhand.training import run_folder

if TYPE_CHECKING:
    from evenhand.experiments.sweep.settings import Line

RUNS = (
    "variant", "scenario", "algorithm", "arm", "seed", "state", "attempts", "seconds", "reason",
    "folder",
)  # fmt: skip
Variants = dict[Variant, list["Line"]]


def write_all(out: Path, lines: Sequence[Line], command: str, workers: int, seconds: float) -> None:
    """Write what the runs of a sweep say.

    Args:
        out: folder of the sweep.
        lines: what became of every run.
        command: noted in the manifests.
        workers: runs at the same time, and now pages.
        seconds: since the sweep began.
    """
    files.write_table(out / "runs.csv", [_run(line) for line in lines], RUNS)
    failed = [line for line in lines if line.failure is not None]
    _write_failures(out / "failures.txt", failed)
    by_variant: Variants = {}
    for line in lines:
        if line.test is not None:
            by_variant.setdefault(line.job.variant, []).append(line)
    gathered: dict[str, list[Row]] = {name: [] for name in ("results", "summary", "fronts")}
    noted = _circumstances(command)
    for variant, own in by_variant.items():
        folder = files.make_folder(out / "variants" / variant.name)
        results = {line.job.cell: line.test for line in own if line.test is not None}
        made = {
            "results": (tables.tidy(results), tables.RESULTS),
            "summary": (tables.summary(results), tables.SUMMARY),
            "fronts": (tables.fronts(results), tables.FRONTS),
        }
        for name, (rows, columns) in made.items():
            files.write_table(folder / f"{name}.csv", rows, columns)
            gathered[name] += [{"variant": variant.name} | row for row in rows]
        files.write_json(folder / "manifest.json", noted | _variant(variant, own))
    for name, columns in (
        ("results", tables.RESULTS),
        ("summary", tables.SUMMARY),
        ("fronts", tables.FRONTS),
    ):
        files.write_table(out / f"{name}.csv", gathered[name], ("variant", *columns))
    run_all([_page(out, variant) for variant in by_variant], workers, lambda *_: None)
    files.write_json(
        out / "manifest.json",
        noted
        | {
            "runs": len(lines),
            "failed": len(failed),
            "variants": {variant.name: _settings(variant) for variant in by_variant},
            "workers": workers,
            "run_seconds": _spent(lines),
            "elapsed_s": round(seconds, 1),
        },
    )
    page.build(out)


def _run(line: Line) -> Row:
    state = "failed" if line.failure is not None else "done"
    return row_of(line.job) | {
        "state": state,
        "attempts": line.attempts,
        "seconds": line.seconds,
        "reason": line.reason,
        "folder": str(line.job.path),
    }


def _write_failures(path: Path, failed: Sequence[Line]) -> None:
    """All that is known of runs that failed, tracebacks included."""
    if failed:
        told = [f"{line.job}\n{line.failure}\n" for line in failed]
        files.write_text(path, "\n".join(told))
    else:
        path.unlink(missing_ok=True)


def _circumstances(command: str) -> dict[str, Any]:
    versions = run_folder.versions()
    return {
        "version": versions["evenhand"],
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": command,
        "commit": provenance.commit(),
        "versions": versions,
    }


def _settings(variant: Variant) -> dict[str, Any]:
    learner = {n: list(v) if isinstance(v, tuple) else v for n, v in variant.learner}
    sizes = {"epochs": variant.epochs, "people": variant.people, "services": variant.services}
    return sizes | learner


def _variant(variant: Variant, lines: Sequence[Line]) -> dict[str, Any]:
    """What the manifest of a comparison says of its runs."""
    cells = sorted((line.job.cell for line in lines), key=place)
    seeds = sorted({cell.seed for cell in cells})
    return {
        "settings": _settings(variant),
        "runs": len(cells),
        "run_seconds": _spent(lines),
        "earlier": None,
        "scenarios": list(dict.fromkeys(cell.scenario for cell in cells)),
        "algorithms": list(dict.fromkeys(cell.algorithm for cell in cells)),
        "arms": list(dict.fromkeys(cell.arm for cell in cells)),
        "seeds": seeds,
        "test_seeds": [TEST_SEED + seed for seed in seeds],
        "people": variant.people,
    }


def _spent(lines: Iterable[Line]) -> float:
    return round(sum(line.seconds or 0.0 for line in lines), 1)


def _page(out: Path, variant: Variant) -> Task:
    return Task(variant.name, draw, {"folder": out / "variants" / variant.name})


def draw(*, tell: Tell, folder: Path) -> None:
    """Figures and page of one variant."""
    comparison_page.build(folder)
