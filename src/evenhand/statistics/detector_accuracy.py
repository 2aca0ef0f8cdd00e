"""How good a detector is: out-of-fold accuracy, calibration, agreement, confusion.

Every number here is about judgements that the detector which judged them had not seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenhand.core.errors import InputError
from evenhand.methods.judgements import checked_judgements
from evenhand.methods.paper.detector import fit
from evenhand.methods.vocabulary import ISSUES, MANUAL_THRESHOLD

BINS = 10


@dataclass(frozen=True)
class Share:
    """A share ``count / n`` with its Wilson 95 % interval.

    Attributes:
        count: how many.
        n: of how many.
        value: count / n; NaN when n is 0, and so are the limits.
        low: lower limit.
        high: upper limit.
    """

    count: int
    n: int
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class CalibrationBin:
    """The judgements whose predicted probability lies in one tenth of [0, 1].

    Attributes:
        start: lower edge, included.
        stop: upper edge, excluded but in the last bin.
        predicted: mean predicted probability; NaN in an empty bin.
        observed: share that people judged biased.
    """

    start: float
    stop: float
    predicted: float
    observed: Share


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A detector's out-of-fold performance on n judgements.

    The intervals treat the n judgements as independent; the folds share training data, so they
    are somewhat too narrow.

    Attributes:
        source: where the judgements came from; "simulated respondents" are an assumption.
        n: number of judgements.
        folds: number of folds.
        accuracy: share of judgements that the detector gets right.
        baseline: share got right by always giving the more frequent answer.
        manual_accuracy: share that the manual threshold gets right.
        agreement: share in which detector and manual threshold agree (paper: 98 %).
        brier: mean squared difference of probability and answer.
        calibration: ten bins of predicted probability.
        kind_names: discriminations that people named, sorted.
        confusion: int64 [K, K], judgements with a named discrimination; rows what people
            named, columns what the detector finds most likely.
        probability: float64 [n], out-of-fold probability of each judgement.
        fold: int64 [n], the fold in which it was judged.
    """

    source: str
    n: int
    folds: int
    accuracy: Share
    baseline: float
    manual_accuracy: Share
    agreement: Share
    brier: float
    calibration: tuple[CalibrationBin, ...]
    kind_names: tuple[str, ...]
    confusion: NDArray[np.int64]
    probability: NDArray[np.float64]
    fold: NDArray[np.int64]


def evaluate(
    issue_scores: ArrayLike,
    biased: ArrayLike,
    kinds: Sequence[str | None] | None = None,
    *,
    source: str,
    seed: int,
    folds: int = 5,
    groups: ArrayLike | None = None,
    issues: Sequence[str] = ISSUES,
    manual_threshold: float = MANUAL_THRESHOLD,
) -> Evaluation:
    """Fit on all folds but one, judge that one, and compare with what people said.

    Args:
        issue_scores: float [n, K].
        biased: bool [n], what people said.
        kinds: n names of discriminations, as for ``detector.fit``.
        source: where the judgements come from, as for ``detector.fit``.
        seed: decides the folds. Each fold has nearly the same share of "biased".
        folds: number of folds, at least 2.
        groups: [n], who answered. When given, nobody is in the training data and in the
            fold that is judged, so the numbers hold for people who were never asked.
        issues: names of the K issues.
        manual_threshold: limit on the sum of the K scores for the manual rule.

    Returns:
        The evaluation.

    Raises:
        InputError: as ``detector.fit``, too few answers or respondents for the folds, or folds
            without which all others say the same.
    """
    scores, y, names = checked_judgements(issue_scores, biased, kinds, tuple(issues))
    fold = _folds(y, folds, seed, groups)
    probability = np.empty(len(y))
    flagged = np.empty(len(y), dtype=bool)
    looks: list[str | None] = [None] * len(y)
    for number in range(folds):
        held = fold == number
        detector = fit(
            scores[~held],
            y[~held],
            [name for name, out in zip(names, held, strict=True) if not out],
            source=source,
            seed=seed,
            issues=issues,
        )
        probability[held] = detector.probability(scores[held])
        flagged[held] = detector.judge(scores[held])
        if detector.kinds:
            likeliest = detector.looks_like(scores[held]).argmax(axis=-1)
            for row, kind in zip(np.flatnonzero(held), likeliest, strict=True):
                looks[row] = detector.kinds[kind]

    kind_names = tuple(sorted({name for name in names if name is not None}))
    confusion = np.zeros((len(kind_names), len(kind_names)), dtype=np.int64)
    for said, found in zip(names, looks, strict=True):
        if said is not None and found is not None:
            confusion[kind_names.index(said), kind_names.index(found)] += 1
    manual = scores.sum(axis=1) > manual_threshold
    return Evaluation(
        source=source,
        n=len(y),
        folds=folds,
        accuracy=_share(flagged == y),
        baseline=float(max(y.mean(), 1 - y.mean())),
        manual_accuracy=_share(manual == y),
        agreement=_share(flagged == manual),
        brier=float(np.mean((probability - y) ** 2)),
        calibration=_calibration(probability, y),
        kind_names=kind_names,
        confusion=confusion,
        probability=probability,
        fold=fold,
    )


def wilson(count: int, n: int, confidence: float = 0.95) -> Share:
    """A share with its Wilson score interval.

    Args:
        count: successes, 0 to n.
        n: trials.
        confidence: coverage of the interval.

    Returns:
        The share; NaN throughout when n is 0.
    """
    if n == 0:
        return Share(count, n, *(float("nan"),) * 3)
    z2 = NormalDist().inv_cdf(0.5 + confidence / 2) ** 2
    share = count / n
    centre = (share + z2 / (2 * n)) / (1 + z2 / n)
    half = (z2 * (share * (1 - share) / n + z2 / (4 * n * n))) ** 0.5 / (1 + z2 / n)
    # At 0 and n the limit is exact; rounding would put it a hair on the wrong side.
    low = 0.0 if count == 0 else centre - half
    high = 1.0 if count == n else centre + half
    return Share(count, n, share, low, high)


def _share(hits: NDArray[np.bool_]) -> Share:
    return wilson(int(hits.sum()), len(hits))


def _calibration(
    probability: NDArray[np.float64], y: NDArray[np.bool_]
) -> tuple[CalibrationBin, ...]:
    number = np.minimum((probability * BINS).astype(int), BINS - 1)
    bins = []
    for i in range(BINS):
        inside = number == i
        predicted = float(probability[inside].mean()) if inside.any() else float("nan")
        bins.append(CalibrationBin(i / BINS, (i + 1) / BINS, predicted, _share(y[inside])))
    return tuple(bins)


def _folds(
    y: NDArray[np.bool_], folds: int, seed: int, groups: ArrayLike | None
) -> NDArray[np.int64]:
    """The fold of each judgement, int64 [n], stratified by the answer."""
    from sklearn.model_selection import StratifiedGroupKFold, StratifiedKFold

    if folds < 2:
        raise InputError("range folds", f"{folds} folds cannot be held out: use at least 2")
    fewest = int(min(y.sum(), (~y).sum()))
    if fewest < folds:
        raise InputError(
            "range folds",
            f"the rarer answer was given {fewest} times: {folds} folds need it at least "
            f"{folds} times",
        )
    if groups is None:
        parts = StratifiedKFold(folds, shuffle=True, random_state=seed).split(y, y)
    else:
        who = np.asarray(groups)
        if who.shape != y.shape:
            raise InputError(
                "shape groups", f"groups have shape {who.shape} for {len(y)} judgements"
            )
        if len(np.unique(who)) < folds:
            raise InputError(
                "range folds",
                f"{len(np.unique(who))} respondents cannot be dealt into {folds} folds",
            )
        splitter = StratifiedGroupKFold(folds, shuffle=True, random_state=seed)
        parts = splitter.split(y, y, who)
    fold = np.empty(len(y), dtype=np.int64)
    for number, (rest, held) in enumerate(parts):
        fold[held] = number
        if y[rest].all() or not y[rest].any():
            only = "biased" if y[rest].all() else "not biased"
            raise InputError(
                "range folds",
                f"without the respondents of one of {folds} folds all judgements are {only!r}, so "
                "accuracy for new people cannot be told: ask more people, until several have "
                "given each answer",
            )
    return fold
