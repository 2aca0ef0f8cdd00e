"""``evenhand sweep``."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from evenhand.cli import inputs
from evenhand.cli.inputs import Plugin
from evenhand.core.errors import InputError, whole
from evenhand.core.processors import CORES
from evenhand.experiments.settings import WORKERS
from evenhand.experiments.sweep.settings import EXAMPLE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from evenhand.experiments.sweep.cost import Cost
    from evenhand.experiments.sweep.settings import Line
    from evenhand.experiments.sweep.settings import Sweep as Plan

MOST_WORKERS = 10_000
"""Runs at the same time on a cluster."""


@dataclass(frozen=True)
class Sweep:
    """Run many trainings: arms, scenarios, algorithms, seeds and settings from a file.

    Each run is trained and tested in a folder of its own, by processes of this machine or, with
    --ray, on a cluster; the results are the same, bit for bit. Stop it with Ctrl-C whenever you
    like: the same command goes on where it was, and does nothing twice. A run whose process dies
    is tried again, twice at most. One that fails is reported, the others go on, and the exit code
    is 1. In the end there are runs.csv, results.csv, summary.csv, fronts.csv and report.html.

    To begin: evenhand sweep --example > sweep.toml, then: evenhand sweep sweep.toml
    """

    file: Annotated[
        Positional[Path | None],
        arg(
            metavar="FILE",
            help_behavior_hint="(needed)",
            help="TOML file of the sweep. Its scenarios: "
            f"{inputs.registered('evenhand.restaurant.worlds', inputs.SCENARIOS)}.",
        ),
    ] = None

    out: Annotated[
        Path | None, arg(metavar="FOLDER", help_behavior_hint="(default: out/NAME, by the file)")
    ] = None
    """Folder of report.html, the tables and runs. More runs can be added to it later."""

    workers: Annotated[
        int | None, arg(metavar="INT", help_behavior_hint="(default: every core)")
    ] = None
    """Runs at the same time; results do not depend on it."""

    ray: Annotated[str | None, arg(metavar="HOST:PORT", help_behavior_hint="(optional)")] = None
    """Ray cluster to run on instead; this machine has to be one of it. Needs no shared disk, but
    Evenhand with its extra `ray` on every machine."""

    plugin: Plugin = ()

    estimate: bool = False
    """Run nothing but a few short samples, and say what the sweep would cost."""

    example: bool = False
    """Print a sweep to start from."""

    def run(self, command: str) -> int:
        """Run it, print the table and the path of the report."""
        if self.example:
            print(EXAMPLE.read_text(encoding="utf-8"), end="")
            return 0
        inputs.load_physics("train")
        from evenhand.experiments.sweep import file as sweep_file

        if self.file is None:
            raise InputError(
                "missing file",
                "name the file of a sweep; `evenhand sweep --example > sweep.toml` writes one",
            )
        if self.workers is not None:
            whole("workers", self.workers, 1, MOST_WORKERS if self.ray else WORKERS[1])
        plan, wrong = sweep_file.examine(self.file)
        if plan is None:
            for mistake in wrong:
                print(f"evenhand: {self.file}, {mistake}", file=sys.stderr)
            return 2
        if self.estimate:
            return self._estimate(plan)
        return self._sweep(plan, command)

    def _sweep(self, plan: Plan, command: str) -> int:
        from evenhand.cli.sweep_view import view
        from evenhand.experiments.sweep import ray as sweep_ray
        from evenhand.experiments.sweep import sweep

        out = self.out or Path("out") / (self.file or Path("sweep")).stem
        place = nullcontext() if self.ray is None else sweep_ray.connected(self.ray)
        with place as cluster, view() as watch:
            lines = sweep.sweep(plan, out, watch, command, self.workers, cluster)
        return _told(lines, out)

    def _estimate(self, plan: Plan) -> int:
        from evenhand.experiments.sweep import cost

        _priced(cost.estimate(plan), self.workers or CORES)
        return 0


def _told(lines: Sequence[Line], out: Path) -> int:
    from evenhand.core import terminal

    rows: dict[tuple[str, str], list[int | float]] = {}
    for line in lines:
        row = rows.setdefault((line.job.variant.name, line.job.cell.scenario), [0, 0, 0.0])
        row[int(line.failure is not None)] += 1
        row[2] += line.seconds or 0.0
    terminal.table(
        "Runs",
        ("variant", "scenario", "done", "failed", "seconds of computing"),
        [(*head, *row) for head, row in rows.items()],
    )
    failed = [line for line in lines if line.failure is not None]
    if failed:
        print(
            f"evenhand: {len(failed)} of {len(lines)} runs failed, see {out / 'failures.txt'}; "
            "the same command tries them again",
            file=sys.stderr,
        )
    print(out / "report.html")
    return 1 if failed else 0


def _priced(costs: Sequence[Cost], workers: int) -> None:
    from evenhand.core import terminal

    terminal.table(
        "Processor time measured on short runs, and the rest calculated from them",
        ("algorithm", "arm", "people", "runs", "ms an epoch", "ms a service of the test",
         "seconds a run", "measured"),
        [
            (c.kind.algorithm, c.kind.method, c.kind.people, c.runs, 1e3 * c.sample.epoch,
             1e3 * c.sample.service, c.seconds / c.runs, c.measured)
            for c in costs
        ],
    )  # fmt: skip
    runs, hours = sum(c.runs for c in costs), sum(c.seconds for c in costs) / 3600
    compiling, written = sum(c.compiling for c in costs), sum(c.bytes for c in costs)
    print(
        f"{runs:,} runs: {hours:,.1f} h of one core, {hours / workers:,.1f} h with {workers} at a "
        f"time; at most {compiling / 60:,.1f} min of compiling on every machine, once; "
        f"{written / 1e9:,.2f} GB"
    )
