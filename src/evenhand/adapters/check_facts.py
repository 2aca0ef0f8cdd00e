"""What a facts function told, checked: one sentence names field, value and episode."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from evenhand.adapters.episodes import Ended
from evenhand.core.errors import InputError, unknown
from evenhand.methods.scheme import Fact, Identity, Scheme


def checked(scheme: Scheme, ended: Ended, told: Any) -> tuple[np.ndarray, np.ndarray]:
    """Groups and facts of m services.

    Returns:
        Codes of groups, int64 [m, D], and facts, float64 [m, F] in the order of the scheme, NaN
        where missing.

    Raises:
        InputError: for a field that is missing, unknown, of another length, not a number, or holds
            a value that cannot be true; and for a group that the scheme does not have.
    """
    if not isinstance(told, Mapping):
        raise InputError(
            "type facts",
            f"the facts function gave {type(told).__name__} for {which(ended)}: give a dict of "
            "names and values",
        )
    people = scheme.identities if ended.people is None else ()
    wanted = [*(one.name for one in people), *(fact.name for fact in scheme.facts)]
    for name in told:
        if name not in wanted:
            if name in scheme.names:
                raise InputError(
                    "conflict facts",
                    f"the facts function tells {name!r} of {which(ended)}, but people are drawn: "
                    "leave it out, or give no sampler",
                )
            raise unknown(f"field from the facts function, for {which(ended)}:", str(name), wanted)
    for name in wanted:
        if name not in told:
            raise InputError(
                "missing facts",
                f"the facts function gave no {name!r} for {which(ended)}: give all of "
                f"{', '.join(wanted)}",
            )
    facts = np.empty((len(ended), len(scheme.facts)))
    for f, fact in enumerate(scheme.facts):
        facts[:, f] = _numbers(fact, ended, told[fact.name])
    if ended.people is not None:
        return ended.people, facts
    return np.stack([_codes(one, ended, told[one.name]) for one in people], axis=1), facts


def which(ended: Ended, row: int | None = None) -> str:
    """Which episodes, in words."""
    if row is not None or len(ended) == 1:
        place = row or 0
        return f"episode {ended.episode[place]} (lane {ended.lane[place]})"
    return f"episodes {ended.episode[0]} to {ended.episode[-1]}"


def _listed(name: str, ended: Ended, values: Any) -> np.ndarray:
    if isinstance(values, np.ma.MaskedArray):
        mask = np.ma.getmaskarray(values)
        values = np.array(values.data, dtype=object)
        values[mask] = None
    if not isinstance(values, np.ndarray):
        plain = isinstance(values, str) or not hasattr(values, "__len__")
        values = np.array(None if plain else list(values), dtype=object)
    if values.shape != (len(ended),):
        many = f"{len(values)} values" if values.ndim == 1 else "no list of single values"
        raise InputError(
            "type facts",
            f"the facts function gave {many} of {name!r} for {which(ended)}: give "
            f"{len(ended)}, one an episode",
        )
    return values


def _numbers(fact: Fact, ended: Ended, values: Any) -> np.ndarray:
    listed = _listed(fact.name, ended, values)
    if listed.dtype.kind not in "biuf":
        for row, value in enumerate(listed):
            plain = _plain(value)
            if not isinstance(plain, bool | int | float | None) or _beyond(plain):
                raise _odd(fact, ended, row, value)
    numbers = listed.astype(np.float64)
    wrong = fact.wrong(numbers)
    if wrong.any():
        row = int(wrong.argmax())
        raise _odd(fact, ended, row, listed[row])
    return numbers


def _plain(value: Any) -> Any:
    """Python's own number or text for NumPy's; a time is neither and stays what it is."""
    if isinstance(value, np.floating):
        return float(value)
    known = isinstance(value, np.integer | np.bool_ | np.str_)
    return value.item() if known and not isinstance(value, np.timedelta64) else value


def _beyond(number: float | None) -> bool:
    """Whether it is a whole number that no float can hold."""
    return isinstance(number, int) and abs(number) > sys.float_info.max


def _odd(fact: Fact, ended: Ended, row: int, value: Any) -> InputError:
    time = isinstance(value, np.datetime64 | np.timedelta64)
    shown = str(value) if time else repr(value.item() if isinstance(value, np.generic) else value)
    return InputError(
        f"range {fact.name}",
        f"fact {fact.name!r} of {which(ended, row)} is {shown[:60]}: give {fact.wanted()}",
    )


def _codes(one: Identity, ended: Ended, values: Any) -> np.ndarray:
    """Codes of groups given by name or code."""
    listed = _listed(one.name, ended, values)
    last = len(one.groups) - 1
    if listed.dtype.kind in "iu":
        wrong = (listed < -1) | (listed > last)
        if wrong.any():
            raise _no_code(one, ended, int(wrong.argmax()), listed[wrong][0])
        return listed.astype(np.int64)
    code_of: dict[Any, int] = {group: code for code, group in enumerate(one.groups)}
    codes = np.empty(len(listed), np.int64)
    for row, value in enumerate(map(_plain, listed)):
        counted = isinstance(value, int | float) and not isinstance(value, bool)
        number = value if counted else None
        if value is None or number != number:  # NaN
            codes[row] = -1
        elif isinstance(value, str) and value in code_of:
            codes[row] = code_of[value]
        elif number is not None and number == number // 1:
            if not -1 <= number <= last:
                raise _no_code(one, ended, row, number)
            codes[row] = int(number)
        else:
            found = unknown(
                f"group of {one.name!r} in {which(ended, row)}:", str(value), one.groups
            )
            raise InputError(
                f"unknown {one.name}",
                f"{found}; or its code, 0 to {last}, -1 where it is not known",
            )
    return codes


def _no_code(one: Identity, ended: Ended, row: int, value: float) -> InputError:
    return InputError(
        f"range {one.name}",
        f"identity {one.name!r} of {which(ended, row)} is {str(value)[:60]}: give 0 to "
        f"{len(one.groups) - 1}, or -1 where it is not known",
    )
