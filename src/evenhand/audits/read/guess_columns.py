"""Finds the roles of columns by their usual names, and by those of Evenhand's own Services."""

from __future__ import annotations

import re
from collections.abc import Iterable
from collections.abc import Mapping as Columns
from dataclasses import replace
from typing import Any

from evenhand.audits.read.mapping import DISTANCES, TIMES, Mapping
from evenhand.core.errors import InputError, unknown
from evenhand.methods.services import FACTS

NAMES = {
    "responded": ("responded", "response", "answered", "served", "was served", "has response"),
    "response_time": (
        *("response time", "waiting time", "wait time", "wait", "time to response"),
        *("response delay", "delay", "latency", "response step"),
    ),
    "asked_at": ("asked at", "requested at", "request time", "arrived at", "called at"),
    "answered_at": ("answered at", "responded at", "served at", "response at"),
    "waited": ("waited", "gave up after", "time until given up", "timeout", "waited until"),
    "response_distance": (
        "response distance",
        "distance",
        "service distance",
        "interaction distance",
    ),
    "min_distance": (
        "min distance",
        "minimum distance",
        "closest",
        "closest distance",
        "clearance",
    ),
}
"""Usual names of each role, the likeliest first; small letters, words parted by a space."""

IDENTITY_NAMES = (
    *("race", "ethnicity", "ethnic group", "ancestry", "origin", "country of birth", "nationality"),
    *("gender", "gender identity", "sex", "pronouns", "sexual orientation", "pregnant"),
    *("age", "age group", "age band", "age range", "age class", "age category"),
    *("disability", "disabled", "impairment", "mobility", "mobility aid", "wheelchair"),
    *("wheelchair user", "hearing", "hearing aid", "sight", "vision"),
    *("skin", "skin tone", "skin color", "skin colour", "skin type", "body size"),
    *("language", "native language", "mother tongue", "accent", "dialect", "religion", "headscarf"),
    *("education", "income group", "group", "user group", "guest group", "customer group"),
)
"""Usual names of identities, written in the same way."""

UNIT_WORDS = {
    "response_time": {
        **{"s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "ms": "ms"},
        **{"millis": "ms", "milliseconds": "ms", "min": "min", "mins": "min", "minutes": "min"},
        **{"steps": "steps"},
    },
    "response_distance": {
        **{"m": "m", "meter": "m", "meters": "m", "metre": "m", "metres": "m", "cm": "cm"},
        **{"mm": "mm", "ft": "ft", "feet": "ft", "inch": "in", "inches": "in"},
    },
}
"""Last words of a column's name that tell its unit, and the unit."""


def guess(columns: Iterable[str], given: Mapping | None = None) -> Mapping:
    """Fill the roles that nobody named, by the usual names of columns.

    A table of Evenhand's own Services is known by its facts: all its other columns are
    identities, its times are physics steps, its distances metres.

    Args:
        columns: names of the log's columns.
        given: what the operator said; it is kept.

    Raises:
        InputError: when a named column does not exist, or two columns tell other units.
    """
    said = given or Mapping()
    columns = list(columns)
    for _, column in said.roles():
        if column not in columns:
            raise unknown("column", column, columns)
    taken = {column for _, column in said.roles()}
    free = [name for name in columns if name not in taken]
    if {"response_step", "steps"} <= set(free) and set(FACTS) & set(free) >= {"responded"}:
        return _own(free, said)
    found: dict[str, Any] = {}
    units: dict[str, list[tuple[str, str]]] = {"response_time": [], "response_distance": []}
    for role, names in NAMES.items():
        if getattr(said, role) or (role == "response_time" and (said.asked_at or said.answered_at)):
            continue
        if role in ("asked_at", "answered_at") and (said.response_time or "response_time" in found):
            continue
        column = _first(free, names, UNIT_WORDS.get(_kind(role), {}))
        if column:
            found[role] = column
            free.remove(column)
    if bool(found.get("asked_at") or said.asked_at) != bool(
        found.get("answered_at") or said.answered_at
    ):
        for role in ("asked_at", "answered_at"):
            found.pop(role, None)
    if not said.identities:
        found["identities"] = tuple(
            name for name in columns if name in free and (name in said.bins or _usual(name))
        )
    mapping = replace(said, **found)
    for role in (*TIMES, *DISTANCES):
        column = getattr(mapping, role)
        unit = UNIT_WORDS[_kind(role)].get(_plain(column).split()[-1]) if column else None
        if unit and column:
            units[_kind(role)].append((column, unit))
    return replace(
        mapping,
        time_unit=said.time_unit or _one(units["response_time"]),
        distance_unit=said.distance_unit or _one(units["response_distance"]),
    )


def _plain(name: str) -> str:
    """Small letters, words parted by one space; "responseTime" and "response-time" alike."""
    parted = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", name)
    return " ".join(re.split(r"[\W_]+", parted.lower())).strip() or name


def _usual(name: str) -> bool:
    plain = _plain(name)
    return any(plain in (usual, usual.replace(" ", "")) for usual in IDENTITY_NAMES)


def _kind(role: str) -> str:
    return "response_time" if role in TIMES else "response_distance" if role in DISTANCES else role


def _first(free: list[str], names: Iterable[str], units: Columns[str, str]) -> str | None:
    """The column with the likeliest name, with or without a unit as its last word."""
    plain = {column: _plain(column) for column in free}
    for usual in names:
        spellings = {usual, usual.replace(" ", "")}
        for column, name in plain.items():
            head, _, last = name.rpartition(" ")
            if name in spellings or (last in units and head in spellings):
                return column
    return None


def _one(units: list[tuple[str, str]]) -> str | None:
    if len({unit for _, unit in units}) > 1:
        (a, one), (b, other) = units[0], next(pair for pair in units if pair[1] != units[0][1])
        raise InputError(
            "conflict columns",
            f"columns {a!r} and {b!r} are in {one} and in {other}: bring them to one unit",
        )
    return units[0][1] if units else None


def _own(free: list[str], said: Mapping) -> Mapping:
    roles = {
        "responded": "responded",
        "waited": "steps",
        "response_distance": "response_distance",
        "min_distance": "min_distance",
    }
    if not said.asked_at:
        roles["response_time"] = "response_step"
    found: dict[str, Any] = {
        role: column for role, column in roles.items() if column in free and not getattr(said, role)
    }
    return replace(
        said,
        **found,
        identities=said.identities or tuple(name for name in free if name not in FACTS),
        time_unit=said.time_unit or "steps",
        distance_unit=said.distance_unit or "m",
    )
