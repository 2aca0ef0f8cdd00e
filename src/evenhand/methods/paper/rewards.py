"""Rewards of evenness: Eq. 4, and Eq. 5 which lowers it in epochs that look biased."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from evenhand.core.errors import InputError
from evenhand.methods.paper.scores import Scores, own_groups_score

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
        raise InputError(
            "range tau", f"tau is {tuple(tau)}: give {many} finite numbers of at least 0"
        )
    if not weights.any():
        raise InputError("range tau", "tau is 0 for every issue: give at least one issue a weight")
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
