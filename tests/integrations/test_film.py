"""Clips from one end to the other: of a run, of a scripted robot, and by Gymnasium's wrappers."""

import subprocess
import sys
import types
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo, RenderCollection

from benchmarks import film
from evenhand.methods import detector_file
from evenhand.restaurant import registration
from evenhand.restaurant.film import encoder
from evenhand.training import run_folder
from evenhand.training.settings import settings_of

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("opengl")]


def pictures(path, size=(320, 240)):
    """A clip as ffmpeg reads it."""
    out = subprocess.run(
        [encoder.ffmpeg(), "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
        capture_output=True,
        check=True,
    ).stdout
    return np.frombuffer(out, np.uint8).reshape(-1, size[1], size[0], 3)


def test_services_of_a_run(cli, tmp_path):
    settings = replace(settings_of("service", "reinforce", "penalty", epochs=2), people=3)
    run_folder.execute(
        tmp_path / "run", settings, detector_file.load(detector_file.SHIPPED), recorded=True
    )
    words = ("film", "run", "--services", "4,1", "--size", "320x240", "--camera", "guest")
    ended = cli(*words, "--out", "clips")
    assert (ended.code, ended.err) == (0, "")
    assert ended.out.split() == ["clips/service-4-guest.mp4", "clips/service-1-guest.mp4"]
    facts = run_folder.read_services(tmp_path / "run")
    for number in (4, 1):
        path = tmp_path / "clips" / f"service-{number}-guest.mp4"
        steps = int(facts.fact("steps")[number])
        assert len(pictures(path)) == -(-steps // 2) + 1 + 12 + 38
    first = (tmp_path / "clips" / "service-4-guest.mp4").read_bytes()
    assert cli(*words, "--out", "again").code == 0
    assert (tmp_path / "again" / "service-4-guest.mp4").read_bytes() == first


def test_a_scripted_robot_for_raters(cli, tmp_path):
    words = ("film", "--robot", "ageist", "--services", "0", "--size", "320x240", "--out", "c")
    assert cli(*words).out.split() == ["c/service-0-room.mp4"]
    signed = pictures(tmp_path / "c" / "service-0-room.mp4")
    assert cli(*words, "--plain").code == 0
    plain = pictures(tmp_path / "c" / "service-0-room.mp4")
    assert len(signed) == len(plain) + 38  # the caption and its still are gone
    corner = (slice(8, 20), slice(10, 100))  # where the timer was
    assert signed[0][corner].mean() > 150
    assert np.ptp(plain[0][corner].astype(int), axis=(0, 1)).max() < 40


def env(**options):
    registration.register()
    return gym.make("evenhand/Restaurant-v0", render_mode="rgb_array", **options)


def test_pictures_collected_by_gymnasium_become_a_clip(tmp_path):
    made = RenderCollection(env())
    made.reset(seed=0)
    for _ in range(5):
        made.step(0)
    shown = [np.asarray(picture) for picture in made.render()]
    made.close()
    rate = made.metadata["render_fps"]
    assert encoder.write(tmp_path / "a.mp4", shown, rate)[0] == 6
    assert rate == 10
    assert len(pictures(tmp_path / "a.mp4", (640, 480))) == 6


def test_record_video_makes_a_clip_of_each_episode(tmp_path, monkeypatch):
    """RecordVideo hands its pictures to MoviePy; here the same two calls reach our encoder."""

    class ImageSequenceClip:
        def __init__(self, shown, fps):
            self.shown, self.rate = shown, fps

        def write_videofile(self, path, logger=None):
            encoder.write(path, self.shown, self.rate)

    module = types.ModuleType("moviepy.video.io.ImageSequenceClip")
    module.ImageSequenceClip = ImageSequenceClip  # type: ignore[attr-defined]
    for name in ("moviepy", "moviepy.video", "moviepy.video.io"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.setitem(sys.modules, module.__name__, module)
    made = RecordVideo(env(), str(tmp_path / "videos"), episode_trigger=lambda episode: True)
    lengths = []
    for seed in (0, 1):
        made.reset(seed=seed)
        ended, steps = False, 0
        while not ended:
            ended = made.step(1 if steps == 4 + seed else 0)[2]
            steps += 1
        lengths.append(steps + 1)  # and the one of reset
    made.close()
    for episode, length in enumerate(lengths):
        path = tmp_path / "videos" / f"rl-video-episode-{episode}.mp4"
        shown = pictures(path, (640, 480))
        assert len(shown) == length
        assert np.ptp(shown) > 200


def test_the_bench_measures_what_it_says(monkeypatch, capsys):
    monkeypatch.setattr(film, "_CLIPS", 1)
    monkeypatch.setattr(film, "_TURNS", 2)
    monkeypatch.setattr(film, "_PEOPLE", 8)
    found = film.measure()
    cameras = ("room", "robot", "guest")
    for name in ("film_frames_per_s", "film_frames_per_cpu_s", "film_seconds_of_clip_per_s"):
        assert tuple(found[name]) == cameras
        assert all(value > 0 for value in found[name].values())
    assert found["states_ratio"] > 0
    film.show(found)
    assert all(camera in capsys.readouterr().out for camera in cameras[:1])
