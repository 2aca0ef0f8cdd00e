"""Opens the database of a study: makes its tables, brings them up to date, binds them."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, delete, func, select
from sqlalchemy.exc import DBAPIError

from evenhand.core.errors import InputError
from evenhand.study.design.protocol import Protocol
from evenhand.study.server import backup, engines, migrate, schema
from evenhand.study.server.refusal import StorageError
from evenhand.study.server.store import Store, read_note, write_note


def open_store(
    db: str,
    study: Protocol | None,
    *,
    make: bool = True,
    clock: Callable[[], float] = time.time,
    wait: float = engines.WAIT,
) -> Store:
    """Open a database, make its tables or bring them up to date, and bind it to a study.

    Before tables of an older version are changed, a backup is written: beside an SQLite file, and
    into the current folder for PostgreSQL.

    Args:
        db: name of an SQLite file, or a URL.
        study: None to read only, whatever the study is.
        make: whether a database that is not there is made.
        clock: seconds of UTC since 1970.
        wait: seconds to wait for a lock.

    Raises:
        InputError: when it cannot be used: not there, read-only, locked, full, no study's, of
            another study, of a changed study that participants have begun, or of a newer Evenhand.
    """
    url = engines.address(db)
    store = Store(engines.engine(url, wait), engines.shown(url), clock)
    file = Path(url.database) if url.get_backend_name() == "sqlite" and url.database else None
    try:
        if file is not None:
            _check_file(file, make)
            _write_ahead(store)
        _tables(store, file, make)
        if study is not None:
            with store.write() as connection:
                _bind(connection, study, store.name)
    except StorageError as error:
        store.dispose()
        raise InputError(
            "unavailable database",
            f"{error}: see that it can be reached and written, and has space",
        ) from None
    except DBAPIError as error:
        store.dispose()
        raise InputError(
            "unavailable database", f"{store.name} cannot be used: {error.orig}"
        ) from None
    except InputError:
        store.dispose()
        raise
    return store


def _check_file(file: Path, make: bool) -> None:
    if not file.exists():
        if make and file.parent.is_dir():
            return
        raise InputError(
            "missing db", f"{file} does not exist: give the database of a study with --db"
        )
    try:
        with file.open("r+b") as opened:
            head = opened.read(16)
    except OSError as error:
        raise InputError(
            "unavailable db",
            f"{file} cannot be written ({error.strerror or error}): give another --db",
        ) from error
    if head not in (b"", b"SQLite format 3\x00"):
        raise InputError("format db", f"{file} is no SQLite database: give another --db")


def _write_ahead(store: Store) -> None:
    with store._told(), store.engine.connect() as bare:
        raw: Any = bare.connection.driver_connection
        mode = raw.execute("PRAGMA journal_mode=WAL").fetchone()[0]
    if mode != "wal":
        raise InputError(
            "unavailable db",
            f"{store.name} lies where SQLite cannot write ahead: give another --db",
        )


def _tables(store: Store, file: Path | None, make: bool) -> None:
    with store.write() as connection:
        store.one_at_a_time(connection)
        found = migrate.version(connection)
        if found is None:
            if not make:
                raise InputError("empty db", f"{store.name} holds no study: give another --db")
            schema.metadata.create_all(connection)
            write_note(connection, "version", str(schema.VERSION))
            return
    migrate.check(found, store.name)
    if found == schema.VERSION:
        return
    beside = Path("study") if file is None else file
    backup.write(store, beside.with_name(f"{beside.name}.version{found}.backup"))
    with store.write() as connection:
        store.one_at_a_time(connection)
        # another process may have been faster
        migrate.upgrade(connection, migrate.version(connection) or found)


def _bind(connection: Connection, study: Protocol, name: str) -> None:
    there, print_ = read_note(connection, "study"), read_note(connection, "fingerprint")
    if there not in (None, study.name):
        raise InputError(
            "conflict db",
            f"{name} belongs to the study {there!r}, not to {study.name!r}: give another --db",
        )
    if print_ == study.fingerprint():
        return
    begun = connection.scalar(
        select(func.count())
        .select_from(schema.participants)
        .where(schema.participants.c.preview.is_(False))
    )
    if print_ is not None and begun:
        raise InputError(
            "changed db",
            f"{name} holds {begun} participants of {study.name!r} as it was before its questions, "
            "sets or consent were changed: give another --db for the changed study",
        )
    if print_ is not None:
        _forget_previews(connection)
    write_note(connection, "study", study.name)
    write_note(connection, "fingerprint", study.fingerprint())


def _forget_previews(connection: Connection) -> None:
    """Previews of the study as it was are answers to questions that nobody asks any more."""
    people = schema.participants
    previews = select(people.c.participant).where(people.c.preview)
    for table in (schema.answers, schema.pages, schema.external, people):
        connection.execute(delete(table).where(table.c.participant.in_(previews)))
