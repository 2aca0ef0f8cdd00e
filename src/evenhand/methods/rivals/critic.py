"""Critics of what methods constrain: linear in features of an observation, fitted in closed form.

The published methods train a neural critic for every cost. A cost here is known when a service
ends, and there are up to hundreds of them (one for each group and issue), so one ridge regression
with a decaying memory predicts them all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_TIMES = 3
"""Columns after the identities: distance, time, age of the reading."""
_KEEP = 0.9
"""What an older epoch still weighs after one more."""
_RIDGE = 1.0


def features(observation: np.ndarray) -> np.ndarray:
    """1, the observation, and squares and products of distance, time and age, [..., F]."""
    last = observation[..., -_TIMES:].astype(float)
    row, column = np.triu_indices(_TIMES)
    ones = np.ones((*observation.shape[:-1], 1))
    return np.concatenate([ones, observation, last[..., row] * last[..., column]], axis=-1)


def size(groups: int) -> int:
    """F for observations of so many groups."""
    return 1 + groups + _TIMES + _TIMES * (_TIMES + 1) // 2


@dataclass(frozen=True)
class Critic:
    """Predictions of M outcomes of a service from each of its observations.

    Attributes:
        moments: Σ φ φᵀ of earlier epochs, discounted, [F, F].
        products: Σ φ y, [F, M].
    """

    moments: np.ndarray
    products: np.ndarray

    @classmethod
    def none(cls, groups: int, outcomes: int) -> Critic:
        """Before any epoch: it predicts 0."""
        wide = size(groups)
        return cls(np.zeros((wide, wide)), np.zeros((wide, outcomes)))

    def values(self, observation: np.ndarray) -> np.ndarray:
        """Expected outcomes, [n, L, M], from observations [n, L, O]."""
        penalty = _RIDGE * np.eye(len(self.moments))
        return features(observation) @ np.linalg.solve(self.moments + penalty, self.products)

    def after(self, observation: np.ndarray, mask: np.ndarray, outcome: np.ndarray) -> Critic:
        """With one more epoch: every decision foresees how its service ended.

        Args:
            observation: [n, L, O].
            mask: 1 for decisions that happened, [n, L].
            outcome: of each service, [n, M].
        """
        happened = np.asarray(mask) > 0
        seen = features(observation)[happened]
        target = np.repeat(outcome, happened.sum(axis=1), axis=0)
        return Critic(_KEEP * self.moments + seen.T @ seen, _KEEP * self.products + seen.T @ target)


def estimates(
    outcome: np.ndarray, value: np.ndarray, mask: np.ndarray, gae_lambda: float
) -> np.ndarray:
    """Generalised advantage estimates of M outcomes that come at the end, [n, L, M].

    As `paper.losses.gae` without discount, for many outcomes at once.

    Args:
        outcome: of each service, [n, M].
        value: predicted at each decision, [n, L, M].
        mask: 1 for decisions that happened, [n, L]; these come first.
        gae_lambda: trace decay.
    """
    happened = np.asarray(mask) > 0
    last = happened.sum(axis=1) - 1
    found = np.zeros(value.shape)
    following, ahead = np.zeros(outcome.shape), np.zeros(outcome.shape)
    for t in range(value.shape[1] - 1, -1, -1):
        now = happened[:, t, None]
        reward = np.where((last == t)[:, None], outcome, 0.0)
        advantage = reward + following - value[:, t] + gae_lambda * ahead
        ahead = np.where(now, advantage, 0.0)
        following = np.where(now, value[:, t], 0.0)
        found[:, t] = ahead
    return found


def standardised(advantage: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """With mean 0 and standard deviation 1 over decisions that happened, [n, L, ...]; else 0.

    What is everywhere the same becomes 0.
    """
    happened = np.asarray(mask) > 0
    chosen = advantage[happened]
    mean, spread = chosen.mean(axis=0), chosen.std(axis=0)
    # rounding is no difference
    real = spread > 1e-12 * np.maximum(np.abs(chosen).max(axis=0), 1.0)
    scaled = np.where(real, (advantage - mean) / np.where(real, spread, 1.0), 0.0)
    return np.where(happened.reshape(*happened.shape, *(1,) * (advantage.ndim - 2)), scaled, 0.0)
