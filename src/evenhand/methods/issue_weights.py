"""What people mind, as weights of the issues: from their answers, or from a detector.

A logistic regression of the answers on all standardised issue scores, without the detector's
principal components: three of these throw away the direction closeness against ignoring. With
slopes β of standardised scores, b = β / scale, and

    τ_k = K max(0, b_k) / Σ_j max(0, b_j),

so that the weights of K issues add up to K. Where the answers say nothing (all alike, or no slope
by a likelihood-ratio test) every weight is 0: nobody minds, and nothing is paid for evenness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2

from evenhand.core.errors import InputError
from evenhand.methods import asked, detector_file
from evenhand.methods.judgements import checked_judgements, checked_scores
from evenhand.methods.paper.detector import Detector, complete
from evenhand.methods.paper.issues import Issue
from evenhand.methods.vocabulary import ISSUES, SOURCES

LEVEL = 0.01
"""Above this p-value of the likelihood-ratio test, answers do not depend on the scores."""


@dataclass(frozen=True)
class IssueWeights:
    """Weights of K issues, as people judge them.

    Attributes:
        issues: their names.
        tau: weights, at least 0; their sum is K, or 0 where people mind nothing.
        slopes: b, change of the log-odds of "biased" with each issue score.
        p: of the likelihood-ratio test; None without one (answers all alike, or a detector).
        rows: judgements behind them.
        source: who judged: "simulated respondents" or "respondents".
    """

    issues: tuple[str, ...]
    tau: tuple[float, ...]
    slopes: tuple[float, ...]
    p: float | None
    rows: int
    source: str

    def of(self, issues: Sequence[Issue]) -> tuple[Issue, ...]:
        """The issues that are weighed, in their order, in a world that has these.

        Raises:
            InputError: when the world has other issues than people were asked about.
        """
        known = {one.name: one for one in asked.with_distance(issues)}
        names = [one.name for one in issues]
        if {*self.issues} not in ({*names}, {one.name for one in asked.split(issues)}):
            raise InputError(
                "conflict judges",
                f"people were asked about {', '.join(self.issues)}, and the issues here are "
                f"{', '.join(names)}: ask about these, or leave the judges out",
            )
        return tuple(known[name] for name in self.issues)


def fit(
    issue_scores: ArrayLike, biased: ArrayLike, *, source: str, issues: Sequence[str] = ISSUES
) -> IssueWeights:
    """Weights from judgements.

    Args:
        issue_scores: I of the judged identity in each judged window, [n, K].
        biased: whether it was called biased, [n].
        source: who judged.
        issues: names of the K issues.

    Raises:
        InputError: for impossible judgements, or answers that are nowhere the more "biased" the
            greater a score.
    """
    from sklearn.linear_model import LogisticRegression

    names = tuple(issues)
    scores, y = checked_scores(issue_scores, names), np.asarray(biased)
    alike = y.ndim == 1 and len(y) > 0 and (y == y[0]).all()
    if alike and np.isin(y[0], (0, 1)):
        nothing = (0.0,) * len(names)
        return IssueWeights(names, nothing, nothing, None, len(y), source)
    scores, y, _ = checked_judgements(scores, y, None, names)
    scale = scores.std(axis=0)
    varies = scale > 0
    standard = (scores - scores.mean(axis=0)) / np.where(varies, scale, 1.0)
    p = _likelihood_ratio(standard[:, varies], y)
    if not p <= LEVEL:
        nothing = (0.0,) * len(names)
        return IssueWeights(names, nothing, nothing, p, len(y), source)
    found = LogisticRegression(max_iter=1000).fit(standard, y)
    slopes = np.where(varies, found.coef_[0] / np.where(varies, scale, 1.0), 0.0)
    return IssueWeights(names, _weights(slopes), _numbers(slopes), p, len(y), source)


def of_detector(detector: Detector) -> IssueWeights:
    """Weights by the direction of a detector.

    Raises:
        InputError: when no score makes it more likely to say "biased".
    """
    slopes = np.array(detector.weights) @ np.array(detector.components) / np.array(detector.scale)
    return IssueWeights(
        detector.issues, _weights(slopes), _numbers(slopes), None, detector.rows, detector.source
    )


def read(path: str | Path, source: str = SOURCES[1]) -> IssueWeights:
    """Weights from a file of answers (CSV) or of a detector (JSON).

    The answers are about the paper's four issues, or about five: ``too_near`` and ``too_far`` in
    place of ``quality``.

    Args:
        path: of the file.
        source: who answered; a detector says so itself.

    Raises:
        InputError: when it is neither, or cannot be used.
    """
    file = Path(path)
    if file.suffix.lower() == ".json":
        detector = detector_file.load(file)
        try:
            return of_detector(detector)
        except InputError as error:
            raise error.at(f"detector file {file}") from error
    names = asked.ASKED if asked.asks_for_distance(_header(file)) else ISSUES
    found = detector_file.read_answers(file, issues=names, missing=True)
    whole = complete(found.issue_scores)
    try:
        return fit(found.issue_scores[whole], found.biased[whole], source=source, issues=names)
    except InputError as error:
        raise error.at(f"answers file {file}") from error


def _header(file: Path) -> list[str]:
    try:
        with file.open(encoding="utf-8-sig") as lines:
            return [name.strip().lower() for name in lines.readline().split(",")]
    except (OSError, UnicodeDecodeError):
        return []  # the reader says what is wrong


def _likelihood_ratio(standard: np.ndarray, y: np.ndarray) -> float:
    """p-value of no slope at all, from fits without a penalty."""
    from sklearn.linear_model import LogisticRegression

    n, columns = standard.shape
    if not columns:
        return 1.0
    share = y.mean()
    none = n * (share * np.log(share) + (1 - share) * np.log(1 - share))
    # so weak a penalty changes no digit that counts, and answers that can be told apart stay finite
    found = LogisticRegression(C=1e6, max_iter=10_000).fit(standard, y)
    logit = standard @ found.coef_[0] + found.intercept_[0]
    best = -np.logaddexp(0.0, np.where(y, -logit, logit)).sum()
    return float(chi2.sf(max(0.0, 2.0 * (best - none)), columns))


def _weights(slopes: np.ndarray) -> tuple[float, ...]:
    up = np.maximum(slopes, 0.0)
    if not up.sum() > 0:
        raise InputError(
            "conflict judges",
            "by these judgements a robot is the less biased the greater any of its issue scores: "
            "check the column biased, or leave the judges out",
        )
    return _numbers(len(up) * up / up.sum())


def _numbers(row: np.ndarray) -> tuple[float, ...]:
    return tuple(float(x) for x in row)
