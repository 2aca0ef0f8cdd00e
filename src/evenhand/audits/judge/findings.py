"""From the counts of a log to what can be said of it.

Every group of every identity is held against all others, in every issue, and so is every
intersection that occurs, down to the depth that is asked for: one family of comparisons, with
one error.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from evenhand.audits.count.tally import Identity, Tally, membership
from evenhand.audits.judge import means, resemblance, waits
from evenhand.audits.judge.results import AuditSettings, Findings, listed, overall
from evenhand.core.errors import InputError
from evenhand.methods.paper.detector import Detector
from evenhand.statistics.chance import even_gaps
from evenhand.statistics.intersections import shrink
from evenhand.statistics.verdicts import DISPARITY, judge_table

MOST_GROUPS = 2000
"""Groups that are compared in one audit, intersections included."""

BETWEEN = " × "


@dataclass(frozen=True, eq=False)
class Groups:
    """The groups of a log as kinds of people.

    Attributes:
        names: (identity, group) of each column.
        single: columns of single identities; they come first.
        inside: membership of the kinds, bool [I, G].
        who: kind of each row of the tally, int64 [C].
    """

    names: tuple[tuple[str, str], ...]
    single: int
    inside: np.ndarray
    who: np.ndarray


def find(
    tally: Tally, settings: AuditSettings | None = None, detector: Detector | None = None
) -> Findings:
    """Everything that an audit says of a log.

    Args:
        tally: counts of the log.
        settings: level, relevant difference, depth of intersections, seed.
        detector: that is asked; the one that comes with Evenhand by default.

    Raises:
        InputError: for more than ``MOST_GROUPS`` groups, or a tally that does not hold together.
    """
    chosen = settings or AuditSettings()
    testing, measuring, drawing = np.random.default_rng(chosen.seed).spawn(3)
    groups = grouped(tally, chosen.depth)
    verdicts, test = judge_table(
        tally.x,
        groups.inside,
        tally.n,
        testing,
        chosen.verdict,
        tally.stratum,
        groups.who,
        groups.single,
    )
    counts = verdicts.counts
    # Within strata chance is known from its variance; else there is an exact form.
    mixed = len(np.unique(tally.stratum)) > 1
    even = test.even_gap if mixed else even_gaps(counts)
    shrunk = _shrunk(groups, counts.inside_x, counts.inside_n)
    found = listed(verdicts, groups.names, tally.issues, even, shrunk)
    uneven = {one.identity for one in found if one.verdict == DISPARITY}
    return Findings(
        findings=found,
        waits=waits.compare(tally, chosen.verdict.alpha),
        measures=means.compare(tally, measuring, chosen.verdict.permutations),
        resemblance=resemblance.ask(tally, drawing, uneven, detector=detector),
        verdict=overall(found),
        total=test.total,
        even_total=test.even_total,
        p_total=test.p_total,
        services=tally.services,
        settings=chosen,
    )


def grouped(tally: Tally, depth: int = 1) -> Groups:
    """The groups of single identities, then those of the intersections that occur.

    Args:
        tally: counts of the log.
        depth: identities that are combined at most.
    """
    kinds, who = np.unique(tally.codes, axis=0, return_inverse=True)
    names = list(tally.names())
    single = len(names)
    _few(single, 1)
    columns = [membership(kinds, tally.identities).astype(bool)]
    for size in range(2, min(depth, len(tally.identities)) + 1):
        for chosen in combinations(range(len(tally.identities)), size):
            combined, which = np.unique(kinds[:, chosen], axis=0, return_inverse=True)
            several = [tally.identities[d] for d in chosen]
            names += [_named(several, row) for row in combined]
            _few(len(names), size)
            columns.append(which.reshape(-1, 1) == np.arange(len(combined)))
    return Groups(tuple(names), single, np.concatenate(columns, axis=1), who.ravel())


def _named(several: list[Identity], codes: np.ndarray) -> tuple[str, str]:
    """Such as ("race × gender", "Black × female")."""
    groups = [one.groups[code] for one, code in zip(several, codes, strict=True)]
    return BETWEEN.join(one.name for one in several), BETWEEN.join(groups)


def _few(groups: int, depth: int) -> None:
    if groups > MOST_GROUPS:
        advice = "name fewer identities or bin their values" if depth == 1 else "lower the depth"
        raise InputError(
            "range depth",
            f"at depth {depth} the log has {groups} groups or more, and {MOST_GROUPS} is the most "
            f"that can be compared together: {advice}",
        )


def _shrunk(groups: Groups, cases: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Rates of intersections drawn towards each other, [G, K]; NaN for single identities."""
    shrunk = np.full(cases.shape, np.nan)
    identity = np.array([name for name, _ in groups.names])
    for name in dict.fromkeys(identity[groups.single :]):
        rows = np.flatnonzero(identity == name)
        rows = rows[rows >= groups.single]
        for k in range(cases.shape[1]):
            known = rows[n[rows, k] > 0]
            if len(known) > 1:
                shrunk[known, k] = shrink(cases[known, k], n[known, k]).rate
    return shrunk
