"""A mapping written down in a TOML file."""

from __future__ import annotations

import os
import re
import tomllib
from dataclasses import fields
from typing import Any

from evenhand.audits.read.mapping import DEEPEST, Mapping, check_edges, limits
from evenhand.core.errors import InputError, unknown
from evenhand.methods.paper.issues import Thresholds


def from_toml(path: str | os.PathLike[str]) -> Mapping:
    """What an operator wrote down: fields of ``Mapping``, ``[bins]`` and ``[thresholds]``.

    Thresholds are in metres and seconds: ``late = 4.0``.

    Raises:
        InputError: for a file that cannot be read, or the first mistake in it, with its key and
            line.
    """
    try:
        with open(path, "rb") as file:
            text = file.read().decode("utf-8-sig")
    except OSError as error:
        raise InputError(
            "unavailable file", f"{path} cannot be read: {error.strerror or error}"
        ) from error
    except UnicodeDecodeError as error:
        raise InputError("format file", f"{path} is not UTF-8 text: save it as UTF-8") from error
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            "format file", f"{path} is no TOML: {' '.join(str(error).split())}"
        ) from error
    at: list[str] = []
    try:
        values: dict[str, Any] = {}
        names = [one.name for one in fields(Mapping)]
        for key, value in content.items():
            at[:] = [key]
            if key not in names:
                raise unknown("key", key, names)
            values[key] = _field(key, value, at)
        at.clear()
        return Mapping(**values)
    except InputError as error:
        raise error.at(f"{path}{_place(text, at)}") from error


def _field(key: str, value: Any, at: list[str]) -> Any:
    """A value of TOML as a field of ``Mapping``; ``at`` says where, should it be wrong."""
    if key in ("identities", "measures", "within"):
        if isinstance(value, list) and all(isinstance(name, str) for name in value):
            return tuple(value)
        raise InputError(
            f"type {key}", f'{key} must be a list of columns, as {key} = ["race", "gender"]'
        )
    if key == "depth":
        if isinstance(value, int) and not isinstance(value, bool):
            return value
        raise InputError("type depth", f"depth must be a whole number from 1 to {DEEPEST}")
    if key == "bins":
        if not isinstance(value, dict):
            raise InputError(
                "type bins", "bins must be a table of edges, as [bins] and age = [18, 40, 65]"
            )
        bins = {}
        for name, edges in value.items():
            at[:] = [key, name]
            bins[name] = _edges(name, edges)
        return bins
    if key == "thresholds":
        return _limits(value, at)
    if not isinstance(value, str):
        raise InputError(f"type {key}", f'{key} must be text, as {key} = "..."')
    return value


def _edges(name: str, edges: Any) -> tuple[float, ...]:
    if not isinstance(edges, list) or not all(_number(edge) for edge in edges):
        raise InputError(
            "format bins", f"bins of {name!r} must be rising numbers, as {name} = [18, 40, 65]"
        )
    check_edges(name, edges)
    return tuple(float(edge) for edge in edges)


def _limits(value: Any, at: list[str]) -> Thresholds:
    if not isinstance(value, dict):
        raise InputError(
            "type thresholds", "thresholds must be a table, as [thresholds] and late = 4.0"
        )
    for name, number in value.items():
        at[:] = ["thresholds", name]
        if name not in ("nearest", "farthest", "late", "risk"):
            raise unknown("threshold", name, ("nearest", "farthest", "late", "risk"))
        if not _number(number):
            raise InputError(
                f"type {name}", f"threshold {name} must be a number, metres or seconds"
            )
    at[:] = ["thresholds"]
    return limits(**{name: float(number) for name, number in value.items()})


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _place(text: str, at: list[str]) -> str:
    """The line and the key of a mistake, as far as they can be told."""
    lines = text.splitlines()
    start = 0
    for word in at:
        key = re.compile(rf"\s*(\[\s*)?[\"']?{re.escape(word)}[\"']?\s*(\]|=|\.)")
        start = next((i for i in range(start, len(lines)) if key.match(lines[i])), len(lines))
    line = f", line {start + 1}" if at and start < len(lines) else ""
    return f"{line}, {'.'.join(at)}" if at else ""
