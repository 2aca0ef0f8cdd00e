"""Services that an engine counts by who was served where: keys of a count, groups and strata.

The engine counts raw cells; they are made text here, on the few rows that are left. So trimming
and spelling follow one rule wherever the log lies.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from evenhand.audits.count import checks
from evenhand.audits.count.arrow_arrays import floats, integers
from evenhand.audits.count.groups import bin_names, ordered, text_of
from evenhand.audits.count.tally import UNKNOWN, Identity
from evenhand.audits.read import facts
from evenhand.audits.read.engines import Table
from evenhand.audits.read.facts import Facts
from evenhand.audits.read.mapping import Mapping
from evenhand.audits.read.sources import Source
from evenhand.core.errors import InputError

MOST_ROWS = 2_000_000
"""Rows of a count that are taken from the engine; a log with more would not be a count."""

MOST_STRATA = 10_000
"""Strata, with more of which nobody would be compared with anybody."""


@dataclass(frozen=True)
class Keys:
    """Columns of the engine that every count is grouped by, and their names in the result.

    Attributes:
        columns: expressions by name.
        identities: names of those that say who was served, in the order of the mapping.
        strata: names of those that say where.
    """

    columns: dict[str, str]
    identities: tuple[str, ...]
    strata: tuple[str, ...]


def keys_of(table: Table, mapping: Mapping, read: Facts) -> Keys:
    """What services are grouped by."""
    columns: dict[str, str] = {}
    for i, name in enumerate(mapping.identities):
        edges, number = mapping.bins.get(name), read.value(f"identities {name}")
        if edges is not None and number is not None:
            columns[f"i{i}"] = facts.binned(number, edges)
        else:
            columns[f"i{i}"] = table[name]
    for i, name in enumerate(mapping.within):
        columns[f"s{i}"] = table[name]
    identities = tuple(f"i{i}" for i in range(len(mapping.identities)))
    return Keys(columns, identities, tuple(f"s{i}" for i in range(len(mapping.within))))


def count(source: Source, columns: dict[str, str], **more: str) -> pa.Table:
    """Services of each combination of the columns, under plain names; sums of what is more.

    Raises:
        InputError: when there are more combinations than a count can have.
    """
    quote = source.table.engine.quote
    keys = ", ".join(map(quote, columns))
    sums = "".join(f", sum({quote(name)}) as {quote(name)}" for name in more)
    found = source.fetch(
        f"select {keys}, count(*) as n{sums} from ({source.table.query({**columns, **more})}) as c "
        f"group by {keys} limit {MOST_ROWS + 1}"
    )
    if found.num_rows > MOST_ROWS:
        raise InputError(
            "range strata",
            f"{source.name}: identities and strata make more than {MOST_ROWS} combinations: leave "
            "some out or bin them",
        )
    return found


def merged(rows: np.ndarray, *sums: np.ndarray) -> tuple[np.ndarray, ...]:
    """Rows that agree put together, in rising order, whatever order the engine gave.

    Args:
        rows: float64 [C, ...]; NaN agrees with NaN.
        sums: what is added up, [C] each.
    """
    if not len(rows):
        return rows, *sums
    order = np.lexsort(rows.T[::-1])
    rows = rows[order]
    with_nan = np.nan_to_num(rows, nan=-1e308)
    first = np.concatenate([[True], (with_nan[1:] != with_nan[:-1]).any(axis=1)])
    starts = np.flatnonzero(first)
    return rows[starts], *(np.add.reduceat(one[order], starts) for one in sums)


def truth(counted: pa.Table, name: str) -> np.ndarray:
    """1, 0 or NaN for true, false or null; NaN everywhere without the column."""
    if name not in counted.column_names:
        return np.full(counted.num_rows, np.nan)
    return floats(counted[name])


def identity(
    source: Source, name: str, column: pa.ChunkedArray, edges: tuple[float, ...] | None
) -> tuple[Identity, np.ndarray]:
    """An identity, its groups in order, and the group of every row, int64 [C].

    Raises:
        InputError: for more groups than can be compared.
    """
    raw, index = _distinct(column)
    if edges is None:
        texts = [text_of(value) for value in raw]
        groups = ordered(texts)
    else:
        labels = bin_names(edges)
        texts = [UNKNOWN if value is None else labels[value] for value in raw]
        groups = tuple(one for one in (*labels, UNKNOWN) if one in set(texts))
    if len(groups) > checks.MOST_GROUPS:
        raise checks.too_many(source, name)
    place = {group: i for i, group in enumerate(groups)}
    return Identity(name, groups), np.array([place[text] for text in texts], np.int64)[index]


def strata_of(
    source: Source, counted: pa.Table, columns: tuple[str, ...]
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Stratum of every row, int64 [C], and the names of the strata.

    Raises:
        InputError: for more strata than can be compared.
    """
    if not columns:
        return np.zeros(counted.num_rows, np.int64), ("",)
    joined = _stratum_texts(counted, columns)
    if len(set(joined)) > MOST_STRATA:
        raise InputError(
            "range strata",
            f"{source.name}: more than {MOST_STRATA} strata: name columns of fewer values",
        )
    names = ordered(joined)
    place = {name: i for i, name in enumerate(names)}
    return np.array([place[text] for text in joined], np.int64), names


@dataclass(frozen=True)
class Lookup:
    """Codes of what was found in the first count.

    Attributes:
        source: the log.
        mapping: what its columns stand for.
        keys: what it is counted by.
        identities: with their groups.
        strata: names.
        combinations: of groups and strata that occur.
    """

    source: Source
    mapping: Mapping
    keys: Keys
    identities: tuple[Identity, ...]
    strata: tuple[str, ...]
    combinations: int

    def codes(self, counted: pa.Table) -> np.ndarray:
        """Group of each identity in another count, int64 [rows, D]; -1 of those it is not by."""
        found = np.full((counted.num_rows, len(self.identities)), -1, np.int64)
        for i, known in enumerate(self.identities):
            if f"i{i}" not in counted.column_names:
                continue
            edges = self.mapping.bins.get(known.name)
            one, code = identity(self.source, known.name, counted[f"i{i}"], edges)
            found[:, i] = self._places(known.groups, one.groups)[code]
        return found

    def stratum(self, counted: pa.Table) -> np.ndarray:
        """Stratum of each row of another count, int64 [rows]."""
        code, names = strata_of(self.source, counted, self.keys.strata)
        return self._places(self.strata, names)[code]

    def _places(self, known: tuple[str, ...], names: tuple[str, ...]) -> np.ndarray:
        place = {name: i for i, name in enumerate(known)}
        if not place.keys() >= set(names):
            raise checks.changed(self.source)
        return np.array([place[name] for name in names], np.int64)


def _distinct(column: pa.ChunkedArray) -> tuple[list[Any], np.ndarray]:
    """The values that occur, and which of them stands in each row."""
    coded = column.combine_chunks().dictionary_encode(null_encoding="encode")
    if isinstance(coded, pa.ChunkedArray):
        coded = coded.combine_chunks()
    return coded.dictionary.to_pylist(), integers(coded.indices)


def _stratum_texts(counted: pa.Table, columns: tuple[str, ...]) -> list[str]:
    texts = []
    for column in columns:
        raw, index = _distinct(counted[column])
        texts.append(np.array([text_of(value) for value in raw], object)[index])
    return [" · ".join(parts) for parts in zip(*texts, strict=True)]
