"""What people judged: scores of windows, answers, and the names that both are known by.

The detector is fitted to and evaluated on judgements. This room holds their names and the
checks that every way in shares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenhand.core.errors import InputError, unknown

ISSUES = ("willingness", "quality", "priority", "risk")
"""The paper's four issues, in the order of Eq. 2."""

IDENTITIES = ("race", "gender", "age", "disability")
"""The identities that respondents are asked about; the paper's study left skin colour out."""

DISCRIMINATIONS = ("racism", "sexism", "ageism", "ableism")
"""What unevenness between the groups of each of ``IDENTITIES`` is called."""

SIMULATED = "simulated respondents"
SOURCES = (SIMULATED, "respondents")
"""Where judgements can come from; told wherever a detector or its evaluation is shown."""


LEAST = 30
"""Services that a group needs before it can be called the one served worst: of many small groups
one has bad luck."""


@dataclass(frozen=True)
class Identity:
    """One identity and its groups.

    Attributes:
        name: of the column.
        groups: names in the order of their codes, 0 first; at least two.
        reference: the group that the others are compared with; by default each group is compared
            with everybody else, as in Eq. 1. The reference itself always is.
    """

    name: str
    groups: tuple[str, ...]
    reference: str | None = None

    def __post_init__(self) -> None:
        named = isinstance(self.groups, tuple | list) and all(
            isinstance(group, str) and group for group in self.groups
        )
        if not named:
            raise InputError(
                f"identity {self.name!r} has the groups {self.groups!r}: give a tuple of names, "
                "each a text"
            )
        if len(self.groups) < 2 or len(set(self.groups)) < len(self.groups):
            raise InputError(
                f"identity {self.name!r} has the groups {list(self.groups)}: name two or more, "
                "each once"
            )
        if self.reference is not None and self.reference not in self.groups:
            raise unknown(f"reference group of {self.name!r}", self.reference, self.groups)

    @cached_property
    def sides(self) -> np.ndarray:
        """For each code, the last row for a missing one: 1 in the group, 0 on the other side.

        NaN where it is on neither, float64 [groups + 1, groups].
        """
        size = len(self.groups)
        sides = np.concatenate([np.eye(size), np.full((1, size), np.nan)])
        if self.reference is not None:
            other = self.groups.index(self.reference)
            neither = ~np.eye(size, dtype=bool)
            neither[other], neither[:, other] = False, False
            sides[:-1][neither] = np.nan
        return sides


def checked_scores(issue_scores: ArrayLike, issues: tuple[str, ...]) -> NDArray[np.float64]:
    """Issue scores as float64 [..., K]; NaN is allowed.

    Raises:
        InputError: when the last dimension is not K or a score is outside [-1, 1], where every
            difference of two rates lies, corrected for chance or not.
    """
    try:
        scores = np.asarray(issue_scores, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"issue scores must be an array of numbers: {error}") from error
    if scores.ndim == 0 or scores.shape[-1] != len(issues):
        raise InputError(
            f"issue scores have shape {scores.shape}: the last dimension must be the "
            f"{len(issues)} issues {', '.join(issues)}"
        )
    if (np.abs(scores) > 1 + 1e-9).any():
        raise InputError(
            f"issue scores lie between -1 and 1, but {np.nanmax(np.abs(scores)):g} was given: "
            "use shares, not percent"
        )
    return scores


def checked_judgements(
    issue_scores: ArrayLike,
    biased: ArrayLike,
    kinds: Sequence[str | None] | None,
    issues: tuple[str, ...],
) -> tuple[NDArray[np.float64], NDArray[np.bool_], list[str | None]]:
    """Judgements as arrays of one length without gaps, for fitting and for evaluation.

    Returns:
        Scores float [n, K], biased bool [n], kinds (n names, None where nobody named one).

    Raises:
        InputError: as ``fit``.
    """
    scores = checked_scores(issue_scores, issues)
    answers = np.asarray(biased)
    if scores.ndim != 2 or answers.shape != scores.shape[:1]:
        raise InputError(
            f"judgements need scores [n, {len(issues)}] and answers [n], but the shapes are "
            f"{scores.shape} and {answers.shape}"
        )
    if answers.dtype.kind not in "biuf" or not np.isin(answers, (0, 1)).all():
        raise InputError("the answers 'biased' must be True or False")
    for row, column in np.argwhere(np.isnan(scores))[:1]:
        raise InputError(
            f"row {row} has no score for issue {issues[column]!r}: leave out judgements of "
            "windows with a missing score"
        )
    y = answers.astype(bool)
    if y.all() or not y.any():
        raise InputError(
            f"all {len(y)} judgements are {'biased' if y.any() else 'not biased'}: "
            "the detector needs examples of both"
        )
    names: list[str | None] = (
        [None] * len(y) if kinds is None else [str(k) if k else None for k in kinds]
    )
    if len(names) != len(y):
        raise InputError(f"there are {len(names)} kinds for {len(y)} judgements")
    for row, name in enumerate(names):
        if name is not None and not y[row]:
            raise InputError(f"row {row} names {name!r} but was judged not biased")
    return scores, y, names
