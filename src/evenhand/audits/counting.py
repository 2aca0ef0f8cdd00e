"""An Ibis table and a mapping become a Tally: grouped counts, the same on every engine.

The engine counts services that agree in raw identities, stratum and issues; identities are made
text only afterwards, on the few rows that are left. So trimming and spelling follow one rule
wherever the log lies.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ibis
import numpy as np
import pyarrow as pa
from ibis.expr import types as ir

from evenhand.audits import checking, expressions
from evenhand.audits.arrays import floats, integers
from evenhand.audits.expressions import GRID, Facts, facts
from evenhand.audits.groups import bin_names, ordered, text_of
from evenhand.audits.mapping import Mapping
from evenhand.audits.remarks import remarks
from evenhand.audits.sources import Source
from evenhand.audits.tally import UNKNOWN, Identity, Tally, Values, Waits
from evenhand.errors import InputError, unknown
from evenhand.issues import PAPER_ISSUES

MOST_ROWS = 2_000_000
"""Rows of a count that are taken from the engine; a log with more would not be a count."""

MOST_STRATA = 10_000
"""Strata, with more of which nobody would be compared with anybody."""

EXACT = 200_000
"""Services up to which a continuous measure is counted value by value."""

FINE = 200
"""Steps between the quartiles of a measure that is counted in steps."""


@dataclass(frozen=True)
class _Keys:
    """Columns of the engine that every count is grouped by, and their names in the result."""

    columns: dict[str, Any]
    identities: tuple[str, ...]
    strata: tuple[str, ...]


def tally(source: Source, mapping: Mapping, alone: bool = False) -> tuple[Tally, tuple[str, ...]]:
    """Count a log.

    Args:
        source: the log.
        mapping: what its columns stand for.
        alone: accept a log in which every identity has one group only.

    Returns:
        The counts, and what is hardly meant or was left out, one sentence each.

    Raises:
        InputError: for a column that does not exist or holds something else, with row and value;
            for identities with too many groups or with one only; for a log that cannot be read or
            changes meanwhile.
    """
    for _, column in mapping.roles():
        if column not in source.table.columns:
            raise unknown(f"column of {source.name}", column, source.table.columns)
    read = facts(source.table, mapping)
    checked = checking.look(source, mapping, read)
    keys = _keys(source.table, mapping, read)
    try:
        counted = _count(
            source, {**keys.columns, **_flags(read, mapping), **checking.doubts(read, mapping)}
        )
    except InputError:
        checking.refuse_wrong(source, mapping, read)
        raise
    warnings = checking.check(source, mapping, read, counted)
    n = integers(counted["n"])
    _check_total(source, checked.services, int(n.sum()))

    codes, identities = [], []
    for i, name in enumerate(mapping.identities):
        one, code = _identity(source, name, counted[f"i{i}"], mapping.bins.get(name))
        identities.append(one)
        codes.append(code)
    lookup = _Lookup(source, mapping, tuple(identities))
    stratum, strata = _strata(source, counted, keys.strata)
    names, x = _issues(counted, mapping)
    told = np.column_stack([*codes, stratum, x])
    rows, n = _merged(told, n)
    d = len(codes)
    result = Tally(
        identities=tuple(identities),
        issues=names,
        strata=strata,
        codes=rows[:, :d].astype(np.int64),
        stratum=rows[:, d].astype(np.int64),
        x=rows[:, d + 1 :],
        n=n,
        waits=_waits(source, mapping, read, keys, lookup),
        values=tuple(
            _values(source, read, keys, lookup, strata, column, spread, checked.services)
            for column, spread in checked.spreads.items()
        ),
    )
    source.check_unchanged()
    return result, (
        *warnings,
        *remarks(result, mapping, source.name, alone),
        *(
            f"measure {column!r} is counted in {FINE} steps between its quartiles"
            for column, spread in checked.spreads.items()
            if _in_steps(spread, checked.services)
        ),
    )


def _keys(table: ir.Table, mapping: Mapping, read: Facts) -> _Keys:
    columns: dict[str, Any] = {}
    for i, name in enumerate(mapping.identities):
        edges = mapping.bins.get(name)
        columns[f"i{i}"] = (
            table[name]
            if edges is None
            else expressions.binned(read.value(f"identities {name}"), edges)
        )
    for i, name in enumerate(mapping.within):
        columns[f"s{i}"] = table[name]
    identities = tuple(f"i{i}" for i in range(len(mapping.identities)))
    return _Keys(columns, identities, tuple(f"s{i}" for i in range(len(mapping.within))))


def _flags(read: Facts, mapping: Mapping) -> dict[str, Any]:
    responded = read.value("responded")
    flags = dict(expressions.issues(read, mapping))
    return flags if responded is None else {"responded": responded, **flags}


def _count(source: Source, columns: dict[str, Any], **more: Any) -> pa.Table:
    """Services of each combination of the columns, under plain names.

    Raises:
        InputError: when there are more combinations than a count can have.
    """
    chosen: Any = source.table.select(**columns, **more)
    sums = {name: chosen[name].sum() for name in more}
    grouped = chosen.group_by(list(columns)).aggregate(n=chosen.count(), **sums)
    found = source.fetch(grouped.limit(MOST_ROWS + 1))
    if found.num_rows > MOST_ROWS:
        raise InputError(
            f"{source.name}: identities and strata make more than {MOST_ROWS} combinations: leave "
            "some out or bin them"
        )
    return found


def _check_total(source: Source, before: int, after: int) -> None:
    if after != before or source.rows not in (None, after):
        raise InputError(
            f"{source.name} changed while it was read, from {source.rows or before} to {after} "
            "services: audit a copy"
        )


def _identity(
    source: Source, name: str, column: pa.ChunkedArray, edges: tuple[float, ...] | None
) -> tuple[Identity, np.ndarray]:
    """An identity, its groups in order, and the group of every row, int64 [C]."""
    raw, index = _distinct(column)
    if edges is None:
        texts = [text_of(value) for value in raw]
        groups = ordered(texts)
    else:
        labels = bin_names(edges)
        texts = [UNKNOWN if value is None else labels[value] for value in raw]
        groups = tuple(one for one in (*labels, UNKNOWN) if one in set(texts))
    if len(groups) > checking.MOST_GROUPS:
        raise checking.too_many(source, name)
    place = {group: i for i, group in enumerate(groups)}
    return Identity(name, groups), np.array([place[text] for text in texts], np.int64)[index]


def _distinct(column: pa.ChunkedArray) -> tuple[list[Any], np.ndarray]:
    """The values that occur, and which of them stands in each row."""
    coded = column.combine_chunks().dictionary_encode(null_encoding="encode")
    if isinstance(coded, pa.ChunkedArray):
        coded = coded.combine_chunks()
    return coded.dictionary.to_pylist(), integers(coded.indices)


@dataclass(frozen=True)
class _Lookup:
    """Codes of identities that were found in the first count."""

    source: Source
    mapping: Mapping
    identities: tuple[Identity, ...]

    def codes(self, counted: pa.Table) -> np.ndarray:
        """Group of each identity in another count, int64 [rows, D]."""
        found = []
        for i, known in enumerate(self.identities):
            edges = self.mapping.bins.get(known.name)
            one, code = _identity(self.source, known.name, counted[f"i{i}"], edges)
            try:
                place = [known.groups.index(group) for group in one.groups]
            except ValueError as error:
                raise checking.changed(self.source) from error
            found.append(np.array(place, np.int64)[code] if place else code)
        return np.stack(found, axis=1)


def _strata(
    source: Source, counted: pa.Table, columns: tuple[str, ...]
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Stratum of every row, int64 [C], and the names of the strata."""
    if not columns:
        return np.zeros(counted.num_rows, np.int64), ("",)
    joined = _stratum_texts(counted, columns)
    if len(set(joined)) > MOST_STRATA:
        raise InputError(
            f"{source.name}: there are more than {MOST_STRATA} strata: name columns of fewer values"
        )
    names = ordered(joined)
    place = {name: i for i, name in enumerate(names)}
    return np.array([place[text] for text in joined], np.int64), names


def _stratum_texts(counted: pa.Table, columns: tuple[str, ...]) -> list[str]:
    texts = []
    for column in columns:
        raw, index = _distinct(counted[column])
        texts.append(np.array([text_of(value) for value in raw], object)[index])
    return [" · ".join(parts) for parts in zip(*texts, strict=True)]


def _issues(counted: pa.Table, mapping: Mapping) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of the issues that the log tells, and 1, 0 or NaN for each, float64 [C, K]."""
    responded = _truth(counted, "responded")
    columns = []
    names = [issue.name for issue in PAPER_ISSUES if issue.name not in mapping.missing]
    for name in names:
        if name == "willingness":
            columns.append(1.0 - responded)
        elif name == "risk" or not mapping.responded:
            columns.append(_truth(counted, name))
        else:
            columns.append(np.where(responded == 1.0, _truth(counted, name), np.nan))
    return tuple(names), np.stack(columns, axis=1) if columns else np.empty((counted.num_rows, 0))


def _truth(counted: pa.Table, name: str) -> np.ndarray:
    """1, 0 or NaN for true, false or null; NaN everywhere without the column."""
    if name not in counted.column_names:
        return np.full(counted.num_rows, np.nan)
    return floats(counted[name])


def _merged(rows: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows that agree put together, in rising order, whatever order the engine gave.

    Args:
        rows: float64 [C, ...]; NaN agrees with NaN.
        n: services, int64 [C].
    """
    if not len(rows):
        return rows, n.astype(np.int64)
    order = np.lexsort(rows.T[::-1])
    rows, n = rows[order], n[order].astype(np.int64)
    with_nan = np.nan_to_num(rows, nan=-1e308)
    first = np.concatenate([[True], (with_nan[1:] != with_nan[:-1]).any(axis=1)])
    starts = np.flatnonzero(first)
    return rows[starts], np.add.reduceat(n, starts)


def _waits(
    source: Source, mapping: Mapping, read: Facts, keys: _Keys, lookup: _Lookup
) -> Waits | None:
    """Waiting as counts, or None where the log says nothing of it."""
    found = expressions.waiting(read, mapping)
    if found is None:
        return None
    identities = {name: keys.columns[name] for name in keys.identities}
    counted = _count(source, {**identities, **found})
    step, responses = expressions.ended(
        floats(counted["step"]),
        _truth(counted, "late"),
        _truth(counted, "short"),
        _truth(counted, "responded") if "responded" in found else None,
        mapping.waited is not None,
    )
    known = ~np.isnan(step)
    if not known.any():
        return None
    told = np.column_stack([lookup.codes(counted), step, responses])[known]
    rows, n = _merged(told, integers(counted["n"])[known])
    d = len(lookup.identities)
    return Waits(
        codes=rows[:, :d].astype(np.int64),
        step=rows[:, d].astype(np.int64),
        responded=rows[:, d + 1] == 1.0,
        n=n,
        seconds=mapping.late / GRID,
        late=GRID,
    )


def _values(
    source: Source,
    read: Facts,
    keys: _Keys,
    lookup: _Lookup,
    strata: tuple[str, ...],
    column: str,
    spread: checking.Spread,
    services: int,
) -> Values:
    """A measure as counts: value by value, or in fine steps where there are too many values."""
    value = read.value(f"measures {column}")
    if _in_steps(spread, services):
        width = (spread.high - spread.low) / FINE
        step = ((value - spread.low) / width).floor()
        step = ibis.greatest(ibis.least(step, 100.0 * FINE), -100.0 * FINE)
        counted = _count(source, {**keys.columns, "step": step}, total=value)
        counted = counted.filter(counted["step"].is_valid())
        steps, n = floats(counted["step"]), integers(counted["n"])
        _, at = np.unique(steps, return_inverse=True)
        # one value a step, the mean of all services in it, so that the mean of the log stays exact
        number = (np.bincount(at, floats(counted["total"])) / np.bincount(at, n))[at]
    else:
        counted = _count(source, {**keys.columns, "value": value})
        counted = counted.filter(counted["value"].is_valid())
        number, n = floats(counted["value"]), integers(counted["n"])
    stratum = np.zeros(counted.num_rows, np.int64)
    if keys.strata:
        place = {name: i for i, name in enumerate(strata)}
        texts = _stratum_texts(counted, keys.strata)
        stratum = np.array([place[text] for text in texts], np.int64)
    rows, n = _merged(np.column_stack([lookup.codes(counted), stratum, number]), n)
    d = len(lookup.identities)
    return Values(
        column, rows[:, :d].astype(np.int64), rows[:, d].astype(np.int64), rows[:, d + 1], n
    )


def _in_steps(spread: checking.Spread, services: int) -> bool:
    return services > EXACT and spread.distinct > 10 * FINE and spread.high > spread.low
