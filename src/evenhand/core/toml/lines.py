"""On which line of a TOML file each key stands; the standard library's reader does not tell."""

from __future__ import annotations

import re
from collections.abc import Iterator

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
    """The dotted key at a position, and where it ends."""
    names: list[str] = []
    while match := _BARE.match(line, at):
        names.append(next(group for group in match.groups() if group is not None))
        at = match.end()
        if line[at : at + 1] != ".":
            break
        at += 1
    return tuple(names), at
