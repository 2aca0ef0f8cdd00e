"""What a whole training costs, alone or against another commit.

Each side trains in a process of its own by the command line, which changes least from commit to
commit. The first training of a process compiles and is not counted. Then the sides take turns, and
every ratio is a median over rounds. Processor time counts all threads; other work on the machine
disturbs it less than the clock.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from evenhand.core import terminal as display
from evenhand.core.errors import InputError

ARMS = {"levelup": ("levelup",), "service": ("service", "none")}
"""Guidances: level-up, and service alone. Each with the names that commits know it by."""
_HERE = Path(__file__).parents[1]
_CHILD = """
import contextlib, io, json, os, sys, tempfile
from time import perf_counter, process_time
from evenhand.cli import main

for line in sys.stdin:
    words, names = json.loads(line)
    for name in names:
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
            processor, clock = process_time(), perf_counter()
            code = main([*words, "--guidance", name, "--out", os.path.join(folder, "run")])
            processor, clock = process_time() - processor, perf_counter() - clock
        if not code:
            break
    else:
        sys.exit(code)
    print(json.dumps([processor, clock]), flush=True)
"""


def measure(
    against: Path | None = None,
    *,
    epochs: int = 300,
    rounds: int = 3,
    arms: Sequence[str] = tuple(ARMS),
) -> dict[str, Any]:
    """Train by PPO with seed 0, 30 services per epoch; two minutes, or four against a commit.

    Args:
        against: a checkout of another commit.
        epochs: of every training.
        rounds: each has one training of every arm on every side.
        arms: of ``ARMS``.

    Returns:
        ``train_processor_s`` and ``train_wall_s``, median seconds; with ``against`` also
        ``train_processor_ratio`` and ``train_wall_ratio``, to the other commit. Each: arm ->
        number. And the circumstances.

    Raises:
        InputError: ``against`` is no checkout.
        RuntimeError: when a training fails.
    """
    sides = [_HERE]
    if against is not None:
        if not (against / "src" / "evenhand").is_dir():
            raise InputError(
                "missing against",
                f"{against} has no src/evenhand: give a checkout of another commit",
            )
        sides.append(against)
    spent = np.empty((rounds + 1, len(arms), len(sides), 2))
    with ExitStack() as stack:
        trainers = [stack.enter_context(_trainer(side.resolve() / "src")) for side in sides]
        for turn, arm, side in np.ndindex(spent.shape[:3]):
            which = side if turn % 2 else len(sides) - 1 - side  # who begins changes
            words = ["train", "--preset", "service", "--algorithm", "ppo", "--seed", "0"]
            words += ["--epochs", str(epochs)]
            spent[turn, arm, which] = _train(trainers[which], words, ARMS[arms[int(arm)]])
    spent = spent[1:]
    found: dict[str, Any] = {}
    for what, name in enumerate(("processor", "wall")):
        seconds = spent[..., what]
        found[f"train_{name}_s"] = _by_arm(arms, seconds[..., 0], 2)
        if against is not None:
            found[f"train_{name}_ratio"] = _by_arm(arms, seconds[..., 0] / seconds[..., 1], 3)
    return found | {
        "train_epochs": epochs,
        "train_rounds": rounds,
        "cpus": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
    }


def _by_arm(arms: Sequence[str], each: np.ndarray, digits: int) -> dict[str, float]:
    """Median over rounds, [R, A], by arm."""
    return dict(zip(arms, np.median(each, axis=0).round(digits).tolist(), strict=True))


@contextmanager
def _trainer(source: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that trains with the code of this folder; it ends when its input does."""
    with (
        tempfile.TemporaryDirectory(prefix="evenhand-") as folder,
        subprocess.Popen(
            [sys.executable, "-c", _CHILD],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(source)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        ) as process,
    ):
        yield process


def _train(
    process: subprocess.Popen[str], words: list[str], names: Sequence[str]
) -> tuple[float, float]:
    """Seconds of the processor and of the clock, with the first guidance that is known there."""
    assert process.stdin is not None
    assert process.stdout is not None
    print(json.dumps([words, names]), file=process.stdin, flush=True)
    answer = process.stdout.readline()
    if not answer:
        command = " ".join(["evenhand", *words, "--guidance", names[0]])
        raise RuntimeError(f"a training failed; to see why, run: {command}")
    processor, clock = json.loads(answer)
    return processor, clock


def show(found: dict[str, Any]) -> None:
    """Print the measurements."""
    titles = {
        "train_processor_s": "processor, s",
        "train_wall_s": "wall, s",
        "train_processor_ratio": "processor, to the other commit",
        "train_wall_ratio": "wall, to the other commit",
    }
    names = [name for name in titles if name in found]
    display.table(
        f"A training of {found['train_epochs']} epochs by PPO, median of {found['train_rounds']} "
        f"rounds ({found['cpus']} processors, load {found['load']})",
        ("guidance", *(titles[name] for name in names)),
        [(arm, *(found[name][arm] for name in names)) for arm in found[names[0]]],
    )
