"""``evenhand study analyse``, ``fit`` and ``simulate``."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from evenhand.cli import inputs
from evenhand.cli.inputs import OPTIONAL
from evenhand.core import extras, files
from evenhand.core.errors import InputError, whole

if TYPE_CHECKING:
    from evenhand.study.analysis.fit_detector import Fitted
    from evenhand.study.design.protocol import Protocol

_SEEDS = (0, 2**63 - 1)


@dataclass(frozen=True)
class StudyAnalyse:
    """Analyse the answers of a study, and write a report.

    Ratings and what was named with intervals, scenarios against even controls, agreement, order,
    pairs, how far participants came, and how carefully they answered. People and simulated
    participants are never mixed. The folder then holds report.html, its figures, every table as
    CSV, and the codebook.

    For instance: evenhand study analyse answers.csv --protocol study.toml
    """

    answers: Annotated[Positional[Path], arg(metavar="ANSWERS")]
    """File of `evenhand study export` or `simulate`: .csv, .json or .parquet."""

    protocol: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint=OPTIONAL)] = None
    """TOML file of the study; without it, controls and the middle of scales are not known."""

    out: Annotated[Path, arg(metavar="FOLDER")] = Path("study-report")
    """Where report, figures and tables go."""

    exclude_flagged: bool = False
    """Leave out participants with a flag; they are counted, and results shown both ways."""

    permutations: int = 1999
    """Exchanges of ratings within participants, at most."""

    seed: int = 0
    """Of these, and of the bootstrap."""

    def run(self, command: str) -> int:
        """Analyse, write, print."""
        whole("permutations", self.permutations, 99, 100_000)
        whole("seed", self.seed, *_SEEDS)
        from evenhand.core import terminal
        from evenhand.study.analysis import analyse, answers, check_answers, page
        from evenhand.study.design import clip_lengths

        found = answers.read(self.answers)
        study = None if self.protocol is None else _protocol(self.protocol)
        if study is not None:
            check_answers.check_codebook(self.answers, study)
        settings = analyse.Settings(
            seed=self.seed, permutations=self.permutations, exclude_flagged=self.exclude_flagged
        )
        times = clip_lengths.of_study(study) if study is not None else {}
        try:
            made = analyse.analyse(found, study, settings, times)
        except InputError as error:
            raise error.at(self.answers) from error
        source = page.Source(self.answers.name, command, date.today().isoformat())
        target = page.write(made, found, source, self.out)
        terminal.table(
            "Answers",
            ("of", "finished", "begun", "flagged", "in the results"),
            [
                (part.label.lower(), part.statuses["finished"], part.statuses["begun"],
                 part.flagged, part.used)
                for part in made.parts
            ],
        )  # fmt: skip
        if made.strange:
            print(f"note: {check_answers.told(made.strange)}", file=sys.stderr)
        for part in made.parts:
            print("\n".join(page.sentences(part, made)))
        print(target)
        return 0


@dataclass(frozen=True)
class StudyFit:
    """Fit the detector to the answers of a study; `train --detector` takes it.

    A judgement is a participant's rating of a set: biased if it lies on the unfair side of the
    scale's middle. The study's file has to state the issue scores of the robots behind the clips.
    Accuracy is measured on participants that the detector never saw, and on sets that it never
    saw. A detector of any simulated answer says so wherever it is used.

    For instance: evenhand study fit answers.csv --protocol study.toml --out detector.json
    """

    answers: Annotated[Positional[Path], arg(metavar="ANSWERS")]
    """File of `evenhand study export` or `simulate`: .csv, .json or .parquet."""

    protocol: Annotated[Path, arg(metavar="FILE")]
    """TOML file of the study."""

    out: Annotated[Path, arg(metavar="FILE")]
    """Where the detector goes (JSON)."""

    who: Annotated[
        Literal["people", "simulated", "both"] | None,
        arg(metavar="people|simulated|both", help_behavior_hint="(whoever there is)"),
    ] = None
    """Whose answers; has to be said when there are both."""

    exclude_flagged: bool = False
    """Leave out participants with a flag."""

    seed: int = 0
    """Of the folds in which accuracy is measured."""

    def run(self, command: str) -> int:
        """Fit, measure, save, print."""
        whole("seed", self.seed, 0, 2**32 - 1)
        inputs.check_target(self.out)
        from evenhand.methods import detector_file
        from evenhand.study.analysis import answers, check_answers, fit_detector, quality
        from evenhand.study.design import clip_lengths

        study = _protocol(self.protocol)
        check_answers.check_codebook(self.answers, study)
        try:
            found = fit_detector.chosen(answers.read(self.answers), self.who)
            if self.exclude_flagged:
                kept, gone = quality.unflagged(found, study, clip_lengths.of_study(study))
                print(f"note: {gone} flagged participants are left out", file=sys.stderr)
                found = kept
            strange = check_answers.told(check_answers.strangers(found, study))
            fitted = fit_detector.fit(found, study, self.seed)
        except InputError as error:
            told = str(error)
            named = told if str(self.answers) in told else f"{self.answers}: {told}"
            raise InputError(error.args[0], named) from error
        detector_file.save(fitted.detector, self.out)
        if strange:
            print(f"note: {strange}", file=sys.stderr)
        _show(fitted)
        print(self.out)
        return 0


@dataclass(frozen=True)
class StudySimulate:
    """Let simulated participants take a study: into a file, or through a running server.

    They judge by the scores that the study's file states; some leave, some do not care. It is for
    trying out a study and what comes after it. Their answers are marked as simulated for ever.

    For instance: evenhand study simulate --protocol study.toml --out trial.csv, or:
    evenhand study simulate --protocol study.toml --url http://127.0.0.1:8000 --pages
    """

    respondents: int = 24
    """How many; the paper had 24."""

    protocol: Annotated[
        Path | None, arg(metavar="FILE", help_behavior_hint="(the paper's study)")
    ] = None
    """TOML file of the study; the paper's if none."""

    out: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint=OPTIONAL)] = None
    """File to write: .csv, .json or .parquet."""

    url: Annotated[str | None, arg(metavar="URL", help_behavior_hint=OPTIONAL)] = None
    """Instead: a server that was started with --allow-simulated."""

    pages: bool = False
    """With --url: through the real pages, in a Chromium without a window."""

    seed: int = 0
    """Of everything random."""

    def run(self, command: str) -> int:
        """Simulate, and write or send."""
        whole("seed", self.seed, *_SEEDS)
        if (self.out is None) == (self.url is None):
            raise InputError("conflict out", "name either a file with --out or a server with --url")
        if self.pages and self.url is None:
            raise InputError("missing url", "--pages needs a server: name it with --url")
        if self.pages:
            extras.require("pages", "--pages")
        from evenhand.study.analysis import answers
        from evenhand.study.design import protocol_file
        from evenhand.study.simulated import in_browser, over_http, participants

        whole("respondents", self.respondents, 1, participants.MOST)
        study = _protocol(self.protocol or protocol_file.PAPER)
        if self.url is not None:
            from evenhand.core import terminal

            with terminal.stages() as stage:
                advance = stage("simulated participants", self.respondents)
                finished = (in_browser if self.pages else over_http).take(
                    over_http.Server(self.url),
                    study,
                    self.respondents,
                    self.seed,
                    tell=lambda done: advance(done, {}),
                )
            print(f"{finished} of {self.respondents} simulated participants finished at {self.url}")
            return 0
        assert self.out is not None
        answers.check_ending(self.out)
        files.make_folder(self.out.parent)
        made = participants.answers(study, self.respondents, self.seed)
        answers.write(made, self.out)
        print(f"{len(made):,} answers of {self.respondents} simulated participants")
        print(self.out)
        return 0


def _protocol(path: Path) -> Protocol:
    """A study, whether its clips are at hand or not."""
    from evenhand.study.design import protocol_file

    found, wrong = protocol_file.examine(path, look=False)
    if found is None:
        more = f" ({len(wrong)} mistakes: see `evenhand study check {path}`)"
        raise InputError("format file", f"{path}, {wrong[0]}" + (more if len(wrong) > 1 else ""))
    return found


def _show(fitted: Fitted) -> None:
    from evenhand.core import terminal

    data = fitted.judgements
    if data.left_out:
        print(f"note: {data.left_out} judgements of sets without scores are left out",
              file=sys.stderr)  # fmt: skip
    for one in fitted.held_out:
        if one.why_not:
            print(f"note: accuracy on new {one.over} cannot be told: {one.why_not}",
                  file=sys.stderr)  # fmt: skip
        elif one.accuracy <= fitted.baseline:
            print(
                f"note: on {one.over} it never saw the detector does no better than always giving "
                "the more frequent answer: the sets differ too little in their scores, or are too "
                "few",
                file=sys.stderr,
            )
    rows = [
        [f"accuracy on {one.over} it never saw", one.accuracy, one.low, one.high, one.groups]
        for one in fitted.held_out
    ]
    shipped = fitted.shipped
    terminal.table(
        f"Detector fitted to {len(data.biased):,} judgements of {data.source}",
        ("measure", "value", "from", "to", "of"),
        [
            *rows,
            ["accuracy of the more frequent answer", fitted.baseline, None, None, len(data.biased)],
            ["accuracy of the simulated detector", shipped.value, shipped.low, shipped.high,
             shipped.n],
            ["sets on which both agree", fitted.alike.value, fitted.alike.low, fitted.alike.high,
             fitted.alike.n],
        ],
    )  # fmt: skip
