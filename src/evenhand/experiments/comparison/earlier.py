"""Runs of an earlier comparison, taken from its table instead of being done again."""

import csv
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from evenhand.core import files
from evenhand.core.errors import InputError
from evenhand.experiments.comparison.settings import Cell, checked, computed
from evenhand.experiments.comparison.tables import METRICS, RESULTS, metrics_of
from evenhand.restaurant import worlds
from evenhand.training import run_folder

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


def load(
    table: Path, epochs: int, services: int, prints: Callable[[str], str], detector: str
) -> Earlier:
    """Read ``results.csv`` of an earlier comparison, with its manifest.

    Returns:
        Every run in the table.

    Raises:
        InputError: when a file is missing or not what it should be, the comparison was another
            one, an arm, a scenario or the detector was another then, or a run lacks a number.
    """
    if not table.is_file():
        raise InputError(
            "missing file", f"{table} is no file: give results.csv of an earlier comparison"
        )
    noted = _manifest(manifest_of(table))
    then = {name: noted["settings"].get(name) for name in ("epochs", "services")}
    now = {"epochs": epochs, "services": services}
    differs = files.differences(then, now)
    if differs:
        raise InputError(
            "changed file", f"{table} is of another comparison ({differs}): give the same numbers"
        )
    results: dict[Cell, dict[str, float | None]] = {}
    called: dict[str, str] = {}
    for number, row in enumerate(_rows(table), start=2):
        cell, metric, value = _parsed(row, f"{table}, line {number}")
        called[cell.arm] = row["arm"]
        if metric in results.setdefault(cell, {}):
            raise InputError(
                "duplicate file", f"{table}, line {number}: {metric} of {cell} stands there twice"
            )
        results[cell][metric] = value
    if not results:
        raise InputError(
            "empty file", f"{table} holds no runs: leave it out, or give another table"
        )
    for cell, numbers in results.items():
        lacking = [name for name in metrics_of(numbers) if name not in numbers]
        if lacking:
            raise InputError(
                "missing file", f"{table} lacks {', '.join(lacking)} of {cell}: it is cut off"
            )
    for arm, name in called.items():
        if noted["fingerprints"].get(name) != prints(arm):
            raise _other(table, f"{arm} had other settings")
    # tables from before these were noted name arms and scenarios only
    if noted.get("detector") not in (None, detector):
        raise _other(table, "another detector judged")
    for name in dict.fromkeys(cell.scenario for cell in results):
        world = (noted.get("worlds") or {}).get(name)
        if world is not None and world != worlds.scenario(name).described():
            raise _other(table, f"scenario {name} was another one")
    kept = [*NOTED, *(name for name in ("made_with",) if name in noted)]
    return Earlier(results, {name: noted[name] for name in kept})


def _other(table: Path, what: str) -> InputError:
    return InputError(
        "changed file",
        f"{table}: {what} in that comparison than it has now: leave its rows out, or use the "
        "version that made them",
    )


def _manifest(path: Path) -> dict[str, Any]:
    noted = files.read_json(path)
    needed = ("settings", "fingerprints", *NOTED)
    if not isinstance(noted, dict) or not noted.keys() >= {*needed}:
        raise InputError(
            "format file",
            f"{path} is no manifest of a comparison: give results.csv of a folder of `evenhand "
            "compare`, with its manifest beside it",
        )
    for name in ("settings", "fingerprints", "worlds"):
        if not isinstance(noted.get(name, {}), dict):
            raise InputError(
                f"type {name}",
                f"{path}: {name} is {noted[name]!r}, and has to be a record: restore the file",
            )
    return noted


def other_versions(earlier: Earlier | None, here: dict[str, Any]) -> list[str]:
    """How the versions of earlier comparisons differ from those of now, each difference once."""
    found, noted = [], earlier.manifest if earlier else None
    while isinstance(noted, dict):
        if isinstance(noted.get("versions"), dict):
            found.append(run_folder.other_versions(noted["versions"], here))
        noted = noted.get("earlier")  # which may have taken runs from another one
    return [differs for differs in dict.fromkeys(found) if differs]


def all_of_it(table: Path | None, earlier: Earlier) -> str:
    """The sentence where nothing is left to run: when, by which code, and how long it took."""
    commit, seconds = earlier.manifest["commit"], computed(earlier.manifest)
    made = f" by commit {commit['hash'][:10]}" if isinstance(commit, dict) else ""
    took = f", after {seconds / 3600:,.1f} h of computing" if seconds else ""
    when = earlier.manifest["created"]
    return f"nothing to run: all runs are taken from {table}, written {when}{made}{took}"


def _rows(table: Path) -> Iterable[dict[str, str]]:
    try:
        with table.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            if tuple(reader.fieldnames or ()) != RESULTS:
                raise InputError(
                    "format file",
                    f"{table} is no comparison: its columns are not {', '.join(RESULTS)}",
                )
            return list(reader)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("unavailable file", f"{table} cannot be read: {error}") from error


def _parsed(row: dict[str, str], where: str) -> tuple[Cell, str, float | None]:
    if None in row or None in row.values():
        raise InputError("format file", f"{where}: give {len(RESULTS)} columns")
    if row["metric"] not in METRICS and not row["metric"].startswith("corrected_"):
        raise InputError("unknown metric", f"{where}: unknown metric {row['metric']!r}")
    try:
        seed = int(row["seed"])
        value = float(row["value"]) if row["value"] else None
        if not row["seed"].isdecimal() or (value is not None and not isfinite(value)):
            raise ValueError
    except ValueError:
        raise InputError(
            "format file", f"{where}: seed {row['seed']!r} or value {row['value']!r} is no number"
        ) from None
    try:
        cell = checked(Cell(row["scenario"], row["algorithm"], row["arm"], seed))
    except InputError as error:
        raise error.at(where) from None
    return cell, row["metric"], value
