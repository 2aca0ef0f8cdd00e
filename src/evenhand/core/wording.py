"""Numbers and lists for readers: a true minus, no sign on zero, words for what is missing."""

import math
from collections.abc import Sequence

MINUS, SPACE = "\N{MINUS SIGN}", "\N{NO-BREAK SPACE}"
NOT_DEFINED = "not defined"


def number(
    value: float | None, places: int = 2, missing: str = NOT_DEFINED, sign: bool = False
) -> str:
    """A number with so many decimals.

    Args:
        value: the number; None or NaN is said in words.
        places: decimals.
        missing: the words.
        sign: whether a plus is written too.
    """
    if value is None or math.isnan(value):
        return missing
    said = f"{value:{'+' if sign else ''}z,.{places}f}"
    return said[1:] if sign and not said.strip("+0.") else said.replace("-", MINUS)


def percent(value: float | None, missing: str = NOT_DEFINED) -> str:
    """A share as per cent with one decimal; None or NaN in words."""
    if value is None or math.isnan(value):
        return missing
    return f"{number(100 * value, 1)}{SPACE}%"


def points(value: float | None, missing: str = NOT_DEFINED) -> str:
    """A difference of shares in percentage points with its sign; None or NaN in words."""
    return number(None if value is None else 100 * value, 1, missing, sign=True)


def joined(names: Sequence[str]) -> str:
    """Names as a list in a sentence."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
