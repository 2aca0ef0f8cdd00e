"""An epoch after its last service: what every method is given, counted when it asks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from evenhand.core.errors import InputError
from evenhand.methods.paper.detector import Detector, WindowVerdict
from evenhand.methods.paper.scores import Counts, Scores, count, scores_of

Judge = Callable[[Scores], WindowVerdict]


class Weight(Protocol):
    """A number between 0 and 1."""

    @property
    def weight(self) -> float:
        """It."""
        ...


@dataclass(frozen=True, eq=False)
class Epoch:
    """n services in the order in which people were served; it knows no simulator.

    Attributes:
        x: issues of each service, float64 [n, K], NaN where an issue does not apply.
        inside: membership, float64 [n, G], NaN where unknown.
        reward: what each service earned, evenness apart, [n].
        mask: 1 for decisions that happened, [n, L].
        groups: (identity, category) of the G groups.
        issues: names of the K issues.
        tau: weight of each issue, [K].
        observation: of every decision as the policy took it, [n, L, O]; None where nobody knows.
        value: of the critic at every decision, [n, L]; None without one.
        gae_lambda: trace decay of the learner's advantages.
        scored: issues that are scored and judged where these are others than are weighed: their
            names and [n, K'] of them; None where they are the same.
        advantages_of: from rewards of the services [n] to advantages of their decisions [n, L].
        corrected_of: from counts to their total issue score without what chance alone gives, see
            `statistics.chance.corrected_scores`.
        judge: what a detector says of scores (Eq. 3); None without one.
        guard: what the guard makes evenness weigh; None without one.
        number: of the epoch, from 0.
    """

    x: np.ndarray
    inside: np.ndarray
    reward: np.ndarray
    mask: np.ndarray
    groups: Sequence[tuple[str, str]]
    issues: Sequence[str]
    tau: np.ndarray
    advantages_of: Callable[[np.ndarray], np.ndarray]
    corrected_of: Callable[[Counts], float]
    judge: Judge | None = None
    guard: Weight | None = None
    number: int = 0
    scored: tuple[Sequence[str], np.ndarray] | None = None
    observation: np.ndarray | None = None
    value: np.ndarray | None = None
    gae_lambda: float = 1.0

    def __len__(self) -> int:
        return len(self.x)

    @cached_property
    def identity(self) -> np.ndarray:
        """Number of the identity that each group belongs to, int64 [G]."""
        names = list(dict.fromkeys(name for name, _ in self.groups))
        return np.array([names.index(name) for name, _ in self.groups])

    @cached_property
    def counts(self) -> Counts:
        """Issues and services on both sides of every group, [G, K]."""
        return count(self.x, self.inside)

    @cached_property
    def scores(self) -> Scores:
        """How uneven these services were in what is weighed (Eq. 1 and 2)."""
        return scores_of(self.counts, tuple(self.groups), tuple(self.issues))

    @cached_property
    def judged(self) -> Scores:
        """How uneven they were in what is judged."""
        if self.scored is None:
            return self.scores
        names, x = self.scored
        return scores_of(count(x, self.inside), tuple(self.groups), tuple(names))

    @cached_property
    def verdict(self) -> WindowVerdict:
        """What the detector says of them (Eq. 3).

        Raises:
            InputError: without a detector.
        """
        if self.judge is None:
            raise InputError("missing detector", "the method asks for a verdict: give a detector")
        return self.judge(self.judged)

    @property
    def biased(self) -> bool:
        """Whether the detector calls them biased; errors as ``verdict``."""
        return bool(self.verdict.biased)

    @cached_property
    def advantage(self) -> np.ndarray:
        """Advantage of every decision by ``reward``, [n, L]; 0 where none happened."""
        return self.advantages_of(self.reward)

    @property
    def guard_weight(self) -> float:
        """What evenness weighs, from 0 to 1: less while service is poor or becomes worse."""
        return 1.0 if self.guard is None else self.guard.weight


@dataclass(frozen=True, eq=False)
class Answers:
    """What each service of an epoch would have been with each of A answers.

    Attributes:
        x: issues, float64 [n, A, K], NaN where an issue does not apply.
        reward: what it would have earned, evenness apart, [n, A].
        window: the services as they were.
    """

    x: np.ndarray
    reward: np.ndarray
    window: Epoch

    def over(self, each: np.ndarray) -> np.ndarray:
        """One number a service as one for each of its answers, [n, A]."""
        return np.broadcast_to(np.asarray(each, float)[:, None], self.reward.shape)

    @cached_property
    def flat(self) -> Epoch:
        """All of them as services, [n A]: no decisions, and people as in the window."""
        n, answers, issues = self.x.shape
        return replace(
            self.window,
            x=self.x.reshape(n * answers, issues),
            inside=np.repeat(self.window.inside, answers, axis=0),
            reward=self.reward.reshape(-1),
            mask=np.zeros((n * answers, 0)),
            scored=None,
            observation=None,
            value=None,
        )


def judge_of(detector: Detector | None, identities: Sequence[str]) -> Judge:
    """What a detector says of scores by some identities; each one more raises false alarms.

    Args:
        detector: without one nothing is called biased.
        identities: those that the scores have are judged.
    """

    def judge(scores: Scores) -> WindowVerdict:
        if detector is None:
            none = np.zeros((1, scores.overall.shape[-1]), bool)
            return WindowVerdict(np.array(False), np.full(1, np.nan), none, np.array(-1))
        rows = [list(scores.issues).index(name) for name in detector.issues]
        known = [name for name in identities if name in scores.by_identity]
        return detector.judge_window({name: scores.by_identity[name][..., rows] for name in known})

    return judge
