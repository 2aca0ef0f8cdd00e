"""``evenhand demos``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from evenhand.cli import inputs
from evenhand.core import files
from evenhand.core.errors import whole
from evenhand.core.processors import CORES
from evenhand.experiments.settings import DEMO_SEED, SEEDS, WINDOWS, WORKERS
from evenhand.restaurant import people


@dataclass(frozen=True)
class Demos:
    """Let scripted robots serve, and simulated respondents judge what they did.

    An even, a racist, an ageist and an ableist robot take turns. The folder then holds:
    - services/: the services, as Parquet
    - judgements.csv: what the respondents said of each window of 30
    - signatures.csv: the issue scores of every discrimination
    - behaviour.csv: how far, how late and how seldom each robot responds
    - questionnaire.csv, questionnaire_issue.csv: answers to the four scenarios

    Then: evenhand detect fit --answers FOLDER/judgements.csv --source "simulated respondents"
    """

    out: Annotated[Path, arg(metavar="FOLDER")]
    """Folder of the tables."""

    windows: int = 1000
    """Windows of 30 services; each is judged once."""

    seed: int = DEMO_SEED
    """Of everything random."""

    population: Annotated[str, arg(metavar="uniform|us|fairface")] = "uniform"
    """Where people are drawn from: all categories alike, or published shares."""

    workers: int = CORES
    """Processes that work at the same time; results do not depend on it."""

    def run(self, command: str) -> int:
        """Serve, judge, write, and print the signatures."""
        whole("windows", self.windows, *WINDOWS)
        whole("seed", self.seed, *SEEDS)
        whole("workers", self.workers, *WORKERS)
        people.population(self.population)
        inputs.load_physics()
        from evenhand.core import terminal
        from evenhand.core.processes import run_all
        from evenhand.experiments.paper import demonstrations, tables
        from evenhand.report import table
        from evenhand.training import evaluate

        out = files.make_folder(self.out)
        fixed = {"windows": self.windows, "seed": self.seed, "population": self.population}
        with files.locked(out):
            files.claim_folder(out, "demonstrations.json", fixed)
            folder = files.make_folder(out / "services")
            files.sweep(out)
            files.sweep(folder)
            with terminal.stages() as stage:
                tell = stage("demonstrations", self.windows * evaluate.WINDOW)
                work = demonstrations.tasks(self.windows, self.seed, self.population, folder)
                run_all(work, self.workers, tell)
            shown = demonstrations.load(self.windows, self.seed, folder)
            study = demonstrations.study(shown, self.seed)
            named, worst = tables.questionnaire(study)
            signatures = tables.signatures(shown)
            for name, rows in (
                ("judgements", tables.judgements(shown, study)),
                ("signatures", signatures),
                ("behaviour", tables.behaviour(shown)),
                ("questionnaire", named),
                ("questionnaire_issue", worst),
            ):
                table.write(out / f"{name}.csv", rows)
        terminal.table(
            "Mean issue scores at full strength (simulated)",
            ("discrimination", "issue", "paper", "ours", "from", "to"),
            [
                [row[k] for k in ("discrimination", "issue", "paper", "ours", "ci_low", "ci_high")]
                for row in signatures
            ],
        )
        print(out)
        return 0
