"""A copy of a running study, always as an SQLite file that can be served itself."""

from __future__ import annotations

import contextlib
import os
import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection, MetaData, create_engine, inspect, select, text

from evenhand.core.errors import InputError
from evenhand.study.server import schema

if TYPE_CHECKING:
    from evenhand.study.server.store import Store


def write(store: Store, path: Path) -> Path:
    """Copy everything, as it is at one moment, while the study goes on.

    SQLite is copied page by page by its own online backup; of PostgreSQL, all rows are read in one
    repeatable transaction.

    Raises:
        InputError: when it is there already, or cannot be written.
        StorageError: when the database cannot be read.
    """
    if path.exists():
        raise InputError(
            "duplicate file", f"{path} is there already: move it away or give another name"
        )
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with store.read() as connection:
            if store.engine.dialect.name == "sqlite":
                _pages(connection, aside)
            else:
                _rows(connection, aside)
        with aside.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(aside, path)
    except (OSError, sqlite3.Error) as error:
        raise InputError("unavailable file", f"{path} cannot be written: {error}") from error
    finally:
        for name in (aside, Path(f"{aside}-wal"), Path(f"{aside}-shm"), Path(f"{aside}-journal")):
            with contextlib.suppress(OSError):
                name.unlink()
    return path


def _pages(connection: Connection, aside: Path) -> None:
    source: Any = connection.connection.driver_connection
    with contextlib.closing(sqlite3.connect(aside)) as target:
        source.backup(target)
        # one file, without a log beside it
        target.execute("PRAGMA journal_mode=DELETE")


def _rows(connection: Connection, aside: Path) -> None:
    # nothing was read yet in this transaction
    connection.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY"))
    # the tables as they are there, which may be those of an older version
    names = set(inspect(connection).get_table_names()) & set(schema.metadata.tables)
    there = MetaData()
    there.reflect(connection, only=sorted(names))
    target = create_engine(f"sqlite:///{aside}", hide_parameters=True)
    try:
        with target.begin() as copy:
            there.create_all(copy)
            for table in there.sorted_tables:
                rows = connection.execution_options(yield_per=1000).execute(select(table))
                for some in rows.mappings().partitions():
                    copy.execute(table.insert(), [dict(row) for row in some])
    finally:
        target.dispose()
