"""What an audit finds, as plain records; its settings; and how verdicts become findings."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import nan

import numpy as np

from evenhand.core import errors
from evenhand.statistics.verdicts import INSUFFICIENT, VERDICTS, Verdicts, VerdictSettings


def _verdict_settings() -> VerdictSettings:
    return VerdictSettings(permutations=2000)


@dataclass(frozen=True)
class AuditSettings:
    """How a log is judged.

    Attributes:
        verdict: level, relevant difference, power, permutations.
        depth: identities that are combined; 2 adds groups such as "Black × female", 3 those of
            three identities too.
        seed: of every random draw; the same log and seed give the same findings.
    """

    verdict: VerdictSettings = field(default_factory=_verdict_settings)
    depth: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        errors.whole("depth", self.depth, 1, 3)
        errors.whole("seed", self.seed, 0, 2**63 - 1)


@dataclass(frozen=True)
class Finding:
    """One group and issue.

    Attributes:
        identity: such as "race", or "race × gender".
        group: such as "Black", or "Black × female".
        issue: its name.
        n: services of the group to which the issue applies.
        cases: of them with the issue.
        rate: cases / n; NaN without services.
        rest_n: services of all others to which it applies.
        rest_rate: their rate.
        difference: rate − rest_rate; within strata, where there are any; NaN if a side is empty.
        low: lower limit of the difference; all limits of an audit hold together (Newcombe's from
            exact limits of both rates, with Bonferroni's adjustment); NaN if a side is empty.
        high: upper limit.
        corrected: |difference| less what chance gives on average; below 0 where chance gives more.
        p: of the permutation test by itself; NaN if a side is empty.
        p_adjusted: adjusted for all groups and issues (step-down max-T).
        verdict: one of ``inference.verdicts.VERDICTS``.
        needed: services in the whole log that would do; NaN unless data are insufficient, and
            where a side is empty.
        shrunk: rate of an intersection drawn towards those of the other groups of the same
            identities (:mod:`evenhand.statistics.intersections`); NaN for a single identity.
    """

    identity: str
    group: str
    issue: str
    n: int
    cases: int
    rate: float
    rest_n: int
    rest_rate: float
    difference: float
    low: float
    high: float
    corrected: float
    p: float
    p_adjusted: float
    verdict: str
    needed: float
    shrunk: float = nan


@dataclass(frozen=True)
class WaitFinding:
    """Waiting of one group, services without a response counted as censored.

    Attributes:
        identity: its name.
        group: its name.
        n: services whose waiting is known.
        responses: of them with a response.
        median: seconds until half were answered; NaN if that was not reached.
        unserved: Kaplan-Meier share still waiting when a response begins to be late.
        unserved_low: lower limit of the share by itself.
        unserved_high: upper limit.
        rest_unserved: share of all others.
        difference: unserved − rest_unserved; within strata, where there are any, so that it need
            not be the difference of the two; NaN if either is missing.
        low: lower limit of the difference; those of all groups hold together (Bonferroni).
        high: upper limit.
        p: log-rank test against all others, within strata where there are any, adjusted over all
            groups (Holm); NaN if a side is empty.
    """

    identity: str
    group: str
    n: int
    responses: int
    median: float
    unserved: float
    unserved_low: float
    unserved_high: float
    rest_unserved: float
    difference: float
    low: float
    high: float
    p: float


@dataclass(frozen=True)
class MeasureFinding:
    """A continuous measure in one group.

    Attributes:
        measure: its name.
        identity: its name.
        group: its name.
        n: services of the group where it is known.
        mean: of the group; NaN without services.
        rest_mean: of all others.
        mean_p: permutation test of the means, adjusted over the groups (max-T); NaN if a side is
            empty.
        median: of the group.
        rest_median: of all others.
        median_p: the same for being above or below the common median.
    """

    measure: str
    identity: str
    group: str
    n: int
    mean: float
    rest_mean: float
    mean_p: float
    median: float
    rest_median: float
    median_p: float


@dataclass(frozen=True)
class Resemblance:
    """What the detector says of short windows drawn from the log, for one identity.

    Attributes:
        identity: its name.
        scores: I of Eq. 2 of the whole log, one an issue.
        biased: share of the drawn windows that it calls biased.
        biased_even: the same with outcomes shuffled among people: what chance gives.
        looks_like: the discrimination most often named among windows called biased; None
            where ``biased`` is not clearly above ``biased_even``.
    """

    identity: str
    scores: tuple[float, ...]
    biased: float
    biased_even: float
    looks_like: str | None


@dataclass(frozen=True)
class Findings:
    """Everything that an audit says of a log.

    Attributes:
        findings: one for each group and issue.
        waits: one a group; empty where the log says nothing of waiting.
        measures: one for each further measure and group.
        resemblance: one an identity; empty where the detector cannot be asked.
        verdict: "disparity" if any finding is one, else "no evidence" if any is, else
            "insufficient data".
        total: total issue score of the log (the sum of Eq. 2 over the issues), single identities
            only.
        even_total: what chance gives on average.
        p_total: share of permutations with as great a total.
        services: of the log.
        settings: of the audit.
    """

    findings: tuple[Finding, ...]
    waits: tuple[WaitFinding, ...]
    measures: tuple[MeasureFinding, ...]
    resemblance: tuple[Resemblance, ...]
    verdict: str
    total: float
    even_total: float
    p_total: float
    services: int
    settings: AuditSettings


def listed(
    verdicts: Verdicts,
    groups: Sequence[tuple[str, str]],
    issues: Sequence[str],
    even: np.ndarray,
    shrunk: np.ndarray | None = None,
) -> tuple[Finding, ...]:
    """Verdicts as findings, all issues of a group after one another.

    Args:
        verdicts: of one window or log.
        groups: (identity, group) of each row.
        issues: names.
        even: difference that chance gives on average, [G, K].
        shrunk: rates of intersections, [G, K]; see ``Finding``.
    """
    counts = verdicts.counts
    with np.errstate(invalid="ignore"):
        rate, rest = counts.inside_x / counts.inside_n, counts.outside_x / counts.outside_n
    corrected = np.abs(verdicts.gap) - even
    needed = np.where(verdicts.verdict == INSUFFICIENT, verdicts.needed, nan)
    return tuple(
        Finding(
            identity=identity,
            group=group,
            issue=issue,
            n=int(counts.inside_n[g, k]),
            cases=int(counts.inside_x[g, k]),
            rate=float(rate[g, k]),
            rest_n=int(counts.outside_n[g, k]),
            rest_rate=float(rest[g, k]),
            difference=float(verdicts.gap[g, k]),
            low=float(verdicts.low[g, k]),
            high=float(verdicts.high[g, k]),
            corrected=float(corrected[g, k]),
            p=float(verdicts.p[g, k]),
            p_adjusted=float(verdicts.p_adjusted[g, k]),
            verdict=str(verdicts.verdict[g, k]),
            needed=float(needed[g, k]),
            shrunk=nan if shrunk is None else float(shrunk[g, k]),
        )
        for g, (identity, group) in enumerate(groups)
        for k, issue in enumerate(issues)
    )


def overall(findings: Sequence[Finding]) -> str:
    """The verdict on a log: the first of ``VERDICTS`` that any finding has."""
    there = {one.verdict for one in findings}
    return next(verdict for verdict in VERDICTS if verdict in there)
