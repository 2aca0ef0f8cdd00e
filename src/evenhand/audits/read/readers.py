"""Files of each kind as tables of the embedded engine, checked before they are read."""

from __future__ import annotations

import contextlib
import glob
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq

from evenhand.audits.read.engines import Engine, Kind, Table, duckdb_engine
from evenhand.audits.read.jsonlines import read_lines
from evenhand.audits.read.strict_csv import Delimited, check_delimited, check_names
from evenhand.core.errors import InputError

THREADS = 2
MEMORY = "700MB"
"""What the embedded engine may use; beyond that it writes to the disk for a while."""


@dataclass(frozen=True)
class Part:
    """A piece of a log that knows its rows.

    Attributes:
        name: the file, as shown.
        table: its services.
        row: how its n-th service (from 0) is called, as "row 7".
    """

    name: str
    table: Table
    row: Callable[[int], str]


TEXT = Kind("varchar", "text")
NOTHING = ("cast(null as varchar)", TEXT)
"""A column in which nothing is known."""


def embedded(database: str = ":memory:", read_only: bool = False, **options: Any) -> Engine:
    """The embedded engine, which leaves the machine to others; options are DuckDB's own."""
    config = {"threads": THREADS, "memory_limit": MEMORY} | options
    con = duckdb.connect(database, read_only=read_only, config=config)
    # in a notebook without ipywidgets there is no progress bar, and nothing of it can be set
    with contextlib.suppress(duckdb.InvalidInputException):
        # else a query of more than two seconds draws itself into what the command says
        con.execute("set enable_progress_bar_print = false")
    return duckdb_engine(con)


def registered(engine: Engine, at: str, frame: pa.Table, name: str) -> Table:
    """An Arrow table as one of the engine, not copied.

    Args:
        engine: the engine.
        at: its name there.
        frame: the rows.
        name: how a complaint calls it.

    Raises:
        InputError: when it holds a type that the engine does not know.
    """
    try:
        engine.con.register(at, frame)
        return _typed(engine.table(at))
    except (duckdb.Error, pa.ArrowException, NotImplementedError) as error:
        raise InputError("unavailable log", f"{name} cannot be read: {one_line(error)}") from error


Read = tuple[list[Part], int, str]


def _delimited(engine: Engine, paths: list[Path]) -> Read:
    parts, rows, digest = [], 0, ""
    for path in paths:
        one = check_delimited(path)
        parts.append(Part(str(path), _csv(engine, one), lambda n: f"row {n + 2}"))
        rows, digest = rows + one.rows, one.sha256
    return parts, rows, digest


def _csv(engine: Engine, one: Delimited) -> Table:
    """Columns are read under plain names and renamed: no name of a log becomes part of a query."""
    plain = ", ".join(f"'c{i}': 'varchar'" for i in range(len(one.names)))
    source = (
        f"read_csv({_literal(one.path)}, columns = {{{plain}}}, delim = '{one.mark}', "
        "quote = '\"', escape = '\"', header = true, strict_mode = true, null_padding = false, "
        "max_line_size = 4000000)"
    )
    read = Table(engine, source, {f"c{i}": TEXT for i in range(len(one.names))})
    named = read.query({name: f"c{i}" for i, name in enumerate(one.names)})
    return Table(engine, f"({named}) as t", dict.fromkeys(one.names, TEXT))


def _literal(path: Path) -> str:
    """A path in a query; it is no pattern, whatever it is called."""
    return "'" + glob.escape(str(path)).replace("'", "''") + "'"


def _lines(engine: Engine, paths: list[Path]) -> Read:
    parts, rows, digest = [], 0, ""
    for i, path in enumerate(paths):
        one = read_lines(path)
        table = registered(engine, f"log{i}", one.table, str(path))
        parts.append(Part(str(path), table, _namer(one.numbers)))
        rows, digest = rows + one.table.num_rows, one.sha256
    return parts, rows, digest


def _namer(numbers: list[int] | None) -> Callable[[int], str]:
    return lambda n: f"line {numbers[n] if numbers else n + 1}"


def _typed(table: Table) -> Table:
    """Columns in which nothing is known as empty text: they have no type of their own."""
    empty = [name for name, kind in table.kinds.items() if kind.name == "null"]
    return table.having(dict.fromkeys(empty, NOTHING)) if empty else table


def _parquet(engine: Engine, paths: list[Path]) -> Read:
    parts, rows = [], 0
    for path in paths:
        try:
            found = pq.ParquetFile(path)
        except (OSError, pa.ArrowException) as error:
            raise damaged(path, "Parquet", error) from error
        check_names(path, tuple(found.schema_arrow.names))
        rows += found.metadata.num_rows
        try:
            source = f"read_parquet({_literal(path)}, hive_partitioning = false)"
            table = _typed(engine.read(source))
        except duckdb.Error as error:
            raise damaged(path, "Parquet", error) from error
        parts.append(Part(str(path), table, lambda n: f"row {n + 1}"))
    return _some(parts, rows, paths)


def _arrow(engine: Engine, paths: list[Path]) -> Read:
    parts, rows = [], 0
    for i, path in enumerate(paths):
        try:
            # not mapped into memory: there, a file that is cut off later ends the whole process
            with pa.OSFile(str(path)) as file:
                frame = pa.ipc.open_file(file).read_all()
        except pa.ArrowInvalid:
            # the other form of Arrow files, which begins without the mark
            frame = _arrow_stream(path)
        except (OSError, pa.ArrowException) as error:
            raise damaged(path, "Arrow", error) from error
        check_names(path, tuple(frame.column_names))
        table = registered(engine, f"log{i}", frame, str(path))
        parts.append(Part(str(path), table, lambda n: f"row {n + 1}"))
        rows += frame.num_rows
    return _some(parts, rows, paths)


def _arrow_stream(path: Path) -> pa.Table:
    try:
        with pa.OSFile(str(path)) as file:
            return pa.ipc.open_stream(file).read_all()
    except (OSError, pa.ArrowException) as error:
        raise damaged(path, "Arrow", error) from error


def _some(parts: list[Part], rows: int, paths: list[Path]) -> Read:
    if not rows:
        raise InputError("empty log", f"{paths[0]} has no rows: there is nothing to audit")
    return parts, rows, ""


def damaged(path: Path, kind: str, error: Exception) -> InputError:
    """What is said of a file that is not what it is called."""
    return InputError(
        "format file",
        f"{path} cannot be read as {kind}, it is damaged or was cut off: {one_line(error)}",
    )


def one_line(error: Exception) -> str:
    """The first line of what an engine complains of."""
    lines = str(error).strip().splitlines()
    return lines[0].strip().rstrip(".:") if lines else type(error).__name__


READERS = {
    "CSV": _delimited,
    "TSV": _delimited,
    "JSON Lines": _lines,
    "Parquet": _parquet,
    "Arrow": _arrow,
}
"""How each kind of file is read: parts, rows in all, and the sha256 of the last file if known."""
