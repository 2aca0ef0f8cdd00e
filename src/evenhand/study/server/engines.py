"""Engines of databases: SQLite that loses nothing, PostgreSQL, and one in memory."""

from typing import Any

from sqlalchemy import URL, Connection, Engine, StaticPool, create_engine, event, make_url
from sqlalchemy.exc import ArgumentError, NoSuchModuleError

from evenhand.core import extras
from evenhand.core.errors import InputError

MEMORY = "sqlite://"
"""A database that is gone when the program ends."""
WAIT = 10.0
"""Seconds to wait for a database that somebody else has locked."""


def address(db: str) -> URL:
    """What ``--db`` means: a URL, or the name of an SQLite file.

    Raises:
        InputError: for a URL that is none, or of another kind of database.
    """
    if "://" not in db:
        return URL.create("sqlite", database=db)
    try:
        url = make_url(db)
    except (ArgumentError, ValueError):
        raise InputError(
            "format db",
            "--db is no address of a database: give the name of a file, or "
            "postgresql://user:password@host/name",
        ) from None
    if url.drivername in ("postgres", "postgresql", "postgresql+psycopg"):
        return url.set(drivername="postgresql+psycopg")
    if url.drivername == "sqlite":
        return url
    raise InputError(
        "unknown db",
        f"--db names a database of kind {url.drivername!r}: give the name of an SQLite file, or "
        "postgresql://user:password@host/name",
    )


def shown(url: URL) -> str:
    """The address without its password."""
    if url.get_backend_name() == "sqlite":
        return url.database or "memory"
    return url.set(drivername="postgresql").render_as_string(hide_password=True)


def engine(url: URL, wait: float = WAIT, connections: int = 8) -> Engine:
    """An engine whose errors never hold what participants wrote.

    SQLite writes ahead (WAL) and waits for the disk at each commit (synchronous=FULL), so that what
    was acknowledged survives a killed process and a power cut; what is deleted is overwritten.

    Args:
        url: by ``address``.
        wait: seconds to wait for a lock.
        connections: at once, PostgreSQL.
    """
    common: dict[str, Any] = {"hide_parameters": True}
    if url.get_backend_name() == "sqlite":
        if not url.database or url.database == ":memory:":
            made = create_engine(
                "sqlite://",
                poolclass=StaticPool,
                connect_args={"check_same_thread": False},
                **common,
            )
        else:
            made = create_engine(url, connect_args={"timeout": wait}, **common)
        event.listen(made, "connect", _prepare)
        event.listen(made, "begin", _begin)
        return made
    try:
        return create_engine(
            url,
            pool_size=connections,
            max_overflow=0,
            pool_pre_ping=True,
            connect_args={"connect_timeout": 10, "options": f"-c lock_timeout={int(wait * 1000)}"},
            **common,
        )
    except (ImportError, NoSuchModuleError):
        raise InputError(
            "unavailable postgresql",
            f"PostgreSQL needs its driver: {extras.install('study', 'postgres')}",
        ) from None


def _prepare(connection: Any, _: Any) -> None:
    connection.isolation_level = None
    for line in ("synchronous=FULL", "foreign_keys=ON", "secure_delete=ON"):
        connection.execute(f"PRAGMA {line}")


def _begin(connection: Connection) -> None:
    # one that will write takes the lock at once: later, two of them could lock each other out
    reads = connection.get_execution_options().get("reads")
    connection.exec_driver_sql("BEGIN" if reads else "BEGIN IMMEDIATE")
