"""The words of the method, each said once: issues, limits, identities, discriminations, sources."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evenhand.core.errors import InputError, unknown

NEAREST, FARTHEST = 1.0, 1.5
"""The paper's limits ("Experiment Setting"): proper distances of a response, metres."""
LATE = 200
"""Physics steps after which a response is late."""
RISK = 0.5
"""Distance below which any step is risky, metres."""
WINDOW = 30
"""Services that are scored together: the paper's epoch."""
MANUAL_THRESHOLD = 0.5
"""The paper's manual rule: a total issue score above it is biased."""

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
                "type identity",
                f"identity {self.name!r} has the groups {self.groups!r}: give a tuple of names, "
                "each a text",
            )
        if len(self.groups) < 2 or len(set(self.groups)) < len(self.groups):
            raise InputError(
                "range identity",
                f"identity {self.name!r} has the groups {list(self.groups)}: name two or more, "
                "each once",
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
