"""Definitions 1 to 4 of the paper: the four issues that a service can have.

An issue is a rule on the facts of services. Shapes: n services, K issues.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from evenhand.core.errors import InputError
from evenhand.methods.vocabulary import FARTHEST, LATE, NEAREST, RISK


@dataclass(frozen=True)
class Thresholds:
    """The paper's limits (section "Experiment Setting").

    Attributes:
        nearest: least proper distance of a response, metres.
        farthest: greatest proper distance of a response, metres.
        late: physics steps after which a response is late.
        risk: distance below which any step is risky, metres.
    """

    nearest: float = NEAREST
    farthest: float = FARTHEST
    late: float = float(LATE)
    risk: float = RISK

    def __post_init__(self) -> None:
        numbers = (self.nearest, self.farthest, self.late, self.risk)
        if not all(np.isfinite(numbers)) or min(numbers) < 0 or self.nearest > self.farthest:
            raise InputError(
                "range thresholds",
                f"thresholds {numbers} are not finite numbers with 0 <= nearest <= farthest",
            )


class Facts(Protocol):
    """Columns of facts; Services are such."""

    def fact(self, name: str) -> np.ndarray:
        """A fact as numbers, float64 [n] with NaN for what is missing."""
        ...

    def __contains__(self, name: str) -> bool: ...


@dataclass(frozen=True)
class Issue:
    """A named rule on facts; ``schemes.own_issue`` makes one of columns.

    Attributes:
        name: what it is called.
        rule: from facts to 1 (issue), 0 (none), NaN (does not apply or not known), [n]; how severe
            it is, 0 to 1, where an issue is graded.
        needs: facts the rule reads.
    """

    name: str
    rule: Callable[[Facts], np.ndarray]
    needs: tuple[str, ...]


def _of_response(x: Facts, name: str) -> np.ndarray:
    """A fact of the response; missing without one, though a log may hold its last value."""
    value = x.fact(name)
    if "responded" in x:
        value = np.where(x.fact("responded") == 0.0, np.nan, value)
    return value


def _willingness(x: Facts, limit: Thresholds) -> np.ndarray:
    del limit
    return 1.0 - x.fact("responded")


def _quality(x: Facts, limit: Thresholds) -> np.ndarray:
    distance = _of_response(x, "response_distance")
    improper = (distance < limit.nearest) | (distance > limit.farthest)
    return np.where(np.isnan(distance), np.nan, improper)


def _priority(x: Facts, limit: Thresholds) -> np.ndarray:
    step = _of_response(x, "response_step")
    return np.where(np.isnan(step), np.nan, step > limit.late)


def _risk(x: Facts, limit: Thresholds) -> np.ndarray:
    least = x.fact("min_distance")
    return np.where(np.isnan(least), np.nan, least < limit.risk)


@dataclass(frozen=True)
class _Definition:
    """A definition with its limits. It can be sent to another process, and is equal there."""

    of: Callable[[Facts, Thresholds], np.ndarray]
    limit: Thresholds

    def __call__(self, x: Facts) -> np.ndarray:
        return self.of(x, self.limit)


def paper_issues(thresholds: Thresholds | None = None) -> tuple[Issue, ...]:
    """Definitions 1-4: willingness, quality, priority, risk.

    Quality and priority are said of responses only: a service without one has neither.
    """
    limit = thresholds or Thresholds()
    return (
        Issue("willingness", _Definition(_willingness, limit), ("responded",)),
        Issue("quality", _Definition(_quality, limit), ("response_distance",)),
        Issue("priority", _Definition(_priority, limit), ("response_step",)),
        Issue("risk", _Definition(_risk, limit), ("min_distance",)),
    )


PAPER_ISSUES = paper_issues()


def indicators(facts: Facts, issues: Sequence[Issue] = PAPER_ISSUES) -> np.ndarray:
    """Which service has which issue, float64 [n, K]; NaN where an issue does not apply.

    Raises:
        InputError: when a fact that an issue needs is absent.
    """
    for issue in issues:
        for fact in issue.needs:
            if fact not in facts:
                raise InputError(
                    "missing issue",
                    f"issue {issue.name!r} needs the fact {fact!r}, which this table lacks: "
                    "add the column or leave the issue out",
                )
    return np.stack([issue.rule(facts) for issue in issues], axis=1)
