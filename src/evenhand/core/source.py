"""What users register: names that can be, and the text of their files as a fingerprint."""

import hashlib
import inspect
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from evenhand.core.errors import InputError

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_PACKAGE = Path(__file__).parents[1].resolve()


def check_name(kind: str, name: str, taken: Iterable[str]) -> None:
    """Whether something can be registered by a name.

    Raises:
        InputError: for a name that is taken or cannot be one.
    """
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError(f"a {kind} cannot be called {name!r}: give letters, digits, - and _")
    if name in taken:
        raise InputError(f"there is a {kind} {name!r} already: register yours by another name")


def file_of(thing: Any) -> str | None:
    """The file in which a function, a class, or the class of an object is written."""
    for one in (inspect.unwrap(thing) if callable(thing) else thing, type(thing)):
        try:
            return inspect.getsourcefile(one)
        except TypeError:
            continue
    return None


def source_hash(*files: str | None) -> str | None:
    """16 hexadecimal digits that change with the text of these files.

    Args:
        files: paths; None and what cannot be read (typed into a terminal) count as empty.

    Returns:
        None where every file is of Evenhand, whose version says enough.
    """
    paths = [os.path.realpath(path) for path in dict.fromkeys(files) if path is not None]
    foreign = [path for path in paths if _PACKAGE not in Path(path).parents]
    if paths and not foreign:
        return None
    text = hashlib.sha256()
    for path in sorted(foreign):
        try:
            text.update(Path(path).read_bytes())
        except OSError:
            continue
    return text.hexdigest()[:16]
