"""Clips as files: what browsers need, the same bytes each time, and never a broken one."""

import hashlib
import os
import re
import subprocess
import sys

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.restaurant.film import encoder
from support.refusals import refused


def gradient(number=0, height=48, width=64):
    picture = np.zeros((height, width, 3), np.uint8)
    picture[..., 0] = np.linspace(30, 220, width).astype(np.uint8)
    picture[..., 1] = 40 + 10 * (number % 20)
    picture[..., 2] = np.linspace(220, 30, height).astype(np.uint8)[:, None]
    return picture


def film(path, count=10):
    return encoder.write(path, (gradient(i) for i in range(count)))


def boxes(path):
    """Names of the outer boxes of an MP4, in order (ISO/IEC 14496-12)."""
    content, at, names = path.read_bytes(), 0, []
    while at < len(content):
        size = int.from_bytes(content[at : at + 4], "big")
        names.append(content[at + 4 : at + 8].decode())
        at += size
    assert at == len(content)
    return names


def decoded(path):
    """Pictures as ffmpeg reads them again."""
    out = subprocess.run(
        [encoder.ffmpeg(), "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
        capture_output=True,
        check=True,
    ).stdout
    return np.frombuffer(out, np.uint8).reshape(-1, 48, 64, 3)


def test_every_browser_can_play_it(tmp_path):
    path = tmp_path / "a.mp4"
    film(path)
    asked = subprocess.run([encoder.ffmpeg(), "-i", path], capture_output=True, text=True)
    stream = next(line for line in asked.stderr.splitlines() if "Video:" in line)
    assert "h264" in stream
    assert "yuv420p(tv, bt709" in stream
    assert "64x48" in stream
    assert re.search(r"\b25 fps\b", stream)
    assert "Duration: 00:00:00.40" in asked.stderr  # 10 pictures
    assert "Audio:" not in asked.stderr
    names = boxes(path)
    assert names[0] == "ftyp"
    assert names.index("moov") < names.index("mdat"), "it begins to play before it is all there"


def test_pictures_come_back_with_their_colours(tmp_path):
    film(tmp_path / "a.mp4")
    back = decoded(tmp_path / "a.mp4")
    assert len(back) == 10
    for number in (0, 9):
        assert np.abs(back[number].astype(int) - gradient(number)).mean() < 4


def test_the_same_pictures_give_the_same_bytes(tmp_path):
    one, other = film(tmp_path / "a.mp4"), film(tmp_path / "b.mp4")
    assert one == other
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()
    film(tmp_path / "c.mp4", 11)
    assert (tmp_path / "a.mp4").read_bytes() != (tmp_path / "c.mp4").read_bytes()


def test_the_hash_is_of_the_pictures(tmp_path):
    count, found = film(tmp_path / "a.mp4", 3)
    content = b"".join(gradient(i).tobytes() for i in range(3))
    assert (count, found) == (3, hashlib.sha256(content).hexdigest())


def test_nothing_of_the_machine_is_in_the_file(tmp_path):
    film(tmp_path / "a.mp4")
    content = (tmp_path / "a.mp4").read_bytes()
    assert str(tmp_path).encode() not in content
    assert b"Lavf" not in content


def test_what_fails_in_mid_clip_leaves_nothing_and_keeps_what_was_there(tmp_path, alive):
    path = tmp_path / "a.mp4"
    path.write_bytes(b"an older clip")

    def breaking():
        yield gradient()
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        encoder.write(path, breaking())
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"]
    assert path.read_bytes() == b"an older clip"
    assert not [command for command in alive(parent=os.getpid()) if "rawvideo" in command]


def test_pictures_of_two_sizes_are_a_defect(tmp_path):
    with pytest.raises(ValueError, match="shape"):
        encoder.write(tmp_path / "a.mp4", [gradient(), gradient(height=50)])
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def broken(tmp_path, monkeypatch):
    """``broken("exit 3")``: ffmpeg is a script that does this instead."""

    def make(script):
        program = tmp_path / "ffmpeg"
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
        monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(program))

    return make


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("echo no such codec >&2; exit 3", r"ffmpeg ended with code 3 \(no such codec\)"),
        ("kill -9 $$", r"ffmpeg was ended by signal 9 \(it does not say why\)"),
        ("head -c 9 > /dev/null; echo 'x: No space left on device' >&2; exit 228",
         "a.mp4 cannot be written: No space left on device: free some space"),
        ("cat > /dev/null; kill -XFSZ $$", "a.mp4 cannot be written: File too large"),
        ("cat > /dev/null; exit 5", "ffmpeg ended with code 5"),
    ],
)  # fmt: skip
def test_an_ffmpeg_that_dies_is_said_in_one_sentence(tmp_path, broken, script, said):
    broken(script)
    with pytest.raises(InputError, match=said):
        film(tmp_path / "a.mp4", 200)
    assert [p.name for p in tmp_path.iterdir()] == ["ffmpeg"]


def test_an_ffmpeg_that_is_not_there(tmp_path, monkeypatch):
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "nowhere"))
    with refused("unavailable ffmpeg", ".[film]"):
        film(tmp_path / "a.mp4")
    assert list(tmp_path.iterdir()) == []


def test_without_the_extra_its_name_is_said(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with refused("unavailable imageio_ffmpeg", "'.[film]'"):
        film(tmp_path / "a.mp4")


def test_a_folder_that_is_not_there(tmp_path):
    with refused("unavailable file"):
        film(tmp_path / "nowhere" / "a.mp4")
