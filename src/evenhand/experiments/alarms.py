"""How far verdicts can be trusted: false alarms and power by simulated windows, with a figure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np

from evenhand.core import files
from evenhand.experiments import alarms_figure
from evenhand.statistics.power import FalseAlarms, Power, false_alarms, power

SIZES = (30, 120, 300, 1000)
"""Services of a window; 30 are the paper's epoch."""
DIFFERENCES = (0.1, 0.2, 0.3, 0.5)
"""Known disparities: what belonging to one group adds to the rate of one issue."""
POWER_SHARE = 10
"""There is one window of power for so many of false alarms."""


def measure(
    windows: int, seed: int, tell: Callable[[int], None]
) -> tuple[list[FalseAlarms], list[Power]]:
    """Simulate windows of all sizes.

    Args:
        windows: of each size for false alarms; a tenth for each cell of the power.
        seed: of everything random.
        tell: told of every size, and of every size and difference, that is done.
    """
    false, found = [], []
    for size in SIZES:
        false += false_alarms([size], np.random.default_rng([seed, 0, size]), windows)
        tell(1)
    for size in SIZES:
        for i, difference in enumerate(DIFFERENCES):
            rng = np.random.default_rng([seed, 1, size, i])
            found += power([size], [difference], rng, windows // POWER_SHARE)
            tell(1)
    return false, found


def write(false: list[FalseAlarms], found: list[Power], seed: int, out: Path) -> list[Path]:
    """Write two tables and the figure; returns the files."""
    files.make_folder(out)
    files.write_table(out / "false_alarms.csv", [asdict(row) for row in false])
    files.write_table(out / "power.csv", [asdict(row) for row in found])
    svg, pdf = alarms_figure.draw(
        [asdict(row) for row in false], [asdict(row) for row in found], seed
    )
    files.write_text(out / "alarms.svg", svg)
    files.write_bytes(out / "alarms.pdf", pdf)
    return [out / name for name in ("false_alarms.csv", "power.csv", "alarms.svg", "alarms.pdf")]
