"""JSON Lines, read strictly: one object a line, every value kept as the text that stands there."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa

from evenhand.audits.read.strict_csv import check_names
from evenhand.core.errors import InputError

_BATCH = 50_000


@dataclass(frozen=True)
class Lines:
    """The objects of a file.

    Attributes:
        table: a text column for every key, null where a line lacks it.
        numbers: line of each row, counted from 1; None where row i stands in line i.
        size: bytes.
        sha256: of the file.
    """

    table: pa.Table
    numbers: list[int] | None
    size: int
    sha256: str


def read_lines(path: str | os.PathLike[str]) -> Lines:
    """Read JSON Lines; empty lines are passed over.

    Raises:
        InputError: for the first line that is no object in UTF-8, names a key twice, or holds a
            number that JSON does not know.
    """
    path = Path(path)
    digest = hashlib.sha256()
    size = 0
    batches: list[pa.Table] = []
    rows: list[dict[str, str | None]] = []
    numbers: list[int] = []
    try:
        with path.open("rb") as file:
            for number, line in enumerate(file, 1):
                digest.update(line)
                size += len(line)
                if number == 1:
                    line = line.removeprefix(b"\xef\xbb\xbf")
                if not line.strip():
                    continue
                rows.append(_object(path, number, line))
                numbers.append(number)
                if len(rows) == _BATCH:
                    batches.append(_table(rows))
                    rows = []
    except OSError as error:
        raise InputError(
            "unavailable file", f"{path} cannot be read: {error.strerror or error}"
        ) from error
    if rows:
        batches.append(_table(rows))
    if not batches:
        raise InputError("empty file", f"{path} is empty: give a file with at least one line")
    table = pa.concat_tables(batches, promote_options="default")
    check_names(path, tuple(table.column_names))
    plain = numbers[-1] == len(numbers)
    return Lines(table, None if plain else numbers, size, digest.hexdigest())


class _RefusedError(ValueError):
    """What JSON allows and a table does not."""


def _pairs(items: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(items)
    if len(found) < len(items):
        keys = [key for key, _ in items]
        twice = next(key for key in found if keys.count(key) > 1)
        raise _RefusedError(f"the key {twice!r} stands there twice: rename or drop one")
    return found


def _constant(word: str) -> Any:
    raise _RefusedError(f"{word} is no number of JSON: write null where nothing is known")


_DECODER = json.JSONDecoder(
    parse_float=str, parse_int=str, parse_constant=_constant, object_pairs_hook=_pairs
)


def _object(path: Path, number: int, line: bytes) -> dict[str, str | None]:
    def fail(what: str) -> InputError:
        return InputError("format file", f"{path}, line {number}: {what}")

    try:
        value = _DECODER.decode(line.decode())
    except UnicodeDecodeError as error:
        raise fail(f"byte 0x{line[error.start]:02x} is no UTF-8: save the file as UTF-8") from error
    except json.JSONDecodeError as error:
        raise fail(
            f"it is no JSON (character {error.pos + 1}): write one object a line; was the file cut "
            "off?"
        ) from error
    except _RefusedError as error:
        raise fail(str(error)) from error
    except RecursionError as error:
        raise fail("objects are nested too deeply: write one flat object a line") from error
    if not isinstance(value, dict):
        raise fail('it is no object: write one a line, as {"gender": "female", "responded": true}')
    row = {key: _text(cell) for key, cell in value.items()}
    try:
        "".join(text or "" for text in (*row, *row.values())).encode()
    except UnicodeEncodeError as error:
        raise fail("half of a surrogate pair stands there: the text is damaged") from error
    return row


def _text(value: Any) -> str | None:
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    return json.dumps(value, ensure_ascii=False)


def _table(rows: list[dict[str, str | None]]) -> pa.Table:
    names = list(dict.fromkeys(name for row in rows for name in row))
    return pa.table({name: pa.array([r.get(name) for r in rows], pa.string()) for name in names})
