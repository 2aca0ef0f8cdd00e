"""Anything that holds a log, as one table: files, folders, databases, data frames.

Text files are read as text in every column and converted later by expressions of our own, so that
no engine guesses what a cell means. Files are checked before they are read, and looked at again
after they were counted.
"""

from __future__ import annotations

import glob
import hashlib
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import duckdb
import pyarrow as pa

from evenhand.audits.read import databases
from evenhand.audits.read.engines import Table
from evenhand.audits.read.readers import READERS, Part, damaged, embedded, one_line, registered
from evenhand.audits.read.strict_csv import check_names
from evenhand.core.errors import InputError
from evenhand.methods.services import Services

KINDS = {
    ".csv": "CSV",
    ".tsv": "TSV",
    ".jsonl": "JSON Lines",
    ".ndjson": "JSON Lines",
    ".parquet": "Parquet",
    ".arrow": "Arrow",
    ".feather": "Arrow",
    ".ipc": "Arrow",
    ".duckdb": "DuckDB",
}
"""Endings of files and what they hold."""

BINARY = ("Parquet", "Arrow")

HASHED = 256_000_000
"""A single file up to so many bytes is described by its SHA-256."""


@dataclass(frozen=True)
class Source:
    """A log that can be counted.

    Attributes:
        table: all services; any engine.
        name: short, as shown; never a password.
        description: kind, files, rows and bytes where known, sha256 of a single file.
        parts: pieces whose rows have an order, to say where a wrong cell stands; none in a
            database.
        rows: services, where the check of the files has counted them.
    """

    table: Table
    name: str
    description: dict[str, Any]
    parts: tuple[Part, ...] = ()
    rows: int | None = None
    _stamps: tuple[tuple[Path, int, int], ...] = field(default=(), repr=False)
    _secret: str = field(default="", repr=False)

    def fetch(self, query: str) -> pa.Table:
        """The rows of a query, from the log's engine.

        Raises:
            InputError: when the engine cannot read the log, without any password.
        """
        try:
            return self.table.engine.fetch(query)
        except duckdb.Error as error:
            self.check_unchanged()
            raise InputError(
                "unavailable log", f"{self.name} cannot be read: {one_line(error)}"
            ) from error
        except Exception as error:
            if not self._secret and not databases.complains(error):
                raise
            detail = databases.hide(one_line(error), self._secret)
            raise InputError("unavailable log", f"{self.name} cannot be read: {detail}") from None

    def close(self) -> None:
        """Leave a database that was opened by its URL; nothing can be fetched afterwards."""
        if self._secret:
            self.table.engine.close()

    def check_unchanged(self) -> None:
        """After counting: is the log still what was checked?

        Raises:
            InputError: when a file has grown, shrunk, gone or been written since.
        """
        for path, size, written in self._stamps:
            try:
                now = path.stat()
            except OSError as error:
                raise InputError(
                    "changed file", f"{path} went away while it was read: try again"
                ) from error
            if (now.st_size, now.st_mtime_ns) != (size, written):
                raise InputError(
                    "changed file",
                    f"{path} changed while it was read: audit a copy, or wait until it is written",
                )


def open_source(source: object, table: str | None = None) -> Source:
    """Anything that holds a log, as a table.

    Args:
        source: a path of a CSV, TSV, JSON Lines, Parquet, Arrow or DuckDB file; a folder or glob
            of files of one kind; the URL of a database, as postgres://user:password@host/name; a
            data frame of pandas, polars or pyarrow, or anything else that gives an Arrow stream;
            ``Services``.
        table: of a database.

    Raises:
        InputError: when it cannot be read, is no table, or is damaged: where, and what to do.
    """
    if isinstance(source, Services):
        return _from_arrow(source.to_arrow(), "services", "Services")
    if isinstance(source, str | os.PathLike):
        text = os.fspath(source)
        if databases.is_url(text):
            _table, name, description, secret = databases.open_table(text, table)
            return Source(_table, name, description, _secret=secret)
        return _from_files(text, table)
    if isinstance(source, pa.Table):
        return _from_arrow(source, "data frame", "data frame")
    if hasattr(source, "__arrow_c_stream__"):
        check_names("data frame", tuple(map(str, getattr(source, "columns", ()))))
        try:
            frame = pa.table(source)
        except (pa.ArrowException, TypeError, ValueError) as error:
            if "non-struct type" in str(error):
                raise InputError(
                    "type log",
                    f"{type(source).__name__} is a single column: give a data frame with a column "
                    "of identities and one of responses",
                ) from error
            raise InputError(
                "format log",
                f"the data frame is no plain table: {one_line(error)}: give each column one type",
            ) from error
        return _from_arrow(frame, "data frame", "data frame")
    raise InputError(
        "type log",
        f"a log cannot be read from {type(source).__name__}: give a path, a database URL or a data "
        "frame",
    )


def check_target(source: str, path: Path) -> None:
    """Check that writing a file leaves the log as it is.

    Args:
        source: where the log is, as for ``open_source``.
        path: what will be written.

    Raises:
        InputError: when it is a file of the log; or when there is no such log.
    """
    if databases.is_url(source) or not path.exists():
        return
    if any(one.exists() and path.samefile(one) for one in _find(source)[0]):
        raise InputError(
            "conflict file",
            f"{path} is the log itself, which is never changed: choose another name",
        )


def _from_arrow(frame: pa.Table, name: str, kind: str) -> Source:
    check_names(name, tuple(frame.column_names))
    if not frame.num_rows:
        raise InputError("empty log", f"the {kind} has no rows: there is nothing to audit")
    table = registered(embedded(), "log", frame, name)
    return Source(
        table,
        name,
        {"kind": kind, "rows": frame.num_rows},
        (Part(name, table, lambda i: f"row {i + 1}"),),
        frame.num_rows,
    )


def _from_files(text: str, table: str | None) -> Source:
    paths, kind = _find(text)
    if kind == "DuckDB":
        return _from_duckdb(paths, table)
    if table is not None:
        raise InputError(
            "unsupported table", f"{text} holds one table: leave out the name {table!r}"
        )
    stamps = tuple(_stamp(path) for path in paths)
    size = sum(size for _, size, _ in stamps)
    described = len(paths) == 1 and size <= HASHED
    with ThreadPoolExecutor(1) as aside:
        # texts are read through anyway, and described then
        hashed = aside.submit(_digest, paths[0]) if described and kind in BINARY else None
        parts, rows, digest = READERS[kind](embedded(), paths)
    names = set(parts[0].table.columns)
    for part in parts[1:]:
        for name in sorted(names ^ set(part.table.columns)):
            lacking, other = (part, parts[0]) if name in names else (parts[0], part)
            raise InputError(
                f"missing {name}",
                f"{lacking.name} has no column {name!r}, which {other.name} has: give files of the "
                "same columns",
            )
    description: dict[str, Any] = {"kind": kind, "files": len(paths), "rows": rows, "bytes": size}
    if described:
        description["sha256"] = hashed.result() if hashed else digest
    return Source(_together(parts), text, description, tuple(parts), rows, stamps)


def _together(parts: Sequence[Part]) -> Table:
    first = parts[0].table
    if len(parts) == 1:
        return first
    for part in parts[1:]:
        for name, kind in first.kinds.items():
            if part.table.kinds[name] != kind:
                raise InputError(
                    f"conflict {name}",
                    f"{part.name}: column {name!r} holds {part.table.kinds[name].name}, in "
                    f"{parts[0].name} {kind.name}: give files of the same types",
                )
    every = {name: first[name] for name in first.columns}
    union = " union all ".join(part.table.query(every) for part in parts)
    return replace(first, source=f"({union}) as t")


def _find(text: str) -> tuple[list[Path], str]:
    """The files that a path, a folder or a pattern stands for, all of one kind."""
    path = Path(text)
    if path.is_dir():
        found = [one for one in sorted(path.rglob("*")) if one.is_file() and _shown(one, path)]
        if not found:
            raise InputError("empty folder", f"folder {text} has no files: give one with a log")
    elif path.exists():
        found = [path]
    elif glob.has_magic(text):
        found = [
            Path(one) for one in sorted(glob.glob(text, recursive=True)) if Path(one).is_file()
        ]
        if not found:
            raise InputError("missing file", f"no file is like {text}: check the pattern")
    else:
        raise InputError(
            "missing file", f"{text} does not exist: give a file, a folder or the URL of a database"
        )
    kinds: dict[str, Path] = {}
    for one in found:
        kind = KINDS.get(one.suffix.lower())
        if kind is None:
            raise InputError(
                "unknown file", f"{one} is of no known kind: give a file that ends in {_listed()}"
            )
        kinds.setdefault(kind, one)
    if len(kinds) > 1:
        (a, one), (b, other) = list(kinds.items())[:2]
        raise InputError(
            "conflict file",
            f"{text} holds files of several kinds, as {a} ({one.name}) and {b} ({other.name}): "
            "give a pattern such as logs/*.csv",
        )
    return found, next(iter(kinds))


def _shown(path: Path, folder: Path) -> bool:
    """Not hidden, nor what Spark and others note beside the data."""
    return not any(part.startswith((".", "_")) for part in path.relative_to(folder).parts)


def _listed() -> str:
    endings = list(KINDS)
    return f"{', '.join(endings[:-1])} or {endings[-1]}"


def _stamp(path: Path) -> tuple[Path, int, int]:
    try:
        found = path.stat()
    except OSError as error:
        raise InputError(
            "unavailable file", f"{path} cannot be read: {error.strerror or error}"
        ) from error
    return path, found.st_size, found.st_mtime_ns


def _digest(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(
            "unavailable file", f"{path} cannot be read: {error.strerror or error}"
        ) from error


def _from_duckdb(paths: list[Path], table: str | None) -> Source:
    if len(paths) > 1:
        raise InputError("unsupported log", "a log is one DuckDB file: name the file")
    stamp = _stamp(paths[0])
    try:
        engine = embedded(str(paths[0]), read_only=True)
        name = databases.choose(str(paths[0]), engine.tables(), table)
        log = engine.table(name)
    except duckdb.Error as error:
        raise damaged(paths[0], "DuckDB", error) from error
    check_names(paths[0], tuple(log.columns))
    description = {"kind": "DuckDB", "files": 1, "bytes": stamp[1], "table": name}
    part = Part(f"{paths[0]}, table {name}", log, lambda n: f"row {n + 1}")
    return Source(log, str(paths[0]), description, (part,), None, (stamp,))
