"""Room: what a report reads. Takes: a folder. Gives: checked tables, claims and manifest.

May touch: the disk (reading only). Whatever is missing or malformed is refused here, in one
sentence that names file, row and column, so that the rooms after this one need no doubts.
"""

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenhand.core.errors import InputError
from evenhand.report.table import Table

# Column kinds: text, int, number, share (a number in [0, 1]), flag (true or false).
# A question mark allows an empty cell, which means: not defined, or not stated.

# Rows with the same values in these columns would be drawn over each other.


@dataclass(frozen=True)
class Results:
    """Everything that a report is made of.

    Attributes:
        tables: the tables of ``SCHEMAS`` by name.
        manifest: settings, versions, seeds and the command of the run.
        claims: one mapping a claim: id, claim, paper, ours, ci95, seeds, status, evidence.
    """

    tables: Mapping[str, Table]
    manifest: Mapping[str, Any]
    claims: Sequence[Mapping[str, Any]]

    def __getitem__(self, name: str) -> Table:
        return self.tables[name]


def read_table(
    path: Path, schema: Mapping[str, str], key: Sequence[str] = (), may_be_empty: bool = False
) -> Table:
    """Read one CSV file with the columns of ``schema``; other columns are left out.

    Args:
        path: of the file.
        schema: the kind of cell of each column.
        key: columns whose values no two rows share.
        may_be_empty: whether a header alone will do.

    Raises:
        InputError: no such file, no rows, a column is missing, a cell is not what its column
            holds, or two rows have the same ``key``.
    """
    header, rows = _csv_rows(path)
    for column in schema:
        if column not in header:
            raise InputError(
                f"missing {column}",
                f"{path}: column {column!r} is missing; it needs {', '.join(schema)}",
            )
    if not rows and not may_be_empty:
        raise InputError(
            "empty file", f"{path}: there is a header but no rows; run the experiment again"
        )
    for number, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise InputError(
                "shape row",
                f"{path}: row {number} has {len(row)} cells, the header has {len(header)}; "
                "correct the row",
            )
    columns: dict[str, NDArray[Any]] = {}
    for column, kind in schema.items():
        place = header.index(column)
        cells = [
            _cell(row[place], kind, column, f"{path}: row {number}, column {column!r}")
            for number, row in enumerate(rows, start=2)
        ]
        bare = kind.rstrip("?")
        dtype = {"text": object, "int": np.int64}.get(bare, np.float64)
        columns[column] = np.array(cells, dtype=dtype)
    seen: dict[tuple[Any, ...], int] = {}
    if key:
        for number, values in enumerate(
            zip(*(columns[column].tolist() for column in key), strict=True), start=2
        ):
            if values in seen:
                raise InputError(
                    "duplicate row",
                    f"{path}: row {number} repeats row {seen[values]} in the columns "
                    f"{', '.join(key)}; remove one of them",
                )
            seen[values] = number
    return Table(columns)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(
            "missing file", f"{path} is missing: run the experiment again to write it"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("format file", f"{path} cannot be read as text: {error}") from None


def _csv_rows(path: Path) -> tuple[list[str], list[list[str]]]:
    try:
        lines = [line for line in csv.reader(io.StringIO(_text(path), newline="")) if line]
    except csv.Error as error:
        raise InputError("format file", f"{path} is not a CSV table: {error}") from None
    if not lines:
        raise InputError("empty file", f"{path} is empty: run the experiment again to write it")
    return lines[0], lines[1:]


def _cell(text: str, kind: str, column: str, where: str) -> str | int | float:
    text = text.strip()
    bare, optional = kind.rstrip("?"), kind.endswith("?")
    if bare == "text":
        if not text and not optional:
            raise InputError(f"empty {column}", f"{where} is empty; write a name")
        if any(ord(letter) < 32 and letter != "\t" for letter in text):
            raise InputError(f"format {column}", f"{where} holds a control character; remove it")
        return text
    if optional and text.lower() in ("", "nan"):
        return math.nan
    if bare == "flag":
        flags = {"true": 1.0, "false": 0.0, "1": 1.0, "0": 0.0}
        if text.lower() not in flags:
            raise InputError(f"type {column}", f"{where} is {text!r}; write true or false")
        return flags[text.lower()]
    try:
        value = int(text) if bare == "int" else float(text)
    except ValueError:
        noun = "a whole number" if bare == "int" else "a number"
        raise InputError(f"type {column}", f"{where} is {text!r}; write {noun}") from None
    if not math.isfinite(value):
        raise InputError(f"range {column}", f"{where} is {text!r}; write a finite number")
    if bare == "share" and not 0 <= value <= 1:
        raise InputError(f"range {column}", f"{where} is {text!r}; write a share between 0 and 1")
    return value


def read_json(path: Path) -> Any:
    """What a file of JSON holds."""
    try:
        return json.loads(_text(path))
    except json.JSONDecodeError as error:
        raise InputError(
            "format file",
            f"{path}: row {error.lineno}, column {error.colno} is not JSON ({error.msg}); "
            "run the experiment again to write it",
        ) from None
