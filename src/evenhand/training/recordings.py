"""What was to be seen in a run: a file of recorded services for each checkpoint."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from evenhand.core import files
from evenhand.core.errors import InputError
from evenhand.restaurant.simulation import recording
from evenhand.restaurant.simulation.recording import Recording

_NAME = re.compile(r"(\d{6,})-(\d{6,})\.npz")


def keep(root: Path, parts: Sequence[Recording], epoch: int) -> None:
    """Write the recordings of the epochs before ``epoch``, one part an epoch."""
    folder = files.make_folder(root / "states")
    name = f"{epoch - len(parts):06d}-{epoch:06d}.npz"
    recording.write(recording.concat(parts), folder / name)


def drop(root: Path, epoch: int) -> None:
    """Delete what was recorded in this epoch and after it, and what was half-written."""
    if (root / "states").is_dir():
        files.sweep(root / "states")
        for path in _files(root):
            if _epochs_of(path)[1] > epoch:
                path.unlink()


def read(folder: str | os.PathLike[str], services: Iterable[int] | None = None) -> Recording:
    """Recorded services of a run.

    Args:
        folder: of the run.
        services: their numbers, in the order wanted; all of them by default.

    Raises:
        InputError: when the run has no states or not those of a service, or a file is damaged.
    """
    root = Path(folder)
    if not (root / "settings.json").exists():
        raise InputError("missing folder", f"{root} holds no run: there is no settings.json in it")
    found = _files(root)
    if not found:
        raise InputError(
            "missing states",
            f"{root} has no states to draw: it was run with --no-states, or has no checkpoint "
            "yet; train it again in a new folder without --no-states",
        )
    whole = recording.concat([recording.read(path) for path in found])
    if services is None:
        return whole
    return whole[[whole.row(number) for number in services]]


def _files(root: Path) -> list[Path]:
    named = [p for p in (root / "states").glob("*") if _NAME.fullmatch(p.name)]
    return sorted(named, key=_epochs_of)


def _epochs_of(path: Path) -> tuple[int, int]:
    first, last = path.stem.split("-")
    return int(first), int(last)
