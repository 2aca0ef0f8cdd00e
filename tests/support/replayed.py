"""Recorded services, for the tests of the replay: served by a scripted robot, or made by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from evenhand.core import files
from evenhand.methods.services import Services
from evenhand.restaurant import floor_plan, people, robots, serve_people, worlds
from evenhand.restaurant.simulation import layout, recording
from evenhand.restaurant.simulation.recording import Recording
from evenhand.training import recordings


def places(n: int, seed: int = 3) -> layout.Setups:
    """Set-ups to fill by hand."""
    return layout.draw(people.population("uniform"), n, np.random.default_rng(seed))


def served(n: int, robot: str = "ageist", seed: int = 3) -> tuple[Recording, Services]:
    """Services 0 to n - 1 of a scripted robot, 30 an epoch."""
    world, scripted = worlds.scenario("even"), robots.ScriptedRobot(robot, 1.0)
    rng = np.random.default_rng(seed)
    done = serve_people.serve_people(world, scripted, n, rng, recorded=True)
    assert done.seen is not None
    return done.seen, serve_people.table(done, world, robot)


def approach(distances: list[list[float]], interval: int = 5) -> Recording:
    """Services in which the robot is at these distances, one after another."""
    n, most = len(distances), floor_plan.MAX_STEPS // interval + 1
    setups = places(n)
    pose = np.full((n, most, 3), np.nan)
    for row, several in enumerate(distances):
        pose[row, : len(several)] = [*setups.position[row, 0], 0.0]
        inwards = -np.sign(setups.position[row, 0, 0])  # recordings end 8 m from the middle
        pose[row, : len(several), 0] += inwards * np.array(several)
    sensed = np.full((n, most - 1), np.nan)
    return recording.make(setups, pose, sensed, interval)


def table(**facts: list) -> Services:
    """Services with these facts; everybody is a child."""
    n = len(next(iter(facts.values())))
    facts = {"service": list(range(n)), "epoch": [0] * n} | facts
    return Services.build({"age": (np.zeros(n, int), people.IDENTITIES[2].groups)}, facts)


def run_folder(folder: Path, services: int = 60, states_kept: bool = True) -> Path:
    """A folder as a run leaves it, as far as a replay reads it."""
    seen, rows = served(services)
    (folder / "services").mkdir(parents=True)
    noted = {"settings": {"scenario": "even"}, "fingerprints": {}}
    files.write_json(folder / "settings.json", noted)
    rows.write_parquet(folder / "services" / "000000-000002.parquet")
    if states_kept:
        recordings.keep(folder, [seen[:30], seen[30:]], 2)
    return folder
