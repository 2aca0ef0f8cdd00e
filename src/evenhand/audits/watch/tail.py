"""New rows of a growing log, a batch at a time: a text file that is appended to, or a table."""

from __future__ import annotations

import contextlib
import os
import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evenhand.audits.count.count import tally
from evenhand.audits.count.tally import Tally
from evenhand.audits.read.engines import Kind, Table
from evenhand.audits.read.mapping import Mapping
from evenhand.audits.read.readers import NOTHING
from evenhand.audits.read.sources import Source, open_source
from evenhand.audits.read.strict_csv import LONGEST, OPEN, WITHIN, between
from evenhand.core.errors import InputError, unknown

TEXT = (".csv", ".tsv", ".jsonl", ".ndjson")
"""Files that can be followed while they grow."""
FIRST = 10_000
"""Services by which the columns of a text file are known."""
MOST = 3_000
"""Batches that are counted together: enough to catch up fast, few enough to answer soon."""
_BATCH = "evenhand batch"


@dataclass
class TextTail:
    """Whole records of a text file, as far as it is written.

    Attributes:
        path: the file.
        once: read it once only: then a last record needs no line end.
        read: bytes taken from it.
        rows: found in it, header and empty ones included.
        head: the header of CSV and TSV, empty for JSON Lines.
        mark: what parts its cells.
        waiting: records that have not been handed out.
        rest: the beginning of a record that is not whole yet.
    """

    path: Path
    once: bool = False
    read: int = 0
    rows: int = 0
    head: bytes = b""
    mark: bytes = b""
    waiting: tuple[bytes, ...] = ()
    rest: bytes = b""

    def grow(self) -> None:
        """Read what has been written since.

        Raises:
            InputError: when the file went away or became shorter, or a quote stands within a cell
                or is never closed.
        """
        if self.once and self.read:
            return
        try:
            with self.path.open("rb") as file:
                size = os.fstat(file.fileno()).st_size
                if size < self.read:
                    raise InputError(
                        "changed file",
                        f"{self.path} became shorter while it was watched: it was cut off or "
                        "replaced, so begin a new watch",
                    )
                file.seek(self.read)
                new = file.read(size - self.read)
        except OSError as error:
            raise InputError(
                "unavailable file", f"{self.path} cannot be read: {error.strerror or error}"
            ) from error
        self.read += len(new)
        self.rest += new
        if self._quoted and not self.head:
            self._begin()
        if self.head or not self._quoted:
            try:
                found, self.rest = records(self.rest, self.mark, self.rows + 1)
            except InputError as error:
                raise InputError(error.args[0], f"{self.path}, {error}") from None
            self._take_in(found)
        if len(self.rest) > LONGEST:
            raise InputError(
                "format file",
                f"{self.path}, behind byte {self.read - len(self.rest)}: a record is longer than "
                f"{LONGEST} bytes: was a quote never closed?",
            )
        if self.once and self.mark and self.rest.count(b'"') % 2:
            raise InputError("format file", f"{self.path}, row {self.rows + 1}: {OPEN}")
        if self.once and (self.head or not self._quoted):
            self._take_in([self.rest])
            self.rest = b""

    def take(self, n: int) -> bytes:
        """The next n records as a file of their own, header included."""
        taken, self.waiting = self.waiting[:n], self.waiting[n:]
        return self.head + b"".join(taken)

    def _begin(self) -> None:
        end = self.rest.find(b"\n")
        while self.rest.count(b'"', 0, max(end, 0)) % 2:
            end = self.rest.find(b"\n", end + 1)
        if end >= 0:
            self.head, self.rest, self.rows = self.rest[: end + 1], self.rest[end + 1 :], 1
            self.mark = between(self.path, self.head.decode(errors="replace"))[0].encode()

    def _take_in(self, found: list[bytes]) -> None:
        self.rows += len(found)
        self.waiting += tuple(one for one in found if one.strip())

    @property
    def _quoted(self) -> bool:
        return self.path.suffix.lower() in TEXT[:2]


def records(content: bytes, mark: bytes = b"", row: int = 1) -> tuple[list[bytes], bytes]:
    """Cut text into records, each with its line end; and what is left behind the last.

    Args:
        content: from the beginning of a record on.
        mark: what parts two cells; a line end between quotation marks belongs to a cell (RFC
            4180). Without it, a line is a record.
        row: number of the first record.

    Raises:
        InputError: for a quote that opens a cell elsewhere than at its start, or closes it before
            its end: it would swallow the records after it.
    """
    found, first, inside = [], 0, False
    for at in re.finditer(rb'[\n"]' if mark else rb"\n", content):
        place = at.start()
        if at.group() == b'"':
            beside = (
                content[place + 1 : place + 2] if inside else content[max(first, place - 1) : place]
            )
            if beside not in (b"", mark, b'"', *((b"\n", b"\r") if inside else ())):
                raise InputError("format row", f"row {row + len(found)}: {WITHIN}")
            inside = not inside
        elif not inside:
            found.append(content[first : at.end()])
            first = at.end()
    return found, content[first:]


@dataclass
class Follower:
    """Hands out counts of whole batches, in the order of the log.

    Attributes:
        source: the log as it was when the watch began; its columns decide the mapping.
        mapping: what they stand for.
        batch: services in each.
        seen: services handed out.
        left: services behind them that do not make a batch.
        tail: of a text file; None for a table.
        order: column by which a table is in order of time; None for a file that does not grow.
        last: value of that column in the last service handed out.
    """

    source: Source
    mapping: Mapping
    batch: int
    seen: int = 0
    left: int = 0
    tail: TextTail | None = None
    order: str | None = None
    last: Any = None

    def next(self) -> Tally | None:
        """Counts of the next batches, each a stratum named by its number; None if none is full.

        Raises:
            InputError: when the log cannot be read, or holds what it should not.
        """
        if self.tail is not None:
            return self._from_text(self.tail)
        table = self.source.table
        there = int(self.source.fetch(table.query({"n": "count(*)"}))["n"][0].as_py())
        if there < self.seen:
            raise InputError(
                "changed log", f"{self.source.name} lost rows while it was watched: begin anew"
            )
        full = min((there - self.seen) // self.batch, MOST) * self.batch
        self.left = there - self.seen - full
        if not full:
            return None
        rows = table.rows(f"{self._ordered(table)} limit {full} offset {self.seen}")
        if self.order is not None:
            self._check_order(rows, self.order, full)
        return self._counted(replace(self.source, table=rows, parts=(), rows=full), full)

    def _ordered(self, table: Table) -> str:
        return "" if self.order is None else f"order by {table[self.order]}"

    def _check_order(self, rows: Table, order: str, n: int) -> None:
        """Rows alike in their order, or late ones, would be counted twice or never."""
        place = rows[order]
        asked = {"n": f"count(distinct {place})", "low": f"min({place})", "high": f"max({place})"}
        told = self.source.fetch(rows.query(asked)).to_pylist()[0]
        if told["n"] < n:
            raise InputError(
                f"missing {order}",
                f"{self.source.name}: column {order!r} is missing or the same in several rows: "
                "order by one that tells all rows apart",
            )
        if self.last is not None and not told["low"] > self.last:
            raise InputError(
                f"changed {order}",
                f"{self.source.name}: a row came late, before {order!r} {self.last}, which was "
                "watched already: order by a column that only grows, and begin anew",
            )
        self.last = told["high"]

    def _from_text(self, tail: TextTail) -> Tally | None:
        tail.grow()
        full = min(len(tail.waiting) // self.batch, MOST) * self.batch
        self.left = len(tail.waiting) - full
        if not full:
            return None
        try:
            with _apart(tail.path, tail.take(full)) as part:
                return self._counted(open_source(part), full)
        except InputError as error:
            raise InputError(
                error.args[0], f"{error} (rows are counted from the {self.seen + 1:,}. service on)"
            ) from None

    def _counted(self, log: Source, services: int) -> Tally:
        table = log.table
        columns = [column for _, column in self.mapping.roles()]
        if self.tail is not None and self.tail.path.suffix.lower() in TEXT[2:]:
            # keys of JSON Lines that no service of these has
            lacking = [column for column in columns if column not in table.columns]
            table = table.having(dict.fromkeys(lacking, NOTHING))
        place = f"row_number() over ({self._ordered(table)}) - 1"
        batch = f"cast(floor(({place}) / {self.batch}.0) as bigint)"
        log = replace(log, table=table.having({_BATCH: (batch, Kind("bigint", "whole"))}))
        counts, _ = tally(log, replace(self.mapping, within=(_BATCH,)), alone=True, waiting=False)
        self.seen += services
        return counts


def follower(
    source: str,
    table: str | None,
    order: str | None,
    batch: int,
    chosen: Callable[[Source], Mapping],
    once: bool = False,
) -> Follower:
    """Begin to follow a log.

    Args:
        source: a file, or the URL of a database.
        table: in a database, which.
        order: column by which a database is in order of time.
        batch: services that are counted together.
        chosen: from the log to what its columns stand for.
        once: a text file is read once, its last record with or without a line end.

    Raises:
        InputError: when the log cannot be read, or its order is not known.
    """
    path = Path(source)
    if path.suffix.lower() in TEXT and path.is_file() and table is None:
        return _text(path, batch, chosen, once)
    log = open_source(source, table)
    try:
        return _table(log, order, batch, chosen(log))
    except InputError:
        log.close()
        raise


def _text(path: Path, batch: int, chosen: Callable[[Source], Mapping], once: bool) -> Follower:
    """What the columns stand for is told by whole records: the last may be half written."""
    tail = TextTail(path, once)
    tail.grow()
    # without a whole line, what there is tells what is wrong with it
    with _apart(path, replace(tail).take(FIRST) or tail.rest) as part:
        log = replace(open_source(part), name=str(path))
        return Follower(log, _plain(chosen(log)), batch, tail=tail)


def _table(log: Source, order: str | None, batch: int, mapping: Mapping) -> Follower:
    if "url" in log.description or log.description["kind"] == "DuckDB":
        if order is None:
            raise InputError(
                "missing order_by",
                f"{log.name} has no order of its own: name the column of time with --order-by",
            )
        if order not in log.table.columns:
            raise unknown(f"column of {log.name}", order, log.table.columns)
    return Follower(log, _plain(mapping), batch, order=order)


def _plain(mapping: Mapping) -> Mapping:
    if mapping.within:
        raise InputError(
            "unsupported within", "a watch compares within each batch already: leave out --within"
        )
    return mapping


@contextlib.contextmanager
def _apart(path: Path, content: bytes) -> Iterator[Path]:
    """Some records in a file of their own; complaints name the file that they are from."""
    with tempfile.TemporaryDirectory(prefix="evenhand-") as folder:
        part = Path(folder) / f"new{path.suffix}"
        part.write_bytes(content)
        try:
            yield part
        except InputError as error:
            raise InputError(error.args[0], str(error).replace(str(part), str(path))) from None
