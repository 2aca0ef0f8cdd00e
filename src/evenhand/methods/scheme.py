"""What is compared, as data: own identities, own facts and own issues.

The restaurant's five identities and the paper's four issues are one scheme. Anything else that
serves people can be described by another, and scores, statistics, detector and guidance follow:
they work on identities × issues, whatever these are called.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pyarrow as pa

from evenhand.core.errors import InputError, unknown
from evenhand.methods.paper.issues import PAPER_ISSUES, Facts, Issue, indicators
from evenhand.methods.paper.scores import Counts, Scores, count, scores_of
from evenhand.methods.services import FACTS, OWN_TYPES, Services
from evenhand.methods.vocabulary import Identity

KINDS: dict[type, pa.DataType] = {bool: OWN_TYPES[0], int: OWN_TYPES[1], float: OWN_TYPES[2]}
"""Kinds of facts that a scheme can have, and how tables hold them."""

NUMBERING = ("epoch", "service")
"""Columns that number windows and services; no fact or identity takes these names."""

LARGEST = 2.0**53
"""Whole numbers beyond it are not exact as floats."""


@dataclass(frozen=True)
class Fact:
    """One fact of a service, and which values can be true.

    Attributes:
        name: of the column.
        kind: bool, int or float.
        least: the least value that makes sense, for instance 0 of a time.
        most: the greatest.
        may_miss: whether a service may lack it; None or NaN stand for that.
    """

    name: str
    kind: type
    least: float = -math.inf
    most: float = math.inf
    may_miss: bool = False

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(
                "type fact", f"fact {self.name!r} is of kind {self.kind!r}: give bool, int or float"
            )
        if not self.least <= self.most:
            raise InputError(
                "range fact",
                f"fact {self.name!r} lies from {self.least} to {self.most}: give the least first",
            )

    @property
    def column(self) -> pa.DataType:
        """How tables hold it."""
        return FACTS.get(self.name, KINDS[self.kind])

    def wrong(self, values: np.ndarray) -> np.ndarray:
        """Which values cannot be true, bool [n].

        Args:
            values: float64 [n], NaN where missing.
        """
        missing = np.isnan(values)
        least, most = (0.0, 1.0) if self.kind is bool else (self.least, self.most)
        odd = (values < least) | (values > most) | np.isinf(values)
        if self.kind is not float:
            odd |= ~missing & (values != np.floor(values)) | (np.abs(values) > LARGEST)
        return odd if self.may_miss else odd | missing

    def wanted(self) -> str:
        """What a value should be, in words."""
        noun = {bool: "True or False", int: "a whole number", float: "a finite number"}[self.kind]
        if self.kind is not bool and self.least > -math.inf:
            noun += f" of at least {self.least:g}"
        if self.kind is not bool and self.most < math.inf:
            noun += f"{' and' if self.least > -math.inf else ' of'} at most {self.most:g}"
        return noun + (", or None where it is missing" if self.may_miss else "")


def own_issue(
    name: str,
    needs: Sequence[str],
    rule: Callable[..., np.ndarray],
    where: Callable[..., np.ndarray] | None = None,
    *,
    graded: bool = False,
) -> Issue:
    """An issue of one's own.

    Args:
        name: what it is called.
        needs: facts that it is told by.
        rule: from their columns, in this order, to whether a service has the issue: float64 [n]
            each, NaN where missing, to bool [n].
        where: the same for whether it can be said of a service at all; both sides of Eq. 1 count
            these only, as lateness is said of responses only. By default of every service.
        graded: the rule gives how severe the issue is, from 0 (none) to 1, and Eq. 1 compares mean
            severities. What needs a yes or no, such as verdicts, calls 0.5 and more an issue.

    Returns:
        The issue; not known where a fact that it needs is missing.

    Raises:
        InputError: when it needs no fact; and, once used, when a rule gives something else than
            one True or False, or one severity, per service.
    """
    needs = (needs,) if isinstance(needs, str) else tuple(needs)
    if not needs:
        raise InputError(
            "missing needs", f"issue {name!r} needs no fact: name those that its rule reads"
        )

    def asked(what: str, function: Callable[..., np.ndarray], columns: list[Any]) -> np.ndarray:
        found = np.asarray(function(*columns))
        if found.shape != columns[0].shape or found.dtype != bool:
            raise InputError(
                f"type {name}",
                f"issue {name!r}: its {what} gave {found.dtype} of shape {found.shape} for "
                f"{len(columns[0])} services: give True or False for each",
            )
        return found

    def severity(columns: list[Any], known: np.ndarray) -> np.ndarray:
        found = np.asarray(rule(*columns), float)
        if found.shape != known.shape:
            raise InputError(
                f"shape {name}",
                f"issue {name!r}: its rule gave an array of shape {found.shape} for {len(known)} "
                "services: give a severity for each",
            )
        if (wrong := known & ~((found >= 0.0) & (found <= 1.0))).any():
            row = int(np.flatnonzero(wrong)[0])
            raise InputError(
                f"range {name}",
                f"issue {name!r} has severity {found[row]:g} in service {row}: give 0 to 1",
            )
        return found

    def told(facts: Facts) -> np.ndarray:
        columns = [facts.fact(fact) for fact in needs]
        if not len(columns[0]):
            return np.zeros(0)  # a rule may take a mean or a maximum
        known = ~np.any([_missing(column) for column in columns], axis=0)
        if where is not None:
            known &= asked("where", where, columns)
        happened = severity(columns, known) if graded else asked("rule", rule, columns)
        return np.where(known, happened, np.nan)

    return Issue(name, told, needs)


@dataclass(frozen=True)
class Scheme:
    """Identities, facts and issues that belong together.

    Attributes:
        identities: who is compared; D of them, with G groups together.
        facts: what is known of a service.
        issues: what can go wrong in one, K of them.
    """

    identities: tuple[Identity, ...]
    facts: tuple[Fact, ...]
    issues: tuple[Issue, ...]

    def __post_init__(self) -> None:
        for kind, listed in (
            ("identities", self.identities),
            ("facts", self.facts),
            ("issues", self.issues),
        ):
            if not listed:
                raise InputError(f"empty {kind}", f"the scheme has no {kind}: name at least one")
            _once(kind, [one.name for one in listed])
        facts = [fact.name for fact in self.facts]
        _once("identities and facts", [*NUMBERING, *self.names, *facts])
        if taken := [name for name in self.names if name in FACTS]:
            raise InputError(
                f"duplicate {taken[0]}",
                f"identity {taken[0]!r} has the name of a fact: call it otherwise",
            )
        for issue in self.issues:
            for need in issue.needs:
                if need not in facts:
                    raise unknown(f"fact that issue {issue.name!r} needs:", need, facts)
        for fact in self.facts:
            house = FACTS.get(fact.name)
            if house is not None and not _fits(fact.kind, house):
                raise InputError(
                    f"conflict {fact.name}",
                    f"fact {fact.name!r} is {fact.kind.__name__}, but the house's fact of that "
                    f"name holds {house}: call it otherwise",
                )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the identities."""
        return tuple(one.name for one in self.identities)

    @property
    def issue_names(self) -> tuple[str, ...]:
        """Names of the issues."""
        return tuple(issue.name for issue in self.issues)

    @cached_property
    def groups(self) -> tuple[tuple[str, str], ...]:
        """(identity, group) of each of the G columns of a membership."""
        return tuple((one.name, group) for one in self.identities for group in one.groups)

    @property
    def own(self) -> dict[str, pa.DataType]:
        """Facts that only this scheme has, as Services want them."""
        return {f.name: f.column for f in self.facts if f.name not in FACTS}

    def inside(self, codes: np.ndarray) -> np.ndarray:
        """Who is on which side of which comparison, float64 [n, G].

        Args:
            codes: of the groups, int [n, D]; -1 where an identity is not known.
        """
        return np.concatenate(
            [one.sides[codes[:, d]] for d, one in enumerate(self.identities)], axis=1
        )

    def codes(self, table: Services) -> np.ndarray:
        """Groups of the services of a table by this scheme's order, int64 [n, D].

        Raises:
            InputError: for an identity that the table lacks, or a group that the scheme does.
        """
        columns = []
        for one in self.identities:
            codes, there = table.identity(one.name)
            for place in np.unique(codes[codes >= 0]).tolist():
                if there[place] not in one.groups:
                    row = int(np.flatnonzero(codes == place)[0])
                    raise unknown(f"group of {one.name!r} in row {row}", there[place], one.groups)
            code_of = {group: code for code, group in enumerate(one.groups)}
            moved = np.array([*(code_of.get(group, -1) for group in there), -1])
            columns.append(moved[codes])
        return np.stack(columns, axis=1)

    def indicators(self, facts: Facts) -> np.ndarray:
        """Which service has which issue, float64 [n, K], see :func:`issues.indicators`."""
        return indicators(facts, self.issues)

    def count(self, table: Services) -> Counts:
        """All that Eq. 1 needs of a table, [G, K].

        Raises:
            InputError: as :meth:`codes`, or when a fact is absent.
        """
        return count(self.indicators(table), self.inside(self.codes(table)))

    def score(self, table: Services) -> Scores:
        """Eq. 1 and 2 of a table.

        Raises:
            InputError: as :meth:`count`.
        """
        return scores_of(self.count(table), self.groups, self.issue_names)


def paper_facts() -> tuple[Fact, ...]:
    """What the paper's four issues need."""
    return (
        Fact("responded", bool),
        Fact("response_step", int, least=0, may_miss=True),
        Fact("response_distance", float, least=0.0, may_miss=True),
        Fact("min_distance", float, least=0.0, may_miss=True),
    )


def paper_scheme(identities: Sequence[Identity]) -> Scheme:
    """The paper's four issues for identities of one's own."""
    return Scheme(tuple(identities), paper_facts(), PAPER_ISSUES)


def _missing(column: np.ndarray) -> np.ndarray:
    """Where a column has no value: None in text, NaN in numbers."""
    return column == None if column.dtype == object else np.isnan(column)  # noqa: E711 - each cell


def _once(kind: str, names: Sequence[str]) -> None:
    for name in names:
        if not name:
            raise InputError("missing name", f"one of the {kind} has no name: give it one")
        if names.count(name) > 1:
            raise InputError(
                f"duplicate {name}", f"{name!r} stands twice among the {kind}: call one otherwise"
            )


def _fits(kind: type, column: pa.DataType) -> bool:
    fits = {bool: pa.types.is_boolean, int: pa.types.is_integer, float: pa.types.is_floating}
    return fits[kind](column)


def named(issues: Sequence[Issue], found: np.ndarray) -> list[str]:
    """Issues that a service has, a graded one from 0.5 on and with its severity.

    Args:
        issues: K of them.
        found: row of ``indicators``, [K].
    """
    return [
        one.name if value == 1.0 else f"{one.name} {value:.2f}"
        for one, value in zip(issues, found, strict=True)
        if value >= 0.5
    ]
