"""Is every cell what its column is named as? Told by the same pass that counts the services."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from evenhand.audits.count.arrow_arrays import floats, integers
from evenhand.audits.read.engines import Kind, number
from evenhand.audits.read.facts import Facts, Reading, facts
from evenhand.audits.read.mapping import DISTANCES, TIMES, Mapping
from evenhand.audits.read.sources import Source
from evenhand.core.errors import InputError

MOST_GROUPS = 1000
"""Groups of an identity; with more it is an identifier, or a number that was not binned."""

# A rough count beyond so many times MOST_GROUPS is beyond doubt; later groups are counted exactly.
_DOUBTLESS = 1.25

FAR, CLOSE = 20.0, 0.02
"""Metres; a median distance beyond or below is hardly meant."""

LONG, BRIEF = 600.0, 0.01
"""Seconds; the same for times."""


@dataclass(frozen=True)
class Spread:
    """How the values of a measure lie, roughly.

    Attributes:
        distinct: how many there are.
        low: lower quartile.
        high: upper quartile.
    """

    distinct: int
    low: float
    high: float


@dataclass(frozen=True)
class Checked:
    """What a first look at the log tells.

    Attributes:
        services: how many.
        spreads: of the measures, by column.
    """

    services: int
    spreads: dict[str, Spread]


def look(source: Source, mapping: Mapping, read: Facts) -> Checked:
    """Look whether a log can be counted at all, before it is.

    Raises:
        InputError: for an identity with too many groups, or that is no plain value; for an empty
            log.
    """
    table = source.table
    sql = table.engine.dialect
    asked = {"n": "count(*)"}
    measures = [one for one in read.readings.values() if one.role == "measures"]
    for i, reading in enumerate(measures):
        asked[f"distinct{i}"] = sql.distinct.format(reading.value)
        asked[f"low{i}"] = sql.quantile.format(reading.value, 0.25)
        asked[f"high{i}"] = sql.quantile.format(reading.value, 0.75)
    plain = [name for name in mapping.identities if name not in mapping.bins]
    for i, name in enumerate(plain):
        _check_type(table.kinds[name], name)
        asked[f"groups{i}"] = sql.distinct.format(table[name])
    told = source.fetch(table.query(asked)).to_pylist()[0]
    if not told["n"]:
        source.check_unchanged()
        raise InputError("empty log", f"{source.name} has no services: there is nothing to audit")
    for i, name in enumerate(plain):
        if told[f"groups{i}"] > _DOUBTLESS * MOST_GROUPS:
            refuse_wrong(source, mapping, read)
            raise too_many(source, name)
    return Checked(
        told["n"],
        {
            reading.columns[0]: Spread(
                told[f"distinct{i}"], _known(told[f"low{i}"]), _known(told[f"high{i}"])
            )
            for i, reading in enumerate(measures)
        },
    )


def doubts(read: Facts, mapping: Mapping) -> dict[str, str]:
    """What services are counted by so that the cells are checked in the same pass.

    Returns:
        ``wrong``, whether any fact of a service is none; and for each time and distance, under
        its role, 1 where it is hardly meant so great, -1 where so small, else 0.
    """
    wrong = " or ".join(["false", *(reading.wrong for reading in read.readings.values())])
    found = {}
    for role, reading in read.readings.items():
        if role in TIMES or role in DISTANCES:
            small, great = map(number, _implausible(role, mapping))
            value = f"({reading.value})"
            # null where the value is
            found[role] = (
                f"case when {value} > {great} then 1 when {value} < {small} then -1 "
                f"when {value} is not null then 0 end"
            )
    return {"wrong": wrong, **found}


def check(source: Source, mapping: Mapping, read: Facts, counted: pa.Table) -> tuple[str, ...]:
    """Judge the cells by services that were counted by ``doubts``.

    Returns:
        What is hardly meant, one sentence each.

    Raises:
        InputError: for the first cell that is no fact, with its row and value.
    """
    if floats(counted["wrong"]).any():
        refuse_wrong(source, mapping, read)
        raise changed(source)
    n, warnings = integers(counted["n"]), []
    for role, reading in read.readings.items():
        if role in TIMES or role in DISTANCES:
            side = floats(counted[role])
            half = n[~np.isnan(side)].sum() / 2
            for which, size in ((1, "more"), (-1, "less")):
                if n[side == which].sum() > half:
                    warnings.append(_doubt(role, reading, mapping, size))
    return tuple(warnings)


def refuse_wrong(source: Source, mapping: Mapping, read: Facts) -> None:
    """Look for cells that are no facts.

    Raises:
        InputError: for the first one, with its row and value.
    """
    readings = list(read.readings.values())
    asked = {
        f"wrong{i}": f"count(case when {one.wrong} then 1 end)" for i, one in enumerate(readings)
    }
    told = source.fetch(source.table.query(asked)).to_pylist()[0]
    for i, reading in enumerate(readings):
        if told[f"wrong{i}"]:
            raise _wrong(source, mapping, reading, told[f"wrong{i}"])


def changed(source: Source) -> InputError:
    """What is said of a log that two passes saw differently."""
    return InputError("changed log", f"{source.name} changed while it was read: audit a copy")


def too_many(source: Source, name: str) -> InputError:
    """What is said of an identity that tells every person apart."""
    return InputError(
        f"range {name}",
        f"{source.name}: identity {name!r} has more than {MOST_GROUPS} groups and looks like an "
        f"identifier: bin its numbers, as {name}=18,40,65, or leave it out",
    )


def _known(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _check_type(kind: Kind, name: str) -> None:
    if kind.family == "nested":
        raise InputError(
            f"type {name}",
            f"identity {name!r} holds {kind.name}, expected text, numbers or yes/no: name another "
            "column",
        )


def _implausible(role: str, mapping: Mapping) -> tuple[float, float]:
    """Limits of a plausible median in the unit of the column."""
    if role in TIMES:
        unit = mapping.seconds(role)
        return BRIEF / float(unit), LONG / float(unit)
    return CLOSE / float(mapping.metres), FAR / float(mapping.metres)


def _doubt(role: str, reading: Reading, mapping: Mapping, size: str) -> str:
    time = role in TIMES
    bound = (LONG if size == "more" else BRIEF) if time else (FAR if size == "more" else CLOSE)
    unit = (mapping.time_unit or "s") if time else (mapping.distance_unit or "m")
    first, *last = reading.columns
    if last:
        return (
            f"half of the times between {first!r} and {last[0]!r} are {size} than {bound:g} s: are "
            "these the right columns?"
        )
    return (
        f"half of column {first!r} is {size} than {bound:g} {'s' if time else 'm'}: "
        f"is its unit {unit!r}?"
    )


def _wrong(source: Source, mapping: Mapping, reading: Reading, n: int) -> InputError:
    """The first wrong cell, sought again in one file after the other."""
    key = next(k for k, r in facts(source.table, mapping).readings.items() if _alike(r, reading))
    for part in source.parts:
        again = facts(part.table, mapping).readings[key]
        cells = {f"c{i}": part.table[column] for i, column in enumerate(reading.columns)}
        numbered = part.table.query({**cells, "wrong": again.wrong, "n": "row_number() over ()"})
        found = source.fetch(
            f"select * from ({numbered}) as cells where wrong order by n limit 1"
        ).to_pylist()
        if found:
            place = f"{part.name}, {part.row(found[0]['n'] - 1)}"
            return InputError("format log", _sentence(place, reading, found[0]))
    table = source.table
    cells = {f"c{i}": table[column] for i, column in enumerate(reading.columns)}
    found = source.fetch(table.query(cells, f"where {reading.wrong} limit 1")).to_pylist()
    place = f"{source.name}, in {n} rows"
    return InputError("format log", _sentence(place, reading, found[0] if found else {"c0": None}))


def _alike(one: Reading, other: Reading) -> bool:
    return (one.role, one.columns) == (other.role, other.columns)


def _sentence(place: str, reading: Reading, cells: dict[str, Any]) -> str:
    first, *last = reading.columns
    if last:
        return (
            f"{place}: answered ({last[0]!r}: {cells['c1']}) before asked ({first!r}: "
            f"{cells['c0']}): correct or drop the row"
        )
    return f"{place}, column {first!r}: {_complaint(reading.role, cells['c0'])}"


def _complaint(role: str, value: Any) -> str:
    text = value.strip() if isinstance(value, str) else str(value)
    shown = repr(text if len(text) <= 40 else text[:37] + "...")
    if role == "responded":
        return f"{shown} is neither yes nor no: write yes or no, or nothing where it is not known"
    if role in ("asked_at", "answered_at"):
        return f"{shown} is no timestamp: write it as 2026-03-14 15:09:26"
    try:
        number = float(text.replace("_", "?"))
    except ValueError:
        comma = text.replace(",", ".", 1)
        point = comma != text and comma.replace(".", "", 1).lstrip("+-").isdecimal()
        hint = "write a decimal point" if point else "write a number, or nothing where not known"
        return f"{shown} is no number: {hint}"
    if math.isnan(number):
        return "it is NaN: leave the cell empty where nothing is known"
    if math.isinf(number):
        return f"{shown} is infinite or too great: write a finite number"
    what = "time" if role in TIMES else "distance"
    return f"{shown} is negative, which no {what} can be: correct or empty the cell"
