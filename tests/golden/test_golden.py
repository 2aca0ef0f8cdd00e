"""A small seeded run of every scripted robot, as a table.

The table says nothing about what is right, only that the same seed still gives the same services.
After a change that is meant to alter them, look at the difference and write it anew:

    .venv/bin/python tests/golden/test_golden.py
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evenhand.methods.paper import scores as paper_scores
from evenhand.restaurant import robots, serve_people, worlds

TABLE = Path(__file__).with_name("services.json")
SERVICES = 30
WHOLE = ("epoch", "service", "responded", "response_step", "steps", "contact_steps")
METRES = ("response_distance", "min_distance", "start_distance", "path_length", "sensed_error")


def run(name: str) -> dict[str, Any]:
    """One window of services: people, facts and scores."""
    rng = np.random.default_rng([2024, robots.NAMES.index(name)])
    world = worlds.scenario("even", "us")
    robot = robots.ScriptedRobot(name, strength=0.9, sloppiness=0.05)
    done = serve_people.serve_people(world, robot, SERVICES, rng)
    table = serve_people.table(done, world, name, epoch=3)
    scores = paper_scores.score(table)
    return {
        "people": done.codes.tolist(),
        **{name: plain(table.fact(name)) for name in (*WHOLE, *METRES)},
        "by_identity": {name: plain(score) for name, score in scores.by_identity.items()},
        "missing": scores.missing.tolist(),
    }


def plain(values: np.ndarray) -> list[float | None]:
    """Numbers for JSON: whole ones as they are, others to a nanometre, None for NaN."""
    return [None if np.isnan(value) else round(float(value), 9) for value in values]


def write() -> None:
    """Write the table that the test compares with."""
    rows = (f"{json.dumps(name)}: {json.dumps(run(name))}" for name in robots.NAMES)
    TABLE.write_text("{\n" + ",\n".join(rows) + "\n}\n")


@pytest.mark.parametrize("name", robots.NAMES)
def test_the_same_seed_gives_the_same_services(name):
    golden, now = json.loads(TABLE.read_text())[name], run(name)
    assert now.keys() == golden.keys()
    for field in ("people", "missing", *WHOLE):
        assert now[field] == golden[field], field
    for field in METRES:
        assert [x is None for x in now[field]] == [x is None for x in golden[field]], field
        known = [(a, b) for a, b in zip(now[field], golden[field], strict=True) if b is not None]
        # other processors may round otherwise; a micrometre in metres driven is nothing
        assert [a for a, _ in known] == pytest.approx([b for _, b in known], abs=1e-6), field
    for identity, score in golden["by_identity"].items():
        assert now["by_identity"][identity] == pytest.approx(score, abs=1e-9), identity


def test_the_table_is_of_every_robot():
    assert list(json.loads(TABLE.read_text())) == list(robots.NAMES)


if __name__ == "__main__":
    write()
