"""``evenhand calibrate``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import arg

from evenhand.cli import inputs
from evenhand.core import files
from evenhand.core.errors import whole
from evenhand.experiments.settings import SEEDS, SERVICES

if TYPE_CHECKING:
    from evenhand.experiments.paper.calibrate import Calibration


@dataclass(frozen=True)
class Calibrate:
    """Search odds for the biased robots, so that their issue scores come close to the paper's.

    Every manner of serving is measured in the simulator. Then odds are searched on windows of 30
    services put together from these, and rounded to hundredths. What is shown was measured on
    windows that the search has not seen; beside it stands what the odds in use give there.

    The odds are values to start from: no robot changes. For instance:
    evenhand calibrate --robot ableist --out out/odds.json
    """

    robot: Annotated[str, arg(metavar="all|racist|ageist|ableist")] = "all"
    """Whose odds; the paper prints a signature of these three robots."""

    seed: int = 0
    """Of everything random."""

    rounds: int = 2
    """Searches for each robot, each from another start; the best counts."""

    services: int = 1000
    """Services measured in each of the six manners."""

    windows: int = 200
    """Windows of 30 services put together for each trial."""

    out: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = None
    """Write odds, scores, settings and versions to this JSON file."""

    def run(self, command: str) -> int:
        """Measure, search, print, and write."""
        whole("seed", self.seed, *SEEDS)
        whole("rounds", self.rounds, 1, 1000)
        whole("services", self.services, 30, SERVICES[1])
        whole("windows", self.windows, 20, 10_000)
        if self.out is not None:
            inputs.check_target(self.out)
        inputs.load_physics()
        from evenhand.core import terminal
        from evenhand.experiments.paper import calibrate
        from evenhand.restaurant import robots

        names = calibrate.chosen(self.robot)
        settings = {
            "seed": self.seed,
            "rounds": self.rounds,
            "services": self.services,
            "windows": self.windows,
        }
        with terminal.stages() as stage:
            units = len(robots.MANNERS) + len(names) * self.rounds
            tell = stage("calibration", units)
            found = calibrate.calibrate(names, **settings, tell=tell)
        _show(found)
        if self.out is not None:
            content = {"command": command, "settings": {"robot": self.robot, **settings}}
            files.write_json(self.out, content | calibrate.record(found))
            print(self.out)
        return 0


def _show(found: list[Calibration]) -> None:
    from evenhand.core import terminal
    from evenhand.methods.vocabulary import ISSUES
    from evenhand.restaurant import robots

    terminal.table(
        "Mean issue scores of windows of 30 services (simulated)",
        ("robot", "issue", "paper", "found", "difference", "with the odds in use"),
        [
            [one.name, issue, *map(float, (target, score, score - target, used))]
            for one in found
            for issue, target, score, used in zip(
                ISSUES, one.target, one.found.score, one.used.score, strict=True
            )
        ],
    )
    terminal.table(
        "Their responses, and the share of people they ignore (simulated)",
        ("robot", "measure", "found", "with the odds in use"),
        [
            [one.name, measure, getattr(one.found, name), getattr(one.used, name)]
            for one in found
            for measure, name in (
                ("mean distance (m)", "distance"),
                ("mean time (steps)", "step"),
                ("ignored", "ignored"),
            )
        ],
    )
    terminal.table(
        "Odds that were found; the rest is proper",
        ("robot", "who", *robots.MANNERS[1:]),
        [
            [one.name, who, *map(float, odds)]
            for one in found
            for who, odds in zip(("served worse", "others"), one.found.odds, strict=True)
        ],
    )
