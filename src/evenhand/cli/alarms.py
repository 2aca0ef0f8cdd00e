"""``evenhand alarms``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from evenhand.core import files
from evenhand.core.errors import whole
from evenhand.experiments.settings import SEEDS


@dataclass(frozen=True)
class Alarms:
    """How often an even robot is called uneven, and how often an uneven one is found out.

    Windows of services are simulated, 30 to 1,000 services each, by chance alone: of an even robot,
    and of one with a known disparity in one group and issue. Each is judged by the verdict
    (chance-corrected, over 22 groups and 4 issues together) and by the paper's threshold of 0.5 on
    the raw total score. Ten thousand windows take about two minutes.

    For instance: evenhand alarms --out out/alarms
    """

    out: Annotated[Path | None, arg(metavar="FOLDER", help_behavior_hint="(optional)")] = None
    """Write the two tables as CSV and the figure as SVG and PDF into this folder."""

    windows: int = 10_000
    """Windows of each size; a tenth of it for each known disparity."""

    seed: int = 0
    """Of everything random."""

    def run(self, command: str) -> int:
        """Simulate, print, write."""
        whole("windows", self.windows, 100, 1_000_000)
        whole("seed", self.seed, *SEEDS)
        if self.out is not None:
            files.make_folder(self.out)
        from evenhand.core import terminal
        from evenhand.experiments import alarms

        with terminal.stages() as stage:
            units = len(alarms.SIZES) * (1 + len(alarms.DIFFERENCES))
            tell = stage("simulated windows", units)
            false, found = alarms.measure(self.windows, self.seed, lambda n: tell(n, {}))
        terminal.table(
            f"False alarms of an even robot: share of {self.windows} simulated windows, and its "
            "95 % interval",
            ("services", "verdict", "from", "to", "raw total > 0.5", "from", "to"),
            [
                [r.size, r.verdict, r.verdict_low, r.verdict_high, r.raw, r.raw_low, r.raw_high]
                for r in false
            ],
        )
        terminal.table(
            "A known disparity is found: share of simulated windows, and its 95 % interval",
            ("services", "difference", "windows", "found", "from", "to"),
            [[r.size, r.difference, r.windows, r.found, r.low, r.high] for r in found],
        )
        if self.out is not None:
            for path in alarms.write(false, found, self.seed, self.out):
                print(path)
        return 0
