"""PPO-Lagrangian: service quality subject to a limit on unevenness (Ray et al. 2019)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.core import palette
from evenhand.core.errors import whole
from evenhand.methods.beyond.influence import CreditSettings, influence, influence_of
from evenhand.methods.epoch import Answers, Epoch
from evenhand.methods.pooling import Pool, pooled, remember
from evenhand.methods.registry import method
from evenhand.methods.rivals.critic import Critic, estimates, standardised
from evenhand.methods.rivals.shared import Rival, within


def multiplier(lam: float, score: float, limit: float, rate: float) -> float:
    """λ ← [λ + η (J_c − d)]₊, the dual step of the constraint J_c <= d.

    Ray, Achiam and Amodei 2019 (Benchmarking Safe Exploration); OmniSafe `common/lagrange.py`,
    which steps λ before the policy, as is done here.

    Args:
        lam: λ so far.
        score: J_c, unevenness; NaN (not known) leaves λ as it is.
        limit: d.
        rate: η.
    """
    return lam if np.isnan(score) else max(0.0, lam + rate * (score - limit))


def lagrangian_advantage(
    advantage: np.ndarray, mask: np.ndarray, cost: np.ndarray, lam: float
) -> np.ndarray:
    """A' = (A_r − λ A_c) / (1 + λ), OmniSafe `naive_lagrange/ppo_lag.py`.

    As in OmniSafe A_r is standardised, and A_c is centred and not scaled.

    Args:
        advantage: A_r, [n, L].
        mask: [n, L].
        cost: A_c, advantage of the cost, [n, L].
        lam: λ.

    Returns:
        [n, L].
    """
    happened = mask > 0
    centred = cost - cost[happened].mean() if happened.any() else cost
    mixed = (standardised(advantage, mask) - lam * centred) / (1.0 + lam)
    return np.where(happened, mixed, 0.0)


@dataclass(frozen=True)
class LagrangianState:
    """What PPO-Lagrangian remembers.

    Attributes:
        lam: λ.
        pool: counts of the last epochs.
        critic: of the cost.
    """

    lam: float
    pool: Pool
    critic: Critic


@method(
    "lagrangian",
    field="limit",
    label="PPO-Lagrangian",
    colour=palette.PURPLE,
    marker="^",
    filled=False,
)
@dataclass(frozen=True)
class Lagrangian(Rival):
    """PPO-Lagrangian: service quality subject to unevenness <= ``limit``."""

    limit: float = 0.05
    """d, the total issue score that is allowed."""

    rate: float = 0.1
    """η, step size of λ."""

    start: float = 0.0
    """λ at the beginning."""

    windows: int = 8
    """Epochs that unevenness is pooled over, the running one included."""

    def __post_init__(self) -> None:
        for name in ("limit", "rate", "start"):
            within(name, getattr(self, name), 0.0)
        whole("windows", self.windows, 1, 1000)

    def begin(self, scheme: Any) -> LagrangianState:
        """λ at the beginning, and no epoch yet."""
        empty = Pool.empty(self.windows, len(scheme.groups), len(scheme.issues))
        return LagrangianState(float(self.start), empty, Critic.none(len(scheme.groups), 1))

    def lesson(self, epoch: Epoch, memory: LagrangianState) -> tuple[np.ndarray, LagrangianState]:
        """First λ takes its step, then the advantages are mixed with it.

        The constrained score is without what chance gives, else it could never be met. The cost
        of a service is its influence on the score times the number of services, so that the
        gradient of the score is the mean over services of cost ∇ log π(service). A critic of the
        cost gives its advantages; where observations are not known, the cost is its own.
        """
        pool = remember(memory.pool, epoch.counts)
        counts, equal = pooled(pool), np.ones(len(epoch.issues))
        lam = multiplier(memory.lam, epoch.corrected_of(counts), self.limit, self.rate)
        found = influence(epoch.x, epoch.inside, equal, counts, CreditSettings(shrink=0.0))
        cost, critic = (found.total * len(epoch))[:, None], memory.critic
        seen, mask = epoch.observation, epoch.mask
        expected = np.zeros((*mask.shape, 1)) if seen is None else critic.values(seen)
        advantage = estimates(cost, expected, mask, 1.0 if seen is None else epoch.gae_lambda)
        if seen is not None:
            critic = critic.after(seen, mask, cost)
        mixed = lagrangian_advantage(epoch.advantage, mask, advantage[..., 0], lam)
        return mixed, LagrangianState(lam, pool, critic)

    def value(self, answers: Answers, memory: LagrangianState) -> np.ndarray:
        """(r − λ c) / (1 + λ) with the cost that each answer would have had, [n, A]."""
        counts, window = pooled(memory.pool), answers.window
        equal, settings = np.ones(len(window.issues)), CreditSettings(shrink=0.0)
        flat = answers.flat
        found = influence_of(flat.x, flat.inside, equal, counts, window.counts, settings)
        cost = found.total.reshape(answers.reward.shape) * len(window)
        return (answers.reward - memory.lam * cost) / (1.0 + memory.lam)
