"""An epoch after its last service: counted at once, scored and judged when somebody asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evenhand import issues, people
from evenhand.detector import Detector, WindowVerdict
from evenhand.restaurant import serve
from evenhand.restaurant.lanes import Facts

ISSUES = tuple(issue.name for issue in issues.PAPER_ISSUES)


@dataclass(frozen=True)
class Epoch:
    """n finished services and how even they were.

    Attributes:
        done: the services; observations as the policy saw them.
        codes: identities of the people served, int64 [n, 5].
        x: issues, [n, 4], NaN where one does not apply.
        inside: membership, [n, 22].
        counts: of these services.
        judge: what a detector says of their scores.
    """

    done: serve.Services
    codes: np.ndarray
    x: np.ndarray
    inside: np.ndarray
    counts: issues.Counts
    judge: Callable[[issues.Scores], WindowVerdict]

    @cached_property
    def scores(self) -> issues.Scores:
        """Of these services (Eq. 1 and 2)."""
        return issues.scores_of(self.counts, people.GROUPS, ISSUES)

    @cached_property
    def verdict(self) -> WindowVerdict:
        """What the detector says of them (Eq. 3)."""
        return self.judge(self.scores)

    @property
    def biased(self) -> bool:
        """Whether the detector calls them biased."""
        return bool(self.verdict.biased)


def counted(done: serve.Services, codes: np.ndarray, detector: Detector) -> Epoch:
    """The issues of finished services, by group.

    Args:
        done: the services; observations as the policy saw them.
        codes: identities of the people served, int64 [n, 5].
        detector: judges them.
    """

    def judge(scores: issues.Scores) -> WindowVerdict:
        # only what the detector was taught: each identity more raises the false alarms
        return detector.judge_window(
            {name: scores.by_identity[name] for name in detector.identities}
        )

    x = issues.indicators(_Columns(done.facts))
    inside = people.encode(codes).astype(float)
    return Epoch(done, codes, x, inside, issues.count(x, inside), judge)


class _Columns:
    """Facts as rules read them, without a table in between."""

    def __init__(self, facts: Facts) -> None:
        answered = facts.responded
        self._columns = {
            "responded": answered.astype(float),
            "response_step": np.where(answered, facts.steps, np.nan),
            "response_distance": np.where(answered, facts.distance, np.nan),
            "min_distance": facts.min_distance,
        }

    def __contains__(self, name: str) -> bool:
        return name in self._columns

    def fact(self, name: str) -> np.ndarray:
        return self._columns[name]
