"""Databases by URL, whose passwords are never shown."""

from __future__ import annotations

import re
from typing import Any
from urllib.parse import unquote, urlsplit

import ibis
import ibis.expr.operations as ops
import pyarrow as pa
from ibis.expr import types as ir

from evenhand.audits.read.engines import one_line
from evenhand.core.errors import InputError, unknown

_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*://")
# What Ibis has to tell DuckDB of before a query: tables in memory and functions of the user.
_REGISTERED_FIRST = (ops.InMemoryTable, ops.ScalarUDF, ops.AggUDF)

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


def open_table(url: str, table: str | None) -> tuple[ir.Table, str, dict[str, Any], str]:
    """A table of a database.

    Args:
        url: as postgres://user:password@host:port/name, of any engine that Ibis knows.
        table: its name, with a schema before a point if need be; optional where there is one only.

    Returns:
        The table, its name as shown, a description, and what must be hidden in later messages.

    Raises:
        InputError: when the database cannot be reached or has no such table; the password is never
            in the sentence.
    """
    name = shown(url)
    con: Any = None
    try:
        con = ibis.connect(url)
        tables = [] if table and "." in table else tables_of(con)
    except ImportError as error:
        scheme = name.partition("://")[0]
        wanted = f"ibis-framework[{scheme}]"
        if scheme in EXTRAS:
            wanted = f"evenhand[{EXTRAS[scheme]}]"
        raise InputError(
            f"{name} needs the package {error.name or 'of its engine'}: pip install {wanted!r}"
        ) from None
    # what an engine raises is its own: the address is the input here
    except Exception as error:
        leave(con)
        raise InputError(
            f"{name} cannot be reached ({hide(one_line(error), url)}): check the address, the "
            "password and that the database runs"
        ) from None
    try:
        if table and "." in table:
            schema, _, one = table.rpartition(".")
            log = con.table(one, database=schema)
        else:
            table = choose(name, tables, table)
            log = con.table(table)
    except InputError:
        leave(con)
        raise
    except Exception as error:
        leave(con)
        raise InputError(
            f"{name} has no table {table!r} to read: {hide(one_line(error), url)}"
        ) from None
    return log, f"{name}, table {table}", {"kind": con.name, "table": table, "url": name}, url


def tables_of(con: Any) -> list[str]:
    """Names of the tables of a connection."""
    if con.name != "duckdb":
        return con.list_tables()
    # Ibis asks DuckDB for its tables by a function that DuckDB 2 no longer has
    rows = con.con.execute(
        "select table_name from information_schema.tables where table_schema = current_schema()"
    ).fetchall()
    return [name for (name,) in rows]


def choose(place: str, tables: list[str], table: str | None) -> str:
    """The named table, or the only one.

    Raises:
        InputError: when there is no such table, or several and none is named.
    """
    if table is None:
        if len(tables) == 1:
            return tables[0]
        if not tables:
            raise InputError(f"{place} has no tables: there is nothing to audit")
        some = ", ".join(sorted(tables)[:10])
        raise InputError(f"{place} has several tables ({some}): name one")
    if table not in tables:
        raise unknown(f"table of {place}", table, sorted(tables)[:50])
    return table


def run(expression: ir.Table) -> pa.Table:
    """An expression's rows, from the engine that it belongs to."""
    try:
        con: Any = expression.get_backend()
    except ibis.common.exceptions.IbisError:  # it lies in memory only
        return expression.to_pyarrow()
    if con.name == "duckdb" and not expression.op().find(_REGISTERED_FIRST):
        # the rows of to_pyarrow, which loads pandas: half a second
        rows = con.con.sql(con.compile(expression)).to_arrow_table()
    elif con.name == "pyspark":
        # Ibis goes by way of pandas, which knows neither missing whole numbers nor old moments
        rows = con.raw_sql(con.compile(expression)).toArrow()
    else:
        return expression.to_pyarrow()
    return rows.cast(expression.schema().to_pyarrow())


def leave(con: Any) -> None:
    """Close a connection; a Spark session may be in use elsewhere and stays."""
    if con is not None and con.name != "pyspark":
        con.disconnect()


def complains(error: Exception) -> bool:
    """Whether an engine other than the embedded one says that it cannot read a log."""
    return type(error).__module__.partition(".")[0] in ("psycopg", "py4j", "pyspark")
