"""What is said to a user whose input cannot be used: one sentence, no traceback."""

import difflib
import re
from collections.abc import Iterable
from numbers import Integral

KINDS = {
    "missing": "something that is needed is not there: a file, a column, a field, an option",
    "unknown": "a name that is not among the choices",
    "duplicate": "given twice, or there already",
    "range": "a number outside its limits",
    "type": "a value of another kind than is needed",
    "shape": "lengths or shapes that do not fit each other",
    "format": "text or a file that cannot be understood, or is damaged",
    "conflict": "two inputs that contradict each other",
    "changed": "of another version or another run, or edited since",
    "empty": "nothing to work on",
    "unavailable": "the machine, a server, a package or a permission is in the way",
    "unsupported": "what is asked for cannot be done by this part",
}
"""What can be wrong with an input."""


class InputError(ValueError):
    """Wrong input from outside: what is wrong, where, and what to do.

    The command line prints the sentence and ends with exit code 2. Anything else that is raised is
    a defect of Evenhand and keeps its traceback.

    Args:
        code: one of ``KINDS``, a space, and the setting, option, column or field that is wrong;
            "file", "folder" or another noun where it has no name of its own. Programs and tests
            read it as ``kind`` and ``field``.
        sentence: for people.
    """

    def __init__(self, code: str, sentence: str) -> None:
        super().__init__(code, sentence)
        self.kind, _, self.field = code.partition(" ")

    def __str__(self) -> str:
        return self.args[1]

    def at(self, place: object) -> "InputError":
        """The same error with its place before the sentence, as ``place: sentence``."""
        return InputError(self.args[0], f"{place}: {self}")


class WorkerLostError(RuntimeError):
    """A process that worked for this one is gone; what it had finished is kept."""


def whole(name: str, value: int, least: int, most: int) -> None:
    """Check a whole number.

    Raises:
        InputError: when it lies outside ``least`` to ``most``, or is not whole.
    """
    if not (isinstance(value, Integral) and least <= value <= most):
        raise InputError(
            f"range {name}", f"{name} is {value}: give a whole number from {least} to {most}"
        )


def nearest(name: str, choices: Iterable[str]) -> str | None:
    """The choice most like ``name``, or None when nothing comes close."""
    found = difflib.get_close_matches(name.lower(), list(choices), n=1, cutoff=0.5)
    return found[0] if found else None


def unknown(kind: str, name: str, choices: Iterable[str], field: str | None = None) -> InputError:
    """An error for a name that does not exist, with the nearest one that does.

    Args:
        kind: what was named, for instance "population".
        name: what was given.
        choices: the names that exist.
        field: of the error; None for the noun of ``kind``.
    """
    names = list(choices)
    guess = nearest(name, names)
    hint = f"did you mean {guess!r}? " if guess else ""
    field = field or re.split(" (?:of|in|with|from|that) ", kind)[0]
    return InputError(
        f"unknown {field}", f"unknown {kind} {name!r}: {hint}choose one of {', '.join(names)}"
    )
