"""A file of TOML as text and content, and what is said of the mistakes in it."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evenhand.core.errors import InputError
from evenhand.core.toml.lines import Place, line_of, lines


@dataclass(frozen=True)
class Mistake:
    """One mistake: its line (1 first), the key, and what to do about it."""

    line: int
    key: str
    sentence: str

    def __str__(self) -> str:
        key = f", {self.key}" if self.key else ""
        return f"line {self.line}{key}: {self.sentence}"


def text_of(path: str | os.PathLike[str]) -> str:
    """What a file says, with the ends of lines of Unix.

    Raises:
        InputError: when the file cannot be read, or is not UTF-8.
    """
    try:
        return Path(path).read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text: save it as UTF-8") from error


def content_of(text: str) -> dict[str, Any] | Mistake:
    """Keys and values, or why there are none."""
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        told = " ".join(str(error).split())
        at = re.search(r" ?\(at line (\d+), column \d+\)| ?\(at end of document\)", told)
        line = int(at.group(1)) if at and at.group(1) else text.count("\n") + 1
        told = told.replace(at.group(), "") if at else told
        return Mistake(line, "", f"this is no TOML: {told}")


def located(
    text: str, wrong: Iterable[tuple[Place, str]], named: Callable[[Place], str]
) -> list[Mistake]:
    """Mistakes by their lines.

    Args:
        text: of the file, valid TOML.
        wrong: (place, sentence) of each.
        named: a place in words.
    """
    where = lines(text)
    told = [Mistake(line_of(where, place), named(place), said) for place, said in wrong]
    return sorted(told, key=lambda one: one.line)
