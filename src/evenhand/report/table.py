"""Room: columns and the small statistics of a report. Takes: arrays. Gives: arrays, text.

Pure. What figures and text share stands here once, so that a number is the same wherever it is
shown and a value that is not defined never turns into 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenhand.core import csv_file, files
from evenhand.core.wording import NOT_DEFINED, number, percent
from evenhand.statistics.means import Estimate

Row = dict[str, Any]
"""Cells of a row by column."""


@dataclass(frozen=True)
class Table:
    """Named columns of equal length, in the order of the file.

    Attributes:
        columns: text as object arrays, ``int`` as int64, all other kinds as float64 with NaN
            for an empty cell (a flag is 1.0, 0.0 or NaN).
    """

    columns: dict[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()))) if self.columns else 0

    def __getitem__(self, column: str) -> NDArray[Any]:
        return self.columns[column]

    def where(self, **equals: object) -> Table:
        """The rows whose columns equal the given values."""
        keep = np.ones(len(self), dtype=bool)
        for column, value in equals.items():
            keep &= self.columns[column] == value
        return Table({name: cells[keep] for name, cells in self.columns.items()})

    def distinct(self, column: str) -> list[Any]:
        """The values of a column, each once, in order of first appearance."""
        return list(dict.fromkeys(self.columns[column].tolist()))

    def rows(self) -> Iterator[dict[str, Any]]:
        """The rows as plain Python values."""
        names = list(self.columns)
        for cells in zip(*(column.tolist() for column in self.columns.values()), strict=True):
            yield dict(zip(names, cells, strict=True))


def table(names: Sequence[str], rows: Iterable[Sequence[object]]) -> Table:
    """A table from rows of cells; None becomes NaN in a column of numbers."""
    cells = [list(row) for row in rows]
    columns: dict[str, NDArray[Any]] = {}
    for place, name in enumerate(names):
        values = [row[place] for row in cells]
        if any(isinstance(value, str) for value in values):
            columns[name] = np.array(values, dtype=object)
        elif values and all(isinstance(value, int | np.integer) for value in values):
            columns[name] = np.array(values, dtype=np.int64)
        else:
            columns[name] = np.array(
                [math.nan if value is None else value for value in values], dtype=np.float64
            )
    return Table(columns)


def csv_text(data: Table) -> str:
    """The table as CSV: a header row, ten significant digits, an empty cell for NaN."""

    def cell(value: object) -> object:
        if not isinstance(value, float):
            return value
        return "" if math.isnan(value) else f"{value:.10g}"

    return csv_file.text_of(data.columns, (map(cell, row.values()) for row in data.rows()))


def trailing_mean(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Mean of the last ``width`` values at each place, of fewer at the start.

    NaN values are left out; a place with nothing but NaN is NaN.
    """
    known = ~np.isnan(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(known, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(known)])
    end = np.arange(1, len(values) + 1)
    start = np.maximum(end - width, 0)
    n = count[end] - count[start]
    return np.where(n > 0, (total[end] - total[start]) / np.maximum(n, 1), np.nan)


def say(value: float, digits: int = 3) -> str:
    """A number for a reader: ``digits`` decimals, fewer when it is large; NaN in words."""
    if math.isnan(value):
        return NOT_DEFINED
    places = digits if abs(value) < 10 else max(digits - 1, 0) if abs(value) < 100 else 1
    return number(value, places)


def say_estimate(estimate: Estimate, share: bool = False) -> str:
    """A mean with its interval in brackets; without an interval the text says why."""
    tell = percent if share else say
    if not estimate.n:
        return NOT_DEFINED
    if not estimate.has_interval:
        return f"{tell(estimate.mean)} (one seed, no interval)"
    return f"{tell(estimate.mean)} [{tell(estimate.low)}, {tell(estimate.high)}]"


def seeds_text(seeds: Iterable[int]) -> str:
    """How many seeds, in words that fit into a caption."""
    n = len(set(seeds))
    return "1 seed (so no interval)" if n == 1 else f"{n} seeds"


def write(path: Path, rows: Iterable[Row], columns: Sequence[str] | None = None) -> None:
    """Write rows as CSV, aside and renamed; None and NaN become empty cells."""
    listed = list(rows)
    names = list(columns or listed[0])
    cells = ([_cell(row.get(name)) for name in names] for row in listed)
    files.write_text(path, csv_file.text_of(names, cells))


def _cell(value: Any) -> Any:
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if value is None or (isinstance(value, (float, np.floating)) and np.isnan(value)):
        return ""
    return repr(float(value)) if isinstance(value, (float, np.floating)) else value
