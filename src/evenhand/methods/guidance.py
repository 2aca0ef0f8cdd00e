"""Guidance: what evenness is worth to the robot (the paper's Eq. 4 and 5). Pure arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from evenhand.core.errors import InputError, unknown
from evenhand.methods.beyond.levelup import CreditSettings
from evenhand.methods.paper.scores import Scores, own_groups_score

SERVICE_KINDS = ("influence", "surgery", "levelup")
"""Kinds that are added to a service reward; see ``credit``."""
KINDS = ("none", "score", "penalty", *SERVICE_KINDS)
WHEN = ("always", "biased")
CREDITS = ("own_groups", "epoch")

STRENGTH: Mapping[str, float] = {"influence": 0.5, "surgery": 1.0, "levelup": 5.0}
"""``CreditSettings.strength`` of each kind that was best of four on seeds kept for tuning."""

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


@dataclass(frozen=True)
class GuidanceSettings:
    """What the robot is told about its evenness.

    Attributes:
        kind: none; score (Eq. 4); penalty (Eq. 4 and 5); influence: minus the influence of each
            service on the total issue score; surgery: its gradient, off what conflicts with
            service; levelup: issues of worse-off groups cost more.
        credit: own_groups: a person's reward counts the groups this person belongs to; epoch: one
            reward for everybody.
        tau: weight of each issue, a preset or four numbers of at least 0.
        penalty: lambda of Eq. 5, by which the reward of a biased epoch is multiplied.
        when: whether influence, surgery and levelup count always, or in epochs that the detector
            calls biased.
        weigh: how much they weigh, and which gaps steer.
        guarded: whether they give way while service becomes worse for a group, see ``guard``.
    """

    kind: Literal["none", "score", "penalty", "influence", "surgery", "levelup"] = "penalty"
    credit: Literal["own_groups", "epoch"] = "own_groups"
    tau: tuple[float, float, float, float] = TAU["equal"]
    penalty: float = 0.5
    when: Literal["always", "biased"] = "always"
    weigh: CreditSettings = field(default_factory=CreditSettings)
    guarded: bool = True

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise unknown("guidance", self.kind, KINDS)
        if self.credit not in CREDITS:
            raise unknown("credit", self.credit, CREDITS)
        if self.when not in WHEN:
            raise unknown("when", self.when, WHEN)
        check_tau(self.tau)
        if not 0.0 <= self.penalty <= 1.0:
            raise InputError(f"penalty is {self.penalty}: lambda multiplies rewards, give 0 to 1")


def guided(kind: str, strength: float | None = None, **others: Any) -> GuidanceSettings:
    """Guidance of a kind with the strength that suits it.

    Args:
        kind: one of ``KINDS``.
        strength: of evenness; by default the kind's own, see ``STRENGTH``.
        **others: fields of ``GuidanceSettings``.

    Raises:
        InputError: for an unknown kind, or a strength that is not finite or below 0.
    """
    chosen = STRENGTH.get(kind, 1.0) if strength is None else strength
    return GuidanceSettings(kind, weigh=CreditSettings(strength=chosen), **others)  # type: ignore[arg-type]


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
    scores: Scores,
    inside: np.ndarray,
    biased: bool,
    settings: GuidanceSettings,
    tau: Sequence[float] | np.ndarray | None = None,
) -> np.ndarray:
    """R_t for every person of an epoch (Eq. 4, and Eq. 5 when the detector says biased).

    Args:
        scores: of the epoch.
        inside: membership of the people, [n, G].
        biased: the detector's verdict on the epoch.
        settings: which reward; what is not of Eq. 4 gives 0.
        tau: weight of each issue where they are not the paper's four; else that of the settings.

    Returns:
        [n].
    """
    n = len(inside)
    if settings.kind not in ("score", "penalty"):
        return np.zeros(n)
    if settings.credit == "own_groups":
        score = own_groups_score(scores.gap, inside)
    else:
        score = np.broadcast_to(scores.overall, (n, len(scores.overall)))
    reward = evenness_reward(score, settings.tau if tau is None else tau)
    if settings.kind == "penalty" and biased:
        reward = settings.penalty * reward
    return reward
