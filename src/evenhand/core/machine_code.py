"""Compiled loops: thirty short turns of one cost less than thirty calls of NumPy."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Records = Any
"""A structured array, whose rows have their fields as attributes in compiled code."""

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F, **options: Any) -> F:
    """Compile on first use; where no folder can keep the machine code, anew in each process.

    Kept code is known by the age of the function's own file alone. So a compiled function must
    neither call one of another file nor read a constant from there: foreign numbers are arguments.
    """
    try:
        return cast(F, numba.njit(function, cache=True, **options))
    except RuntimeError:
        return cast(F, numba.njit(function, **options))


def compiled_apart(function: F) -> F:
    """The same, and other threads of Python go on while it runs."""
    return compiled(function, nogil=True)
