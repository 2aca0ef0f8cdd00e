"""``evenhand detect fit`` and ``evenhand detect judge``."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from tyro.conf import Positional, arg

from evenhand.cli import inputs
from evenhand.cli.inputs import OPTIONAL
from evenhand.core.errors import InputError, unknown, whole
from evenhand.experiments.settings import SEEDS
from evenhand.methods.vocabulary import ISSUES, SIMULATED, SOURCES

if TYPE_CHECKING:
    from evenhand.methods.paper.detector import Detector


@dataclass(frozen=True)
class DetectFit:
    """Fit the detector to a table of judgements.

    A row is a judged window. It needs the columns willingness, quality, priority and risk (issue
    scores, 0 to 1) and biased (yes or no). If there is a column discrimination (racism, sexism,
    ageism, ableism), the detector learns to tell them apart; if there is a column respondent,
    accuracy is measured on people it never saw.

    For instance: evenhand detect fit --answers answers.csv --out detector.json
    """

    answers: Annotated[Path, arg(metavar="FILE")]
    """CSV file of judgements: of people, or judgements.csv from `evenhand demos`."""

    out: Annotated[Path, arg(metavar="FILE")]
    """Where the detector goes (JSON); `evenhand train --detector` takes it."""

    source: Annotated[str, arg(metavar="WHO")] = "respondents"
    """Who answered: "respondents", or "simulated respondents"; shown wherever it is used."""

    seed: int = 0
    """Of the five folds in which accuracy is measured."""

    def run(self, command: str) -> int:
        """Fit, measure out of fold, save, print."""
        if self.source not in SOURCES:
            raise unknown("source", self.source, SOURCES)
        whole("seed", self.seed, *SEEDS)
        inputs.check_target(self.out)
        from evenhand.core import terminal
        from evenhand.methods import detector_file
        from evenhand.methods.paper import detector
        from evenhand.statistics import detector_accuracy

        found = detector_file.read_answers(self.answers, missing=self.source == SIMULATED)
        # as in the simulated study: a window with a score that Eq. 1 cannot say is left out
        kept = detector.complete(found.issue_scores)
        scores, biased = found.issue_scores[kept], found.biased[kept]
        kinds = [kind for kind, keep in zip(found.kinds, kept, strict=True) if keep]
        asked = found.respondents
        groups = None if asked is None else np.array(asked)[kept]
        try:
            fitted = detector.fit(scores, biased, kinds, source=self.source, seed=self.seed)
            evaluation = detector_accuracy.evaluate(
                scores,
                biased,
                kinds,
                source=self.source,
                seed=self.seed,
                groups=groups,
            )
        except InputError as error:
            raise error.at(f"answers file {self.answers}") from error
        detector_file.save(fitted, self.out)
        terminal.table(
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
        shipped = inputs.load_detector(None)
        alike = float((fitted.judge(scores) == shipped.judge(scores)).mean())
        if alike < AGREEMENT:
            print(
                f"warning: it judges {100 * (1 - alike):.0f} % of these windows otherwise than the "
                "detector that comes with Evenhand; check the column biased",
                file=sys.stderr,
            )
        print(self.out)
        return 0


AGREEMENT = 0.8
"""Below this share of windows a detector is said to disagree with the one that comes along."""


@dataclass(frozen=True)
class DetectJudge:
    """Judge services or issue scores: biased or not, and which discrimination it looks like.

    For instance: evenhand detect judge out/run/services/000000-000050.parquet, or:
    evenhand detect judge --scores 0.5 0.2 0.4 0.4
    """

    services: Annotated[
        Positional[Path | None], arg(metavar="FILE", help_behavior_hint=OPTIONAL)
    ] = None
    """Parquet or CSV file of services; all of them are scored as one window."""

    scores: Annotated[
        tuple[float, float, float, float] | None,
        arg(metavar="WILLINGNESS QUALITY PRIORITY RISK", help_behavior_hint=OPTIONAL),
    ] = None
    """Instead of a file: four issue scores."""

    detector: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint=OPTIONAL)] = None
    """Detector file; the one that comes with Evenhand if none."""

    identities: Annotated[
        tuple[str, ...], arg(metavar="NAME ...", help_behavior_hint=OPTIONAL)
    ] = ()
    """Which columns of a CSV file are identities; race, gender, age, disability, skin if none."""

    json: bool = False
    """Print JSON instead of a table."""

    def run(self, command: str) -> int:
        """Judge and print."""
        if (self.services is None) == (self.scores is None):
            raise InputError(
                "conflict scores", "name either a file of services or four numbers with --scores"
            )
        from evenhand.core import terminal
        from evenhand.methods.paper.scores import score

        judge = inputs.load_detector(self.detector)
        if self.scores is not None:
            vectors = {"scores": np.array(self.scores)}
        else:
            path = Path(str(self.services))
            table = inputs.read_services(path, self.identities)
            try:
                vectors = dict(score(table).by_identity)
            except InputError as error:
                raise error.at(path) from error
        columns = ("of", *ISSUES, "probability", "biased", "looks like")
        rows = [_judged(name, vector, judge) for name, vector in vectors.items()]
        if self.json:
            print(json.dumps([dict(zip(columns, row, strict=True)) for row in rows]))
        else:
            shown = [[*row[:-1], row[-1] or ("none" if row[-2] is False else None)] for row in rows]
            terminal.table(f"Judged by a detector fitted to {judge.source}", columns, shown)
        return 0


def _judged(name: str, vector: np.ndarray, judge: Detector) -> list[Any]:
    """One row: what was judged, its scores, and the verdict; None where nothing is known."""
    scores = [None if np.isnan(x) else float(x) for x in vector]
    if np.isnan(vector).all():
        return [name, *scores, None, None, None]
    biased, looks = bool(judge.judge(vector)), judge.looks_like(vector)
    # what it looks like is said of biased vectors only
    like = judge.kinds[int(looks.argmax())] if biased and len(looks) else None
    return [name, *scores, float(judge.probability(vector)), biased, like]
