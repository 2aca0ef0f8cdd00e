"""The epochs of a run, as its folder keeps them; read without anything that learns."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from evenhand.core.errors import InputError

NAME = "epochs.jsonl"


def read(folder: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """Every epoch of a run.

    Raises:
        InputError: when the file is missing or a line is not JSON.
    """
    path = Path(folder) / NAME
    if not path.exists():
        raise InputError(
            "missing file", f"{path} does not exist: {folder} is no run folder, or nothing ran yet"
        )
    return parse(path, path.read_bytes().splitlines())


def parse(log: Path, lines: list[bytes]) -> list[dict[str, Any]]:
    """Lines of a log as JSON, each of them whole and of the epoch that it stands for.

    Raises:
        InputError: for the first one that is not.
    """
    found = []
    for number, line in enumerate(lines):
        try:
            found.append(json.loads(line))
            right = found[-1]["epoch"] == number
        except (ValueError, TypeError, KeyError):
            right = False
        if not right:
            raise InputError(
                "format file",
                f"{log} line {number + 1} is cut off or damaged: delete {log.parent} and run the "
                "same command again",
            )
    return found
