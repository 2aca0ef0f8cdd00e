"""Eq. 1 and 2 of the paper: how unevenly groups of people meet the issues.

Everything works on identities × issues, whatever they are called. Shapes: n services, G groups,
K issues; leading axes, for instance many windows at once, are carried along.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evenhand.core.errors import InputError, unknown
from evenhand.methods.paper.issues import PAPER_ISSUES, Issue, indicators
from evenhand.methods.services import Services


@dataclass(frozen=True)
class Membership:
    """Who belongs to which group.

    Attributes:
        inside: 1 in the group, 0 not, NaN unknown, float64 [..., n, G].
        groups: (identity, category) of each column.
    """

    inside: np.ndarray
    groups: tuple[tuple[str, str], ...]

    def columns(self, identity: str) -> np.ndarray:
        """Indices of the groups of one identity (G_c).

        Raises:
            InputError: when there is no such identity.
        """
        found = [g for g, (name, _) in enumerate(self.groups) if name == identity]
        if not found:
            raise unknown("identity", identity, self.identities)
        return np.array(found)

    @property
    def identities(self) -> tuple[str, ...]:
        """Names of the identities, in order."""
        return tuple(dict.fromkeys(name for name, _ in self.groups))


def membership(table: Services) -> Membership:
    """Groups of every identity: one column a category."""
    columns, groups = [], []
    for name in table.identities:
        codes, categories = table.identity(name)
        belongs = (codes[:, None] == np.arange(len(categories))).astype(float)
        belongs[codes < 0] = np.nan
        columns.append(belongs)
        groups += [(name, category) for category in categories]
    if not columns:
        raise InputError(
            "missing identities", "there are no identities: a disparity needs groups to compare"
        )
    return Membership(np.concatenate(columns, axis=1), tuple(groups))


@dataclass(frozen=True)
class Counts:
    """All that Eq. 1 needs of a window; every later number is a function of these.

    Attributes:
        inside_n: services of the group to which the issue applies, [..., G, K].
        inside_x: of those, services with the issue, or the sum of its severities, [..., G, K].
        outside_n: the same of the others.
        outside_x: the same of the others.
    """

    inside_n: np.ndarray
    inside_x: np.ndarray
    outside_n: np.ndarray
    outside_x: np.ndarray

    def rounded(self) -> Counts:
        """With severities of graded issues, added up, as whole numbers of issues."""
        return replace(self, inside_x=np.round(self.inside_x), outside_x=np.round(self.outside_x))

    def __add__(self, other: Counts) -> Counts:
        return Counts(
            self.inside_n + other.inside_n,
            self.inside_x + other.inside_x,
            self.outside_n + other.outside_n,
            self.outside_x + other.outside_x,
        )


def count(x: np.ndarray, inside: np.ndarray) -> Counts:
    """Count issues on both sides of every group.

    Args:
        x: indicators, [..., n, K].
        inside: membership, [..., n, G].

    Returns:
        Counts; services with an unknown side or an issue that does not apply count nowhere.
    """
    applies = (~np.isnan(x)).astype(float)
    happened = np.nan_to_num(x)
    is_in = np.nan_to_num(inside).swapaxes(-1, -2)
    is_out = np.nan_to_num(1.0 - inside).swapaxes(-1, -2)
    return Counts(is_in @ applies, is_in @ happened, is_out @ applies, is_out @ happened)


def signed_gaps(counts: Counts) -> np.ndarray:
    """Pr(issue | in the group) - Pr(issue | not in it), [..., G, K]; NaN if a side is empty."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return counts.inside_x / counts.inside_n - counts.outside_x / counts.outside_n


def gaps(counts: Counts) -> np.ndarray:
    """d(g) of Eq. 1, in [0, 1], [..., G, K]; NaN (missing) if a side is empty."""
    return np.abs(signed_gaps(counts))


def issue_score(gap: np.ndarray) -> np.ndarray:
    """I(G) of Eq. 2: mean over the groups whose gap is defined.

    Args:
        gap: [..., G, K].

    Returns:
        [..., K]; NaN when no group has a defined gap.
    """
    known = ~np.isnan(gap)
    n = known.sum(axis=-2)
    total = np.where(known, gap, 0.0).sum(axis=-2)
    return np.where(n > 0, total / np.maximum(n, 1), np.nan)


@dataclass(frozen=True)
class Scores:
    """How unevenly the services of a window, or of many windows, were given.

    Attributes:
        issues: names of the K issues.
        groups: (identity, category) of the G groups.
        gap: d(g), [..., G, K], NaN where missing.
        overall: I over all groups, [..., K].
        by_identity: identity -> I over its groups, [..., K].
        missing: gaps that Eq. 1 cannot say, for each issue, int64 [..., K].
    """

    issues: tuple[str, ...]
    groups: tuple[tuple[str, str], ...]
    gap: np.ndarray
    overall: np.ndarray
    by_identity: Mapping[str, np.ndarray]
    missing: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """Total issue score: the sum of the defined components of I over all groups, [...]."""
        return total(self.overall)

    def total_of(self, identity: str) -> np.ndarray:
        """The same for the groups of one identity, [...]."""
        return total(self.by_identity[identity])


def total(score: np.ndarray) -> np.ndarray:
    """Sum of the components that are defined, [..., K] -> [...]; NaN when none is."""
    return np.where(np.isnan(score).all(axis=-1), np.nan, np.nansum(score, axis=-1))


def scores_of(counts: Counts, groups: Sequence[tuple[str, str]], issues: Sequence[str]) -> Scores:
    """Eq. 1 and 2 from counts.

    Args:
        counts: of a window or of many, [..., G, K].
        groups: (identity, category) of each group.
        issues: names of the issues.
    """
    gap = gaps(counts)
    return averaged(gap, gap, issue_score, groups, issues)


def averaged(
    gap: np.ndarray,
    value: np.ndarray,
    average: Callable[[np.ndarray], np.ndarray],
    groups: Sequence[tuple[str, str]],
    issues: Sequence[str],
) -> Scores:
    """Scores of gaps, overall and by identity.

    Args:
        gap: of each group, to be shown, [..., G, K].
        value: what is averaged, [..., G, K].
        average: over the groups, [..., G, K] -> [..., K].
        groups: (identity, category) of each group.
        issues: names of the issues.
    """
    names = [name for name, _ in groups]
    return Scores(
        issues=tuple(issues),
        groups=tuple(groups),
        gap=gap,
        overall=average(value),
        by_identity={
            name: average(value[..., [g for g, other in enumerate(names) if other == name], :])
            for name in dict.fromkeys(names)
        },
        missing=np.isnan(gap).sum(axis=-2),
    )


def score(table: Services, issues: Sequence[Issue] = PAPER_ISSUES) -> Scores:
    """Scores of one window of services.

    Args:
        table: the services of the window.
        issues: the issues to look at; the paper's four by default.

    Raises:
        InputError: when a fact is absent or there are no identities.
    """
    who = membership(table)
    x = indicators(table, issues)
    return scores_of(count(x, who.inside), who.groups, [issue.name for issue in issues])


def own_groups_score(gap: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """For each person, I over the groups that this person belongs to.

    Args:
        gap: d(g) of the window, [G, K].
        inside: membership, [n, G].

    Returns:
        [n, K]; NaN where none of the person's groups has a defined gap.
    """
    known = ~np.isnan(gap)
    mine = np.nan_to_num(inside)
    n = mine @ known.astype(float)
    summed = mine @ np.where(known, gap, 0.0)
    return np.where(n > 0, summed / np.maximum(n, 1), np.nan)
