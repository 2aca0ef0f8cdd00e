"""A made-up comparison: the folder that its page is built from, with numbers to check by hand."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from evenhand.experiments.comparison import tables

ISSUES = ("willingness", "quality", "priority", "risk")
HEAD = ("scenario", "algorithm", "arm")
# corrected total, perfect services, worst group, biased epochs of the interquartile mean
NUMBERS: dict[tuple[str, str], tuple[float, float, float, float | None]] = {
    ("reference", "none"): (0.0, 0.99, 0.95, None),
    ("untrained", "none"): (0.2, 0.2, 0.1, None),
    ("service", "ppo"): (0.5, 0.90, 0.50, 50.0),
    ("levelup", "ppo"): (0.05, 0.91, 0.80, 4.0),
    ("surgery", "ppo"): (0.3, 0.85, 0.45, 20.0),
    ("elbert", "ppo"): (0.1, 0.90, 0.70, 10.0),
}
BLIND = {"corrected_total": 0.15, "perfect_rate": 0.905}
"""Of the cost without groups, which stands in no row of its own."""
VOLUMES = {"service": 0.1, "levelup": 0.8, "surgery": 0.4, "elbert": 0.7}
SCENARIOS = ("even", "prejudiced", "tips")


def write_csv(path: Path, columns: tuple[str, ...], rows: list[dict[str, Any]]) -> None:
    """What is missing is an empty cell."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def summary_row(place: str, arm: str, algorithm: str, metric: str, n: int) -> dict[str, Any]:
    """Interquartile mean ± 0.001; against service alone where that is the same algorithm."""
    names = ("corrected_total", "perfect_rate", "worst_group_rate", "biased_epochs")
    given: dict[str, float | None] = dict(zip(names, NUMBERS[arm, algorithm], strict=True))
    alone: dict[str, float | None] = dict(zip(names, NUMBERS["service", "ppo"], strict=True))
    total = given["corrected_total"]
    assert total is not None
    parts = dict(zip(ISSUES, (0.6 * total, 0.2 * total, 0.1 * total, 0.1 * total), strict=True))
    given |= {f"corrected_{issue}": part for issue, part in parts.items()}
    given |= {"raw_total": total + 0.3, "per_imperfect": 2 * total}
    value = given[metric]
    row: dict[str, Any] = dict(zip(HEAD, (place, algorithm, arm), strict=True))
    row |= {"metric": metric, "seeds": n if value is not None else 0, "iqm": value}

    def estimate(name: str, middle: float) -> None:
        ends = ("low", "high") if name == "iqm" else (f"{name}_low", f"{name}_high")
        row[name] = middle
        if n > 1:
            row.update(zip(ends, (middle - 0.001, middle + 0.001), strict=True))

    if value is not None:
        estimate("iqm", value)
    if algorithm == "ppo" and value is not None and alone.get(metric) is not None:
        estimate("difference", value - alone[metric])  # type: ignore[operator]
        if metric in BLIND:
            estimate("to_blind", value - BLIND[metric])
        estimate("improvement", 0.5)
        if metric == "corrected_total":
            estimate("share", (0.5 - total) / 0.5)
    return row


def write_comparison(
    folder: Path, seeds: int = 10, scenarios: Sequence[str] = SCENARIOS, **manifest: Any
) -> Path:
    """Write the tables of a comparison, the same numbers in every scenario."""
    folder.mkdir()
    cells = [(place, algorithm, arm) for place in scenarios for arm, algorithm in NUMBERS]
    summary = [
        summary_row(place, arm, algorithm, metric, seeds)
        for place, algorithm, arm in cells
        for metric in tables.METRICS
    ]
    results = [
        {name: row[name] for name in (*HEAD, "metric")} | {"seed": seed, "value": row["iqm"]}
        for seed in range(seeds)
        for row in summary
    ]
    ends = (-0.01, 0.01)
    fronts = [
        dict(zip(("scenario", "algorithm", "method"), (place, "ppo", method), strict=True))
        | {"hypervolume": volume, "seeds": seeds, "arms": method, "front": method, "scale": 0.5}
        | ({"low": volume + ends[0], "high": volume + ends[1]} if seeds > 1 else {})
        for place in scenarios
        for method, volume in VOLUMES.items()
    ]
    write_csv(folder / "results.csv", tables.RESULTS, results)
    write_csv(folder / "summary.csv", tables.SUMMARY, summary)
    write_csv(folder / "fronts.csv", tables.FRONTS, fronts)
    noted = {
        "version": "0.1.0", "created": "2026-11-20T12:00:00+00:00",
        "command": "evenhand compare --out out/compare", "commit": None, "earlier": None,
        "settings": {"epochs": 300, "services": 5000, "arms": ["service", "levelup"]},
        "versions": {"python": "3.11.7"}, "runs": 180, "run_seconds": 7260.0, "people": 30,
    }  # fmt: skip
    (folder / "manifest.json").write_text(json.dumps(noted | manifest), encoding="utf-8")
    return folder
