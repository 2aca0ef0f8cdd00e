"""Pictures as an MP4 file that every browser plays: H.264, yuv420p, index at the front."""

from __future__ import annotations

import contextlib
import hashlib
import os
import signal
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO

import numpy as np

from evenhand.core import extras
from evenhand.core.errors import InputError
from evenhand.restaurant.film.motion import RATE

_FULL = ("No space left on device", "File too large", "Disk quota exceeded")
"""What ffmpeg says when a disk is full, and so what is told."""
_PIPE = 1 << 20
"""Bytes of pictures that may lie between us and ffmpeg."""


def ffmpeg() -> str:
    """Where ffmpeg is.

    Raises:
        InputError: when it is not installed.
    """
    extras.require("film", "a clip")
    import imageio_ffmpeg

    try:
        return imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError as error:
        raise InputError(
            "unavailable ffmpeg", f"a clip needs ffmpeg: {extras.install('film')}"
        ) from error


def write(
    path: str | os.PathLike[str], pictures: Iterable[np.ndarray], rate: int = RATE
) -> tuple[int, str]:
    """Write pictures as a clip, aside and renamed: it appears whole or not at all.

    The same pictures give the same bytes with the same ffmpeg.

    Args:
        path: of the clip; it ends in .mp4.
        pictures: at least one, all of one size, uint8 [height, width, 3]; sides are even.
        rate: pictures a second.

    Returns:
        Number of pictures, and the SHA-256 of their bytes.

    Raises:
        InputError: when ffmpeg is missing or ends early, or the file cannot be written.
    """
    target = Path(path)
    aside = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        found = _encode(target, aside, iter(pictures), rate)
        with aside.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(aside, target)
        return found
    except OSError as error:
        raise InputError(
            "unavailable file", f"{target} cannot be written: {error.strerror or error}"
        ) from error
    finally:
        aside.unlink(missing_ok=True)


def _encode(
    target: Path, aside: Path, pictures: Iterator[np.ndarray], rate: int
) -> tuple[int, str]:
    picture = next(pictures)
    shape, count, digest = picture.shape, 0, hashlib.sha256()
    with tempfile.TemporaryFile() as said:
        encoder = _start(aside, shape, rate, said)
        pipe = encoder.stdin
        assert pipe is not None
        try:
            while True:
                if picture.shape != shape:
                    raise ValueError(f"a picture of shape {picture.shape} among those of {shape}")
                content = np.ascontiguousarray(picture).data
                digest.update(content)
                pipe.write(content)
                count += 1
                if (following := next(pictures, None)) is None:
                    break
                picture = following
            pipe.close()
            code = encoder.wait()
        except BrokenPipeError:  # it has ended by itself, and says why
            code = encoder.wait() or 1
        finally:
            if encoder.poll() is None:
                encoder.kill()
                encoder.wait()
            with contextlib.suppress(OSError):
                pipe.close()
        if code:
            said.seek(0)
            raise InputError(
                "unavailable file", _reason(target, code, said.read().decode(errors="replace"))
            )
    return count, digest.hexdigest()


def _start(
    aside: Path, shape: tuple[int, ...], rate: int, said: IO[bytes]
) -> subprocess.Popen[bytes]:
    """Start ffmpeg: raw pictures in, a file out, complaints into ``said``."""
    program = ffmpeg()
    words = [
        *("-hide_banner", "-loglevel", "error", "-y"),
        *("-f", "rawvideo", "-pixel_format", "rgb24", "-framerate", str(rate)),
        *("-video_size", f"{shape[1]}x{shape[0]}", "-i", "pipe:0", "-an"),
        # colours as the standard of video says, and said so, or browsers guess
        *("-vf", "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p"),
        *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"),
        *("-c:v", "libx264", "-preset", "veryfast", "-crf", "20", "-g", str(rate)),
        # one thread and no names of versions: the same pictures give the same bytes
        *("-threads", "1", "-flags:v", "+bitexact", "-fflags", "+bitexact"),
        *("-map_metadata", "-1", "-movflags", "+faststart", "-f", "mp4", f"file:{aside}"),
    ]
    try:
        return subprocess.Popen(
            [program, *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=said,
            pipesize=_PIPE,
            process_group=0,  # Ctrl-C is for us, and we end it
        )
    except OSError as error:
        raise InputError(
            "unavailable ffmpeg",
            f"ffmpeg cannot be started ({program}: {error.strerror or error}): leave "
            f"IMAGEIO_FFMPEG_EXE unset and {extras.install('film')}",
        ) from error


def _reason(target: Path, code: int, said: str) -> str:
    full = next((words for words in _FULL if words in said), None)
    if full is None and code == -signal.SIGXFSZ:
        full = "File too large"
    if full is not None:
        return f"{target} cannot be written: {full}: free some space or give another folder"
    lines = said.strip().splitlines() or ["it does not say why"]
    how = f"was ended by signal {-code}" if code < 0 else f"ended with code {code}"
    return f"{target} cannot be written: ffmpeg {how} ({lines[-1].strip()}): try again"
