"""What the answers of a study say: tables with intervals, people and simulated participants apart.

A part of an analysis holds one kind of participants. Its tables are made of everybody, or of all
but the flagged where that was asked for; ratings and agreement stand beside what the other way
gives.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa

from evenhand.core import errors
from evenhand.core.errors import InputError
from evenhand.report.table import Table, table
from evenhand.study.analysis import (
    agreement,
    check_answers,
    contrasts,
    counting,
    infer_protocol,
    judgements,
    quality,
)
from evenhand.study.analysis.answer_columns import pc
from evenhand.study.analysis.answers import Answers
from evenhand.study.analysis.judgements import Judged
from evenhand.study.analysis.quality import FLAGS, Limits, Quality
from evenhand.study.design.protocol import Protocol

KINDS = {"people": "Participants", "simulated": "Simulated participants"}
"""Kinds of participants, and how a part of the report is called."""


@dataclass(frozen=True)
class Settings:
    """How answers are analysed.

    Attributes:
        seed: of permutations and bootstrap samples.
        permutations: of each test of scenarios against controls, at most.
        bootstraps: of each interval of agreement.
        exclude_flagged: whether the flagged are left out; they are counted and shown all the same.
        limits: of the flags.
    """

    seed: int = 0
    permutations: int = contrasts.PERMUTATIONS
    bootstraps: int = agreement.BOOTSTRAPS
    exclude_flagged: bool = False
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        errors.whole("permutations", self.permutations, 99, 100_000)
        errors.whole("bootstraps", self.bootstraps, 99, 100_000)
        errors.whole("seed", self.seed, 0, 2**63 - 1)


@dataclass(frozen=True, eq=False)
class Part:
    """What one kind of participants answered.

    Attributes:
        kind: one of ``KINDS``.
        statuses: participants of each status.
        used: participants that the tables are made of.
        flagged: participants with any flag.
        minutes: median time of those who finished; NaN without any.
        tables: by name; a table that has no rows is there all the same.
        texts: free answers: participant, question, set or pair, text.
        quality: of every participant, flagged or not.
    """

    kind: str
    statuses: dict[str, int]
    used: int
    flagged: int
    minutes: float
    tables: dict[str, Table]
    texts: list[tuple[str, str, str, str]]
    quality: Quality

    @property
    def label(self) -> str:
        """How the part is called."""
        return KINDS[self.kind]


@dataclass(frozen=True, eq=False)
class Analysis:
    """What the answers of a study say.

    Attributes:
        study: the study.
        known: whether its protocol was given; else it is what the answers tell of it.
        parts: people first.
        previews: participants of previews; they are in no part.
        strange: sets, pairs and checks that the protocol lacks: number of answers, which are left
            out.
        settings: how it was analysed.
    """

    study: Protocol
    known: bool
    parts: tuple[Part, ...]
    previews: int
    strange: dict[str, int]
    settings: Settings


def analyse(
    answers: Answers,
    study: Protocol | None = None,
    settings: Settings | None = None,
    clip_seconds: dict[str, float] | None = None,
) -> Analysis:
    """Analyse the answers of a study.

    Args:
        answers: people and simulated participants are kept apart, previews left out.
        study: its protocol; without it, controls and the middle of scales are not known.
        settings: the default ones when None.
        clip_seconds: how long the clips of sets and pairs last, by id.

    Raises:
        InputError: when there are no answers, none that belong to the study, or one that its
            question cannot have.
    """
    settings = settings or Settings()
    preview = answers.table["preview"]
    previews = len(answers.where(preview).participants)
    kept = answers.where(pc.invert(preview))
    if not len(kept):
        more = f" but those of {previews} previews" if previews else ""
        raise InputError("empty answers", f"there are no answers{more}: nothing to analyse")
    plan = study or infer_protocol.study_of(kept)
    known = {one.id for one in (*plan.questions, *plan.demographics, *plan.checks)}
    asked = set(pc.unique(kept.table["question"]).to_pylist())
    if not asked & known:
        raise InputError(
            "changed answers",
            f"no answer is to a question of the study {plan.name!r}: give the protocol that the "
            "answers belong to",
        )
    check_answers.check(kept, plan)
    simulated = kept.table["simulated"]
    both = {"people": pc.invert(simulated), "simulated": simulated}
    parts = []
    for number, (kind, mask) in enumerate(both.items()):
        part = kept.where(mask)
        if len(part):
            rng = np.random.default_rng([settings.seed, number])
            parts.append(
                _part(kind, part, plan, study is not None, settings, rng, clip_seconds or {})
            )
    strange = check_answers.strangers(kept, plan)
    return Analysis(plan, study is not None, tuple(parts), previews, strange, settings)


def _part(
    kind: str,
    answers: Answers,
    study: Protocol,
    known: bool,
    settings: Settings,
    rng: np.random.Generator,
    clip_seconds: dict[str, float],
) -> Part:
    rated = quality.rate(answers, study if known else None, settings.limits, clip_seconds)
    flagged = pa.array(np.array(rated.participants)[rated.flagged], pa.string())
    without = answers.where(pc.invert(pc.is_in(answers.table["participant"], flagged)))
    used, other = (without, answers) if settings.exclude_flagged else (answers, without)
    mine, theirs = judgements.judge(used, study), judgements.judge(other, study)
    testing, *sampling = rng.spawn(3)
    tables = {
        "ratings": _ratings(mine, theirs, known),
        "named": counting.named(used, study),
        "controls": _controls(mine, testing, settings),
        "places": _places(mine),
        "early": _early(mine, known),
        "pairs": counting.pairs(used, study),
        "agreement": _agreement(mine, theirs, sampling, settings),
        "progress": counting.progress(answers, study if known else None),
        "flags": _flags(rated),
        "participants": _participants(answers, rated),
        "others": counting.others(used, study),
    }
    status = counting.statuses(answers)
    return Part(
        kind=kind,
        statuses=status,
        used=len(used.participants),
        flagged=int(rated.flagged.sum()),
        minutes=counting.minutes(answers),
        tables=tables,
        texts=counting.texts(used),
        quality=rated,
    )


def _ratings(judged: Judged, other: Judged, known: bool) -> Table:
    rows = []
    aside = {name: s for s, name in enumerate(other.sets)}
    for s, name in enumerate(judged.sets):
        mean = contrasts.mean_interval(judged.fairness[:, s])
        way = contrasts.mean_interval(other.fairness[:, aside[name]])
        # a t interval knows nothing of the ends of a scale
        low, high = np.clip([mean.low, mean.high], 1, 2 * judged.middle - 1).tolist()
        biased = judged.biased[:, s] if known else np.array([])
        share = counting.share(int(np.nansum(biased)), int((~np.isnan(biased)).sum()))
        kind = ("control" if judged.control[s] else "scenario") if known else "not known"
        rows.append((name, kind, mean.n, mean.mean, low, high, *share, way.n, way.mean))
    names = ("set", "kind", "n", "mean", "low", "high", "biased", "biased_low", "biased_high",
             "other_n", "other_mean")  # fmt: skip
    return table(names, rows)


def _controls(judged: Judged, rng: np.random.Generator, settings: Settings) -> Table:
    names = ("set", "n", "difference", "low", "high", "p", "p_adjusted", "permutations")
    return table(
        names,
        [
            (one.name, one.difference.n, one.difference.mean, one.difference.low,
             one.difference.high, one.p, one.p_adjusted, one.permutations)
            for one in contrasts.controls(judged, rng, settings.permutations)
        ],
    )  # fmt: skip


def _places(judged: Judged) -> Table:
    found = [(f"{place + 1}", one) for place, one in contrasts.by_place(judged)]
    found.append(("change from one to the next", contrasts.slope(judged)))
    rows = [(name, one.n, one.mean, one.low, one.high) for name, one in found if one.n]
    return table(("place", "n", "mean", "low", "high"), rows)


def _early(judged: Judged, known: bool) -> Table:
    rows: list[tuple[Any, ...]] = []
    for name, counts, low, high in contrasts.early_and_late(judged) if known else ():
        sides = ((counts.inside_n, counts.inside_x), (counts.outside_n, counts.outside_x))
        (n, x), (m, y) = ((int(a[0, 0]), int(b[0, 0])) for a, b in sides)
        rate, rest = x / n if n else np.nan, y / m if m else np.nan
        rows.append((name, n, rate, m, rest, rate - rest, low, high))
    names = ("set", "early_n", "early", "late_n", "late", "difference", "low", "high")
    return table(names, rows)


def _agreement(
    judged: Judged, other: Judged, rngs: list[np.random.Generator], settings: Settings
) -> Table:
    rows = []
    for (name, level, counts), (_, _, aside) in zip(_counts(judged), _counts(other), strict=True):
        one, way = (
            agreement.agreement(c, level, rng, bootstraps=settings.bootstraps)
            for c, rng in ((counts, rngs[0]), (aside, rngs[1]))
        )
        rows.append((name, level, one.alpha, one.low, one.high, one.units, one.answers, way.alpha))
    names = ("answer", "level", "alpha", "low", "high", "sets", "answers", "other_alpha")
    return table(names, rows)


def _counts(judged: Judged) -> list[tuple[str, agreement.Level, np.ndarray]]:
    """Counts [S, C] of each answer whose agreement is told."""
    people, sets = judged.fairness.shape
    unit = np.tile(np.arange(sets), people)
    found: list[tuple[str, agreement.Level, np.ndarray]] = []
    if not np.isnan(judged.middle):
        points = int(2 * judged.middle - 1)
        rating = np.nan_to_num(judged.fairness.ravel() - 1, nan=-1).astype(np.int64)
        found.append(("rating", "ordinal", agreement.counted(unit, rating, sets, points)))
    for name, codes, values in (
        ("worst issue", judged.issue, judged.issues),
        ("identity", judged.identity, judged.identities),
    ):
        if values:
            counts = agreement.counted(unit, codes.ravel(), sets, len(values))
            found.append((name, "nominal", counts))
    return found


def _flags(rated: Quality) -> Table:
    said = rated.limits.said()
    rows = [(flag, int(rated.flags[:, k].sum()), said[flag]) for k, flag in enumerate(FLAGS)]
    return table(("flag", "participants", "when"), [*rows, ("any", int(rated.flagged.sum()), "")])


def _participants(answers: Answers, rated: Quality) -> Table:
    """One row a participant: every number of the quality, and the flags."""
    first = answers.table.group_by("participant", use_threads=False).aggregate(
        [("status", "first"), ("order", "first")]
    )
    status = dict(
        zip(first["participant"].to_pylist(), first["status_first"].to_pylist(), strict=True)
    )
    q = rated
    columns = (q.seconds, q.z, q.too_quick, q.unseen, q.scales, q.run, q.entropy, q.checks,
               q.failed, q.sets, q.contradictory)  # fmt: skip
    flags = ["; ".join(rated.reasons(who)) for who in range(len(rated.participants))]
    names = ("participant", "status", "seconds", "z", "too_quick", "unseen", "scales", "run",
             "entropy", "checks", "failed", "sets", "contradictory", "flags")  # fmt: skip
    people = [status[name] for name in rated.participants]
    return Table(
        dict(
            zip(
                names,
                (
                    np.array(rated.participants, dtype=object),
                    np.array(people, dtype=object),
                    *columns,
                    np.array(flags, dtype=object),
                ),
                strict=True,
            )
        )
    )
