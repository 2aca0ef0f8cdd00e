"""Findings against published tables, statsmodels, Fairlearn and hand numbers."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from fairlearn.metrics import demographic_parity_difference
from statsmodels.stats.contingency_tables import StratifiedTable
from statsmodels.stats.proportion import proportion_confint

from evenhand.audits.count.tally import Identity, Tally
from evenhand.audits.judge import findings
from evenhand.audits.judge.results import AuditSettings
from evenhand.statistics.verdicts import VerdictSettings
from support.refusals import refused


def log(rows, groups, issues=("callback",), strata=("",)):
    """A tally from rows (codes, stratum, x, n)."""
    codes, stratum, x, n = (list(column) for column in zip(*rows, strict=True))
    return Tally(
        identities=tuple(Identity(name, values) for name, values in groups.items()),
        issues=issues,
        strata=strata,
        codes=np.array(codes, np.int64),
        stratum=np.array(stratum, np.int64),
        x=np.array(x, float),
        n=np.array(n, np.int64),
    )


def callbacks():
    """Bertrand and Mullainathan, American Economic Review 2004, table 1: all résumés sent."""
    return log(
        [
            ([0], 0, [1], 235),
            ([0], 0, [0], 2435 - 235),
            ([1], 0, [1], 157),
            ([1], 0, [0], 2435 - 157),
        ],
        {"name": ("White-sounding", "Black-sounding")},
    )


def test_callbacks_by_name_as_published():
    found = findings.find(callbacks())
    white, black = found.findings
    # Published: 9.65 %, 6.45 %, difference 3.20 points, p = 0.0000.
    assert round(100 * white.rate, 2) == 9.65
    assert round(100 * black.rate, 2) == 6.45
    assert round(100 * white.difference, 2) == 3.20
    assert white.p_adjusted < 0.001
    assert (white.verdict, black.verdict, found.verdict) == ("disparity",) * 3
    assert (white.n, white.cases, white.rest_n) == (2435, 235, 2435)
    assert found.services == 4870
    assert math.isnan(white.needed)
    assert found.total == pytest.approx(78 / 2435)
    # Newcombe's formula from Clopper and Pearson's limits, two gaps together
    (a, b), (c, d) = (
        proportion_confint(x, 2435, alpha=0.05 / 2, method="beta") for x in (235, 157)
    )
    p, q = 235 / 2435, 157 / 2435
    low, high = p - q - np.hypot(p - a, d - q), p - q + np.hypot(b - p, q - c)
    assert (white.low, white.high) == pytest.approx((low, high), abs=1e-9)
    assert (black.low, black.high) == pytest.approx((-high, -low), abs=1e-9)


def test_the_difference_is_fairlearn_s_and_chance_is_taken_out():
    white = findings.find(callbacks()).findings[0]
    who = np.repeat([0, 1], 2435)
    got = np.concatenate([np.repeat([1, 0], [235, 2200]), np.repeat([1, 0], [157, 2278])])
    parity = demographic_parity_difference(got, got, sensitive_features=who)
    assert abs(white.difference) == pytest.approx(parity)
    # Chance gives sqrt(2/π) standard errors on average, nearly so in large groups.
    r = 392 / 4870
    even = math.sqrt(2 / math.pi) * math.sqrt(r * (1 - r) * 2 / 2435)
    assert white.corrected == pytest.approx(78 / 2435 - even, abs=2e-5)


BERKELEY = [  # Bickel, Hammel and O'Connell, Science 1975: admitted and not, men then women
    ((512, 313), (89, 19)),
    ((353, 207), (17, 8)),
    ((120, 205), (202, 391)),
    ((138, 279), (131, 244)),
    ((53, 138), (94, 299)),
    ((22, 351), (24, 317)),
]


def test_admissions_compared_within_departments():
    rows = [
        ([sex], department, [1 - refused], BERKELEY[department][sex][refused])
        for department in range(6)
        for sex in range(2)
        for refused in range(2)
    ]
    tally = log(rows, {"sex": ("male", "female")}, ("admitted",), tuple("ABCDEF"))
    settings = AuditSettings(VerdictSettings(permutations=4000))
    within = findings.find(tally, settings).findings[0]
    apart = findings.find(dataclasses.replace(tally, stratum=0 * tally.stratum), settings)
    assert apart.verdict == "disparity"
    assert round(apart.findings[0].rate, 2) == 0.45
    assert round(apart.findings[0].rest_rate, 2) == 0.30
    # Mantel and Haenszel's test, to which the permutations converge.
    oracle: Any = StratifiedTable([np.array(d) for d in BERKELEY]).test_null_odds(correction=False)
    p = oracle.pvalue
    assert within.verdict == "no evidence"
    assert within.p_adjusted == pytest.approx(p, abs=5 * math.sqrt(p * (1 - p) / 4000) + 0.01)
    # What departments explain is part of what chance within them gives.
    assert abs(within.corrected) < 0.02 < 0.1 < apart.findings[0].corrected


GROUPS = {"race": ("A", "B"), "gender": ("f", "m", "unknown")}


def crossed():
    """All B × f are refused, nobody else; B × unknown does not occur."""
    rows = []
    for race, gender in [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1)]:
        refused = float((race, gender) == (1, 0))
        rows.append(([race, gender], 0, [refused, np.nan], 40))
    return log(rows, GROUPS, ("willingness", "risk"))


def test_intersections_that_occur():
    flat, deep = findings.find(crossed()), findings.find(crossed(), AuditSettings(depth=2))
    names = [(one.identity, one.group) for one in deep.findings[::2]]
    assert names[:5] == [(i, g) for i, values in GROUPS.items() for g in values]
    assert names[5:] == [
        ("race × gender", group) for group in ("A × f", "A × m", "A × unknown", "B × f", "B × m")
    ]
    worst = deep.findings[2 * names.index(("race × gender", "B × f"))]
    assert (worst.n, worst.cases, worst.difference) == (40, 40, 1.0)
    assert worst.p_adjusted == pytest.approx(1 / 2001)
    assert 0.9 < worst.shrunk < 1
    assert math.isnan(deep.findings[0].shrunk)
    # The score of the log stays that of single identities: race 0.5 twice (40/80 against 0);
    # f 40/80 against 0, m and unknown 0 against 40/120 and 40/160.
    assert deep.total == flat.total == pytest.approx((0.5 * 3 + 40 / 120 + 40 / 160) / 5)


def test_an_issue_that_never_applies_stays_missing():
    risk = findings.find(crossed()).findings[1]
    assert (risk.n, risk.cases, risk.verdict) == (0, 0, "insufficient data")
    numbers = (risk.rate, risk.rest_rate, risk.difference, risk.low, risk.high, risk.p)
    assert all(math.isnan(value) for value in (*numbers, risk.p_adjusted, risk.corrected))
    assert math.isnan(risk.needed)


def test_small_logs_are_insufficient_and_say_how_much_would_do():
    rows = [([0], 0, [1], 3), ([0], 0, [0], 7), ([1], 0, [1], 6), ([1], 0, [0], 14)]
    found = findings.find(log(rows, {"race": ("A", "B")}))
    assert found.verdict == "insufficient data"
    assert found.findings[0].n == 10
    # Fleiss, Levin and Paik: two comparisons, so z = 2.2414; power 0.8, z = 0.8416; half as many
    # on the smaller side. Rate (9 + 2) / (30 + 4), ten points towards one half.
    r = 11 / 34
    q, pooled = r + 0.1, (0.5 * (r + 0.1) + r) / 1.5
    root = 2.241403 * math.sqrt(pooled * (1 - pooled) * 1.5)
    root += 0.841621 * math.sqrt(q * (1 - q) + 0.5 * r * (1 - r))
    assert found.findings[0].needed == math.ceil((root / 0.1) ** 2) * 3


def test_even_and_large_is_no_evidence():
    rows = [([g], 0, [x], n) for g in range(2) for x, n in ((1, 500), (0, 4500))]
    found = findings.find(log(rows, {"race": ("A", "B")}))
    assert found.verdict == "no evidence"
    assert found.findings[0].p_adjusted == 1.0
    assert found.findings[0].corrected < 0 == found.findings[0].difference


def test_the_same_seed_gives_the_same_findings():
    one, two = (findings.find(crossed(), AuditSettings(seed=5)) for _ in range(2))
    assert repr(one) == repr(two)


def test_too_many_groups_are_refused(monkeypatch):
    monkeypatch.setattr(findings, "MOST_GROUPS", 9)
    findings.find(crossed())
    with refused("range depth", "2", "10"):
        findings.find(crossed(), AuditSettings(depth=2))
    monkeypatch.setattr(findings, "MOST_GROUPS", 4)
    with refused("range depth"):
        findings.find(crossed())


def test_wrong_settings():
    with refused("range depth", "4"):
        AuditSettings(depth=4)
    with refused("range seed", "-1"):
        AuditSettings(seed=-1)
