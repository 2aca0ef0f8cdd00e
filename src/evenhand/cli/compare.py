"""``evenhand compare``."""

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isnan
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import arg

from evenhand.cli import inputs
from evenhand.cli.inputs import Plugin
from evenhand.experiments.comparison.settings import CompareSettings


@dataclass(frozen=True)
class Compare:
    """Compare methods in scenarios that make a robot uneven.

    Every arm is trained in every scenario with both algorithms, and tested on people it never
    saw. Two arms learn nothing: reference, the scripted robot that makes up for the scenario (what
    can be attained), and untrained. report.html says which aims were reached; results.csv holds
    every number, summary.csv interquartile means over seeds with 95 % bootstrap intervals,
    fronts.csv evenness against service.

    Stop it with Ctrl-C whenever you like: the same command goes on where it was. More seeds, arms
    or scenarios can be added to the same folder later, with the same versions of Evenhand and its
    libraries. A run takes 1 to 2 MB.

    A small one: evenhand compare --seeds 2 --scenarios perception tips --arms reference service
    levelup
    """

    out: Path = CompareSettings.out
    """Folder of report.html, the tables, figures and runs."""

    scenarios: Annotated[
        tuple[str, ...], arg(metavar="NAME[+NAME] ...", help=inputs.scenario_help())
    ] = CompareSettings.scenarios

    arms: Annotated[tuple[str, ...], arg(metavar="ARM[@STRENGTH] ...")] = CompareSettings.arms
    """Methods, or reference and untrained. A strength follows an @, as in levelup@0.5 levelup@2:
    the weight of evenness, for a published method its own main setting; fronts.csv then compares
    methods over their strengths."""

    plugin: Plugin = ()

    algorithms: Annotated[
        tuple[Literal["ppo", "reinforce", "ppo-all", "reinforce-all"], ...],
        arg(metavar="ppo|reinforce|ppo-all|reinforce-all ..."),
    ] = CompareSettings.algorithms  # type: ignore[assignment]
    """What learns. With -all every moment of responding is weighed by what would have come of it,
    instead of the one that was taken."""

    seeds: int = CompareSettings.seeds
    """Runs of every arm, with seeds that follow each other; intervals need two or more."""

    first_seed: int = CompareSettings.first_seed
    """The first of these seeds. Choose settings of a method with other seeds than you report."""

    earlier: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = (
        CompareSettings.earlier
    )
    """results.csv of an earlier comparison with its manifest beside it: what ran there is taken
    from there, so that a published comparison can be continued, or an arm be added to it."""

    epochs: int = CompareSettings.epochs
    """Updates of every run, 30 services each."""

    services: int = CompareSettings.services
    """Services in the test of every run."""

    workers: int = CompareSettings.workers
    """Processes that work at the same time; results do not depend on it."""

    def run(self, command: str) -> int:
        """Run it, print the table and the path of the report."""
        inputs.load_physics("train")
        settings = CompareSettings(**{n: v for n, v in asdict(self).items() if n != "plugin"})
        from evenhand.core import terminal
        from evenhand.experiments.comparison import compare, tables

        def announce(sentence: str) -> None:
            print(sentence, file=sys.stderr)

        with terminal.stages() as stage:
            rows = compare.compare(settings, stage, announce, command)
        shown = tables.shown(rows)
        named = {"biased epochs": f"biased epochs of {self.epochs}"}
        terminal.table(
            "Interquartile means over seeds, 95 % intervals; 1 attained: as even as the reference",
            [named.get(name, name) for name in _COLUMNS],
            [[cell(row) for cell in _COLUMNS.values()] for row in shown],
        )
        if any(row["seeds"] == 2 for row in shown):
            print("Where there are two seeds, an interval is at most the range of the two.")
        print(settings.out / "report.html")
        return 0


def _interval(row: Mapping[str, Any], name: str, digits: int) -> str:
    value, low, high = (row[name + end] for end in ("", "_low", "_high"))
    if value is None or isnan(value):
        return "missing"
    limits = "" if isnan(low) else f" [{low:z.{digits}f}, {high:z.{digits}f}]"
    return f"{value:z.{digits}f}{limits}"


_COLUMNS = {
    "scenario": lambda row: row["scenario"],
    "algorithm": lambda row: row["algorithm"],
    "arm": lambda row: row["arm"],
    "seeds": lambda row: row["seeds"],
    "corrected total": lambda row: _interval(row, "corrected_total", 3),
    "attained": lambda row: _interval(row, "share", 2),
    "to blind": lambda row: _interval(row, "to_blind", 3),
    "perfect": lambda row: _interval(row, "perfect_rate", 3),
    "worst group": lambda row: _interval(row, "worst_group_rate", 3),
    "biased epochs": lambda row: _interval(row, "biased_epochs", 1),
}
