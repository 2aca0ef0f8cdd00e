"""The detector as a file of readable JSON, and other people's answers as CSV.

Nothing is pickled. A file that cannot be used is told in one sentence: which file, which field
or row and column, and what is wrong with it.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from math import nan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evenhand.core import files
from evenhand.core.errors import InputError, nearest, unknown
from evenhand.methods.paper.detector import Detector
from evenhand.methods.vocabulary import DISCRIMINATIONS, ISSUES

FORMAT, VERSION = "evenhand-detector", 1

YES, NO = ("yes", "true", "1", "y", "t"), ("no", "false", "0", "n", "f")
NOTHING_NAMED = ("", "none", "-", "n/a")


SHIPPED = Path(__file__).parent / "data" / "detector.json"
"""Fitted to simulated respondents by ``evenhand reproduce`` with its default settings."""


@dataclass(frozen=True, eq=False)
class Answers:
    """People's judgements of n windows, ready for ``detector.fit`` and ``evaluate``.

    Attributes:
        issue_scores: float64 [n, K].
        biased: bool [n].
        kinds: n names of discriminations, None where none was named.
        respondents: n names of respondents; None when the file has no such column.
    """

    issue_scores: NDArray[np.float64]
    biased: NDArray[np.bool_]
    kinds: tuple[str | None, ...]
    respondents: tuple[str, ...] | None


def save(detector: Detector, path: str | Path) -> None:
    """Write a detector as JSON, one field a line.

    The file is written aside and renamed, so that a reader never sees half of it. Numbers are
    written with all their digits: ``load`` gives an equal detector.

    Raises:
        InputError: when the file cannot be written.
    """
    content = {"format": FORMAT, "version": VERSION} | asdict(detector)
    lines = (f"  {json.dumps(field)}: {json.dumps(value)}" for field, value in content.items())
    files.write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")


def load(path: str | Path) -> Detector:
    """Read a detector that ``save`` wrote.

    Raises:
        InputError: when the file is missing, cut off, of another format or version, or when a
            field is missing, unknown, of the wrong length or not finite.
    """
    where = f"detector file {path}"
    text = _text(path, where)
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(
            "format file",
            f"{where} is cut off or is not JSON: line {error.lineno}, column {error.colno}: "
            f"{error.msg}",
        ) from error
    except (ValueError, RecursionError) as error:
        raise InputError("format file", f"{where} is not a detector: {error}") from error
    if not isinstance(content, dict) or content.pop("format", None) != FORMAT:
        raise InputError(
            "format format", f"{where} is not a detector: field 'format' must be {FORMAT!r}"
        )
    version = content.pop("version", None)
    if version != VERSION or isinstance(version, bool):
        raise InputError(
            "changed file",
            f"{where} has version {version!r}, but this Evenhand reads version {VERSION}: "
            "fit the detector again",
        )
    names = [field.name for field in fields(Detector)]
    for name in names:
        if name not in content:
            raise InputError(
                f"missing {name}", f"{where} lacks field {name!r}: save the detector again"
            )
    for name in content:
        if name not in names:
            raise unknown("field", name, names).at(where)
    try:
        return Detector(
            issues=_names(content, "issues"),
            identities=_names(content, "identities"),
            mean=_row(content["mean"], "mean"),
            scale=_row(content["scale"], "scale"),
            components=_rows(content, "components"),
            weights=_row(content["weights"], "weights"),
            bias=_number(content["bias"], "bias"),
            kinds=_names(content, "kinds"),
            kind_weights=_rows(content, "kind_weights"),
            kind_bias=_row(content["kind_bias"], "kind_bias"),
            rows=_whole(content["rows"], "rows"),
            source=_name(content["source"], "source"),
            seed=None if content["seed"] is None else _whole(content["seed"], "seed"),
            threshold=_number(content["threshold"], "threshold"),
        )
    except InputError as error:
        raise error.at(where) from error


def read_answers(
    path: str | Path,
    *,
    issues: Sequence[str] = ISSUES,
    discriminations: Sequence[str] = DISCRIMINATIONS,
    missing: bool = False,
) -> Answers:
    """Read people's judgements from a CSV file with a header, one row a judged window.

    Columns: one for each issue with a score in [-1, 1]; ``biased`` (yes/no, true/false, 1/0);
    optional ``discrimination`` (empty or "none" where none was named) and ``respondent``. Upper
    and lower case are the same; other columns are ignored.

    Args:
        path: the file, UTF-8, separated by commas.
        issues: names of the issue columns, in the detector's order.
        discriminations: names that the column ``discrimination`` may hold.
        missing: an empty score is a missing one (NaN) instead of a mistake.

    Returns:
        The answers.

    Raises:
        InputError: names the file, the line and the column of the first mistake.
    """
    where = f"answers file {path}"
    lines = csv.reader(
        io.StringIO(_text(path, where).removeprefix("\ufeff"), newline=""), strict=True
    )
    scores: list[list[float]] = []
    biased: list[bool] = []
    kinds: list[str | None] = []
    respondents: list[str] = []
    try:
        header = [name.strip().lower() for name in next(lines, [])]
        columns = _columns(header, issues, where)
        known = {name.lower(): name for name in discriminations}
        for cells in lines:
            if not any(cell.strip() for cell in cells):
                continue
            row = f"{where}, line {lines.line_num}"
            if len(cells) != len(header):
                raise InputError(
                    "shape row",
                    f"{row}: there are {len(cells)} cells where the header has {len(header)}",
                )
            cell = {name: cells[i].strip() for name, i in columns.items()}
            scores.append(
                [
                    nan
                    if missing and not cell[issue]
                    else _score(cell[issue], f"{row}, column {issue!r}")
                    for issue in issues
                ]
            )
            biased.append(_yes(cell["biased"], f"{row}, column 'biased'"))
            kinds.append(_kind(cell.get("discrimination", ""), biased[-1], known, row))
            respondents.append(cell.get("respondent", ""))
            if "respondent" in columns and not respondents[-1]:
                raise InputError(
                    "empty respondent", f"{row}, column 'respondent': the cell is empty"
                )
    except csv.Error as error:
        raise InputError("format file", f"{where}, line {lines.line_num}: {error}") from error
    if not scores:
        raise InputError(
            "empty file", f"{where} has no answers: give one row for each judged window"
        )
    return Answers(
        issue_scores=np.array(scores),
        biased=np.array(biased),
        kinds=tuple(kinds),
        respondents=tuple(respondents) if "respondent" in columns else None,
    )


def _text(path: str | Path, where: str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise InputError("unavailable file", f"cannot read {where}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(
            "format file", f"{where} is not text in UTF-8 (byte {error.start})"
        ) from error


def _number(value: object, field: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"type {field}", f"field {field!r} must be a number")
    try:
        return float(value)
    except OverflowError as error:
        raise InputError(
            f"range {field}", f"field {field!r} holds a number that is far too large"
        ) from error


def _whole(value: object, field: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f"type {field}", f"field {field!r} must be a whole number")
    return value


def _name(value: object, field: str) -> str:
    if not isinstance(value, str) or not value:
        raise InputError(f"type {field}", f"field {field!r} must be a name")
    return value


def _list(value: object, field: str) -> list[object]:
    if not isinstance(value, list):
        raise InputError(f"type {field}", f"field {field!r} must be a list")
    return value


def _row(value: object, field: str) -> tuple[float, ...]:
    return tuple(_number(item, f"{field}[{i}]") for i, item in enumerate(_list(value, field)))


def _rows(content: dict[str, object], field: str) -> tuple[tuple[float, ...], ...]:
    return tuple(_row(row, f"{field}[{i}]") for i, row in enumerate(_list(content[field], field)))


def _names(content: dict[str, object], field: str) -> tuple[str, ...]:
    items = _list(content[field], field)
    return tuple(_name(item, f"{field}[{i}]") for i, item in enumerate(items))


def _columns(header: list[str], issues: Sequence[str], where: str) -> dict[str, int]:
    if len(header) == 1 and any(mark in header[0] for mark in ";\t"):
        raise InputError("format file", f"{where}: separate the columns by commas")
    wanted = {name: name.lower() for name in (*issues, "biased")}
    used = {name: header.index(low) for name, low in wanted.items() if low in header}
    for name in wanted:
        if name not in used:
            guess = nearest(name, [other for other in header if other not in wanted.values()])
            hint = f" (is it {guess!r}?)" if guess else ""
            raise InputError(f"missing {name}", f"{where} lacks column {name!r}{hint}")
    for name in ("discrimination", "respondent"):
        if name in header:
            used[name] = header.index(name)
    for name in used:
        if header.count(name.lower()) > 1:
            raise InputError(f"duplicate {name}", f"{where} has column {name!r} twice")
    return used


def _score(cell: str, at: str) -> float:
    try:
        score = float(cell.replace("_", "?"))  # Python reads 0_1 as 1
    except ValueError as error:
        what = f"{cell!r} is not a number" if cell else "the cell is empty"
        raise InputError("type score", f"{at}: {what}; give a score such as 0.25") from error
    if not -1 <= score <= 1:
        raise InputError(
            "range score", f"{at}: {cell} is outside -1 to 1; give a share, not percent"
        )
    return score


def _yes(cell: str, at: str) -> bool:
    if cell.lower() not in YES + NO:
        raise InputError("unknown biased", f"{at}: {cell!r} is neither yes nor no")
    return cell.lower() in YES


def _kind(cell: str, biased: bool, known: Mapping[str, str], row: str) -> str | None:
    """The discrimination, as it is spelled; ``known`` has it by its lower case."""
    name = cell.lower()
    if name in NOTHING_NAMED:
        return None
    at = f"{row}, column 'discrimination'"
    if name not in known:
        raise unknown("discrimination", cell, known.values()).at(at)
    if not biased:
        raise InputError(
            "conflict discrimination", f"{at}: {cell!r} is named in a row that says not biased"
        )
    return known[name]
