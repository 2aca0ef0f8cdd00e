"""Room: what the page of a comparison reads. Takes: a folder. Gives: checked tables to look up.

May touch: the disk (reading only).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import nan
from pathlib import Path
from typing import Any

from evenhand.core import files
from evenhand.core.errors import InputError, unknown
from evenhand.experiments.comparison.figures import POOLED, looks
from evenhand.report.read_tables import read_table
from evenhand.report.table import Table
from evenhand.statistics.means import Estimate

NO_ALGORITHM = "none"
_ENDS = ("", "_low", "_high")
_HEAD = dict.fromkeys(("scenario", "algorithm", "arm"), "text")
SCHEMAS: dict[str, dict[str, str]] = {
    "results": {**_HEAD, "seed": "int", "metric": "text", "value": "number?"},
    "summary": {
        **_HEAD,
        "metric": "text",
        **dict.fromkeys(("iqm", "low", "high"), "number?"),
        "seeds": "int",
        **{
            f"{name}{end}": "number?"
            for name in ("share", "difference", "to_blind", "improvement")
            for end in _ENDS
        },
    },
    "fronts": {
        **dict.fromkeys(("scenario", "algorithm", "method"), "text"),
        **dict.fromkeys(("hypervolume", "low", "high"), "number?"),
        "seeds": "int",
        "arms": "text",
        "front": "text?",
        "scale": "number",
    },
}
_KEYS = {
    "results": (*_HEAD, "seed", "metric"),
    "summary": (*_HEAD, "metric"),
    "fronts": ("scenario", "algorithm", "method"),
}
_MANIFEST: dict[str, type | tuple[type, ...]] = {
    **dict.fromkeys(("version", "created", "command"), str),
    **dict.fromkeys(("settings", "versions"), dict),
    **dict.fromkeys(("commit", "earlier"), (dict, type(None))),
    "runs": int,
    "run_seconds": (int, float),
    "people": int,
}
_NUMBERS = ("epochs", "services")
_NONE = Estimate(nan, nan, nan, 0)


@dataclass(frozen=True)
class Comparison:
    """Everything that the page is made of."""

    results: Table
    summary: Table
    fronts: Table
    manifest: Mapping[str, Any]

    @cached_property
    def scenarios(self) -> list[str]:
        """In the order of the table, without the pooled rows."""
        return [name for name in self.summary.distinct("scenario") if name != POOLED]

    @cached_property
    def algorithms(self) -> list[str]:
        """What learned."""
        return [name for name in self.summary.distinct("algorithm") if name != NO_ALGORITHM]

    @cached_property
    def arms(self) -> list[str]:
        """In the order of the table."""
        return self.summary.distinct("arm")

    @cached_property
    def seeds(self) -> list[int]:
        """All that any arm ran with."""
        return sorted(self.results.distinct("seed"))

    @cached_property
    def seed_counts(self) -> list[int]:
        """How many seeds the arms have, each number once, least first."""
        pooled = self.summary["scenario"] == POOLED
        known = (self.summary["metric"] == "perfect_rate") & ~pooled
        return sorted(set(self.summary["seeds"][known].tolist()))

    @cached_property
    def _rows(self) -> dict[tuple[str, ...], dict[str, Any]]:
        return {
            (row["scenario"], row["algorithm"], row["arm"], row["metric"]): row
            for row in self.summary.rows()
        }

    @cached_property
    def _fronts(self) -> dict[tuple[str, ...], dict[str, Any]]:
        return {
            (row["scenario"], row["algorithm"], row["method"]): row for row in self.fronts.rows()
        }

    def has(self, scenario: str, algorithm: str, arm: str) -> bool:
        """Whether this arm was run there."""
        return (scenario, algorithm, arm, "corrected_total") in self._rows

    def issues(self, scenario: str) -> list[str]:
        """Names of the issues that are scored there."""
        there = self.summary["scenario"] == scenario
        metrics = dict.fromkeys(self.summary["metric"][there].tolist())
        named = [name.removeprefix("corrected_") for name in metrics if "corrected_" in name]
        return [name for name in named if name != "total"]

    def estimate(
        self, scenario: str, algorithm: str, arm: str, metric: str, of: str = "iqm"
    ) -> Estimate:
        """A number of the summary with its interval; missing where there is none.

        Args:
            scenario: where.
            algorithm: that learned, ``none`` for an arm that learns nothing.
            arm: method and perhaps strength.
            metric: as in the table.
            of: ``iqm``, ``share``, ``difference``, ``to_blind`` or ``improvement``.
        """
        row = self._rows.get((scenario, algorithm, arm, metric))
        if row is None:
            return _NONE
        low, high = ("low", "high") if of == "iqm" else (f"{of}_low", f"{of}_high")
        return Estimate(row[of], row[low], row[high], row["seeds"])

    def hypervolumes(self, scenario: str, algorithm: str) -> dict[str, Estimate]:
        """Of each method that learned there."""
        return {
            key[2]: Estimate(row["hypervolume"], row["low"], row["high"], row["seeds"])
            for key, row in self._fronts.items()
            if key[:2] == (scenario, algorithm)
        }


def method_of(arm: str) -> str:
    """The method of an arm, without its strength."""
    return arm.partition("@")[0]


def arm_label(arm: str) -> str:
    """The name of an arm for readers."""
    method, mark, strength = arm.partition("@")
    return looks()[method].label + (f", strength {strength}" if mark else "")


def read(folder: Path) -> Comparison:
    """Read and check the tables and the manifest of a comparison.

    Raises:
        InputError: a file is missing or malformed; the sentence names file, row and column.
    """
    if not folder.is_dir():
        raise InputError(
            "missing folder", f"{folder} is not a folder: give the folder of a comparison"
        )
    path = folder / "manifest.json"
    manifest = files.read_record(path, *_MANIFEST)
    for field, kind in _MANIFEST.items():
        if not isinstance(manifest[field], kind):
            raise InputError(
                f"type {field}",
                f"{path}: field {field!r} is {manifest[field]!r}, of a wrong type",
            )
    for field in _NUMBERS:
        if not isinstance(manifest["settings"].get(field), int):
            raise InputError(
                f"type {field}", f"{path}: settings need a whole number of {field}; run it again"
            )
    tables = {
        name: read_table(folder / f"{name}.csv", schema, _KEYS[name])
        for name, schema in SCHEMAS.items()
    }
    for arm in tables["summary"].distinct("arm"):
        if method_of(arm) not in looks():
            raise unknown(f"arm in {folder / 'summary.csv'}", arm, looks())
    return Comparison(**tables, manifest=manifest)
