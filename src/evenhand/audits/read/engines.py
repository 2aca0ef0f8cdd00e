"""Tables of DuckDB, PostgreSQL and Spark, asked in SQL.

Expressions are text. SQL that the three engines spell alike is written where it is needed; what
they spell differently is a field of ``Dialect``. Names of columns are always quoted, text literals
are our own and hold no quote and no backslash, and no cell of a log becomes part of a query.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import pyarrow as pa

Family = Literal["boolean", "whole", "float", "text", "moment", "nested", "other"]


@dataclass(frozen=True)
class Kind:
    """Type of a column.

    Attributes:
        name: as its engine calls it.
        family: what it can be read as. ``whole`` has exact decimals too; ``nested`` holds several
            values, bytes or an interval; ``other`` is a plain value of another kind.
    """

    name: str
    family: Family

    @property
    def numeric(self) -> bool:
        """Whether it holds numbers."""
        return self.family in ("whole", "float")


@dataclass(frozen=True)
class Dialect:
    """How an engine spells what SQL leaves open; templates of ``str.format``.

    Attributes:
        mark: stands around a name.
        double: the type of 64-bit floats.
        trim: {0} is text; without blanks around it.
        matches: {0} is text, {1} a regular expression; whether it is found.
        part: the same; what the group of the expression found, or ''.
        number: {0} is text that is written as a number; the number.
        micros: {0} is a moment; microseconds since 1970, and what has no zone is in UTC.
        text_micros: the same of text as 2026-03-14 15:09:26.
        distinct: {0} is a value; about how many there are.
        quantile: {0} is a value, {1} a share; about the value below which so great a share lies.
    """

    mark: str
    double: str
    trim: str
    matches: str
    part: str
    number: str
    micros: str
    text_micros: str
    distinct: str
    quantile: str


_BLANKS = "' \t\n\r\v\f'"
_DUCKDB = Dialect(
    mark='"',
    double="double",
    trim=f"trim({{0}}, {_BLANKS})",
    matches="regexp_matches({0}, '{1}')",
    part="regexp_extract({0}, '{1}', 1)",
    number="try_cast({0} as double)",
    micros="epoch_us({0})",
    text_micros="epoch_us(try_cast({0} as timestamp))",
    distinct="approx_count_distinct({0})",
    quantile="approx_quantile({0}, {1})",
)
_POSTGRES = Dialect(
    mark='"',
    double="double precision",
    trim=f"btrim({{0}}, {_BLANKS})",
    matches="({0} ~ '{1}')",
    part="coalesce(substring({0} from '{1}'), '')",
    number="cast({0} as double precision)",
    micros="cast(extract(epoch from {0}) * 1000000 as bigint)",
    text_micros="cast(extract(epoch from cast({0} as timestamp)) * 1000000 as bigint)",
    distinct="count(distinct {0})",
    quantile="percentile_cont({1}) within group (order by {0})",
)
_SPARK = Dialect(
    mark="`",
    double="double",
    trim=f"btrim({{0}}, {_BLANKS})",
    matches="regexp_like({0}, '{1}')",
    part="regexp_extract({0}, '{1}', 1)",
    number="try_cast({0} as double)",
    micros="unix_micros(cast({0} as timestamp))",
    text_micros="unix_micros(cast({0} as timestamp))",
    distinct="approx_count_distinct({0})",
    quantile="percentile_approx({0}, {1})",
)


def number(value: float) -> str:
    """A float64 literal: with an exponent no engine takes it for a decimal, 17 digits are exact."""
    return f"({value:.16e})"


@dataclass(frozen=True)
class Engine:
    """A connection.

    Attributes:
        name: of the engine.
        dialect: how it spells.
        con: of the engine's own library.
        fetch: from a query to its rows.
        kinds: from what stands behind FROM to the types of its columns.
        tables: names of the tables that need no schema before them.
        close: leave; nothing can be fetched afterwards.
    """

    name: str
    dialect: Dialect
    con: Any
    fetch: Callable[[str], pa.Table]
    kinds: Callable[[str], dict[str, Kind]]
    tables: Callable[[], list[str]]
    close: Callable[[], None]

    def quote(self, name: str) -> str:
        """A name of a column or table."""
        mark = self.dialect.mark
        return mark + name.replace(mark, 2 * mark) + mark

    def table(self, *names: str) -> Table:
        """A table by its name, with a schema before it if need be."""
        return self.read(".".join(map(self.quote, names)))

    def read(self, source: str) -> Table:
        """What stands behind FROM, as a table."""
        return Table(self, source, self.kinds(source))


@dataclass(frozen=True)
class Table:
    """Rows of an engine.

    Attributes:
        engine: that has them.
        source: what stands behind FROM.
        kinds: types by column, in order.
    """

    engine: Engine
    source: str
    kinds: dict[str, Kind]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.kinds)

    def __getitem__(self, column: str) -> str:
        """The column in an expression."""
        return self.engine.quote(column)

    def query(self, columns: Mapping[str, str], rest: str = "") -> str:
        """SELECT of expressions by name; the rest follows FROM and the table."""
        chosen = ", ".join(f"{sql} as {self.engine.quote(name)}" for name, sql in columns.items())
        return f"select {chosen} from {self.source} {rest}".rstrip()

    def having(self, columns: Mapping[str, tuple[str, Kind]]) -> Table:
        """The table with other or further columns, each an expression and its type."""
        every = {name: self[name] for name in self.columns}
        every |= {name: sql for name, (sql, _) in columns.items()}
        kinds = self.kinds | {name: kind for name, (_, kind) in columns.items()}
        return replace(self, source=f"({self.query(every)}) as t", kinds=kinds)

    def rows(self, rest: str) -> Table:
        """Some of its rows: which, says what follows FROM and the table."""
        return replace(self, source=f"(select * from {self.source} {rest}) as t")


_TABLES = (
    "select cast(table_name as varchar) from information_schema.tables "
    "where table_schema = current_schema()"
)


# --- DuckDB ---

_DUCKDB_FAMILIES: dict[str, Family] = {
    "boolean": "boolean",
    **dict.fromkeys(("float", "double"), "float"),
    **dict.fromkeys(("integer", "uinteger", "decimal", "bignum"), "whole"),
    **dict.fromkeys(("varchar", "enum"), "text"),
    **dict.fromkeys(("date", "timestamp", "timestamp with time zone"), "moment"),
    **dict.fromkeys(("timestamp_s", "timestamp_ms", "timestamp_ns"), "moment"),
    **dict.fromkeys(("list", "array", "struct", "map", "union", "variant"), "nested"),
    **dict.fromkeys(("blob", "bit", "interval"), "nested"),
}


def duckdb_engine(con: Any) -> Engine:
    """The embedded engine, by a connection of DuckDB."""
    fetch, kinds = partial(_duckdb_fetch, con), partial(_duckdb_kinds, con)

    def tables() -> list[str]:
        return [name for (name,) in con.execute(_TABLES).fetchall()]

    return Engine("duckdb", _DUCKDB, con, fetch, kinds, tables, con.close)


def _duckdb_fetch(con: Any, query: str) -> pa.Table:
    found = con.sql(query).to_arrow_table()
    for i, column in enumerate(found.schema):
        if pa.types.is_dictionary(column.type):
            found = found.set_column(i, column.name, found[i].cast(column.type.value_type))
        elif pa.types.is_timestamp(column.type) and column.type.unit == "ns":
            # Python has no nanoseconds
            coarse = found[i].cast(pa.timestamp("us", column.type.tz), safe=False)
            found = found.set_column(i, column.name, coarse)
    return found


def _duckdb_kinds(con: Any, source: str) -> dict[str, Kind]:
    empty = con.sql(f"select * from {source} limit 0")
    kinds = zip(empty.columns, empty.types, strict=True)
    return {name: Kind(str(kind).strip('"').lower(), _of_duckdb(kind.id)) for name, kind in kinds}


def _of_duckdb(kind: str) -> Family:
    return "whole" if kind.endswith("int") else _DUCKDB_FAMILIES.get(kind, "other")


# --- PostgreSQL ---

_POSTGRES_FAMILIES: dict[str, Family] = {
    "bool": "boolean",
    **dict.fromkeys(("float4", "float8"), "float"),
    **dict.fromkeys(("int2", "int4", "int8", "oid", "numeric"), "whole"),
    **dict.fromkeys(("text", "varchar", "bpchar", "name", "unknown"), "text"),
    **dict.fromkeys(("date", "timestamp", "timestamptz"), "moment"),
    **dict.fromkeys(("bytea", "interval", "json", "jsonb", "record"), "nested"),
}
_ARROW = {"boolean": pa.bool_(), "float": pa.float64(), "text": pa.string(), "other": pa.string()}


def postgres_engine(url: str) -> Engine:
    """A PostgreSQL server, from which it is only read.

    Args:
        url: as libpq takes it.
    """
    import psycopg

    con: Any = psycopg.connect(url, autocommit=True)
    for setting in ("default_transaction_read_only = on", "timezone = 'UTC'"):
        con.execute(f"set {setting}")
    fetch, kinds = partial(_postgres_fetch, con), partial(_postgres_kinds, con)

    def tables() -> list[str]:
        return [name for (name,) in con.execute(_TABLES).fetchall()]

    return Engine("postgres", _POSTGRES, con, fetch, kinds, tables, con.close)


def _postgres_fetch(con: Any, query: str) -> pa.Table:
    with con.execute(query) as cursor:
        kinds = _described(cursor)
        rows = cursor.fetchall()
    columns = zip(*rows, strict=True) if rows else [()] * len(kinds)
    every = zip(kinds.items(), columns, strict=True)
    return pa.table({name: _arrow(cells, kind) for (name, kind), cells in every})


def _postgres_kinds(con: Any, source: str) -> dict[str, Kind]:
    with con.execute(f"select * from {source} limit 0") as cursor:
        return _described(cursor)


def _described(cursor: Any) -> dict[str, Kind]:
    shown = {one.name: one.type_display for one in cursor.description}
    return {name: Kind(kind, _of_postgres(kind)) for name, kind in shown.items()}


def _of_postgres(kind: str) -> Family:
    return "nested" if kind.endswith("]") else _POSTGRES_FAMILIES.get(kind.split("(")[0], "other")


def _arrow(cells: tuple[Any, ...], kind: Kind) -> pa.Array:
    """Cells of a column; what Arrow has no type for becomes text."""
    wanted = _ARROW.get(kind.family)
    if kind.family != "other":
        try:
            return pa.array(cells, wanted)
        except pa.ArrowException:  # a NaN among decimals
            wanted = pa.string()
    # nothing but NaN is unlike itself
    return pa.array([None if one is None or one != one else str(one) for one in cells], wanted)


# --- Spark ---

_ZONE = "spark.sql.session.timeZone"
_SPARK_FAMILIES: dict[str, Family] = {
    "boolean": "boolean",
    **dict.fromkeys(("float", "double"), "float"),
    **dict.fromkeys(("tinyint", "smallint", "int", "bigint", "decimal"), "whole"),
    **dict.fromkeys(("string", "varchar", "char"), "text"),
    **dict.fromkeys(("timestamp", "timestamp_ntz", "date"), "moment"),
    **dict.fromkeys(("array", "map", "struct", "binary", "variant", "interval"), "nested"),
}


def spark_engine(options: Iterable[tuple[str, str]] = ()) -> Engine:
    """The Spark session of this process, or a new one.

    Args:
        options: settings of the session.
    """
    from pyspark.sql import SparkSession

    builder: Any = SparkSession.builder
    for name, value in options:
        builder = builder.config(name, value)
    session: Any = builder.getOrCreate()
    zone = session.conf.get(_ZONE)
    session.conf.set(_ZONE, "UTC")

    def fetch(query: str) -> pa.Table:
        return session.sql(query).toArrow()

    def kinds(source: str) -> dict[str, Kind]:
        fields = session.sql(f"select * from {source} limit 0").schema
        shown = {field.name: field.dataType.simpleString() for field in fields}
        return {name: Kind(kind, _of_spark(kind)) for name, kind in shown.items()}

    def tables() -> list[str]:
        return [one.name for one in session.catalog.listTables()]

    def close() -> None:
        # the session may be in use elsewhere and stays
        session.conf.set(_ZONE, zone)

    return Engine("pyspark", _SPARK, session, fetch, kinds, tables, close)


def _of_spark(kind: str) -> Family:
    # as decimal(10,2), array<string>, interval day to second
    return _SPARK_FAMILIES.get(kind.split("(")[0].split("<")[0].split(" ")[0], "other")
