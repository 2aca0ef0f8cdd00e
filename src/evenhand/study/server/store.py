"""Where answers are kept: one database, one study."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from sqlalchemy import Connection, Engine, delete, insert, select, text
from sqlalchemy.exc import DataError, DBAPIError, IntegrityError, ProgrammingError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from evenhand.study.design import orders
from evenhand.study.design.protocol import Protocol
from evenhand.study.server import schema
from evenhand.study.server.refusal import StorageError

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
    return connection.scalar(select(schema.about.c.value).where(schema.about.c.key == key))


def write_note(connection: Connection, key: str, value: str) -> None:
    """Write one of the notes of ``tables.about``."""
    connection.execute(delete(schema.about).where(schema.about.c.key == key))
    connection.execute(insert(schema.about).values(key=key, value=value))
