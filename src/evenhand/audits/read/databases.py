"""Databases by URL, whose passwords are never shown."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, unquote, urlsplit

from evenhand.audits.read.engines import Engine, Table, postgres_engine, spark_engine
from evenhand.audits.read.readers import embedded, one_line
from evenhand.core import extras
from evenhand.core.errors import InputError, unknown

_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*://")

EXTRAS = {"postgres": "postgres", "postgresql": "postgres", "pyspark": "spark"}
"""Schemes of URLs, and the extra of Evenhand that brings their engine."""


def is_url(text: str) -> bool:
    """Whether this is the address of a database rather than a path."""
    return _URL.match(text) is not None


def shown(url: str) -> str:
    """A URL without password, options and fragment, which may hold secrets as well."""
    try:
        parts = urlsplit(url)
        user = (parts.username or "") + "@" if parts.username else ""
        place = parts.netloc.rpartition("@")[2]
    except ValueError:
        return url.partition("://")[0] + "://..."
    # with a slash too many, user and password are taken for a path
    before, mark, path = parts.path.rpartition("@")
    return f"{parts.scheme}://{user}{place}{before and '...'}{mark}{path}"


def hide(text: str, url: str) -> str:
    """A message of an engine without anything secret of the URL in it."""
    try:
        parts = urlsplit(url)
        password = parts.password or ""
    except ValueError:
        return "the URL cannot be read"
    secrets = {url, password, unquote(password), parts.query, unquote(parts.query)}
    secrets |= {value.partition("=")[2] for value in parts.query.split("&")}
    secrets.add(parts.path.rpartition("@")[0].strip("/"))
    found = [secret for secret in secrets if secret and secret in text]
    return "the engine's message names the password and is not shown" if found else text


def open_table(url: str, table: str | None) -> tuple[Table, str, dict[str, Any], str]:
    """A table of a database.

    Args:
        url: as postgres://user:password@host:port/name, pyspark:// or duckdb:///path.
        table: its name, with a schema before a point if need be; optional where there is one only.

    Returns:
        The table, its name as shown, a description, and what must be hidden in later messages.

    Raises:
        InputError: when the database cannot be reached or has no such table; the password is never
            in the sentence.
    """
    name = shown(url)
    scheme = name.partition("://")[0].lower()
    if scheme not in ENGINES:
        raise unknown("kind of database", scheme, ENGINES, "database")
    if scheme in EXTRAS:
        extras.require(EXTRAS[scheme], name)
    engine: Engine | None = None
    try:
        engine = ENGINES[scheme](url)
        tables = [] if table and "." in table else engine.tables()
    # what an engine raises is its own: the address is the input here
    except Exception as error:
        if engine is not None:
            engine.close()
        raise InputError(
            "unavailable database",
            f"{name} cannot be reached ({hide(one_line(error), url)}): check the address, the "
            "password and that the database runs",
        ) from None
    try:
        if table is None or "." not in table:
            table = choose(name, tables, table)
            log = engine.table(table)
        else:
            log = engine.table(*table.rsplit(".", 1))
    except InputError:
        engine.close()
        raise
    except Exception as error:
        engine.close()
        raise InputError(
            "missing table",
            f"{name} has no table {table!r} to read: {hide(one_line(error), url)}",
        ) from None
    return log, f"{name}, table {table}", {"kind": engine.name, "table": table, "url": name}, url


def _duckdb(url: str) -> Engine:
    parts = urlsplit(url)
    options = dict(parse_qsl(parts.query))
    return embedded(unquote(parts.netloc + parts.path), read_only=True, **options)


def _spark(url: str) -> Engine:
    parts = urlsplit(url)
    path = unquote(parts.path.removeprefix("/"))
    warehouse = [("spark.sql.warehouse.dir", str(Path(path).absolute()))] if path else []
    return spark_engine([*warehouse, *parse_qsl(parts.query)])


ENGINES: dict[str, Callable[[str], Engine]] = {
    "postgres": postgres_engine,
    "postgresql": postgres_engine,
    "pyspark": _spark,
    "duckdb": _duckdb,
}
"""What opens the database of a URL, by its scheme."""


def choose(place: str, tables: list[str], table: str | None) -> str:
    """The named table, or the only one.

    Raises:
        InputError: when there is no such table, or several and none is named.
    """
    if table is None:
        if len(tables) == 1:
            return tables[0]
        if not tables:
            raise InputError("empty database", f"{place} has no tables: there is nothing to audit")
        some = ", ".join(sorted(tables)[:10])
        raise InputError("missing table", f"{place} has several tables ({some}): name one")
    if table not in tables:
        raise unknown(f"table of {place}", table, sorted(tables)[:50])
    return table


def complains(error: Exception) -> bool:
    """Whether an engine other than the embedded one says that it cannot read a log."""
    return type(error).__module__.partition(".")[0] in ("psycopg", "py4j", "pyspark")
