"""Values of identities as the names of groups: one rule, whatever engine or file they come from."""

from __future__ import annotations

import datetime
import decimal
import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any

from evenhand.audits.tally import UNKNOWN


def text_of(value: Any) -> str:
    """The group that a cell names; nothing, blanks and NaN are ``UNKNOWN``.

    A whole number is written alike whether a table holds it as 3, 3.0 or "3".
    """
    if value is None:
        return UNKNOWN
    if isinstance(value, str):
        return value.strip() or UNKNOWN
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float | decimal.Decimal):
        number = float(value)
        if math.isnan(number):
            return UNKNOWN
        return str(int(number)) if number.is_integer() else repr(number)
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return str(value)


def ordered(texts: Iterable[str]) -> tuple[str, ...]:
    """Groups without repetition: numbers by size if all are, else by letters; ``UNKNOWN`` last."""
    names = sorted(set(texts) - {UNKNOWN})
    if numeric(names):
        names.sort(key=float)
    return (*names, UNKNOWN) if UNKNOWN in texts else tuple(names)


def numeric(names: Sequence[str]) -> bool:
    """Whether every name is a finite number."""
    try:
        return all(math.isfinite(float(name)) for name in names)
    except ValueError:
        return False


def bin_names(edges: Sequence[float]) -> tuple[str, ...]:
    """Groups of a binned number: below the first edge, between two, from the last on."""
    marks = [f"{edge:.12g}" for edge in edges]
    middle = [f"{a} to below {b}" for a, b in itertools.pairwise(marks)]
    return (f"below {marks[0]}", *middle, f"{marks[-1]} and above")


def twins(groups: Sequence[str]) -> list[tuple[str, str]]:
    """Pairs of groups that only capitals or spaces tell apart."""
    seen: dict[str, str] = {}
    pairs = []
    for group in groups:
        other = seen.setdefault(" ".join(group.casefold().split()), group)
        if other != group:
            pairs.append((other, group))
    return pairs
