"""Speed of clips: pictures drawn, written upon and encoded a second, and what recording costs.

Processor time counts this process and its ffmpeg: on cores that are idle, pictures a second by the
clock lie between what processor time allows for one core and for all of them. Where other work
runs, the clock says little.
"""

from __future__ import annotations

import contextlib
import os
import resource
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

from evenhand.core import terminal as display
from evenhand.experiments import footage as sources
from evenhand.restaurant import robots, serve_people
from evenhand.restaurant.drawing import dressing
from evenhand.restaurant.film import clip, motion
from evenhand.restaurant.film.clip import Style
from evenhand.restaurant.worlds import World

_CLIPS = 3
_TURNS = 12
_PEOPLE = 240


def measure() -> dict[str, Any]:
    """All measurements, about a minute.

    Returns:
        ``film_frames_per_s`` by the clock and ``film_frames_per_cpu_s`` by processor time, camera
        -> pictures; ``film_seconds_of_clip_per_s``, by the clock, camera -> seconds of a clip that
        are made in a second; ``states_ratio``, processor time of serving with recording over that
        without, median over turns; and the circumstances.
    """
    footage = sources.from_robot("even", 1.0, "uniform", 0, services=60)
    # the longest, of which little stands still
    rows = np.argsort(-footage.seen.frames, kind="stable")[:_CLIPS].tolist()
    clock, work = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        for camera in dressing.CAMERAS:
            style = Style(camera=camera, before=0.0, after=0.0)
            with contextlib.closing(style.screen()) as screen:
                path = Path(folder) / "clip.mp4"
                clip.shoot(path, footage, rows[0], style, screen)  # warm
                began, spent = perf_counter(), _spent()
                shots = [clip.shoot(path, footage, row, style, screen) for row in rows]
                pictures = sum(shot.pictures for shot in shots)
                clock[camera] = round(pictures / (perf_counter() - began), 1)
                work[camera] = round(pictures / (_spent() - spent), 1)
    return {
        "film_frames_per_s": clock,
        "film_frames_per_cpu_s": work,
        "film_seconds_of_clip_per_s": {c: round(n / motion.RATE, 2) for c, n in clock.items()},
        "states_ratio": _states_ratio(),
        "cpus": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
    }


def _spent() -> float:
    """Processor seconds of this process and of those that it has seen to their end."""
    own, others = (
        resource.getrusage(whose) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return own.ru_utime + own.ru_stime + others.ru_utime + others.ru_stime


def _states_ratio() -> float:
    """Serving with recording over serving without, in turns."""
    world, robot = World(), robots.ScriptedRobot()
    engine = serve_people.engine(world, _PEOPLE)

    def seconds(recorded: bool) -> float:
        ahead = serve_people.draw(world, _PEOPLE, np.random.default_rng(1), engine, robot)
        began = process_time()
        engine.run(ahead.drawn, ahead.robot, recorded=recorded)
        return process_time() - began

    def turns() -> Iterator[float]:
        for turn in range(_TURNS + 1):
            # who begins changes, so that a slow moment favours neither
            first = seconds(turn % 2 == 0)
            second = seconds(turn % 2 == 1)
            if turn:  # the first one is warm-up
                yield first / second if turn % 2 == 0 else second / first

    return round(float(np.median(list(turns()))), 3)


def show(found: dict[str, Any]) -> None:
    """Print the measurements."""
    display.table(
        f"Clips of 640 x 480, drawn and encoded ({found['cpus']} cores, load {found['load']})",
        ("camera", "pictures/s", "pictures/s of processor time", "seconds of clip/s"),
        [
            (
                camera,
                found["film_frames_per_s"][camera],
                found["film_frames_per_cpu_s"][camera],
                found["film_seconds_of_clip_per_s"][camera],
            )
            for camera in found["film_frames_per_s"]
        ],
    )
    display.table(
        "Recording what was to be seen of services",
        ("time of serving with it, to without",),
        [(found["states_ratio"],)],
    )
