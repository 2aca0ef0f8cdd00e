"""What a sweep costs beside its runs: 16 runs on two cores, against half the sum of the runs.

Both are of the same sweep: a run notes how long it took where it ran, and whatever slows one
process slows the other number too.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

from evenhand.core import terminal as display
from evenhand.experiments.comparison.settings import Cell
from evenhand.experiments.sweep import sweep
from evenhand.experiments.sweep.settings import Job, Sweep, Variant

RUNS = 16
WORKERS = 2
USUAL = Variant()


def measure(runs: int = RUNS, variant: Variant = USUAL) -> dict[str, Any]:
    """A sweep in a folder that is removed again; a minute or two.

    Args:
        runs: seeds of training on service alone by PPO.
        variant: their settings.

    Returns:
        ``sweep_ratio``, seconds from the beginning of the sweep to its report over the sum of the
        runs divided by two; ``sweep_s`` and ``sweep_runs_s``, both of them; ``sweep_report_s``,
        what of it came after the last run; and the circumstances.
    """
    cells = (Cell("tips", "ppo", "service", seed) for seed in range(runs))
    plan = Sweep(tuple(Job(variant, cell) for cell in cells), "")
    ended = 0.0

    def watch(*_: object) -> Any:
        def tell(event: Any) -> None:
            nonlocal ended
            ended = perf_counter()

        return tell

    with tempfile.TemporaryDirectory(prefix="evenhand-") as folder:
        began = perf_counter()
        lines = sweep.sweep(plan, Path(folder) / "out", watch, "evenhand bench", WORKERS)
        spent = perf_counter() - began
    alone = sum(line.seconds or 0.0 for line in lines)
    return {
        "sweep_ratio": round(spent / (alone / WORKERS), 3),
        "sweep_s": round(spent, 1),
        "sweep_runs_s": round(alone, 1),
        "sweep_report_s": round(began + spent - ended, 1),
        "sweep_runs": len(lines),
        "sweep_failed": sum(line.failure is not None for line in lines),
        "cpus": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
    }


def show(found: dict[str, Any]) -> None:
    """Print the measurements."""
    display.table(
        f"A sweep of {found['sweep_runs']} runs, {WORKERS} at a time ({found['cpus']} cores, load "
        f"{found['load']})",
        ("seconds", "of it the report", "sum of the runs", "seconds, to half of the sum"),
        [
            (
                found["sweep_s"],
                found["sweep_report_s"],
                found["sweep_runs_s"],
                found["sweep_ratio"],
            )
        ],
    )
