"""From answers to a detector that ``train --detector`` and ``audit --detector`` accept.

A judgement is what one participant made of one set: biased or not by the rule of
`study.analysis.judgements`, the discrimination named where exactly one identity was, and the
issue scores of the robot behind the clips, as the protocol states them. Of a set with scores for
several identities those with the greatest total count, whatever was named: what is asked of the
detector must not depend on the answer.

How well it does is measured on participants it never saw, and on sets it never saw. The second is
the harder question, and the one that matters: a study has few sets, each judged by many.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evenhand.core.errors import InputError
from evenhand.methods.paper import detector
from evenhand.methods.paper.detector import Detector
from evenhand.methods.vocabulary import DISCRIMINATIONS, IDENTITIES, SIMULATED, SOURCES
from evenhand.statistics import detector_accuracy
from evenhand.statistics.detector_accuracy import Share, wilson
from evenhand.study.analysis import check_answers
from evenhand.study.analysis import judgements as judging
from evenhand.study.analysis.answer_columns import pc
from evenhand.study.analysis.answers import Answers
from evenhand.study.design.protocol import Protocol

Who = Literal["people", "simulated", "both"]
LEAST = 20
"""Judgements that a detector needs."""
FOLDS = 5
BOOTSTRAPS = 2000


@dataclass(frozen=True, eq=False)
class Judgements:
    """n judgements.

    Attributes:
        scores: float64 [n, 4], issue scores of the robot that was judged.
        biased: bool [n].
        kinds: n names of discriminations, None where not exactly one was named.
        participant: int64 [n], who judged.
        set: int64 [n], what was judged.
        source: "simulated respondents" if any of them is simulated, else "respondents".
        left_out: judgements of sets without scores.
    """

    scores: NDArray[np.float64]
    biased: NDArray[np.bool_]
    kinds: tuple[str | None, ...]
    participant: NDArray[np.int64]
    set: NDArray[np.int64]
    source: str
    left_out: int


@dataclass(frozen=True)
class HeldOut:
    """Accuracy on participants or sets that were not fitted to.

    Attributes:
        over: "participants" or "sets".
        groups: how many there are.
        accuracy: share of judgements that were met; NaN where it could not be measured.
        low: lower limit: percentile bootstrap over the groups, for judgements of one group are
            alike.
        high: upper limit.
        why_not: why it could not be measured; empty otherwise.
    """

    over: str
    groups: int
    accuracy: float
    low: float
    high: float
    why_not: str


@dataclass(frozen=True, eq=False)
class Fitted:
    """A detector fitted to answers, and how good it is.

    Attributes:
        detector: fitted to all judgements.
        judgements: that it was fitted to.
        held_out: over participants, then over sets.
        baseline: accuracy of always giving the more frequent answer.
        shipped: accuracy of the simulated detector that comes with Evenhand on the same judgements,
            which it never saw, with Wilson's interval.
        alike: share of the sets judged on which both detectors agree.
    """

    detector: Detector
    judgements: Judgements
    held_out: tuple[HeldOut, HeldOut]
    baseline: float
    shipped: Share
    alike: Share


def chosen(answers: Answers, who: Who | None) -> Answers:
    """The answers of the participants that a detector is to be fitted to, without previews.

    Raises:
        InputError: when there are none, or both people and simulated ones and nothing was said.
    """
    answers = answers.where(pc.invert(answers.table["preview"]))
    simulated = answers.table["simulated"]
    programs = answers.where(simulated)
    people = answers.where(pc.invert(simulated))
    if who is None and len(people) and len(programs):
        raise InputError(
            "conflict who",
            f"the answers are of {len(people.participants)} people and "
            f"{len(programs.participants)} simulated participants: choose with --who people, "
            "simulated or both",
        )
    found = {"people": people, "simulated": programs}.get(who or "both", answers)
    if not len(found):
        raise InputError(
            "empty answers", f"there are no answers of {who or 'anybody'}: nothing to fit to"
        )
    return found


def judgements(answers: Answers, study: Protocol) -> Judgements:
    """Judgements from answers.

    Raises:
        InputError: when no set states scores, nothing was judged, or an answer is one that its
            question cannot have.
    """
    if not any(one.scores for one in study.sets):
        raise InputError(
            "missing scores",
            f"study {study.name!r} states no issue scores of any robot: add scores to its [[sets]]",
        )
    check_answers.check(answers, study)
    judged = judging.judge(answers, study)
    known = ~np.isnan(judged.biased)
    scored = np.array([bool(one.scores) for one in study.sets])
    who, item = np.nonzero(known & scored)
    if not len(who):
        raise InputError(
            "empty answers", "no set whose robot has scores was judged: nothing to fit to"
        )
    vectors = np.full((len(study.sets), 4), np.nan)
    for s, one in enumerate(study.sets):
        if one.scores:
            vectors[s] = max(one.scores.values(), key=sum)
    biased = judged.biased[who, item] == 1
    named = judged.identity[who, item]
    kinds = [
        DISCRIMINATIONS[IDENTITIES.index(judged.identities[code])]
        if unfair and code >= 0 and judged.identities[code] in IDENTITIES
        else None
        for unfair, code in zip(biased, named, strict=True)
    ]
    return Judgements(
        scores=vectors[item],
        biased=biased,
        kinds=tuple(kinds),
        participant=who.astype(np.int64),
        set=item.astype(np.int64),
        source=SIMULATED if answers.simulated else SOURCES[1],
        left_out=int((known & ~scored).sum()),
    )


def fit(answers: Answers, study: Protocol, seed: int = 0) -> Fitted:
    """Fit a detector to answers, and hold it out against people and sets it never saw.

    Args:
        answers: of people, of simulated participants, or both; one simulated answer makes the
            detector's source "simulated respondents".
        study: that was answered.
        seed: of folds and bootstrap samples.

    Raises:
        InputError: as :func:`judgements`, or for too few judgements, or only one kind of them.
    """
    from evenhand.methods import detector_file

    data = judgements(answers, study)
    n, unfair = len(data.biased), int(data.biased.sum())
    if n < LEAST:
        raise InputError(
            "range judgements",
            f"{n} judgements are too few to fit a detector to: {LEAST} are needed at least",
        )
    if unfair in (0, n):
        only = "biased" if unfair else "not biased"
        raise InputError(
            "empty judgements",
            f"all {n} judgements say {only}: a detector needs examples of both, so add "
            f"{'even controls' if unfair else 'scenarios'} to the study",
        )
    fitted = detector.fit(data.scores, data.biased, data.kinds, source=data.source, seed=None)
    rng = np.random.default_rng(seed)
    shipped = detector_file.load(detector_file.SHIPPED)
    theirs, mine = shipped.judge(data.scores), fitted.judge(data.scores)
    _, rows = np.unique(data.set, return_index=True)
    met = int((theirs == data.biased).sum())
    return Fitted(
        detector=fitted,
        judgements=data,
        held_out=(
            _held_out("participants", data, data.participant, seed, rng),
            _held_out("sets", data, data.set, seed, rng),
        ),
        baseline=max(unfair, n - unfair) / n,
        shipped=wilson(met, n),
        alike=wilson(int((theirs == mine)[rows].sum()), len(rows)),
    )


def _held_out(
    over: str,
    data: Judgements,
    groups: NDArray[np.int64],
    seed: int,
    rng: np.random.Generator,
) -> HeldOut:
    there = len(np.unique(groups))
    folds = min(FOLDS, there, int(data.biased.sum()), int((~data.biased).sum()))
    try:
        found = detector_accuracy.evaluate(
            data.scores,
            data.biased,
            data.kinds,
            source=data.source,
            seed=seed,
            folds=folds,
            groups=groups,
        )
    except InputError as error:
        nan = float("nan")
        return HeldOut(over, there, nan, nan, nan, str(error))
    met = (found.probability > 0.5) == data.biased
    low, high = clustered(met, groups, rng)
    return HeldOut(over, there, float(met.mean()), low, high, "")


def clustered(
    met: NDArray[np.bool_],
    groups: NDArray[np.int64],
    rng: np.random.Generator,
    bootstraps: int = BOOTSTRAPS,
) -> tuple[float, float]:
    """95 % limits of a share whose cases come in groups: percentile bootstrap over the groups.

    Args:
        met: [n].
        groups: of each case, [n].
        rng: source of randomness.
        bootstraps: samples of groups.
    """
    _, group = np.unique(groups, return_inverse=True)
    hits, n = np.bincount(group, weights=met), np.bincount(group)
    many = len(n)
    weights = rng.multinomial(many, np.full(many, 1 / many), size=bootstraps)
    low, high = np.quantile((weights @ hits) / (weights @ n), [0.025, 0.975]).tolist()
    return low, high
