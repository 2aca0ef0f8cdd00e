"""Three epochs of training with every preset and algorithm, as a table.

The table says nothing about what is right, only that the same seed still learns the same. After a
change that is meant to alter it, look at the difference and write it anew:

    .venv/bin/python tests/golden/test_training.py
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

from evenhand.methods.paper.detector import Detector
from evenhand.training import train
from evenhand.training.settings import PRESETS, settings_of
from evenhand.training.update import ALGORITHMS

TABLE = Path(__file__).with_name("training.json")
RUNS = [(preset, algorithm) for preset in PRESETS for algorithm in ALGORITHMS]
WHOLE = (
    "epoch",
    "biased_detector",
    "biased_threshold",
    "missing_gaps",
    "physics_steps",
    "services",
)

# Calls biased what has a sum of scores above 0.5, as no fit would: new judgements change nothing.
DETECTOR = Detector(
    issues=("willingness", "quality", "priority", "risk"),
    identities=("race", "gender", "age", "disability"),
    mean=(0.125, 0.125, 0.125, 0.125),
    scale=(1.0, 1.0, 1.0, 1.0),
    components=((0.5, 0.5, 0.5, 0.5),),
    weights=(20.0,),
    bias=0.0,
    kinds=(),
    kind_weights=(),
    kind_bias=(),
    rows=1,
    source="simulated respondents",
    seed=None,
)


def run(preset: str, algorithm: str) -> list[dict[str, Any]]:
    """Everything that is counted in three epochs, and the size of the weights after each."""
    settings = replace(settings_of(preset, algorithm, "penalty", seed=11, epochs=3), people=12)
    out = []
    for record in train.train(settings, DETECTOR):
        numbers = {k: v for k, v in record.numbers.items() if not k.startswith("time_")}
        leaves = [np.asarray(leaf, float) for leaf in jax.tree.leaves(record.state.policy)]
        size = sum(np.abs(leaf).sum() for leaf in leaves)
        out.append({"epoch": record.epoch, "weights": float(size)} | numbers)
    return out


def write() -> None:
    """Write the table that the test compares with."""
    rows = [f"{json.dumps(f'{p} {a}')}: {json.dumps(run(p, a))}" for p, a in RUNS]
    TABLE.write_text("{\n" + ",\n".join(rows).replace("}, {", "},\n{") + "\n}\n")


@pytest.mark.slow
@pytest.mark.parametrize(("preset", "algorithm"), RUNS)
def test_the_same_seed_learns_the_same(preset, algorithm):
    golden = json.loads(TABLE.read_text())[f"{preset} {algorithm}"]
    now = run(preset, algorithm)
    assert len(now) == len(golden) == 3
    for after, before in zip(now, golden, strict=True):
        assert after.keys() == before.keys()
        for name, value in before.items():
            if name in WHOLE or value is None:
                assert after[name] == value, name
            else:  # sums of 32-bit numbers, in the order of the machine
                assert after[name] == pytest.approx(value, rel=1e-3, abs=1e-5), name


def test_the_runs_differ():
    """A table that holds one run four times would compare nothing."""
    weights = [row["weights"] for rows in json.loads(TABLE.read_text()).values() for row in rows]
    assert len(set(weights)) == 3 * len(RUNS)


if __name__ == "__main__":
    write()
