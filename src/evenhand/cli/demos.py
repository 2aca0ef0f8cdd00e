"""``evenhand demos``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from evenhand.cli import inputs
from evenhand.core import files
from evenhand.core.errors import InputError, whole
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

    manners: bool = False
    """Vary one manner at a time (far, near, close, late, ignore) instead of the paper's robots, so
    that answers can tell what people mind. The folder then holds judgements.csv with too_near and
    too_far in place of quality, for `evenhand train --judges`."""

    minds: Annotated[
        tuple[str, ...] | None, arg(metavar="ISSUE ...", help_behavior_hint="(optional)")
    ] = None
    """With --manners: what the simulated people mind, of willingness, too_near, too_far, priority
    and risk; all of them by default. `--minds` with nothing after it: nobody minds anything."""

    workers: int = CORES
    """Processes that work at the same time; results do not depend on it."""

    def run(self, command: str) -> int:
        """Serve, judge, write, and print the signatures."""
        whole("windows", self.windows, *WINDOWS)
        whole("seed", self.seed, *SEEDS)
        whole("workers", self.workers, *WORKERS)
        people.population(self.population)
        if self.minds is not None and not self.manners:
            raise InputError(
                "conflict minds",
                "--minds chooses what people mind of single manners: add --manners",
            )
        inputs.load_physics()
        if self.manners:
            return self._manners()
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

    def _manners(self) -> int:
        """Serve windows of one manner each, let a crowd judge them, and print what it minds."""
        from evenhand.core import terminal
        from evenhand.experiments import tastes
        from evenhand.methods import issue_weights
        from evenhand.methods.paper.detector import complete
        from evenhand.methods.vocabulary import SIMULATED
        from evenhand.report import table

        minds = tastes.MINDED if self.minds is None else self.minds
        tastes.check(minds)
        out = files.make_folder(self.out)
        fixed = {
            "windows": self.windows, "seed": self.seed, "population": self.population,
            "manners": True, "minds": list(minds),
        }  # fmt: skip
        with files.locked(out):
            files.claim_folder(out, "demonstrations.json", fixed)
            seen = tastes.serve(self.windows, self.seed, self.population)
            biased = tastes.judge(seen, minds, self.seed)
            table.write(out / "judgements.csv", tastes.judgements(seen, biased))
        whole = complete(seen.scores)
        found = issue_weights.fit(
            seen.scores[whole], biased[whole], source=SIMULATED, issues=tastes.MINDED
        )
        terminal.table(
            f"Weights of the issues by {found.rows} judgements of {SIMULATED}",
            ("issue", "minded", "weight"),
            [
                [name, "yes" if name in minds else "no", weight]
                for name, weight in zip(found.issues, found.tau, strict=True)
            ],
        )
        print(out / "judgements.csv")
        return 0
