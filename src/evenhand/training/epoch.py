"""An epoch after its last service: counted, scored and judged when somebody asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evenhand.methods.paper import issues
from evenhand.methods.paper.detector import Detector, WindowVerdict
from evenhand.methods.paper.scores import Counts, Scores, count, scores_of
from evenhand.restaurant import people
from evenhand.restaurant.simulation import serve
from evenhand.restaurant.simulation.lanes import Facts

ISSUES = tuple(issue.name for issue in issues.PAPER_ISSUES)


@dataclass(frozen=True)
class Epoch:
    """n finished services and how even they were.

    Attributes:
        done: the services; observations as the policy saw them.
        codes: identities of the people served, int64 [n, 5].
        judge: what a detector says of their scores.
    """

    done: serve.Services
    codes: np.ndarray
    judge: Callable[[Scores], WindowVerdict]

    @cached_property
    def x(self) -> np.ndarray:
        """Issues, [n, 4], NaN where one does not apply."""
        return issues.indicators(_Columns(self.done.facts))

    @cached_property
    def inside(self) -> np.ndarray:
        """Membership, [n, 22]."""
        return people.encode(self.codes).astype(float)

    @cached_property
    def counts(self) -> Counts:
        """Of these services."""
        return count(self.x, self.inside)

    @cached_property
    def scores(self) -> Scores:
        """Of these services (Eq. 1 and 2)."""
        return scores_of(self.counts, people.GROUPS, ISSUES)

    @cached_property
    def verdict(self) -> WindowVerdict:
        """What the detector says of them (Eq. 3)."""
        return self.judge(self.scores)

    @property
    def biased(self) -> bool:
        """Whether the detector calls them biased."""
        return bool(self.verdict.biased)


def judged_by(done: serve.Services, codes: np.ndarray, detector: Detector) -> Epoch:
    """Finished services, to be judged by a detector when somebody asks.

    Args:
        done: the services; observations as the policy saw them.
        codes: identities of the people served, int64 [n, 5].
        detector: judges them.
    """

    def judge(scores: Scores) -> WindowVerdict:
        # only what the detector was taught: each identity more raises the false alarms
        return detector.judge_window(
            {name: scores.by_identity[name] for name in detector.identities}
        )

    return Epoch(done, codes, judge)


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
