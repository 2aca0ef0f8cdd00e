"""Pieces of a model card: front matter as YAML, tables and words as Markdown, all of it escaped."""

import json
import math
import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from evenhand.core import wording
from evenhand.statistics.detector_accuracy import Share

NOT_MEASURED = "not measured"
number = partial(wording.number, places=3, missing=NOT_MEASURED)
_MARKS = re.compile(
    r"[&<>\\`*_\[\]()#!|~$@^{}\"']|:(?=//)|(?<=mailto):|(?<=xmpp):|(?<=www)\.", re.IGNORECASE
)
"""Whatever begins something in Markdown or HTML, or makes a link of bare text."""
_AT_THE_START = re.compile(r"^(?:[-+=]|\d(?=\d*[.)](?:\s|$)))")
"""What makes a list or a heading of a line."""
_IN_NO_YAML = re.compile("[\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff]")


def plain(text: str) -> str:
    """Text from outside on one line: no control characters, no direction marks, single spaces."""
    kept = (
        " " if char.isspace() or unicodedata.category(char) in ("Cc", "Cf", "Cs", "Co") else char
        for char in text
    )
    return " ".join("".join(kept).split())


def words(text: str) -> str:
    """Text from outside as Markdown that shows just these characters, on one line.

    Character references are never taken for markup, neither by Markdown nor by HTML.
    """
    found = _MARKS.sub(lambda mark: f"&#{ord(mark.group())};", plain(text))
    return _AT_THE_START.sub(lambda mark: f"&#{ord(mark.group())};", found)


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; cells are Markdown already."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def code(text: str, language: str) -> str:
    """A block of code, fenced by more backticks than it holds."""
    longest = max((len(run) for run in re.findall("`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}{language}\n{text}\n{fence}"


def between(value: float | None, low: float | None, high: float | None, digits: int = 3) -> str:
    """A number with its interval, as far as they are known."""
    if value is None or not math.isfinite(value):
        return NOT_MEASURED
    mean = number(value, places=digits)
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return f"{mean} (interval {NOT_MEASURED})"
    return f"{mean} ({number(low, places=digits)} to {number(high, places=digits)})"


def percent(share: Share) -> str:
    """A share in percent with its interval and how many it is of."""
    if not share.n:
        return NOT_MEASURED
    return (
        f"{100 * share.value:.1f} % ({100 * share.low:.1f} to {100 * share.high:.1f}, n {share.n})"
    )


def front_matter(content: Mapping[str, Any]) -> str:
    """YAML between two lines of dashes; what is None is left out."""
    return "\n".join(["---", *_block(content, ""), "---"]) + "\n"


def _block(value: Any, indent: str) -> Iterator[str]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            if item is None:
                continue
            if isinstance(item, str | bool | int | float):
                yield f"{indent}{key}: {_scalar(item)}"
            else:
                yield f"{indent}{key}:"
                yield from _block(item, f"{indent}  ")
        return
    for item in value:
        if isinstance(item, str | bool | int | float):
            yield f"{indent}- {_scalar(item)}"
        else:
            first, *others = _block(item, f"{indent}  ")
            yield f"{indent}- {first.removeprefix(indent + '  ')}"
            yield from others


def _scalar(value: str | bool | int | float) -> str:
    """A scalar that every version of YAML reads as what it is; text always in quotes."""
    if isinstance(value, str):
        quoted = json.dumps(plain(value), ensure_ascii=False)
        return _IN_NO_YAML.sub(lambda char: f"\\u{ord(char.group()):04x}", quoted)
    if isinstance(value, float):
        found = repr(value)
        # without a point YAML 1.1 takes 1e-05 for text
        return found.replace("e", ".0e") if "e" in found and "." not in found else found
    return json.dumps(value)
