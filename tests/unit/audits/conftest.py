"""Made-up findings: a disparity, an even identity, a group too small, one without any service."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from evenhand.audits.judge.results import (
    AuditSettings,
    Finding,
    Findings,
    MeasureFinding,
    Resemblance,
    WaitFinding,
)
from evenhand.audits.show.wording import About
from evenhand.statistics.verdicts import VerdictSettings

NAN = math.nan
ISSUES = ("willingness", "quality", "priority", "risk")


def finding(
    identity: str,
    group: str,
    issue: str,
    inside: tuple[int, int],
    rest: tuple[int, int],
    verdict: str = "no evidence",
    **other: Any,
) -> Finding:
    """One finding from (services with the issue, services) of both sides; limits ±5 points."""
    (x, n), (y, m) = inside, rest
    rate, rest_rate = (x / n if n else NAN), (y / m if m else NAN)
    gap = rate - rest_rate
    values: dict[str, Any] = {
        "low": gap - 0.05,
        "high": gap + 0.05,
        "corrected": abs(gap) - 0.01,
        "p": 0.4,
        "p_adjusted": 0.9,
        "needed": NAN,
    }
    return Finding(
        identity=identity,
        group=group,
        issue=issue,
        n=n,
        cases=x,
        rate=rate,
        rest_n=m,
        rest_rate=rest_rate,
        difference=gap,
        verdict=verdict,
        **(values | other),
    )


def mixed_findings() -> tuple[Finding, ...]:
    """Age with disparities, gender even, badge with an empty and a small group."""
    made = []
    for place, issue in enumerate(ISSUES):
        found = {"p": 0.0005, "p_adjusted": 0.0005, "verdict": "disparity"}
        less = {"p": 0.004, "p_adjusted": 0.0123, "verdict": "disparity"}
        unlike = found if issue in ("willingness", "risk") else {}
        child = less if issue == "willingness" else {}
        made += [
            finding("age", "Child", issue, (8 if child else 20 + place, 160), (158, 840), **child),
            finding("age", "Adult", issue, (95 + place, 600), (79, 400)),
            finding("age", "Elder", issue, (72 if unlike else 36, 240), (91, 760), **unlike),
            finding("gender", "Female", issue, (60 + place, 500), (58, 500)),
            finding("gender", "Male", issue, (58, 500), (60 + place, 500)),
            finding("badge", "visitor", issue, (3, 7), (163, 993), "insufficient data",
                    needed=12345.0 + place),
            finding("badge", "staff", issue, (163, 993), (3, 7), "insufficient data",
                    needed=12345.0 + place),
            finding("badge", "unknown", issue, (0, 0), (166, 1000), "insufficient data",
                    low=NAN, high=NAN, corrected=NAN, p=NAN, p_adjusted=NAN),
        ]  # fmt: skip
    return tuple(made)


def waits(
    group: str,
    n: int,
    responses: int,
    median: float,
    unserved: tuple[float, float, float],
    rest: float,
    gap: tuple[float, float, float],
    p: float,
) -> WaitFinding:
    """Waiting of one group of ages; shares and differences with their limits."""
    return WaitFinding("age", group, n, responses, median, *unserved, rest, *gap, p)


def all_findings(**other: Any) -> Findings:
    """A whole audit of 1,000 made-up services."""
    values: dict[str, Any] = {
        "findings": mixed_findings(),
        "waits": (
            waits("Child", 160, 150, 1.26, (0.1, 0.06, 0.16), 0.2, (-0.1, -0.16, -0.03), 0.3),
            waits("Adult", 600, 520, 1.5, (0.17, 0.14, 0.2), 0.21, (-0.04, -0.09, 0.01), 0.4),
            waits("Elder", 240, 160, NAN, (0.55, 0.49, 0.61), 0.15, (0.4, 0.33, 0.46), 0.0006),
            waits("unknown", 0, 0, NAN, (NAN, NAN, NAN), 0.2, (NAN, NAN, NAN), NAN),
        ),
        "measures": (
            MeasureFinding("smiles", "age", "Elder", 240, 1.25, 2.5, 0.002, 1.0, 2.0, 0.06),
            MeasureFinding("smiles", "age", "Adult", 600, 2.4, 2.1, 0.5, 2.0, 1.5, 0.7),
        ),
        "resemblance": (
            Resemblance("age", (0.135, 0.031, 0.032, 0.121), 0.42, 0.11, "ageism"),
            Resemblance("gender", (0.004, 0.006, 0.008, 0.01), 0.12, 0.13, None),
            Resemblance("badge", (NAN, NAN, NAN, NAN), NAN, NAN, None),
        ),
        "verdict": "disparity",
        "total": 0.3117,
        "even_total": 0.1204,
        "p_total": 0.0005,
        "services": 1000,
        "settings": AuditSettings(verdict=VerdictSettings(permutations=2000), seed=7),
    }  # fmt: skip
    return Findings(**(values | other))


@pytest.fixture
def one() -> Callable[..., Finding]:
    return finding


@pytest.fixture
def made_up() -> Callable[..., Findings]:
    return all_findings


@pytest.fixture
def about() -> About:
    return About(
        title="fleet.parquet",
        log={"file": "fleet.parquet", "rows": 1000, "engine": "DuckDB", "from": None},
        mapping=(
            ("identity", "age", ""),
            ("identity", "gender", ""),
            ("identity", "badge", ""),
            ("responded", "served", ""),
            ("response time", "waited", "s"),
        ),
        command="evenhand audit fleet.parquet --seed 7",
        synthetic=True,
        left_out=("The log has no column for the tone of voice.",),
        meanings={"priority": "a response after more than 4 s"},
        late=4.0,
    )
