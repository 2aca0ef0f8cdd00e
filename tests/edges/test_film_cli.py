"""`evenhand film`: what cannot be filmed is said in one sentence, and nothing is half-written."""

import os
import shutil
import sys
from dataclasses import replace

import pytest

from evenhand.core.extras import install
from evenhand.methods import detector_file
from evenhand.training import run_folder
from evenhand.training.settings import settings_of

ROBOT = ("film", "--robot", "even", "--services", "3")
SETTINGS = replace(settings_of("service", "reinforce", "penalty", epochs=2), people=3)


def execute(folder, recorded):
    run_folder.execute(
        folder, SETTINGS, detector_file.load(detector_file.SHIPPED), recorded=recorded
    )
    return folder


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A run of six services; no test may change it."""
    return execute(tmp_path_factory.mktemp("trained") / "run", True)


WORDS = [
    (("film",), "name the folder of a run, or a scripted robot with --robot, or the word study"),
    ((*ROBOT, "x"), "name the folder of a run, or a scripted robot with --robot, or the word"),
    (("film", "study", "--robot", "even"), "or the word study: one of the three"),
    (("film", "study", "--services", "3"), "--services does not go with study"),
    (("film", "x"), "--services is missing: name the services to film, as 3,17"),
    (("film", "x", "--services", "3", "--strength", "1"), "--strength belongs to a scripted"),
    (("film", "x", "--services", "3", "--population", "us"), "--population belongs to a scripted"),
    (("film", "x", "--services", "3", "--seed", "1"), "--seed belongs to a scripted robot and to"),
    ((*ROBOT, "--seed", "-1"), "seed is -1: give a whole number from 0"),
    ((*ROBOT[:3], "--services", "3,x"), "services is '3,x': give whole numbers of at least 0"),
    ((*ROBOT[:3], "--services=-3"), "services is '-3': give whole numbers of at least 0"),
    ((*ROBOT[:3], "--services", ""), "services is '': give whole numbers of at least 0"),
    ((*ROBOT[:3], "--services", "1.5"), "services is '1.5': give whole numbers"),
    ((*ROBOT[:3], "--services", "4,7,4"), "service 4 is named twice: name each service once"),
    ((*ROBOT[:3], "--services", "3000"), "service 3000 does not exist: a scripted robot serves"),
    ((*ROBOT, "--camera", "gest"), "unknown camera 'gest': did you mean 'guest'?"),
    ((*ROBOT, "--size", "640"), "size is '640': give width and height in pixels, as 640x480"),
    ((*ROBOT, "--size", "641x480"), "width of the picture is 641: give an even number of pixels"),
    ((*ROBOT, "--size", "64x48"), "width of the picture is 64: give an even number of pixels from"),
    ((*ROBOT, "--size", "640x100"), "height of the picture is 100: give an even number"),
    ((*ROBOT, "--size", "4000x3000"), "width of the picture is 4000: give an even number"),
    (("film", "--robot", "agist", "--services", "3"), "unknown robot 'agist': did you mean"),
    ((*ROBOT, "--strength", "2"), "strength of the even robot is 2.0: give 0 to 1"),
    ((*ROBOT, "--population", "usa"), "unknown population 'usa': did you mean 'us'?"),
    (("film", "nowhere", "--services", "3"), "nowhere holds no run"),
]


@pytest.mark.parametrize(("words", "said"), WORDS)
def test_what_cannot_be_filmed(cli, tmp_path, words, said):
    assert said in cli(*words).complaint
    assert os.listdir(tmp_path) == []


def test_a_service_that_does_not_exist(cli, tmp_path, trained):
    said = cli("film", trained, "--services", "2,17").complaint
    assert said == "service 17 was not recorded: there are services 0 to 5"
    assert os.listdir(tmp_path) == []


def test_a_run_without_states(cli, tmp_path):
    folder = execute(tmp_path / "run", False)
    said = cli("film", folder, "--services", "2", "--out", "clips").complaint
    assert "has no states to draw: it was run with --no-states" in said
    assert not (tmp_path / "clips").exists()


def test_a_run_whose_facts_lag_behind_its_states(cli, tmp_path, trained):
    folder = tmp_path / "run"
    shutil.copytree(trained, folder)
    from evenhand.methods.services import Services

    path = next((folder / "services").glob("*.parquet"))
    Services.read_parquet(path).take(range(3)).write_parquet(path)  # type: ignore[arg-type]
    said = cli("film", folder, "--services", "4").complaint
    assert "holds no facts of service 4 yet: let the run go on to its next checkpoint" in said


@pytest.mark.parametrize(
    ("out", "said"),
    [
        ("file", "file is a file, not a folder: give another one"),
        ("/proc/x", "folder /proc/x cannot be written"),
    ],
)
def test_a_folder_that_cannot_be_written(cli, opengl, tmp_path, trained, out, said):
    (tmp_path / "file").touch()
    assert said in cli("film", trained, "--services", "2", "--out", out).complaint
    assert os.listdir(tmp_path) == ["file"]


def test_a_disk_that_fills_in_mid_clip_leaves_no_broken_file(apart, opengl, tmp_path, trained):
    out = tmp_path / "clips"
    words = ("film", trained, "--services", "2", "--size", "320x240", "--out", out)
    ended = apart.with_small_files(9000, *words)
    assert f"{out}/service-2-room.mp4 cannot be written: File too large" in ended.complaint
    assert os.listdir(out) == []


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="EGL belongs to Linux")
def test_without_opengl_the_packages_are_named_and_nothing_is_written(apart, tmp_path, trained):
    hidden = ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY", "PYOPENGL_PLATFORM")
    script = (
        "import sys; sys.modules['mujoco.egl'] = None;"
        "from evenhand.cli import main; sys.exit(main())"
    )
    ended = apart.of(sys.executable, "-c", script)(
        *("film", trained, "--services", "2", "--out", tmp_path / "clips"),
        env={name: value for name, value in os.environ.items() if name not in hidden},
    )
    assert "install the Debian packages libegl1 libegl-mesa0 libgl1-mesa-dri" in ended.complaint
    assert os.listdir(tmp_path) == []


def test_without_the_extra_nothing_is_served_or_written(cli, tmp_path, trained, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    said = cli("film", trained, "--services", "2").complaint
    assert said == f"this command needs the package imageio_ffmpeg: {install('film')}"
    assert os.listdir(tmp_path) == []


def test_an_ffmpeg_that_dies_leaves_nothing(cli, opengl, tmp_path, trained, monkeypatch):
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\nhead -c 100 > /dev/null\necho broken >&2\nexit 7\n")
    program.chmod(0o755)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(program))
    said = cli("film", trained, "--services", "2", "--out", "clips").complaint
    assert "service-2-room.mp4 cannot be written: ffmpeg ended with code 7 (broken)" in said
    assert os.listdir(tmp_path / "clips") == []
