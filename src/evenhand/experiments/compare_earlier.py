"""Runs of an earlier comparison, taken from its table instead of being done again."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from evenhand import files
from evenhand.errors import InputError
from evenhand.experiments.compare_settings import Cell, method_of
from evenhand.experiments.compare_tables import METRICS, RESULTS

NOTED = ("version", "created", "command", "commit", "versions", "runs", "run_seconds", "earlier")
"""What the manifest of a comparison says of an earlier one that it took runs from."""


@dataclass(frozen=True)
class Earlier:
    """Runs of an earlier comparison.

    Attributes:
        results: their numbers by metric, None where missing.
        manifest: what that comparison noted of itself (``NOTED``).
    """

    results: dict[Cell, dict[str, float | None]]
    manifest: dict[str, Any]


def manifest_of(table: Path) -> Path:
    """Where the manifest of a table stands: under its name, or as ``manifest.json`` beside it."""
    own = table.with_suffix(".json")
    return own if own.exists() else table.with_name("manifest.json")


def load(table: Path, epochs: int, services: int, prints: Callable[[str], str]) -> Earlier:
    """Read ``results.csv`` of an earlier comparison, with its manifest.

    Args:
        table: the CSV file; its manifest stands beside it.
        epochs: of training, which must be the same.
        services: of the test, which must be the same.
        prints: fingerprint of an arm's settings as they are now, by the arm's name.

    Returns:
        Every run in the table.

    Raises:
        InputError: when a file is missing or not what it should be, the comparison was another
            one, an arm had other settings then, or a run lacks a number.
    """
    noted = files.read_record(manifest_of(table), "settings", "fingerprints", *NOTED)
    then = {name: noted["settings"].get(name) for name in ("epochs", "services")}
    now = {"epochs": epochs, "services": services}
    differs = files.differences(then, now)
    if differs:
        raise InputError(f"{table} is of another comparison ({differs}): give the same numbers")
    results: dict[Cell, dict[str, float | None]] = {}
    for number, row in enumerate(_rows(table), start=2):
        cell, metric, value = _parsed(row, f"{table}, line {number}")
        if metric in results.setdefault(cell, {}):
            raise InputError(f"{table}, line {number}: {metric} of {cell} stands there twice")
        results[cell][metric] = value
    for cell, numbers in results.items():
        lacking = [name for name in METRICS if name not in numbers]
        if lacking:
            raise InputError(f"{table} lacks {', '.join(lacking)} of {cell}: it is cut off")
    for arm in dict.fromkeys(cell.arm for cell in results):
        if noted["fingerprints"].get(arm) != prints(arm):
            raise InputError(
                f"{table}: {arm} had other settings in that comparison than it has now: leave "
                "its rows out, or use the version that made them"
            )
    return Earlier(results, {name: noted[name] for name in NOTED})


def _rows(table: Path) -> Iterable[dict[str, str]]:
    try:
        with table.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            if tuple(reader.fieldnames or ()) != RESULTS:
                raise InputError(f"{table} is no table of a comparison: its columns are not "
                                 f"{', '.join(RESULTS)}")  # fmt: skip
            return list(reader)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{table} cannot be read: {error}") from error


def _parsed(row: dict[str, str], where: str) -> tuple[Cell, str, float | None]:
    if None in row or None in row.values():
        raise InputError(f"{where}: give {len(RESULTS)} columns")
    method_of(row["arm"])
    if row["metric"] not in METRICS:
        raise InputError(f"{where}: unknown metric {row['metric']!r}")
    try:
        seed = int(row["seed"])
        value = float(row["value"]) if row["value"] else None
        if seed < 0 or (value is not None and not isfinite(value)):
            raise ValueError
    except ValueError:
        raise InputError(
            f"{where}: seed {row['seed']!r} or value {row['value']!r} is no number"
        ) from None
    return Cell(row["scenario"], row["algorithm"], row["arm"], seed), row["metric"], value
