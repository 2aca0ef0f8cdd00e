"""Rewards of evenness: Eq. 4, and Eq. 5 which lowers it in epochs that look biased."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from evenhand.core import palette
from evenhand.core.errors import InputError, unknown
from evenhand.methods.guidance import Guidance
from evenhand.methods.paper.epoch import Epoch
from evenhand.methods.paper.scores import Scores, own_groups_score
from evenhand.methods.registry import VERDICT, method

CREDITS = ("own_groups", "epoch")
TAU: Mapping[str, tuple[float, float, float, float]] = {
    "equal": (1.0, 1.0, 1.0, 1.0),
    "risk_first": (1.0, 1.0, 1.0, 2.0),
    "willingness_first": (2.0, 1.0, 1.0, 1.0),
    "risk_then_willingness": (1.5, 1.0, 1.0, 2.0),
}
"""Presets of tau, in the order willingness, quality, priority, risk.

The printed runs use ``equal``. The paper puts risk in the first class and willingness in the
second, without numbers: ``risk_then_willingness``; the sizes are chosen here.
"""


def check_tau(tau: Sequence[float] | np.ndarray, issues: int = 4) -> np.ndarray:
    """Weights of the issues as an array.

    Args:
        tau: the weights.
        issues: how many there are; the paper's four by default.

    Raises:
        InputError: for another number than that of the issues, or for negative or non-finite
            weights, or none above 0.
    """
    weights = np.asarray(tau, float)
    if weights.shape != (issues,) or not np.isfinite(weights).all() or (weights < 0).any():
        many = "four" if issues == 4 else issues
        raise InputError(f"tau is {tuple(tau)}: give {many} finite numbers of at least 0")
    if not weights.any():
        raise InputError("tau is 0 for every issue: give at least one issue a weight")
    return weights


def evenness_reward(score: np.ndarray, tau: Sequence[float] | np.ndarray) -> np.ndarray:
    """Eq. 4: R = sum over issues of tau (1 - I).

    A component that Eq. 1 cannot say is left out and the others are scaled up to the same
    greatest reward, so that a missing score neither pays nor costs.

    Args:
        score: I, [..., K], NaN where missing.
        tau: weights of the issues.

    Returns:
        R, [...], in [0, sum of tau]; half of the greatest reward where every component is
        missing, for nothing is known.
    """
    weights = check_tau(tau, np.shape(score)[-1])
    known = ~np.isnan(score)
    present = (known * weights).sum(axis=-1)
    earned = np.where(known, weights * (1.0 - score), 0.0).sum(axis=-1)
    share = np.where(present > 0, earned / np.where(present > 0, present, 1.0), 0.5)
    return weights.sum() * share


def person_rewards(
    scores: Scores, inside: np.ndarray, tau: Sequence[float] | np.ndarray, credit: str
) -> np.ndarray:
    """R_t of Eq. 4 for every person, [n].

    Args:
        scores: of the epoch.
        inside: membership of the people, [n, G].
        tau: weight of each issue.
        credit: own_groups: I over the groups that a person belongs to; epoch: over all of them.
    """
    if credit == "own_groups":
        score = own_groups_score(scores.gap, inside)
    else:
        score = np.broadcast_to(scores.overall, (len(inside), len(scores.overall)))
    return evenness_reward(score, tau)


@method("score", label="score (Eq. 4)", colour=palette.VERMILLION, marker="o")
@dataclass(frozen=True)
class Score:
    """Eq. 4: the more even an epoch, the more its services earn."""

    strength: float = 2.0
    """Greatest reward beside a perfect service's 1; no matter where evenness is all that pays."""

    credit: Literal["own_groups", "epoch"] = "own_groups"
    """Whose disparity the reward for a person counts.
    own_groups: of the groups this person belongs to.
    epoch: of all groups, the same for everybody."""

    def __post_init__(self) -> None:
        if self.credit not in CREDITS:
            raise unknown("credit", self.credit, CREDITS)
        if not 0.0 <= self.strength < np.inf:
            raise InputError(f"strength is {self.strength}: give a finite number from 0 up")

    def begin(self, scheme: Any) -> None:
        """Nothing to remember."""

    def teach(self, epoch: Epoch, memory: None) -> tuple[Guidance, None]:
        """A service earns by the epoch that it belongs to."""
        return Guidance(evenness=self.pay(epoch, epoch, memory)), memory

    def pay(self, services: Epoch, window: Epoch, memory: None) -> np.ndarray:
        """What services earn by the scores of a window that is over, [m]."""
        paid = self._rewards(services, window)
        return self.strength * paid / services.tau.sum()

    def alone(self, epoch: Epoch) -> np.ndarray:
        """The printed reward and nothing else, [n]."""
        return self._rewards(epoch, epoch)

    def _rewards(self, services: Epoch, window: Epoch) -> np.ndarray:
        return person_rewards(window.scores, services.inside, services.tau, self.credit)


@method("penalty", label="penalty (Eq. 5)", colour=palette.ORANGE, marker="s")
@dataclass(frozen=True)
class Penalty(Score):
    """Eq. 4 and 5: as score, and all rewards of an epoch that looks biased are lowered."""

    strength: float = 1.0
    """Greatest reward beside a perfect service's 1; no matter where evenness is all that pays."""

    lam: float = 0.5
    """Lambda of Eq. 5, by which rewards of a biased epoch are multiplied, 0 to 1."""

    needs = (VERDICT,)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.lam <= 1.0:
            raise InputError(f"lam is {self.lam}: lambda multiplies rewards, give 0 to 1")

    def _rewards(self, services: Epoch, window: Epoch) -> np.ndarray:
        reward = super()._rewards(services, window)
        return self.lam * reward if window.biased else reward
