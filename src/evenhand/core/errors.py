"""What is said to a user whose input cannot be used: one sentence, no traceback."""

import difflib
from collections.abc import Iterable
from numbers import Integral


class InputError(ValueError):
    """Wrong input from outside: what is wrong, where, and what to do.

    The command line prints it as one sentence and ends with exit code 2. Anything else that
    is raised is a defect of Evenhand and keeps its traceback.
    """


class WorkerLostError(RuntimeError):
    """A process that worked for this one is gone; what it had finished is kept."""


def whole(name: str, value: int, least: int, most: int) -> None:
    """Check a whole number.

    Raises:
        InputError: when it lies outside ``least`` to ``most``, or is not whole.
    """
    if not (isinstance(value, Integral) and least <= value <= most):
        raise InputError(f"{name} is {value}: give a whole number from {least} to {most}")


def nearest(name: str, choices: Iterable[str]) -> str | None:
    """The choice most like ``name``, or None when nothing comes close."""
    found = difflib.get_close_matches(name.lower(), list(choices), n=1, cutoff=0.5)
    return found[0] if found else None


def unknown(kind: str, name: str, choices: Iterable[str]) -> InputError:
    """An error for a name that does not exist, with the nearest one that does.

    Args:
        kind: what was named, for instance "population".
        name: what was given.
        choices: the names that exist.
    """
    names = list(choices)
    guess = nearest(name, names)
    hint = f"did you mean {guess!r}? " if guess else ""
    return InputError(f"unknown {kind} {name!r}: {hint}choose one of {', '.join(names)}")
