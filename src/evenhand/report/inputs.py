"""Room: what a report reads. Takes: a folder. Gives: checked tables, claims and manifest.

May touch: the disk (reading only). Whatever is missing or malformed is refused here, in one
sentence that names file, row and column, so that the rooms after this one need no doubts.
"""

from __future__ import annotations

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

from evenhand.errors import InputError
from evenhand.report.tables import ISSUES, Table

STATUSES = ("reproduced", "contradicted", "cannot be told", "cannot be tested")


def _schema(text: str) -> dict[str, str]:
    """``"name:kind name:kind"`` as a mapping; ``{scores}`` and ``{interval}`` stand for columns."""
    scores = " ".join(f"{name}:number?" for name in ("total", *ISSUES))
    text = text.format(scores=scores, interval="ci_low:number? ci_high:number?")
    return {name: kind for name, _, kind in (pair.partition(":") for pair in text.split())}


# Column kinds: text, int, number, share (a number in [0, 1]), flag (true or false).
# A question mark allows an empty cell, which means: not defined, or not stated.
SCHEMAS: dict[str, dict[str, str]] = {
    "questionnaire": _schema(
        "scenario:text scenario_name:text identity:text share:share count:int respondents:int "
        "paper_share:share?"
    ),
    "questionnaire_issue": _schema(
        "scenario:text scenario_name:text issue:text share:share count:int"
    ),
    "judgements": _schema(
        "window:text robot:text strength:number respondent:text shown:text? biased:flag "
        "identity:text? issue:text? {scores}"
    ),
    "signatures": _schema(
        "discrimination:text issue:text paper:number? ours:number? {interval} windows:int "
        "ceiling:number?"
    ),
    "calibration": _schema("bin:text predicted:share? observed:share? {interval} n:int"),
    "confusion": _schema("judged:text predicted:text count:int"),
    "detector": _schema("metric:text value:number? {interval} n:int"),
    "epochs": _schema(
        "preset:text algorithm:text guided:flag arm:text seed:int epoch:int {scores} "
        "biased_detector:flag? biased_threshold:flag? probability:share? perfect_rate:share? "
        "response_rate:share? mean_response_distance:number? mean_response_step:number?"
    ),
    "test": _schema(
        "preset:text arm:text seed:int services:int {scores} perfect_rate:share? "
        "response_rate:share? mean_response_distance:number? mean_response_time:number? "
        "worst_group_rate:share? floor:number?"
    ),
    "behaviour": _schema(
        "robot:text measure:text value:number? {interval} paper:number? unit:text? services:int"
    ),
    "judges": _schema(
        "judge:text measure:text bin:text? predicted:share? value:share? {interval} n:int"
    ),
    "reflection": _schema(
        "preset:text arm:text seed:int epoch:int projection:number? cosine:number? z:number? "
        "p_value:share alarm:flag identity:text? issue:text? favoured:text? earlier:int rate:share"
    ),
    "tsne": _schema("window:text kind:text biased:flag x:number y:number z:number"),
}
RESULTS = _schema("preset:text? arm:text? seed:text? metric:text value:number?")

# Rows with the same values in these columns would be drawn over each other.
KEYS: dict[str, tuple[str, ...]] = {
    "questionnaire": ("scenario", "identity"),
    "questionnaire_issue": ("scenario", "issue"),
    "signatures": ("discrimination", "issue"),
    "calibration": ("bin",),
    "confusion": ("judged", "predicted"),
    "detector": ("metric",),
    "epochs": ("preset", "arm", "seed", "epoch"),
    "test": ("preset", "arm", "seed"),
    "behaviour": ("robot", "measure"),
    "judges": ("judge", "measure", "bin"),
    "reflection": ("preset", "arm", "seed", "epoch"),
}

MAY_BE_EMPTY = ("reflection",)
"""Tables of what only some arms do."""


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


def read(folder: Path) -> Results:
    """Read and check everything that a report needs.

    Args:
        folder: the folder of an experiment, with ``data/*.csv``, ``claims.json``,
            ``results.csv`` and ``manifest.json``.

    Raises:
        InputError: a file is missing or malformed; the sentence names file, row and column.
            Rows are counted as an editor shows them: the header is row 1.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder: give the folder of an experiment")
    manifest = _manifest(folder / "manifest.json")
    claims = _claims(folder / "claims.json")
    read_table(folder / "results.csv", RESULTS)
    tables = {
        name: read_table(
            folder / "data" / f"{name}.csv", schema, KEYS.get(name, ()), name in MAY_BE_EMPTY
        )
        for name, schema in SCHEMAS.items()
    }
    return Results(tables, manifest, claims)


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
            raise InputError(f"{path}: column {column!r} is missing; it needs {', '.join(schema)}")
    if not rows and not may_be_empty:
        raise InputError(f"{path}: there is a header but no rows; run the experiment again")
    for number, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise InputError(
                f"{path}: row {number} has {len(row)} cells, the header has {len(header)}; "
                "correct the row"
            )
    columns: dict[str, NDArray[Any]] = {}
    for column, kind in schema.items():
        place = header.index(column)
        cells = [
            _cell(row[place], kind, f"{path}: row {number}, column {column!r}")
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
                    f"{path}: row {number} repeats row {seen[values]} in the columns "
                    f"{', '.join(key)}; remove one of them"
                )
            seen[values] = number
    return Table(columns)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"{path} is missing: run the experiment again to write it") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read as text: {error}") from None


def _csv_rows(path: Path) -> tuple[list[str], list[list[str]]]:
    try:
        lines = [line for line in csv.reader(io.StringIO(_text(path), newline="")) if line]
    except csv.Error as error:
        raise InputError(f"{path} is not a CSV table: {error}") from None
    if not lines:
        raise InputError(f"{path} is empty: run the experiment again to write it")
    return lines[0], lines[1:]


def _cell(text: str, kind: str, where: str) -> str | int | float:
    """One cell as its kind, or an InputError that begins with ``where``."""
    text = text.strip()
    bare, optional = kind.rstrip("?"), kind.endswith("?")
    if bare == "text":
        if not text and not optional:
            raise InputError(f"{where} is empty; write a name")
        if any(ord(letter) < 32 and letter != "\t" for letter in text):
            raise InputError(f"{where} holds a control character; remove it")
        return text
    if optional and text.lower() in ("", "nan"):
        return math.nan
    if bare == "flag":
        flags = {"true": 1.0, "false": 0.0, "1": 1.0, "0": 0.0}
        if text.lower() not in flags:
            raise InputError(f"{where} is {text!r}; write true or false")
        return flags[text.lower()]
    try:
        value = int(text) if bare == "int" else float(text)
    except ValueError:
        noun = "a whole number" if bare == "int" else "a number"
        raise InputError(f"{where} is {text!r}; write {noun}") from None
    if not math.isfinite(value):
        raise InputError(f"{where} is {text!r}; write a finite number")
    if bare == "share" and not 0 <= value <= 1:
        raise InputError(f"{where} is {text!r}; write a share between 0 and 1")
    return value


def _json(path: Path) -> Any:
    try:
        return json.loads(_text(path))
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path}: row {error.lineno}, column {error.colno} is not JSON ({error.msg}); "
            "run the experiment again to write it"
        ) from None


_MANIFEST: dict[str, type | tuple[type, ...]] = {
    **dict.fromkeys(("version", "created", "command", "population"), str),
    **dict.fromkeys(("settings", "versions", "stages"), dict),
    **dict.fromkeys(("eval_services", "epochs", "people"), int),
    "seeds": list,
    "elapsed_s": (int, float),
}


def _manifest(path: Path) -> dict[str, Any]:
    manifest = _json(path)
    if not isinstance(manifest, dict):
        raise InputError(f"{path} must hold one JSON object with {', '.join(_MANIFEST)}")
    for field, kind in _MANIFEST.items():
        if field not in manifest:
            raise InputError(f"{path}: field {field!r} is missing; run the experiment again")
        if not isinstance(manifest[field], kind):
            raise InputError(f"{path}: field {field!r} is {manifest[field]!r}, of a wrong type")
    return manifest


_CLAIM = ("id", "claim", "paper", "ours", "ci95", "seeds", "status", "evidence")


def _claims(path: Path) -> list[dict[str, Any]]:
    claims = _json(path)
    if not isinstance(claims, list) or not claims:
        raise InputError(f"{path} must hold a JSON list with at least one claim")
    for number, claim in enumerate(claims, start=1):
        where = f"{path}: claim {number}"
        if not isinstance(claim, dict):
            raise InputError(f"{where} is not an object with {', '.join(_CLAIM)}")
        for field in _CLAIM:
            if field not in claim:
                raise InputError(f"{where}: field {field!r} is missing; write it, null if unknown")
        for field in ("id", "claim", "evidence"):
            if not isinstance(claim[field], str):
                raise InputError(f"{where}: field {field!r} is {claim[field]!r}; write a text")
        if claim["status"] not in STATUSES:
            raise InputError(
                f"{where}: status is {claim['status']!r}; choose one of {', '.join(STATUSES)}"
            )
        seeds = claim["seeds"]
        if isinstance(seeds, bool) or not isinstance(seeds, int | list | None):
            raise InputError(f"{where}: seeds is {seeds!r}; write a count, a list or null")
        interval = claim["ci95"]
        if interval is not None and not (isinstance(interval, list) and len(interval) == 2):
            raise InputError(f"{where}: ci95 is {interval!r}; write [low, high] or null")
    return claims
