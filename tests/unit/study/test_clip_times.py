"""How long clips last, from headers written by hand."""

import struct

import pytest

from evenhand.study.design import clip_lengths
from support.answered import protocol


def box(kind: bytes, content: bytes, *, wide: bool = False) -> bytes:
    if wide:
        return struct.pack(">I4sQ", 1, kind, len(content) + 16) + content
    return struct.pack(">I4s", len(content) + 8, kind) + content


def header(scale: int, length: int, version: int = 0) -> bytes:
    times = struct.pack(">IIII" if version == 0 else ">QQIQ", 0, 0, scale, length)
    return box(b"mvhd", bytes([version, 0, 0, 0]) + times + bytes(80))


@pytest.mark.parametrize("version", [0, 1])
@pytest.mark.parametrize("wide", [False, True])
def test_the_movie_header_tells_the_length(tmp_path, version, wide):
    path = tmp_path / "a.mp4"
    movie = box(b"moov", header(600, 4500, version))
    path.write_bytes(box(b"ftyp", b"isom") + box(b"mdat", bytes(99), wide=wide) + movie)
    assert clip_lengths.of_file(path) == 7.5


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"not a film",
        box(b"ftyp", b"isom"),
        box(b"moov", b""),
        box(b"moov", header(0, 10)),
        box(b"moov", box(b"mvhd", b"\0")),
        struct.pack(">I4s", 3, b"moov") + bytes(50),
        b"\x1aE\xdf\xa3webm",
    ],
)
def test_what_does_not_tell_is_not_known(tmp_path, content):
    path = tmp_path / "a.mp4"
    path.write_bytes(content)
    assert clip_lengths.of_file(path) is None
    assert clip_lengths.of_file(tmp_path / "missing.mp4") is None


def test_sets_and_pairs_last_as_long_as_their_clips_together(tmp_path):
    study = protocol(clips=tmp_path)
    for name, seconds in (("no-answer", 5), ("even-one", 7), ("late", 9)):
        movie = box(b"moov", header(1, seconds))
        (tmp_path / f"{name}.mp4").write_bytes(movie)
    found = clip_lengths.of_study(study)
    assert found == {"no-answer": 5, "late": 9, "even-one": 7, "duel": 12}
