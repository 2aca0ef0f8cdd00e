"""What was to be seen of finished services, kept small: who stood where, and where the robot was.

Pictures are made of it later, when somebody asks. Guests keep their places all service long, so
a place each and the robot's pose at every decision are enough. Lengths are rounded to a quarter
of a millimetre and angles to a quarter of a milliradian when a recording is made, so that one
that was kept in a file is the same as one that was not.
"""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from evenhand.core import files
from evenhand.core.errors import InputError
from evenhand.restaurant import floor_plan
from evenhand.restaurant.simulation import layout

_GRID = 4000.0
"""Steps of the grid to a metre, or to a radian."""
_NONE = np.iinfo(np.int16).min
_FORMAT = 1
_KINDS = {
    "number": np.int64,
    "people": np.uint8,
    "table": np.int8,
    "position": np.int16,
    "facing": np.int16,
    "pose": np.int16,
    "sensed": np.int16,
}


@dataclass(frozen=True)
class Recording:
    """N recorded services; the first axis of every array is N.

    Attributes:
        interval: physics steps from one pose to the next.
        number: of each service, int64 [N].
        people: codes of the identities of every guest, int64 [N, 12, 5]; guest 0 asks.
        table: where a guest sits, -1 for a standing guest, int64 [N, 12].
        position: centres of the guests, metres, [N, 12, 2].
        facing: heading of the guests, radians, [N, 12].
        pose: x, y (m) and yaw (rad) of the robot at step 0, interval, 2 interval ...,
            [N, L + 1, 3]; NaN after the end. Yaw is continuous: it does not jump by a turn.
        sensed: distance as the robot took it at each decision, metres, at most 8, [N, L + 1]; NaN
            after the last decision.
    """

    interval: int
    number: np.ndarray
    people: np.ndarray
    table: np.ndarray
    position: np.ndarray
    facing: np.ndarray
    pose: np.ndarray
    sensed: np.ndarray

    def __len__(self) -> int:
        return len(self.number)

    def __getitem__(self, rows: slice | np.ndarray | Sequence[int]) -> Recording:
        return Recording(self.interval, **{k: v[rows] for k, v in self._arrays().items()})

    def _arrays(self) -> dict[str, np.ndarray]:
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "interval"}

    @property
    def shape(self) -> np.ndarray:
        """Index into ``plan.SHAPES`` of the guests, int64 [N, 12]."""
        return layout.shape_of(self.people)

    @property
    def start(self) -> np.ndarray:
        """Where the robot began, metres, [N, 2]."""
        return self.pose[:, 0, :2]

    @property
    def frames(self) -> np.ndarray:
        """Number of poses of each service, int64 [N]."""
        return np.isfinite(self.pose[:, :, 0]).sum(axis=1)

    @property
    def distance(self) -> np.ndarray:
        """True distance of robot and person at every pose, metres, [N, L + 1]."""
        gap = self.pose[:, :, :2] - self.position[:, None, 0]
        return np.hypot(gap[..., 0], gap[..., 1])

    def row(self, number: int) -> int:
        """The row of a service.

        Raises:
            InputError: when it was not recorded.
        """
        found = np.flatnonzero(self.number == number)
        if not len(found):
            held = f"{self.number.min()} to {self.number.max()}" if len(self) else "none"
            raise InputError(
                "missing service", f"service {number} was not recorded: there are services {held}"
            )
        return int(found[0])


def make(
    setups: layout.Setups,
    pose: np.ndarray,
    sensed: np.ndarray,
    interval: int,
    first: int = 0,
) -> Recording:
    """Record finished services.

    Args:
        setups: N services.
        pose: of the robot, [N, L + 1, 3], NaN after the end.
        sensed: distances as the robot took them, metres, [N, L]; NaN after the last decision.
        interval: physics steps between poses.
        first: number of the first service.
    """
    n = len(setups)
    last = np.full((n, 1), np.nan)
    whole = Recording(
        interval,
        number=np.arange(first, first + n),
        people=setups.people,
        table=setups.table,
        position=setups.position,
        facing=setups.facing,
        pose=pose,
        sensed=np.concatenate([sensed, last], axis=1),
    )
    return _fine(interval, _coarse(whole))


def concat(parts: Iterable[Recording]) -> Recording:
    """Recordings of one interval, one after another."""
    several = list(parts)
    arrays = [part._arrays() for part in several]
    return Recording(
        several[0].interval,
        **{name: np.concatenate([a[name] for a in arrays]) for name in arrays[0]},
    )


def renumbered(recording: Recording, first: int) -> Recording:
    """The same services, numbered from ``first`` on."""
    return replace(recording, number=np.arange(first, first + len(recording)))


def write(recording: Recording, path: str | os.PathLike[str]) -> None:
    """Write a recording to an ``.npz`` file, aside and renamed; about 270 bytes a service.

    Raises:
        InputError: when it cannot be written.
    """
    kept: dict[str, Any] = {"format": _FORMAT, "interval": recording.interval}
    kept |= _coarse(recording)
    # a pose differs little from the one before, and small numbers pack well
    kept["pose"] = np.diff(kept["pose"], axis=1, prepend=np.int16(0))
    content = io.BytesIO()
    np.savez_compressed(content, **kept)
    files.write_bytes(path, content.getvalue())


def read(path: str | os.PathLike[str]) -> Recording:
    """Read a recording.

    Raises:
        InputError: when the file is missing, cut off, or no recording.
    """
    try:
        with np.load(io.BytesIO(Path(path).read_bytes()), allow_pickle=False) as kept:
            content = {name: kept[name] for name in kept.files}
    except FileNotFoundError:
        raise InputError("missing file", f"{path} does not exist") from None
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(
            "format file", f"{path} is no recording or was cut off: delete it"
        ) from error
    odd = set(content) ^ {"format", "interval", *_KINDS}
    wrong = [k for k, kind in _KINDS.items() if k in content and content[k].dtype != kind]
    if odd or wrong or content["format"] != _FORMAT or not _fits(content):
        raise InputError(
            "changed file",
            f"{path} is no recording of services, or one of another version of Evenhand: delete it",
        )
    content["pose"] = np.cumsum(content["pose"], axis=1, dtype=np.int16)
    return _fine(int(content["interval"]), content)


def _fits(content: dict[str, np.ndarray]) -> bool:
    """Whether all arrays are of the same services."""
    n, length = len(content["number"]), content["pose"].shape[1:2]
    guests = floor_plan.N_GUESTS
    shapes = {
        "number": (n,),
        "people": (n, guests, 5),
        "table": (n, guests),
        "position": (n, guests, 2),
        "facing": (n, guests),
        "pose": (n, *length, 3),
        "sensed": (n, *length),
    }
    return all(content[name].shape == shape for name, shape in shapes.items())


def _coarse(recording: Recording) -> dict[str, np.ndarray]:
    """As it is kept in a file."""
    arrays = recording._arrays()
    pose = arrays["pose"].copy()
    pose[..., 2] = _within_a_turn(pose[..., 2])
    arrays |= {"pose": pose, "facing": _within_a_turn(arrays["facing"])}
    for name in ("position", "facing", "pose", "sensed"):
        steps = np.rint(arrays[name] * _GRID).clip(_NONE + 1, -(_NONE + 1))
        arrays[name] = np.where(np.isnan(steps), _NONE, steps)
    return {name: arrays[name].astype(kind) for name, kind in _KINDS.items()}


def _fine(interval: int, content: dict[str, np.ndarray]) -> Recording:
    """As it is used."""
    arrays = {name: content[name] for name in _KINDS}
    for name in ("position", "facing", "pose", "sensed"):
        steps = arrays[name]
        arrays[name] = np.where(steps == _NONE, np.nan, steps / _GRID)
    arrays |= {name: arrays[name].astype(np.int64) for name in ("people", "table")}
    pose = arrays["pose"]
    # those after the end come last, so what stands in for them moves none before
    ended = np.isnan(pose[..., 2])
    yaw = np.unwrap(np.where(ended, 0.0, pose[..., 2]), axis=1)
    pose[..., 2] = np.where(ended, np.nan, yaw)
    return Recording(interval, **arrays)


def _within_a_turn(angle: np.ndarray) -> np.ndarray:
    """The same direction in [-pi, pi]."""
    return np.remainder(angle + np.pi, 2 * np.pi) - np.pi
