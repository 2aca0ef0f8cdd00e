"""How long clips last, from their files: nobody can have judged a set sooner.

Of MP4 files the movie header tells it (ISO/IEC 14496-12, 8.2.2); of others it is not known here.
"""

import os
import struct
from pathlib import Path
from typing import BinaryIO

from evenhand.study.design.protocol import Protocol

_BOXES = 1000


def of_study(study: Protocol) -> dict[str, float]:
    """Seconds that all clips of a set, or of both sets of a pair, last together, by id.

    A set with a clip whose length is not known is left out, and so is a pair with such a set.
    """
    known = {name: of_file(study.clips / name) for name in study.clip_names}
    found: dict[str, float] = {}
    for one in study.sets:
        times = [known[clip] for clip in one.clips]
        told = [time for time in times if time is not None]
        if len(told) == len(times):
            found[one.id] = sum(told)
    for pair in study.pairs:
        if pair.first in found and pair.second in found:
            found[pair.id] = found[pair.first] + found[pair.second]
    return found


def of_file(path: Path) -> float | None:
    """Seconds that a clip lasts; None where the file is missing or does not tell."""
    try:
        with path.open("rb") as file:
            moov = _find(file, b"moov", 0, os.fstat(file.fileno()).st_size)
            mvhd = None if moov is None else _find(file, b"mvhd", *moov)
            if mvhd is None:
                return None
            file.seek(mvhd[0])
            head = file.read(32)
            long = head[0] == 1
            scale, length = struct.unpack_from(">IQ" if long else ">II", head, 20 if long else 12)
    except (OSError, IndexError, struct.error):
        return None
    return length / scale if scale else None


def _find(file: BinaryIO, name: bytes, start: int, end: int) -> tuple[int, int] | None:
    """Where the content of the first box of a name begins and ends."""
    for _ in range(_BOXES):
        if start + 8 > end:
            return None
        file.seek(start)
        size, kind = struct.unpack(">I4s", file.read(8))
        head = 8
        if size == 1:
            (size,) = struct.unpack(">Q", file.read(8))
            head = 16
        stop = end if size == 0 else start + size
        if size and size < head:
            return None
        if kind == name:
            return start + head, stop
        start = stop
    return None
