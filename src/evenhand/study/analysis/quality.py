"""Who answered with care? Numbers of every participant, and flags with stated thresholds.

A flag is a reason to look, never an exclusion: whoever is flagged stays in the results unless that
is asked for, and then results are shown both ways. Nothing here depends on whether a robot was
found fair, so that leaving out the flagged cannot make a result.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from evenhand.core.errors import InputError
from evenhand.study.analysis import judgements
from evenhand.study.analysis.answer_columns import pc
from evenhand.study.analysis.answers import Answers
from evenhand.study.analysis.judgements import codes, numbers
from evenhand.study.design.protocol import Protocol

FAST, CLIPS, UNSEEN, ALIKE, CHECKS, CONTRADICTS = (
    "fast",
    "quicker than the clips",
    "clips not seen",
    "same answers",
    "attention",
    "contradictions",
)
FLAGS = (FAST, CLIPS, UNSEEN, ALIKE, CHECKS, CONTRADICTS)
_SCALE = 1.4826  # makes the median absolute deviation a standard deviation of normal numbers
_CLOCK = 0.5  # seconds by which a browser's clock and a clip may differ


@dataclass(frozen=True)
class Limits:
    """When a participant is flagged.

    Attributes:
        z: robust z of the time for a page, at or below which somebody is too fast.
        run: same scale answers in a row, from which somebody is flagged.
        entropy: bits of the scale answers below which somebody is flagged.
        least: scale answers that the entropy needs.
        failed: attention checks failed, from which somebody is flagged; one where only one is
            asked.
        contradicted: share of contradictory sets from which somebody is flagged; at least two.
    """

    z: float = -3.0
    run: int = 8
    entropy: float = 0.5
    least: int = 5
    failed: int = 2
    contradicted: float = 0.5

    def __post_init__(self) -> None:
        for field in fields(self):
            if not np.isfinite(getattr(self, field.name)):
                raise InputError(
                    f"type {field.name}", f"limit {field.name!r} is not a number: give one"
                )

    def said(self) -> dict[str, str]:
        """Every flag in words."""
        return {
            FAST: f"time for a page, against everybody's time for the same page: robust z of "
            f"{self.z:g} or less".replace("-", "\N{MINUS SIGN}"),
            CLIPS: "a page was answered before its clips can have ended",
            UNSEEN: "a page was answered, by its own account, without a clip seen to its end",
            ALIKE: f"the same scale answer {self.run} times in a row or more, or less than "
            f"{self.entropy:g} bits in {self.least} scale answers or more",
            CHECKS: f"{self.failed} attention checks failed, or the only one",
            CONTRADICTS: f"answers contradict each other in {100 * self.contradicted:g} % of the "
            "sets and in at least two: rated unfair and nothing named, or rated fairest and "
            "something named",
        }


@dataclass(frozen=True, eq=False)
class Quality:
    """Numbers of P participants; NaN where something cannot be said.

    Attributes:
        participants: P names.
        seconds: float64 [P], median time for a question, clips included.
        z: float64 [P], robust z of the log time for a page against everybody's.
        too_quick: int64 [P], pages answered before their clips can have ended.
        unseen: int64 [P], pages with a clip that was not seen to its end.
        scales: int64 [P], scale answers about sets.
        run: int64 [P], the longest run of the same one.
        entropy: float64 [P], of the scale answers, bits.
        checks: int64 [P], attention checks answered.
        failed: int64 [P], of these answered wrong.
        sets: int64 [P], sets whose answers could contradict each other.
        contradictory: int64 [P], sets whose answers do.
        flags: bool [P, len(FLAGS)].
        limits: that decided the flags.
    """

    participants: tuple[str, ...]
    seconds: NDArray[np.float64]
    z: NDArray[np.float64]
    too_quick: NDArray[np.int64]
    unseen: NDArray[np.int64]
    scales: NDArray[np.int64]
    run: NDArray[np.int64]
    entropy: NDArray[np.float64]
    checks: NDArray[np.int64]
    failed: NDArray[np.int64]
    sets: NDArray[np.int64]
    contradictory: NDArray[np.int64]
    flags: NDArray[np.bool_]
    limits: Limits

    @property
    def flagged(self) -> NDArray[np.bool_]:
        """Who has any flag, bool [P]."""
        return np.asarray(self.flags.any(axis=1))

    def reasons(self, who: int) -> list[str]:
        """The flags of one participant."""
        return [flag for flag, up in zip(FLAGS, self.flags[who], strict=True) if up]


def rate(
    answers: Answers,
    study: Protocol | None = None,
    limits: Limits | None = None,
    clip_seconds: Mapping[str, float] | None = None,
) -> Quality:
    """Rate participants against each other.

    Args:
        answers: of one kind of participants, people or simulated ones.
        study: without it contradictions are not looked for.
        limits: of the flags; the default ones when None.
        clip_seconds: how long the clips of a set or pair last together, by id; where that is not
            known, no page of it counts as too quick.
    """
    limits = limits or Limits()
    people = answers.participants
    n = len(people)
    table = answers.table
    who = codes(table["participant"], people)
    seconds, z, too_quick = _speed(answers, who, clip_seconds or {})
    unseen = _unseen(answers, who)
    scales, run, entropy = _sameness(answers, who)
    right = np.asarray(pc.fill_null(table["right"].cast(pa.int8()), -1))
    checks = np.bincount(who[right >= 0], minlength=n)
    failed = np.bincount(who[right == 0], minlength=n)
    contradictory = sets = np.zeros(n, np.int64)
    if study is not None:
        contradictory, sets = judgements.judge(answers, study).contradictions()
    with np.errstate(invalid="ignore"):
        flags = np.stack(
            [
                z <= limits.z,
                too_quick > 0,
                unseen > 0,
                (run >= limits.run) | ((scales >= limits.least) & (entropy < limits.entropy)),
                (failed > 0) & (failed >= np.minimum(limits.failed, checks)),
                (contradictory >= 2) & (contradictory >= limits.contradicted * sets),
            ],
            axis=1,
        )
    return Quality(people, seconds, z, too_quick, unseen, scales, run, entropy, checks, failed,
                   sets, contradictory, flags, limits)  # fmt: skip


def unflagged(
    answers: Answers,
    study: Protocol | None = None,
    clip_seconds: Mapping[str, float] | None = None,
    limits: Limits | None = None,
) -> tuple[Answers, int]:
    """The answers without those of flagged participants, and how many these are.

    People are rated against people, simulated participants against each other.
    """
    simulated = answers.table["simulated"]
    gone: list[str] = []
    for mask in (simulated, pc.invert(simulated)):
        rated = rate(answers.where(mask), study, limits, clip_seconds)
        gone += [name for name, up in zip(rated.participants, rated.flagged, strict=True) if up]
    kept = pc.invert(pc.is_in(answers.table["participant"], pa.array(gone, pa.string())))
    return answers.where(kept), len(gone)


def robust_z(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance from the median in units of 1.4826 times the median absolute deviation.

    Args:
        values: [n]; NaN is left out.

    Returns:
        [n]; NaN where a value is, and everywhere when the deviation is 0.
    """
    known = values[~np.isnan(values)]
    if not len(known):
        return np.full(len(values), np.nan)
    middle = np.median(known)
    deviation = _SCALE * np.median(np.abs(known - middle))
    return (values - middle) / deviation if deviation > 0 else np.full(len(values), np.nan)


def medians(values: NDArray[np.float64], group: NDArray[np.int64], n: int) -> NDArray[np.float64]:
    """Median of the values of each group, [n]; NaN for a group without values."""
    order = np.lexsort((values, group))
    values, size = values[order], np.bincount(group, minlength=n)
    start = np.cumsum(size) - size
    some = size > 0
    low = np.where(some, start + (size - 1) // 2, 0)
    high = np.where(some, start + size // 2, 0)
    if not len(values):
        return np.full(n, np.nan)
    return np.where(some, (values[low] + values[high]) / 2, np.nan)


def _speed(
    answers: Answers, who: NDArray[np.int64], clip_seconds: Mapping[str, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Seconds a question, robust z, and pages that were too quick, each [P]."""
    table, n = answers.table, len(answers.participants)
    names = tuple(pc.unique(table["page"]).to_pylist())
    page = codes(table["page"], names)
    # one entry a participant and page, with the number of its questions
    _, rows, asked = np.unique(who * len(names) + page, return_index=True, return_counts=True)
    spent = numbers(table["seconds"])[rows]
    who, page = who[rows], page[rows]
    known = ~np.isnan(spent)
    seconds = medians((spent / asked)[known], who[known], n)
    timed = known & (spent > 0)
    log = np.log(spent[timed])
    usual = medians(log, page[timed], len(names))
    slower = medians(log - usual[page[timed]], who[timed], n)
    items = [clip_seconds.get(name.partition(":")[2], 0.0) for name in names]
    quick = known & (spent < np.array(items)[page] - _CLOCK)
    return seconds, robust_z(slower), np.bincount(who[quick], minlength=n)


def _unseen(answers: Answers, who: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pages of each participant with a clip that was not seen to its end, [P]."""
    table, n = answers.table, len(answers.participants)
    names = tuple(pc.unique(table["page"]).to_pylist())
    none = numbers(table["views"]) == 0
    pages = np.unique(who[none] * len(names) + codes(table["page"], names)[none])
    return np.bincount(pages // max(len(names), 1), minlength=n)


def _sameness(
    answers: Answers, who: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Scale answers about sets, the longest run of the same, entropy in bits, each [P]."""
    table, n = answers.table, len(answers.participants)
    scale = pc.and_(pc.equal(table["type"], "scale"), pc.equal(table["kind"], "set"))
    keep = np.flatnonzero(np.asarray(pc.fill_null(scale, False)))
    value, position = numbers(table["number"])[keep], numbers(table["position"])[keep]
    order = np.lexsort((position, who[keep]))
    value, of = value[order], who[keep][order]
    of, value = of[~np.isnan(value)], value[~np.isnan(value)]
    runs = np.zeros(n, np.int64)
    entropy = np.full(n, np.nan)
    total = np.bincount(of, minlength=n)
    if len(value):
        new = np.r_[True, (np.diff(of) != 0) | (np.diff(value) != 0)]
        lengths = np.bincount(np.cumsum(new) - 1)
        np.maximum.at(runs, of[new], lengths)
        points, code = np.unique(value, return_inverse=True)
        counts = np.bincount(of * len(points) + code, minlength=n * len(points))
        share = counts.reshape(n, -1) / np.maximum(total, 1)[:, None]
        bits = -(share * np.log2(np.where(share > 0, share, 1.0))).sum(axis=1)
        entropy = np.where(total > 0, np.abs(bits), np.nan)
    return total, runs, entropy
