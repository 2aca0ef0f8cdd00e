"""``evenhand reproduce``."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from evenhand.cli import inputs
from evenhand.experiments.settings import ReproduceSettings


@dataclass(frozen=True)
class Reproduce:
    """Run the paper's whole experiment and write its report.

    Scripted robots serve, simulated respondents judge them, the detector is fitted, REINFORCE and
    PPO are trained with and without guidance, every robot is tested on people it never saw, and
    the report sets what came out beside what the paper printed.

    Stop it with Ctrl-C whenever you like: the same command goes on where it was. More seeds or
    another preset can be added to the same folder later, with the same versions of Evenhand and
    its libraries; what is there stays.

    A quick look, about a minute: evenhand reproduce --seeds 2 --epochs 40 --windows 200
    """

    out: Path = ReproduceSettings.out
    """Folder of report.html, claims.json, results.csv and of everything behind them."""

    preset: Annotated[
        tuple[Literal["paper", "service", "prejudiced"], ...],
        arg(metavar="paper|service|prejudiced ..."),
    ] = ReproduceSettings.preset  # type: ignore[assignment]
    """Rewards to train on, one or both.
    paper: Eq. 4/5 and nothing else.
    service: service quality plus Eq. 4/5."""

    seeds: int = ReproduceSettings.seeds
    """Runs of every arm, with seeds 0, 1, 2 ...; intervals need two or more."""

    epochs: int = ReproduceSettings.epochs
    """Updates of every run, 30 services each; the paper has 300."""

    workers: int = ReproduceSettings.workers
    """Processes that work at the same time; results do not depend on it."""

    population: Annotated[str, arg(metavar="uniform|us|fairface")] = ReproduceSettings.population
    """Where people are drawn from: all categories alike, or published shares."""

    windows: int = ReproduceSettings.windows
    """Windows of 30 services by scripted robots that simulated respondents judge."""

    services: int = ReproduceSettings.services
    """Services in the test of every trained robot."""

    def run(self, command: str) -> int:
        """Run it and print the path of the report."""
        settings = ReproduceSettings(**(asdict(self)))
        inputs.load_physics("train")
        from evenhand.core import terminal
        from evenhand.experiments.paper import reproduce

        with terminal.stages() as stage:
            page = reproduce.reproduce(settings, stage, command)
        print(page)
        return 0
