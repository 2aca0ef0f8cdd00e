"""Verdicts on the services of a ledger, as findings that tables, figures and words understand."""

from __future__ import annotations

import numpy as np

from evenhand.adapters.ledger import Ledger
from evenhand.audits.results import AuditSettings, Finding, Findings
from evenhand.errors import InputError
from evenhand.inference.chance import even_gaps
from evenhand.inference.verdicts import DISPARITY, INSUFFICIENT, NO_EVIDENCE, judge_table


def findings_of(ledger: Ledger, settings: AuditSettings | None = None) -> Findings:
    """All that the statistics say of the services of a ledger.

    Args:
        ledger: whose services.
        settings: level, relevant difference, permutations, seed; identities are not combined.

    Raises:
        InputError: before any service has ended.
    """
    if not len(ledger):
        raise InputError("no service has ended yet: there is nothing to judge")
    chosen = settings or AuditSettings()
    x, inside = ledger.rows()
    rng = np.random.default_rng(chosen.seed)
    found, test = judge_table(x, inside, np.ones(len(x), np.int64), rng, chosen.verdict)
    counts = found.counts
    with np.errstate(invalid="ignore"):
        rate, rest = counts.inside_x / counts.inside_n, counts.outside_x / counts.outside_n
    corrected = np.abs(found.gap) - even_gaps(counts)
    needed = np.where(found.verdict == INSUFFICIENT, found.needed, np.nan)
    listed = tuple(
        Finding(
            identity=identity,
            group=group,
            issue=issue,
            n=int(counts.inside_n[g, k]),
            cases=int(counts.inside_x[g, k]),
            rate=float(rate[g, k]),
            rest_n=int(counts.outside_n[g, k]),
            rest_rate=float(rest[g, k]),
            difference=float(found.gap[g, k]),
            low=float(found.low[g, k]),
            high=float(found.high[g, k]),
            corrected=float(corrected[g, k]),
            p=float(found.p[g, k]),
            p_adjusted=float(found.p_adjusted[g, k]),
            verdict=str(found.verdict[g, k]),
            needed=float(needed[g, k]),
        )
        for g, (identity, group) in enumerate(ledger.scheme.groups)
        for k, issue in enumerate(ledger.scheme.issue_names)
    )
    there = {one.verdict for one in listed}
    return Findings(
        findings=listed,
        waits=(),
        measures=(),
        resemblance=(),
        verdict=next(v for v in (DISPARITY, NO_EVIDENCE, INSUFFICIENT) if v in there),
        total=test.total,
        even_total=test.even_total,
        p_total=test.p_total,
        services=len(ledger),
        settings=chosen,
    )
