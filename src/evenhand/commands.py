"""The commands: fields are the options and their docs the help; ``run`` calls and shows."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from tyro.conf import Positional

from evenhand import detector_io, files, guidance, issues, show
from evenhand.detector import Detector
from evenhand.errors import InputError, unknown
from evenhand.experiments import demos, measure, reproduce, tables
from evenhand.experiments.pool import run_all
from evenhand.interactions import Interactions
from evenhand.judgements import ISSUES, SOURCES
from evenhand.learn import run, train
from evenhand.learn.runtime import set_up_jax
from evenhand.people import DISCRIMINATION


@dataclass(frozen=True)
class Reproduce(reproduce.ReproduceSettings):
    """Run the paper's whole experiment and write its report.

    Scripted robots serve, simulated respondents judge them, the detector is fitted, REINFORCE and
    PPO are trained with and without guidance, every robot is tested on people it never saw, and
    the report sets what came out beside what the paper printed. Interrupted, it goes on where it
    was.
    """

    def run(self, command: str) -> int:
        """Run it and print the path of the report."""
        with show.stages() as stage:
            page = reproduce.reproduce(self, stage, command)
        print(page)
        return 0


@dataclass(frozen=True)
class Train:
    """Train one robot in a run folder.

    The folder keeps settings, versions, every epoch, every service, and checkpoints. The same
    command on the same folder goes on where it was, bit for bit.
    """

    out: Path
    """Folder of the run."""

    preset: Literal["paper", "service"] = "service"
    """paper: the reward is Eq. 4/5 alone. service: service quality plus Eq. 4/5."""

    algorithm: Literal["reinforce", "ppo"] = "ppo"
    """How the policy learns."""

    guidance: Literal["none", "score", "penalty"] = "penalty"
    """none; score (Eq. 4); penalty (Eq. 4 and 5)."""

    credit: Literal["own_groups", "epoch"] = "own_groups"
    """Whose disparity a person's reward counts: of the own groups, or of all, alike for all."""

    tau: str = "equal"
    """Weights of willingness, quality, priority, risk: equal, risk_first, willingness_first,
    risk_then_willingness, or four numbers as 1,1,1,2."""

    penalty: float = 0.5
    """Lambda of Eq. 5."""

    seed: int = 0
    """Of everything random in the run."""

    epochs: int = 300
    """Updates; one epoch is 30 services."""

    people: int = 30
    """Services in one epoch."""

    population: str = "uniform"
    """Where people are drawn from: uniform, us, fairface."""

    detector: Path | None = None
    """Detector file; the one fitted to simulated respondents that comes with Evenhand if none."""

    def run(self, command: str) -> int:
        """Train and print where the run is."""
        set_up_jax()
        base = train.preset(
            self.preset,
            self.algorithm,
            True,
            seed=self.seed,
            epochs=self.epochs,
            population=self.population,
        )
        settings = replace(
            base,
            people=self.people,
            guidance=guidance.GuidanceSettings(
                self.guidance, self.credit, parse_tau(self.tau), self.penalty
            ),
        )
        judge = load_detector(self.detector)
        with show.stages() as stage:
            tell = stage(f"{self.algorithm}, seed {self.seed}", self.epochs * self.people)
            run.execute(self.out, settings, judge, progress=lambda n: tell(n["services"], n))
        print(self.out)
        return 0


@dataclass(frozen=True)
class Evaluate:
    """Test a trained robot, or a scripted one, on people it never saw."""

    run_folder: Positional[Path | None] = None
    """Folder of a run of `evenhand train` or `evenhand reproduce`."""

    robot: str | None = None
    """Instead of a run: even, racist, sexist, ageist or ableist."""

    strength: float = 1.0
    """Of the scripted robot's bias, 0 to 1."""

    services: int = 3000
    """How many people are served."""

    seed: int = reproduce.TEST_SEED
    """Of people, places and chances."""

    population: str = "uniform"
    """Where the scripted robot's people are drawn from."""

    out: Path | None = None
    """Write the services to this Parquet or CSV file."""

    json: bool = False
    """Print JSON instead of a table."""

    def run(self, command: str) -> int:
        """Serve, measure, print."""
        if (self.run_folder is None) == (self.robot is None):
            raise InputError("name either the folder of a run or a scripted robot with --robot")
        if self.services < measure.WINDOW:
            raise InputError(f"services is {self.services}: give at least {measure.WINDOW}")
        if self.seed < 0:
            raise InputError(f"seed is {self.seed}: give 0 or a positive whole number")
        table = self._serve()
        if self.out is not None:
            write_services(table, self.out)
        found = measure.summary(table, self.seed)
        if self.json:
            print(json.dumps(found))
        else:
            who = self.robot or str(self.run_folder)
            title = f"{who}: {self.services} services, seed {self.seed}"
            show.table(title, ("measure", "value"), list(found.items()))
        return 0

    def _serve(self) -> Interactions:
        if self.run_folder is not None:
            set_up_jax()
            settings, state = run.load_policy(self.run_folder)
            return measure.serve_policy(state, settings, self.services, self.seed)
        return measure.serve_scripted(
            str(self.robot), self.strength, self.population, self.services, self.seed
        )


@dataclass(frozen=True)
class Demos:
    """Let scripted robots serve, and simulated respondents judge what they did.

    Writes the services (Parquet), the judgements (judgements.csv, which `evenhand detect fit`
    takes), the issue scores of every discrimination (signatures.csv), behaviour and questionnaire.
    """

    out: Path
    """Folder of the tables."""

    windows: int = 1000
    """Windows of 30 services."""

    seed: int = reproduce.DEMO_SEED
    """Of everything random."""

    population: str = "uniform"
    """Where people are drawn from: uniform, us, fairface."""

    workers: int = reproduce.ReproduceSettings.workers
    """Processes that work at the same time."""

    def run(self, command: str) -> int:
        """Serve, judge, write, and print the signatures."""
        if self.windows < 100:
            raise InputError(f"windows is {self.windows}: give at least 100")
        out = files.make_folder(self.out)
        fixed = {"windows": self.windows, "seed": self.seed, "population": self.population}
        with files.locked(out):
            files.claim_folder(out, "demonstrations.json", fixed)
            folder = files.make_folder(out / "services")
            with show.stages() as stage:
                tell = stage("demonstrations", self.windows * measure.WINDOW)
                work = demos.tasks(self.windows, self.seed, self.population, folder)
                run_all(work, self.workers, tell)
            shown = demos.load(self.windows, self.seed, folder)
            study = demos.study(shown, self.seed)
            named, worst = tables.questionnaire(study)
            signatures = tables.signatures(shown)
            for name, rows in (
                ("judgements", tables.judgements(shown, study)),
                ("signatures", signatures),
                ("behaviour", tables.behaviour(shown)),
                ("questionnaire", named),
                ("questionnaire_issue", worst),
            ):
                tables.write(out / f"{name}.csv", rows)
        show.table(
            "Mean issue scores at full strength (simulated)",
            ("discrimination", "issue", "paper", "ours", "from", "to"),
            [
                [row[k] for k in ("discrimination", "issue", "paper", "ours", "ci_low", "ci_high")]
                for row in signatures
            ],
        )
        print(out)
        return 0


@dataclass(frozen=True)
class DetectFit:
    """Fit the detector to a table of judgements.

    The table has the columns willingness, quality, priority, risk (issue scores, 0 to 1), biased
    (yes or no) and, if known, discrimination and respondent.
    """

    answers: Path
    """CSV file of judgements, of people or from `evenhand demos`."""

    out: Path
    """Where the detector goes (JSON)."""

    source: str = "respondents"
    """Who answered: "respondents", or "simulated respondents"."""

    seed: int = 0
    """Of the folds in which accuracy is measured."""

    def run(self, command: str) -> int:
        """Fit, measure out of fold, save, print."""
        from evenhand import detector, detector_report

        if self.source not in SOURCES:
            raise unknown("source", self.source, SOURCES)
        found = detector_io.read_answers(self.answers)
        fitted = detector.fit(
            found.issue_scores, found.biased, found.kinds, source=self.source, seed=self.seed
        )
        evaluation = detector_report.evaluate(
            found.issue_scores,
            found.biased,
            found.kinds,
            source=self.source,
            seed=self.seed,
            groups=None if found.respondents is None else list(found.respondents),
        )
        detector_io.save(fitted, self.out)
        show.table(
            f"Detector fitted to {evaluation.n} judgements of {self.source}, out of fold",
            ("measure", "value", "from", "to"),
            [
                [name, share.value, share.low, share.high]
                for name, share in (
                    ("accuracy", evaluation.accuracy),
                    ("agreement with threshold 0.5", evaluation.agreement),
                    ("accuracy of the threshold", evaluation.manual_accuracy),
                )
            ],
        )
        print(self.out)
        return 0


@dataclass(frozen=True)
class DetectJudge:
    """Judge services or issue scores: biased or not, and which discrimination it looks like."""

    services: Positional[Path | None] = None
    """Parquet or CSV file of services, scored as one window."""

    scores: tuple[float, float, float, float] | None = None
    """Instead of a file: issue scores of willingness, quality, priority, risk."""

    detector: Path | None = None
    """Detector file; the one that comes with Evenhand if none."""

    identities: tuple[str, ...] = ()
    """Identity columns of a CSV file; those of the restaurant if none."""

    json: bool = False
    """Print JSON instead of a table."""

    def run(self, command: str) -> int:
        """Judge and print."""
        if (self.services is None) == (self.scores is None):
            raise InputError("name either a file of services or four numbers with --scores")
        judge = load_detector(self.detector)
        if self.scores is not None:
            vectors = {"scores": np.array(self.scores)}
        else:
            table = read_services(Path(str(self.services)), self.identities)
            vectors = dict(issues.score(table).by_identity)
        rows = []
        for name, vector in vectors.items():
            if np.isnan(vector).all():
                rows.append([name, *([None] * 7)])
                continue
            probability = float(judge.probability(vector))
            looks = judge.looks_like(vector)
            like = judge.kinds[int(looks.argmax())] if len(looks) else None
            scores = [None if np.isnan(x) else float(x) for x in vector]
            rows.append([name, *scores, probability, bool(judge.judge(vector)), like])
        columns = ("of", *ISSUES, "probability", "biased", "looks like")
        if self.json:
            print(json.dumps([dict(zip(columns, row, strict=True)) for row in rows]))
        else:
            show.table(f"Judged by a detector fitted to {judge.source}", columns, rows)
        return 0


@dataclass(frozen=True)
class Bench:
    """Measure speed, side by side in one run.

    Ratios are against a bare mj_step loop over the same model and the same drives, and against
    Gymnasium's SyncVectorEnv over the single environment.
    """

    json: bool = False
    """Print JSON instead of a table."""

    seconds: float = 3.0
    """Length of one measurement; each is taken five times, taking turns."""

    def run(self, command: str) -> int:
        """Measure and print."""
        from evenhand import bench

        set_up_jax()
        found = bench.measure(self.seconds)
        if self.json:
            print(json.dumps(found))
        else:
            bench.show(found)
        return 0


def load_detector(path: Path | None) -> Detector:
    """A detector from a file, or the one that comes with Evenhand."""
    return detector_io.load(path if path is not None else detector_io.SHIPPED)


def parse_tau(text: str) -> tuple[float, float, float, float]:
    """Weights of the issues from a preset's name or four numbers.

    Raises:
        InputError: for an unknown preset or numbers that are no weights.
    """
    if text in guidance.TAU:
        return guidance.TAU[text]
    try:
        a, b, c, d = (float(part) for part in text.split(","))
    except ValueError:
        raise unknown("tau", text, [*guidance.TAU, "four numbers as 1,1,1,2"]) from None
    guidance.check_tau((a, b, c, d))
    return (a, b, c, d)


def read_services(path: Path, identities: tuple[str, ...]) -> Interactions:
    """Services from a Parquet or CSV file."""
    if path.suffix == ".parquet":
        return Interactions.read_parquet(path)
    if path.suffix == ".csv":
        return Interactions.read_csv(path, identities or tuple(DISCRIMINATION))
    raise InputError(f"{path} is neither .parquet nor .csv")


def write_services(table: Interactions, path: Path) -> None:
    """Services to a Parquet or CSV file."""
    if path.suffix == ".parquet":
        table.write_parquet(path)
    elif path.suffix == ".csv":
        table.write_csv(path)
    else:
        raise InputError(f"{path} is neither .parquet nor .csv: choose one of these endings")
