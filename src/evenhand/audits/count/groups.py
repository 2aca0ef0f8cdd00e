"""Values of identities as the names of groups: one rule, whatever engine or file they come from."""

from __future__ import annotations

import datetime
import decimal
import itertools
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

from evenhand.audits.count.tally import UNKNOWN

_WHOLE = re.compile(r"(0|-?[1-9][0-9]*)\.0+")


def text_of(value: Any) -> str:
    """The group that a cell names; nothing, blanks and NaN are ``UNKNOWN``.

    A whole number is written alike whether a table holds it as 3, 3.0, "3" or "3.0".
    """
    if value is None:
        return UNKNOWN
    if isinstance(value, str):
        text = value.strip()
        whole = _WHOLE.fullmatch(text)
        return (whole[1] if whole else text) or UNKNOWN
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, decimal.Decimal):
        # by its digits: a double would take large ones for each other
        return UNKNOWN if value.is_nan() else _plain(format(value, "f"))
    if isinstance(value, float):
        if math.isnan(value):
            return UNKNOWN
        return str(int(value)) if value.is_integer() else repr(value)
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return str(value)


def _plain(digits: str) -> str:
    """Decimal digits without a fraction of noughts."""
    whole, _, fraction = digits.partition(".")
    fraction = fraction.rstrip("0")
    if fraction:
        return f"{whole}.{fraction}"
    return "0" if whole == "-0" else whole


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
