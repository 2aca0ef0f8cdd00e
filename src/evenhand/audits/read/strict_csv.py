"""Strict reading of text files: what is not plainly a table is refused, with file and row.

A reader that guesses what a broken row means gives counts that nobody can repeat. CSV and TSV are
held to RFC 4180, scanned once as bytes, in pieces, before the engine reads them. Rows are numbered
as in a spreadsheet: the header is row 1.
"""

from __future__ import annotations

import codecs
import csv
import hashlib
import os
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from evenhand.core.errors import InputError

PIECE = 4_000_000
"""Bytes looked at together."""

LONGEST = 1_000_000
"""Bytes that a row may have; a quote that is never closed swallows the rows after it."""

MARKS = (",", ";", "\t", "|")
"""What can stand between two cells of a CSV file."""

WITHIN = "a quote stands within a cell: quote the whole cell and double the quote"
"""What is said of a quote that neither opens nor closes a cell."""

OPEN = "a quote is never closed: was the file cut off?"
"""What is said of a quote that is open at the end."""

_ALONE = "a carriage return stands alone: save with line feeds"
_BOM = b"\xef\xbb\xbf"
_LF, _CR, _QUOTE = 10, 13, 34
_AGAIN = "the header stands there again: delete that row"


@dataclass(frozen=True)
class Delimited:
    """A file that is a table.

    Attributes:
        path: the file.
        names: of the columns, in order, none of them twice.
        mark: what stands between two cells.
        rows: services, without the header.
        size: bytes.
        sha256: of the file as it was checked.
    """

    path: Path
    names: tuple[str, ...]
    mark: str
    rows: int
    size: int
    sha256: str


@dataclass
class _Scan:
    """Where a scan stands between two pieces."""

    path: Path
    mark: int
    cells: int
    header: bytes
    rows: int = 0
    marks: int = 0
    length: int = 0
    quoted: bool = False
    before: int = _LF
    windows: bool | None = None
    blank: int = 0
    tail: bytes = b""
    decoder: codecs.IncrementalDecoder = field(
        default_factory=lambda: codecs.getincrementaldecoder("utf-8")("strict")
    )

    def fail(self, row: int, what: str) -> InputError:
        return InputError("format file", f"{self.path}, row {row}: {what}")


def check_delimited(path: str | os.PathLike[str]) -> Delimited:
    """Check that a CSV or TSV file is a table in UTF-8.

    Raises:
        InputError: for the first thing that is wrong, with its row: a wrong encoding, a quote that
            is never closed, a row with too few or too many cells, the header again, mixed line
            ends, a column named twice, no rows.
    """
    path = Path(path)
    digest = hashlib.sha256()
    size = 0
    try:
        with path.open("rb") as file:
            piece = file.read(PIECE)
            header, names, mark = _header(path, piece)
            scan = _Scan(path, ord(mark), len(names), header)
            while piece:
                digest.update(piece)
                start = len(_BOM) if not size and piece.startswith(_BOM) else 0
                size += len(piece)
                _look(scan, piece[start:])
                piece = file.read(PIECE)
    except OSError as error:
        raise InputError(
            "unavailable file", f"{path} cannot be read: {error.strerror or error}"
        ) from error
    _end(scan)
    return Delimited(path, names, mark, scan.rows - 1, size, digest.hexdigest())


def check_names(path: object, names: tuple[str, ...]) -> None:
    """Engines tell columns apart by their names without regard to case; so must a log.

    Raises:
        InputError: when a column is named twice, or only case tells two apart.
    """
    for name, n in Counter(names).items():
        if n > 1:
            raise InputError(
                f"duplicate {name}",
                f"{path}: column {name!r} stands there {n} times: rename or drop one",
            )
    seen: dict[str, str] = {}
    for name in names:
        other = seen.setdefault(name.lower(), name)
        if other != name:
            raise InputError(
                f"duplicate {name}",
                f"{path}: only capitals tell the columns {other!r} and {name!r} apart: rename one",
            )


def between(path: Path, header: str) -> tuple[str, str]:
    """What parts the cells of a file, and what of its header stands outside of quotes."""
    outside = "".join(header.split('"')[::2])
    return "\t" if path.suffix.lower() == ".tsv" else max(MARKS, key=outside.count), outside


def _header(path: Path, piece: bytes) -> tuple[bytes, tuple[str, ...], str]:
    """The header as bytes, the names of its columns, and what parts its cells."""
    if not piece.strip():
        raise InputError(
            "empty file", f"{path} is empty: give a file with a header and at least one row"
        )
    if piece[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in piece[:4]:
        raise InputError("format file", f"{path} is UTF-16 or no text: save it as CSV in UTF-8")
    line = piece.removeprefix(_BOM)
    end, quoted = 0, False
    while end < len(line) and (quoted or line[end] != _LF):
        quoted ^= line[end] == _QUOTE
        end += 1
    line = line[:end].removesuffix(b"\r")
    try:
        text = line.decode()
        if "\r" in text:
            raise InputError("format file", f"{path}, row 1: {_ALONE}")
        mark, outside = between(path, text)
        if mark not in outside:
            raise InputError(
                "format file",
                f"{path}, row 1: the header has one column only: part the columns by commas, and "
                "give a column of identities and one of responses",
            )
        (names,) = csv.reader([text], delimiter=mark, strict=True)
    except UnicodeDecodeError as error:
        raise _not_utf8(path, 1, line[error.start]) from error
    except (csv.Error, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            "format file", f"{path}, row 1: the header cannot be read: {error}"
        ) from error
    named = tuple(name.strip() or f"column {i}" for i, name in enumerate(names, 1))
    # an engine that skips the header may take its lines for rows
    if b"\n" in line or b"\r" in line:
        raise InputError(
            "format file", f"{path}, row 1: the header has a line break in it: rename the column"
        )
    check_names(path, named)
    return line, named, mark


def _not_utf8(path: Path, row: int, byte: int) -> InputError:
    return InputError(
        "format file", f"{path}, row {row}: byte 0x{byte:02x} is no UTF-8: save the file as UTF-8"
    )


def _look(scan: _Scan, piece: bytes) -> None:
    """Check a piece and carry on what the next one needs."""
    a = np.frombuffer(piece, np.uint8)
    if not len(a):
        return
    before = np.concatenate([[scan.before], a[:-1]]).astype(np.uint8)
    quote = a == _QUOTE
    if scan.quoted or quote.any():
        inside = (np.cumsum(quote) + scan.quoted) % 2 == 1
    else:
        inside = np.zeros(len(a), bool)
    ends = np.flatnonzero((a == _LF) & ~inside)

    def row_of(at: int) -> int:
        return scan.rows + 1 + int(np.searchsorted(ends, at))

    try:
        scan.decoder.decode(piece)
    except UnicodeDecodeError as error:
        # bytes held back from the piece before shift the position a little
        at = max(0, min(error.start, len(piece) - 1))
        raise _not_utf8(scan.path, row_of(at), error.object[error.start]) from error
    zero = piece.find(0)
    if zero >= 0:
        raise scan.fail(row_of(zero), "a zero byte stands there: the file is damaged or no text")
    if quote.any() or scan.before == _QUOTE:
        _check_quotes(scan, a, before, quote, inside, row_of)
    _check_ends(scan, a, before, inside, ends, row_of)
    _check_rows(scan, a, inside, ends)
    scan.quoted = bool(inside[-1])
    scan.before = int(a[-1])
    _check_header_again(scan, piece, ends)
    scan.rows += len(ends)


def _check_quotes(
    scan: _Scan,
    a: np.ndarray,
    before: np.ndarray,
    quote: np.ndarray,
    inside: np.ndarray,
    row_of: Callable[[int], int],
) -> None:
    """A quote opens a cell at its start, closes it at its end, and is doubled within."""
    starts = np.isin(before, (scan.mark, _LF, _QUOTE))
    wrong = quote & inside & ~starts
    closed = np.concatenate([[scan.before == _QUOTE and not scan.quoted], (quote & ~inside)[:-1]])
    wrong |= closed & ~np.isin(a, (scan.mark, _LF, _CR, _QUOTE))
    if wrong.any():
        raise scan.fail(
            row_of(int(np.argmax(wrong))),
            WITHIN,
        )


def _check_ends(
    scan: _Scan,
    a: np.ndarray,
    before: np.ndarray,
    inside: np.ndarray,
    ends: np.ndarray,
    row_of: Callable[[int], int],
) -> None:
    """All lines end alike: engines read a file of mixed ends each in its own way."""
    # a return right before the piece belongs to it: only now is it known what follows
    alone = (before == _CR) & (a != _LF) & ~np.concatenate([[scan.quoted], inside[:-1]])
    if alone.any():
        raise scan.fail(row_of(int(np.argmax(alone))), _ALONE)
    windows = before[ends] == _CR
    if len(ends):
        first = bool(windows[0]) if scan.windows is None else scan.windows
        if (windows != first).any():
            row = scan.rows + 1 + int(np.argmax(windows != first))
            raise scan.fail(row, "its line ends unlike those before: save the file anew")
        scan.windows = first


def _check_rows(scan: _Scan, a: np.ndarray, inside: np.ndarray, ends: np.ndarray) -> None:
    """As many cells in every row as in the header; empty lines at the end only."""
    marks = np.flatnonzero((a == scan.mark) & ~inside)
    upto = np.searchsorted(marks, ends)
    found = np.diff(upto, prepend=0)
    lengths = np.diff(ends, prepend=-1) - 1
    if len(ends):
        found[0] += scan.marks
        lengths[0] += scan.length
        lengths -= bool(scan.windows)
    blank = lengths <= 0
    for i in np.flatnonzero(blank | (found != scan.cells - 1) | (lengths > LONGEST)):
        row = scan.rows + 1 + int(i)
        if blank[i]:
            scan.blank = scan.blank or row
        else:
            _check_blank(scan)
            _check_row(scan, row, int(found[i]), int(lengths[i]))
    full = np.flatnonzero(~blank)
    if scan.blank and len(full) and scan.rows + 1 + int(full[-1]) > scan.blank:
        _check_blank(scan)
    last = int(ends[-1]) + 1 if len(ends) else 0
    scan.marks = len(marks) - int(upto[-1]) if len(ends) else scan.marks + len(marks)
    scan.length = len(a) - last + (0 if len(ends) else scan.length)
    if scan.length > LONGEST:
        raise scan.fail(
            scan.rows + len(ends) + 1, f"it is longer than {LONGEST} bytes: is a quote missing?"
        )


def _check_blank(scan: _Scan) -> None:
    if scan.blank:
        raise scan.fail(scan.blank, "it is empty and rows follow: delete it")


def _check_row(scan: _Scan, row: int, marks: int, length: int) -> None:
    if length > LONGEST:
        raise scan.fail(row, f"it is longer than {LONGEST} bytes: is a quote missing?")
    if marks != scan.cells - 1:
        raise scan.fail(
            row, f"it has {marks + 1} cells and the header {scan.cells}: mend or drop the row"
        )


def _check_header_again(scan: _Scan, piece: bytes, ends: np.ndarray) -> None:
    """Files put together one after the other keep their headers."""
    text = scan.tail + piece
    at = -1
    while (at := text.find(b"\n" + scan.header, at + 1)) >= 0:
        after = text[at + 1 + len(scan.header) :][:2]
        if after[:1] == b"\n" or after == b"\r\n":
            row = scan.rows + 1 + int(np.searchsorted(ends, at - len(scan.tail), side="right"))
            raise scan.fail(row, _AGAIN)
    scan.tail = text[-len(scan.header) - 2 :]


def _end(scan: _Scan) -> None:
    """What can be told only when the file has ended."""
    if scan.quoted:
        raise scan.fail(scan.rows + 1, OPEN)
    if scan.before == _CR:
        raise scan.fail(scan.rows + 1, _ALONE)
    try:
        scan.decoder.decode(b"", final=True)
    except UnicodeDecodeError as error:
        raise _not_utf8(scan.path, scan.rows + 1, error.object[0]) from error
    if scan.tail.endswith(b"\n" + scan.header):
        raise scan.fail(scan.rows + 1, _AGAIN)
    if scan.length:
        _check_blank(scan)
        if scan.marks != scan.cells - 1:
            raise scan.fail(
                scan.rows + 1,
                f"the last row has {scan.marks + 1} cells and the header {scan.cells}: was the "
                "file cut off?",
            )
        scan.rows += 1
    elif scan.blank:
        scan.rows = scan.blank - 1
    if scan.rows < 2:
        raise InputError(
            "empty file", f"{scan.path} has a header and no rows: there is nothing to audit"
        )
