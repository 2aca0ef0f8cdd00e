"""Files of TOML that people write: every mistake is told at once, with its line.

The reader of the standard library does not tell on which line a key stands: ``lines`` does.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evenhand.core.errors import InputError, unknown

Place = tuple[str | int, ...]
"""Where something stands, as keys and positions of the file: ("sets", 0, "clips")."""

_BARE = re.compile(r"""\s*(?:"([^"]*)"|'([^']*)'|([A-Za-z0-9_-]+))\s*""")
_STRING = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|' r"'''.*?'{3,5}|" r'"(?:\\.|[^"\\\n])*"|' r"'[^'\n]*'|#[^\n]*",
    re.DOTALL,
)


def lines(text: str) -> dict[Place, int]:
    """Place -> line, 1 first, of every table and key of valid TOML.

    Items of an array of tables are numbered: ``("sets", 2, "clips")``. What stands inside an
    inline table or an array is found by the key that it belongs to.
    """
    found: dict[Place, int] = {(): 1}
    counts: dict[Place, int] = {}
    table: Place = ()
    for number, line in _statements(text):
        head = re.match(r"\s*(\[\[?)", line)
        names, end = _key(line, head.end() if head else 0)
        if not names:
            continue
        if not head:
            if line[end : end + 1] == "=":
                for depth in range(1, len(names) + 1):
                    found.setdefault((*table, *names[:depth]), number)
            continue
        table = ()
        for depth, name in enumerate(names):
            table = (*table, name)
            last = depth == len(names) - 1
            if last and head.group(1) == "[[":
                found.setdefault(table, number)
                counts[table] = counts.get(table, 0) + 1
            if table in counts:
                table = (*table, counts[table] - 1)
            found.setdefault(table, number)
    return found


def line_of(found: dict[Place, int], place: Place) -> int:
    """The line of a place, or of the nearest one around it."""
    while place not in found:
        place = place[:-1]
    return found[place]


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """First lines of statements with their numbers; what is inside brackets is none."""

    # strings and comments are blanked, but for short ones before a "=", which may be keys
    def blank(match: re.Match[str]) -> str:
        word = match.group()
        if word[0] != "#" and not word.startswith(('"""', "'''")):
            return word[0] + re.sub(r"[\[\]{}=]", "_", word[1:-1]) + word[-1]
        return re.sub(r"[^\n]", " ", word)

    depth = 0
    for number, line in enumerate(_STRING.sub(blank, text).split("\n"), 1):
        if depth == 0:
            yield number, line
            if re.match(r"\s*\[", line):
                continue
        depth += len(re.findall(r"[\[{]", line)) - len(re.findall(r"[\]}]", line))


def _key(line: str, at: int) -> tuple[tuple[str, ...], int]:
    names: list[str] = []
    while match := _BARE.match(line, at):
        names.append(next(group for group in match.groups() if group is not None))
        at = match.end()
        if line[at : at + 1] != ".":
            break
        at += 1
    return tuple(names), at


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
        raise InputError(
            "unavailable file", f"{path} cannot be read: {error.strerror or error}"
        ) from error
    except UnicodeDecodeError as error:
        raise InputError("format file", f"{path} is not UTF-8 text: save it as UTF-8") from error


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
    """Mistakes by their lines."""
    where = lines(text)
    told = [Mistake(line_of(where, place), named(place), said) for place, said in wrong]
    return sorted(told, key=lambda one: one.line)


ID = re.compile(r"[a-z0-9-]{1,40}")
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")


@dataclass
class Table:
    """A table, where it stands, and the mistakes found so far.

    A wrong value is noted and an empty one of its kind is returned, so that reading goes on; what
    was read must not be used when there are mistakes.

    Attributes:
        content: keys and values.
        place: of the table.
        wrong: the mistakes, shared by all tables of a file.
        asked: keys that were read.
    """

    content: dict[str, Any]
    place: Place
    wrong: list[tuple[Place, str]]
    asked: list[str] = field(default_factory=list)

    def text(
        self,
        key: str,
        longest: int,
        default: str | None = None,
        pattern: re.Pattern[str] | None = None,
        shape: str = "",
    ) -> str:
        """Text that is not blank, of so many characters at most; needed without a default."""
        value = self.get(key, default is None)
        if value is None:
            return default or ""
        sentence = _text(value, longest, pattern, shape)
        if sentence:
            self.note(key, sentence)
            return ""
        return value

    def id(self) -> str:
        """The table's ``id``."""
        return self.text("id", 40, pattern=ID, shape="a-z, 0-9 and hyphens, 1 to 40 of them")

    def texts(
        self,
        key: str,
        least: int,
        most: int,
        longest: int,
        pattern: re.Pattern[str] | None = None,
        shape: str = "",
        default: tuple[str, ...] | None = None,
    ) -> tuple[str, ...]:
        """A list of texts."""
        value = self.get(key, default is None)
        if value is None:
            return default or ()
        if not isinstance(value, list) or not least <= len(value) <= most:
            self.note(key, f'give {least} to {most} texts, as {key} = ["...", "..."]')
            return ()
        for number, one in enumerate(value, 1):
            sentence = _text(one, longest, pattern, shape)
            if sentence:
                self.note(key, f"item {number}: {sentence}")
        return tuple(str(one) for one in value)

    def whole(self, key: str, least: int, most: int, default: int | None = None) -> int:
        """A whole number."""
        value = self.get(key, default is None)
        if value is None:
            return least if default is None else default
        if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
            span = f"{least}" if least == most else f"a whole number from {least} to {most}"
            self.note(key, f"it is {value!r}: give {span}")
            return least
        return value

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.get(key)
        if value is not None and not isinstance(value, bool):
            self.note(key, f"it is {value!r}: give true or false, without quotes")
            return default
        return default if value is None else value

    def one_of(self, key: str, choices: tuple[str, ...], default: str | None = None) -> str:
        """A name out of several; empty when it is wrong."""
        value = self.get(key, default is None)
        if value is None:
            return default or ""
        if not isinstance(value, str) or value not in choices:
            self.note(key, str(unknown(key, str(value), choices)))
            return ""
        return value

    def table(self, key: str, needed: bool = True) -> Table:
        """A table inside; an empty one when it is not there."""
        value = self.get(key)
        if isinstance(value, dict):
            return Table(value, (*self.place, key), self.wrong)
        if value is not None:
            self.note(key, f"write it as a table, [{key}]")
        elif needed:
            self.wrong.append((self.place, f"[{key}] is missing: add it"))
        # what an absent table lacks was said already
        return Table({}, (*self.place, key), [])

    def tables(self, key: str, needed: bool = False) -> list[Table]:
        """The tables of an array."""
        value = self.get(key)
        if value is None or value == []:
            if needed:
                self.wrong.append((self.place, f"[[{key}]] is missing: add at least one"))
            return []
        if not isinstance(value, list) or not all(isinstance(one, dict) for one in value):
            how = "{ value = ..., label = ... }" if key == "options" else f"[[{key}]]"
            self.note(key, f"write each as a table, {how}")
            return []
        if len(value) > 1000:
            self.note(key, f"there are {len(value)}: give at most 1000")
            return []
        return [Table(one, (*self.place, key, i), self.wrong) for i, one in enumerate(value)]

    def done(self, names: Iterable[str] = (), hidden: tuple[str, ...] = ()) -> None:
        """Everything was asked for: whatever is left is unknown.

        Args:
            names: keys that may stand here beside those that were read.
            hidden: keys that are neither known nor complained about.
        """
        known = [*self.asked, *names]
        for key in self.content:
            if key not in known and key not in hidden:
                self.note(key, str(unknown("key", key, known)))

    def get(self, key: str, needed: bool = False) -> Any:
        """Whatever stands there; None where nothing does."""
        if key not in self.asked:
            self.asked.append(key)
        value = self.content.get(key)
        if value is None and needed:
            self.wrong.append((self.place, f"{key} is missing: add it"))
        return value

    def note(self, key: str, sentence: str) -> None:
        """Note what is wrong with a key."""
        self.wrong.append(((*self.place, key), sentence))


def _text(value: Any, longest: int, pattern: re.Pattern[str] | None, shape: str) -> str:
    if not isinstance(value, str):
        return f'it is {value!r}: give text, in quotes "..."'
    if not value.strip() and not (pattern and pattern.fullmatch(value)):
        return "it is empty: write something, or leave the key out if it may be"
    if len(value) > longest:
        return f"it has {len(value)} characters: give at most {longest}"
    if _CONTROL.search(value):
        return "it holds a control character: remove it"
    if pattern and not pattern.fullmatch(value):
        return f"{value!r} does not fit: give {shape}"
    return ""
