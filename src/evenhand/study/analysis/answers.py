"""Answers of a study: one row an answered question, whoever answered and whatever was asked.

The columns are raw facts as they were stored; ratings, judgements and quality are derived from them
elsewhere. Answers are read and written as CSV, JSON and Parquet, and stay the same in each.

A cell of a CSV file that a spreadsheet would run as a formula gets an apostrophe before it: text
that begins with =, +, - or @ (also in full width, or behind spaces), with a tab or with a new
line. So does text that begins with an apostrophe itself, and reading takes exactly one off again.
"""

from __future__ import annotations

import functools
import io
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from evenhand.core import files
from evenhand.core.csv_file import FORMULA
from evenhand.core.errors import InputError, unknown
from evenhand.study.analysis.answer_columns import (
    COLUMNS,
    LOOSE,
    SCHEMA,
    check_names,
    checked,
    fits,
    misfit,
    pc,
)

FORMAT, VERSION = "evenhand-answers", 1
ENDINGS = (".csv", ".json", ".parquet")

_LARGEST_BLOCK = 1 << 26
_YES, _NO = ("true", "1"), ("false", "0")


@dataclass(frozen=True, eq=False)
class Answers:
    """Answers of a study.

    Attributes:
        table: the columns of ``COLUMNS`` in their order, of the types of ``SCHEMA``; a missing
            value is null, empty text and numbers that are not finite are made so.

    Raises:
        InputError: for other columns or types, a value that a column cannot have, a participant
            who is simulated in some rows only, or a question answered twice on one page.
    """

    table: pa.Table

    def __post_init__(self) -> None:
        object.__setattr__(self, "table", checked(self.table))

    def __len__(self) -> int:
        return self.table.num_rows

    @classmethod
    def of_rows(cls, rows: Iterable[Mapping[str, Any]]) -> Answers:
        """Answers from rows, a value a column; a column that a row lacks is missing there.

        Raises:
            InputError: as the class, or for a value of another type (row and column are named).
        """
        listed = list(rows)
        arrays = []
        for field in SCHEMA:
            values = [row.get(field.name) for row in listed]
            try:
                arrays.append(pa.array(values, field.type))
            except (pa.ArrowInvalid, pa.ArrowTypeError, OverflowError):
                row = next(i for i, value in enumerate(values) if not fits(value, field.type))
                raise InputError(f"type {field.name}", misfit(row, field, values[row])) from None
        return cls(pa.Table.from_arrays(arrays, schema=LOOSE))

    def where(self, mask: Any) -> Answers:
        """The answers that a mask keeps; rows where it is null are left out."""
        return _trusted(self.table.filter(mask))

    @functools.cached_property
    def participants(self) -> tuple[str, ...]:
        """Everybody who answered, in order of first appearance."""
        return tuple(pc.unique(self.table["participant"]).to_pylist())

    @property
    def simulated(self) -> bool:
        """Whether any answer is of a simulated participant."""
        return bool(pc.any(self.table["simulated"]).as_py())

    def rows(self) -> list[dict[str, Any]]:
        """The answers as plain Python values."""
        return self.table.to_pylist()


def read(path: str | Path) -> Answers:
    """Answers from a file that ends in .csv, .json or .parquet.

    Raises:
        InputError: when it cannot be read or does not hold answers; the sentence names file, row
            (the first answer is row 1) and column.
    """
    path = Path(path)
    check_ending(path)
    if not path.is_file():
        raise InputError("missing file", f"{path} does not exist: give a file of answers")
    reader = {".csv": _read_csv, ".json": _read_json, ".parquet": _read_parquet}[path.suffix]
    try:
        return Answers(reader(path))
    except InputError as error:
        raise error.at(f"answers file {path}") from error
    except OSError as error:
        raise InputError(
            "unavailable file", f"cannot read answers file {path}: {error.strerror or error}"
        ) from error


def write(answers: Answers, path: str | Path) -> None:
    """Write answers as the ending of the path says, whole or not at all.

    Raises:
        InputError: for another ending, or when the file cannot be written.
    """
    path = Path(path)
    check_ending(path)
    table = answers.table
    if path.suffix == ".json":
        lines = ",\n".join(json.dumps(row, ensure_ascii=False) for row in table.to_pylist())
        head = f'{{"format": "{FORMAT}", "version": {VERSION}, "answers": ['
        files.write_text(path, f"{head}\n{lines}\n]}}\n")
        return
    out = io.BytesIO()
    if path.suffix == ".csv":
        pyarrow.csv.write_csv(neutralised(table), out)
    else:
        pq.write_table(table, out)
    files.write_bytes(path, out.getvalue())


def check_ending(path: Path) -> None:
    """Check that a path ends as a file of answers does."""
    if path.suffix not in ENDINGS:
        raise InputError(
            "unknown file",
            f"{path} is no file of answers: it has to end in {', '.join(ENDINGS[:-1])} or "
            f"{ENDINGS[-1]}",
        )


def _trusted(table: pa.Table) -> Answers:
    """Answers from rows of answers, which need no second check."""
    answers = object.__new__(Answers)
    object.__setattr__(answers, "table", table)
    return answers


# --- one form a function ---


def neutralised(table: pa.Table) -> pa.Table:
    """A table whose text no spreadsheet runs as a formula; see above."""
    for place, field in enumerate(table.schema):
        if pa.types.is_string(field.type):
            cells = table[field.name]
            risky = pc.match_substring_regex(cells, FORMULA)
            marked = pc.binary_join_element_wise("'", cells, "")
            table = table.set_column(place, field, pc.if_else(risky, marked, cells))
    return table


def _read_csv(path: Path) -> pa.Table:
    try:
        # without threads a mistake has its row
        table = pyarrow.csv.read_csv(
            path,
            pyarrow.csv.ReadOptions(use_threads=False, block_size=_LARGEST_BLOCK),
            pyarrow.csv.ParseOptions(newlines_in_values=True),
            pyarrow.csv.ConvertOptions(
                column_types=dict.fromkeys(COLUMNS, pa.string()),
                null_values=[""],
                strings_can_be_null=True,
                quoted_strings_can_be_null=True,
            ),
        )
    except pa.ArrowInvalid as error:
        raise InputError(
            "format file", f"it is no CSV file of answers: {_first_line(error)}"
        ) from error
    if len(table.column_names) == 1 and ";" in table.column_names[0]:
        raise InputError("format file", "its columns are parted by ';': save it with commas")
    check_names(table.column_names)
    columns = []
    for name in table.column_names:
        cells = table[name]
        apostrophe = pc.starts_with(cells, "'")
        cells = pc.if_else(apostrophe, pc.utf8_slice_codeunits(cells, 1), cells)
        columns.append(_parsed(cells, SCHEMA.field(name)))
    return pa.table(columns, names=table.column_names)


def _parsed(cells: Any, field: pa.Field) -> Any:
    if pa.types.is_string(field.type):
        return cells
    if pa.types.is_boolean(field.type):
        lower = pc.utf8_lower(cells)
        cells = pc.if_else(pc.is_in(lower, pa.array(_YES)), "true", cells)
        cells = pc.if_else(pc.is_in(lower, pa.array(_NO)), "false", cells)
    if pa.types.is_integer(field.type):  # as some programs write them where any is missing
        cells = pc.replace_substring_regex(cells, r"^(-?[0-9]+)\.0+$", r"\1")
    try:
        return cells.cast(field.type)
    except pa.ArrowInvalid:
        for row, cell in enumerate(cells.to_pylist()):
            try:
                pa.array([cell], pa.string()).cast(field.type)
            except pa.ArrowInvalid:
                raise InputError(f"type {field.name}", misfit(row, field, cell)) from None
        raise


def _read_json(path: Path) -> pa.Table:
    content = files.read_json(path)
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError("format format", f"it holds no answers: field 'format' must be {FORMAT!r}")
    if content.get("version") != VERSION:
        raise InputError(
            "changed version",
            f"it has version {content.get('version')!r}, but this Evenhand reads {VERSION}: "
            "export the answers again",
        )
    rows = content.get("answers")
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise InputError("type answers", "field 'answers' must be a list of rows, an object each")
    for number, row in enumerate(rows, 1):
        if not row.keys() <= set(COLUMNS):
            name = next(name for name in row if name not in COLUMNS)
            raise InputError("unknown column", f"row {number}: {unknown('column', name, COLUMNS)}")
    return Answers.of_rows(rows).table


def _read_parquet(path: Path) -> pa.Table:
    try:
        table = pq.read_table(path)
    except (pa.ArrowInvalid, pa.ArrowTypeError) as error:
        raise InputError("format file", f"it is no Parquet file: {_first_line(error)}") from error
    check_names(table.column_names)
    for place, name in enumerate(table.column_names):
        field = SCHEMA.field(name)
        try:
            table = table.set_column(place, name, table[name].cast(field.type))
        except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
            raise InputError(
                f"type {name}",
                f"column {name!r} holds {table[name].type} where {field.type} is needed",
            ) from None
    return table


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0].removeprefix("CSV parse error: ")[:200]
