"""Where answers are kept: one database, one study."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, delete, func, insert, select, text
from sqlalchemy.exc import DataError, DBAPIError, IntegrityError, ProgrammingError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from evenhand.errors import InputError
from evenhand.study import backup, engines, migrate, orders, tables
from evenhand.study.protocol import Protocol
from evenhand.study.refusals import StorageError

_MARK = 4_157_303
"""Of the lock under which participants begin, one after another (PostgreSQL)."""


class Store:
    """A database that belongs to a study.

    Attributes:
        engine: of SQLAlchemy.
        name: the address without its password.
        clock: seconds of UTC since 1970.
    """

    def __init__(self, engine: Engine, name: str, clock: Callable[[], float] = time.time) -> None:
        self.engine, self.name, self.clock = engine, name, clock
        self._sqlite = engine.dialect.name == "sqlite"
        self._memory = self._sqlite and not engine.url.database
        # threads queue here in order; SQLite's own waiting is a lottery
        self._turn = threading.Lock()
        self._pages: dict[int, list[dict[str, Any]]] = {}

    def now(self) -> int:
        """Milliseconds of UTC since 1970."""
        return int(self.clock() * 1000)

    @contextlib.contextmanager
    def write(self) -> Iterator[Connection]:
        """A transaction that writes; committed, and on the disk, when it is left without error.

        Raises:
            StorageError: when the database is full, locked, read-only or gone.
        """
        turn = self._turn if self._sqlite else contextlib.nullcontext()
        with turn, self._told(), self.engine.begin() as connection:
            yield connection

    @contextlib.contextmanager
    def read(self) -> Iterator[Connection]:
        """A transaction that reads.

        Raises:
            StorageError: as ``write``.
        """
        turn = self._turn if self._memory else contextlib.nullcontext()
        with turn, self._told(), self.engine.connect() as bare:
            connection = bare.execution_options(reads=True)
            with connection.begin():
                yield connection

    def one_at_a_time(self, connection: Connection) -> None:
        """Let no other transaction that asks for this pass until this one ends."""
        if not self._sqlite:  # there, writers are alone anyhow
            connection.execute(text(f"SELECT pg_advisory_xact_lock({_MARK})"))

    def pages(self, study: Protocol, order: int) -> list[dict[str, Any]]:
        """``orders.pages``, remembered."""
        if order not in self._pages:
            self._pages[order] = orders.pages(study, order)
        return self._pages[order]

    def note(self, key: str) -> str | None:
        """What is noted about the database: version, study, fingerprint, closed."""
        with self.read() as connection:
            return read_note(connection, key)

    def close_study(self, closed: bool) -> None:
        """Take no more answers, or take them again."""
        with self.write() as connection:
            write_note(connection, "closed", "yes" if closed else "no")

    def forget(self) -> None:
        """Empty the write-ahead log, so that nothing deleted is left in it (SQLite)."""
        if self._sqlite and not self._memory:
            # somebody may be reading; then the next time does it
            with contextlib.suppress(DBAPIError), self._turn, self.engine.connect() as bare:
                raw: Any = bare.connection.driver_connection
                raw.execute("PRAGMA wal_checkpoint(TRUNCATE)")

    def dispose(self) -> None:
        """Give all connections back."""
        self.engine.dispose()

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except (IntegrityError, ProgrammingError, DataError):
            raise
        except (DBAPIError, PoolTimeoutError) as error:
            cause = " ".join(str(getattr(error, "orig", None) or error).split())
            raise StorageError(f"{self.name} cannot store or read: {cause}") from error


def read_note(connection: Connection, key: str) -> str | None:
    """One of the notes of ``tables.about``."""
    return connection.scalar(select(tables.about.c.value).where(tables.about.c.key == key))


def write_note(connection: Connection, key: str, value: str) -> None:
    """Write one of the notes of ``tables.about``."""
    connection.execute(delete(tables.about).where(tables.about.c.key == key))
    connection.execute(insert(tables.about).values(key=key, value=value))


def opened(
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
            f"{error}: see that it can be reached and written, and has space"
        ) from None
    except DBAPIError as error:
        store.dispose()
        raise InputError(f"{store.name} cannot be used: {error.orig}") from None
    except InputError:
        store.dispose()
        raise
    return store


def _check_file(file: Path, make: bool) -> None:
    if not file.exists():
        if make and file.parent.is_dir():
            return
        raise InputError(f"{file} does not exist: give the database of a study with --db")
    try:
        with file.open("r+b") as opened:
            head = opened.read(16)
    except OSError as error:
        raise InputError(
            f"{file} cannot be written ({error.strerror or error}): give another --db"
        ) from error
    if head not in (b"", b"SQLite format 3\x00"):
        raise InputError(f"{file} is no SQLite database: give another --db")


def _write_ahead(store: Store) -> None:
    with store._told(), store.engine.connect() as bare:
        raw: Any = bare.connection.driver_connection
        mode = raw.execute("PRAGMA journal_mode=WAL").fetchone()[0]
    if mode != "wal":
        raise InputError(f"{store.name} lies where SQLite cannot write ahead: give another --db")


def _tables(store: Store, file: Path | None, make: bool) -> None:
    with store.write() as connection:
        store.one_at_a_time(connection)
        found = migrate.version(connection)
        if found is None:
            if not make:
                raise InputError(f"{store.name} holds no study: give another --db")
            tables.metadata.create_all(connection)
            write_note(connection, "version", str(tables.VERSION))
            return
    migrate.check(found, store.name)
    if found == tables.VERSION:
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
            f"{name} belongs to the study {there!r}, not to {study.name!r}: give another --db"
        )
    if print_ == study.fingerprint():
        return
    begun = connection.scalar(
        select(func.count())
        .select_from(tables.participants)
        .where(tables.participants.c.preview.is_(False))
    )
    if print_ is not None and begun:
        raise InputError(
            f"{name} holds {begun} participants of {study.name!r} as it was before its questions, "
            "sets or consent were changed: give another --db for the changed study"
        )
    if print_ is not None:
        _forget_previews(connection)
    write_note(connection, "study", study.name)
    write_note(connection, "fingerprint", study.fingerprint())


def _forget_previews(connection: Connection) -> None:
    """Previews of the study as it was are answers to questions that nobody asks any more."""
    people = tables.participants
    previews = select(people.c.participant).where(people.c.preview)
    for table in (tables.answers, tables.pages, tables.external, people):
        connection.execute(delete(table).where(table.c.participant.in_(previews)))
