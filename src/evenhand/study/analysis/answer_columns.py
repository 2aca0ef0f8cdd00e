"""The columns of answers: names, types, and what their values can be."""

from typing import Any

import pyarrow as pa
import pyarrow.compute

from evenhand.core.errors import InputError, nearest, unknown

pc: Any = pyarrow.compute


KINDS = ("about", "set", "check", "pair", "end")
"""Kinds of pages that ask something."""
ABOUT_ITEMS = ("set", "check", "pair")
"""Those that are about something that has a name."""
STATUSES = ("finished", "begun", "withdrawn")
"""How far participants came."""
BETWEEN = "|"
"""Parts the values of a question that takes several."""

SCHEMA = pa.schema(
    [
        pa.field("participant", pa.string(), nullable=False),
        pa.field("simulated", pa.bool_(), nullable=False),
        pa.field("preview", pa.bool_(), nullable=False),
        pa.field("consent_version", pa.string()),
        pa.field("order", pa.int64()),
        pa.field("position", pa.int64(), nullable=False),
        pa.field("page", pa.string(), nullable=False),
        pa.field("kind", pa.string(), nullable=False),
        pa.field("item", pa.string()),
        pa.field("question", pa.string(), nullable=False),
        pa.field("role", pa.string()),
        pa.field("type", pa.string()),
        pa.field("value", pa.string()),
        pa.field("number", pa.float64()),
        pa.field("right", pa.bool_()),
        pa.field("seconds", pa.float64()),
        pa.field("views", pa.int64()),
        pa.field("received", pa.string()),
        pa.field("status", pa.string(), nullable=False),
    ]
)
COLUMNS = tuple(SCHEMA.names)
LOOSE = pa.schema([field.with_nullable(True) for field in SCHEMA])
"""The same with nulls allowed everywhere: what cannot be missing is checked here."""

LARGEST = 2**31 - 1
"""Of whole numbers: orders, positions and views."""

_CHOICES = {"kind": KINDS, "status": STATUSES}


def check_names(names: list[str]) -> None:
    """Check that all columns are there, once, and no others."""
    for name in COLUMNS:
        if names.count(name) > 1:
            raise InputError(f"duplicate {name}", f"column {name!r} is there twice")
        if name not in names:
            guess = nearest(name, [other for other in names if other not in COLUMNS])
            hint = f" (is it {guess!r}?)" if guess else ""
            raise InputError(
                f"missing {name}", f"column {name!r} is missing{hint}: export the answers again"
            )
    for name in names:
        if name not in COLUMNS:
            raise InputError("unknown column", str(unknown("column", name, COLUMNS)))


def checked(table: pa.Table) -> pa.Table:
    """A table of ``COLUMNS`` whose values are possible; empty text and infinity become null.

    Raises:
        InputError: names the row (the first is 1) and the column.
    """
    check_names(table.column_names)
    columns = []
    for field in SCHEMA:
        cells = table[field.name].combine_chunks()
        if cells.type != field.type:
            raise InputError(
                f"type {field.name}", f"column {field.name!r} holds {cells.type}, not {field.type}"
            )
        nothing = pa.scalar(None, field.type)
        if pa.types.is_string(field.type):
            cells = pc.if_else(pc.equal(cells, ""), nothing, cells)
        elif pa.types.is_floating(field.type):
            cells = pc.if_else(pc.is_finite(cells), cells, nothing)
        if not field.nullable and cells.null_count:
            row = pc.index(pc.is_null(cells), True).as_py()
            raise InputError(
                f"empty {field.name}", f"row {row + 1}, column {field.name!r}: the cell is empty"
            )
        if pa.types.is_integer(field.type):
            wrong = pc.or_(pc.less(cells, 0), pc.greater(cells, LARGEST))
            if pc.any(wrong).as_py():
                row = pc.index(wrong, True).as_py()
                raise InputError(
                    f"range {field.name}",
                    f"row {row + 1}, column {field.name!r}: {cells[row]} is not a whole number "
                    f"from 0 to {LARGEST}",
                )
        if field.name in _CHOICES:
            known = pc.is_in(cells, pa.array(_CHOICES[field.name]))
            if not pc.all(known, min_count=0).as_py():
                row = pc.index(known, False).as_py()
                wrong = unknown(field.name, cells[row].as_py(), _CHOICES[field.name])
                raise InputError(
                    f"unknown {field.name}", f"row {row + 1}, column {field.name!r}: {wrong}"
                )
        columns.append(cells)
    checked = pa.Table.from_arrays(columns, schema=LOOSE)
    lacking = pc.and_(pc.is_in(checked["kind"], pa.array(ABOUT_ITEMS)), pc.is_null(checked["item"]))
    if pc.any(lacking).as_py():
        row = pc.index(lacking, True).as_py()
        raise InputError(
            "empty item",
            f"row {row + 1}, column 'item': the cell is empty: name the {checked['kind'][row]}",
        )
    _check_people(checked)
    return checked


def _check_people(table: pa.Table) -> None:
    kinds = table.group_by("participant").aggregate([("simulated", "count_distinct")])
    if pc.any(pc.greater(kinds["simulated_count_distinct"], 1)).as_py():
        row = pc.index(pc.greater(kinds["simulated_count_distinct"], 1), True).as_py()
        raise InputError(
            "conflict participant",
            f"participant {kinds['participant'][row]} is simulated in some rows and not in others: "
            "simulated answers stay so for ever, export them again",
        )
    keys = ["participant", "page", "question"]
    many = table.group_by(keys).aggregate([([], "count_all")])
    twice = pc.greater(many["count_all"], 1)
    if pc.any(twice).as_py():
        row = pc.index(twice, True).as_py()
        who, page, question = (many[key][row].as_py() for key in keys)
        raise InputError(
            "duplicate participant",
            f"participant {who} answered question {question!r} on page {page!r} twice: leave one "
            "of the rows out",
        )


def fits(value: Any, kind: pa.DataType) -> bool:
    """Whether a column of this type can hold the value."""
    try:
        pa.array([value], kind)
    except (pa.ArrowInvalid, pa.ArrowTypeError, OverflowError):
        return False
    return True


def misfit(row: int, field: pa.Field, value: Any) -> str:
    """What is wrong with a value of another type; ``row`` counts from 0."""
    shown = repr(value)[:60]
    wanted = {"string": "text", "bool": "true or false", "int64": "a whole number"}
    return (
        f"row {row + 1}, column {field.name!r}: {shown} is not "
        f"{wanted.get(str(field.type), 'a number')}"
    )
