"""Verdicts on the services of a ledger, as findings that tables, figures and words understand."""

from __future__ import annotations

import numpy as np

from evenhand.adapters.ledger import Ledger
from evenhand.audits.judge.results import AuditSettings, Findings, listed, overall
from evenhand.core.errors import InputError
from evenhand.statistics.chance import even_gaps
from evenhand.statistics.verdicts import judge_table


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
    x = np.where(np.isnan(x), np.nan, x >= 0.5)  # graded issues as yes or no
    rng = np.random.default_rng(chosen.seed)
    found, test = judge_table(x, inside, np.ones(len(x), np.int64), rng, chosen.verdict)
    scheme = ledger.scheme
    findings = listed(found, scheme.groups, scheme.issue_names, even_gaps(found.counts))
    return Findings(
        findings=findings,
        waits=(),
        measures=(),
        resemblance=(),
        verdict=overall(findings),
        total=test.total,
        even_total=test.even_total,
        p_total=test.p_total,
        services=len(ledger),
        settings=chosen,
    )
