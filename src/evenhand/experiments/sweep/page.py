"""The page of a sweep: what became of its runs, and every variant beside the others.

Takes: a folder with ``runs.csv``, ``summary.csv`` and ``manifest.json``. Gives: ``report.html`` in
the same folder, which leads to the report of each variant. Nothing here simulates or learns.
"""

from collections.abc import Mapping, Sequence
from math import nan
from pathlib import Path
from typing import Any

from evenhand.core import files
from evenhand.experiments.comparison.figures import POOLED
from evenhand.experiments.comparison.judged_aims import algorithm_label
from evenhand.experiments.comparison.read import SCHEMAS, arm_label
from evenhand.experiments.comparison.words import MEASURES, Number, number
from evenhand.report import page
from evenhand.report.read_tables import read_table
from evenhand.statistics.means import Estimate

_RUNS = {
    **dict.fromkeys(("variant", "scenario", "algorithm", "arm"), "text"),
    "seed": "int",
    "state": "text",
    "attempts": "int",
    "seconds": "number?",
    "reason": "text?",
    "folder": "text",
}
_MANIFEST = (
    "version", "created", "command", "commit", "versions", "runs", "failed", "variants", "workers",
    "run_seconds", "elapsed_s",
)  # fmt: skip
_NONE = {"iqm": nan, "low": nan, "high": nan, "seeds": 0}
_METRICS = (*MEASURES, ("Biased epochs", "biased_epochs", False))


def build(folder: Path | str) -> Path:
    """Write the report of a sweep.

    Returns:
        The path of ``report.html``.

    Raises:
        InputError: a table is missing or malformed (file, row and column are named), or the
            folder cannot be written.
    """
    folder = Path(folder)
    manifest = files.read_record(folder / "manifest.json", *_MANIFEST)
    runs = list(read_table(folder / "runs.csv", _RUNS).rows())
    schema = {"variant": "text", **SCHEMAS["summary"]}
    summary = list(read_table(folder / "summary.csv", schema, may_be_empty=True).rows())
    target = folder / "report.html"
    files.write_text(target, render(manifest, runs, summary))
    return target


def render(
    manifest: Mapping[str, Any],
    runs: Sequence[Mapping[str, Any]],
    summary: Sequence[Mapping[str, Any]],
) -> str:
    """The whole page."""
    commit = manifest["commit"]
    return page.fill(
        "sweep.html.j2",
        Path(__file__).parent / "templates",
        manifest=manifest,
        facts=_facts(manifest, runs),
        failed=[_failed(row) for row in runs if row["state"] == "failed"],
        retried=sum(row["attempts"] > 1 and row["state"] == "done" for row in runs),
        variants=_variants(manifest, summary),
        measures=[head for head, _, _ in _METRICS],
        versions=page.flat(manifest["versions"]),
        commit=page.flat(commit) if commit else [],
    )


def _facts(manifest: Mapping[str, Any], runs: Sequence[Mapping[str, Any]]) -> list[tuple[str, str]]:
    done = len(runs) - manifest["failed"]
    return [
        ("Written", manifest["created"]),
        ("Runs", f"{len(runs):,}"),
        ("Done", f"{done:,}"),
        ("Failed", f"{manifest['failed']:,}"),
        ("Variants", f"{len(manifest['variants']):,}"),
        ("Computing", page.duration(manifest["run_seconds"])),
        ("At the same time", f"{manifest['workers']:,}"),
        ("Last call", page.duration(manifest["elapsed_s"])),
    ]


def _failed(row: Mapping[str, Any]) -> tuple[str, str, int, str]:
    words = (row["scenario"], row["algorithm"], row["arm"], f"seed {row['seed']}")
    return row["variant"], ", ".join(words), row["attempts"], row["reason"]


def _variants(
    manifest: Mapping[str, Any], summary: Sequence[Mapping[str, Any]]
) -> list[tuple[str, list[tuple[str, str]], list[tuple[str, str, int, list[Number]]]]]:
    cells: dict[tuple[str, ...], Mapping[str, Any]] = {}
    heads: dict[str, dict[tuple[str, str, str], None]] = {}
    for row in summary:
        head = (row["scenario"], row["algorithm"], row["arm"])
        cells[row["variant"], *head, row["metric"]] = row
        if row["scenario"] != POOLED:
            heads.setdefault(row["variant"], {})[head] = None
    found = []
    # what one variant changes is said of all
    named = dict.fromkeys(key for said in manifest["variants"].values() for key in said)
    for name, settings in manifest["variants"].items():
        lines = []
        for scenario, algorithm, arm in heads.get(name, {}):
            rows = [
                cells.get((name, scenario, algorithm, arm, metric), _NONE)
                for _, metric, _ in _METRICS
            ]
            numbers = [
                number(Estimate(row["iqm"], row["low"], row["high"], row["seeds"]), share)
                for row, (_, _, share) in zip(rows, _METRICS, strict=True)
            ]
            *rest, biased = numbers
            if manifest["variants"][name].get("epochs") and biased.interval:
                biased = Number(f"{biased.value} of {settings['epochs']}", biased.interval)
            numbers = [*rest, biased]
            label = ", ".join(filter(None, (arm_label(arm), algorithm_label(algorithm))))
            lines.append((scenario, label, max(row["seeds"] for row in rows), numbers))
        found.append((name, page.flat(dict.fromkeys(named, "by default") | settings), lines))
    return found
