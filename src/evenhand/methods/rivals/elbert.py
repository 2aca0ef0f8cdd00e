"""ELBERT-PO: squared gaps between long-term benefit rates cost (Xu et al. 2024)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.core import palette
from evenhand.core.errors import whole
from evenhand.methods.epoch import Answers, Epoch
from evenhand.methods.paper.scores import count
from evenhand.methods.registry import method
from evenhand.methods.rivals.critic import Critic, estimates, standardised
from evenhand.methods.rivals.shared import Past, Rival, within


def soft_bias(z: np.ndarray, sharpness: float) -> tuple[float, np.ndarray]:
    """Soft bias b = soft max z − soft min z, and its gradient.

    Soft max is log Σ exp(βz) / β and soft min log Σ exp(−βz) / −β; two groups are compared by max
    and min themselves. Xu et al. 2024 (arXiv 2309.03426), `sb3_ppo_fair/ppo_fair.py`.

    Args:
        z: long-term benefit rates of the groups, [M].
        sharpness: β.

    Returns:
        b and db/dz [M]; zeros for fewer than two groups.
    """
    if len(z) < 2:
        return 0.0, np.zeros(len(z))
    if len(z) == 2:
        low = int(np.argmin(z))
        return float(abs(z[0] - z[1])), np.where(np.arange(2) == low, -1.0, 1.0)
    top = np.logaddexp.reduce(sharpness * z)
    bottom = np.logaddexp.reduce(-sharpness * z)
    gradient = np.exp(sharpness * z - top) - np.exp(-sharpness * z - bottom)
    return float((top + bottom) / sharpness), gradient


def ratio_slope(
    ratio: np.ndarray, known: np.ndarray, identity: np.ndarray, sharpness: float
) -> np.ndarray:
    """∂h/∂z of h = Σ b² over identities and issues, ELBERT's penalty for each of them.

    Args:
        ratio: z = supply / demand of each group, [G, K].
        known: whether the ratio is known, bool [G, K]; others are left out.
        identity: number of the identity that a group belongs to, [G].
        sharpness: β of `soft_bias`.

    Returns:
        [G, K], 0 where not known.
    """
    slope = np.zeros(ratio.shape)
    for name in np.unique(identity):
        for k in range(ratio.shape[1]):
            chosen = np.flatnonzero((identity == name) & known[:, k])
            b, gradient = soft_bias(ratio[chosen, k], sharpness)
            slope[chosen, k] = 2.0 * b * gradient
    return slope


def rate_slopes(
    ratio: np.ndarray, demand: np.ndarray, slope: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """∂h/∂S and ∂h/∂D by the chain rule: ∂h/∂z / D and −∂h/∂z z / D, [G, K] each.

    Args:
        ratio: z = S / D, [G, K].
        demand: D, mean over all services, [G, K]; nothing is said of groups with 0.
        slope: ∂h/∂z, [G, K].
    """
    scale = np.where(demand > 0, slope / np.where(demand > 0, demand, 1.0), 0.0)
    return scale, -scale * ratio


def elbert_credit(
    x: np.ndarray, inside: np.ndarray, ratio: np.ndarray, demand: np.ndarray, slope: np.ndarray
) -> np.ndarray:
    """Σ ∂h/∂z (A^S / D − S A^D / D²): what each service adds to h. A' = A − α times this.

    Supply S is the issue, demand D what it applies to: the request for willingness and risk, the
    response for quality and priority. A service has one outcome, so that A^S and A^D are what it
    supplied and demanded minus the means S and D; since S = z D, the means cancel and
    1(i ∈ g) (x_ik − z_gk) / D_gk is left (0 where the issue does not apply).

    Args:
        x: indicators, [n, K].
        inside: membership, [n, G].
        ratio: z = S / D, [G, K].
        demand: D, mean over all services, [G, K]; nothing is said of groups with 0.
        slope: ∂h/∂z, [G, K].

    Returns:
        [n].
    """
    belongs = np.nan_to_num(inside)
    by_supply, by_demand = rate_slopes(ratio, demand, slope)
    supplied = (belongs @ by_supply) * np.nan_to_num(x)
    return (supplied + (belongs @ by_demand) * ~np.isnan(x)).sum(axis=1)


def outcomes(x: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Supply, then demand, of every group and issue by each service, [n, 2 G K]."""
    belongs = np.nan_to_num(inside)[:, :, None]
    supply, demand = belongs * np.nan_to_num(x)[:, None], belongs * ~np.isnan(x)[:, None]
    return np.concatenate([supply.reshape(len(x), -1), demand.reshape(len(x), -1)], axis=1)


@dataclass(frozen=True)
class ElbertState(Past):
    """What ELBERT-PO remembers, beside the last epochs.

    Attributes:
        ratio: last known z of each group, [G, K].
        known: 1 where z was ever known, [G, K].
        critic: of supply and demand of every group and issue.
    """

    ratio: np.ndarray
    known: np.ndarray
    critic: Critic


@method("elbert", field="alpha", label="ELBERT-PO", colour=palette.PURPLE, marker="D", filled=False)
@dataclass(frozen=True)
class Elbert(Rival):
    """ELBERT-PO: service quality minus ``alpha`` times the squared gaps between benefit rates."""

    alpha: float = 0.02
    """Weight of the squared gaps, summed over identities and issues."""

    sharpness: float = 20.0
    """How nearly soft max and min are max and min, for more than two groups."""

    windows: int = 8
    """Epochs that rates are pooled over, the running one included."""

    standardise: bool = True
    """Scale every advantage to mean 0 and standard deviation 1 before they are combined, as the
    source does."""

    def __post_init__(self) -> None:
        within("alpha", self.alpha, 0.0)
        within("sharpness", self.sharpness, 1e-3)
        whole("windows", self.windows, 1, 1000)

    def begin(self, scheme: Any) -> ElbertState:
        """No epoch and no rate yet."""
        past = Past.none(self.windows, len(scheme.groups), len(scheme.issues))
        nothing = np.zeros((len(scheme.groups), len(scheme.issues)))
        critic = Critic.none(len(scheme.groups), 2 * nothing.size)
        return ElbertState(past.counts, past.services, nothing, nothing, critic)

    def lesson(self, epoch: Epoch, memory: ElbertState) -> tuple[np.ndarray, ElbertState]:
        """A group without demand in the pooled epochs keeps the last rate that it had.

        One that never had any is left out.
        """
        n = len(epoch.x)
        later = memory.after(count(epoch.x, epoch.inside), n)
        pooled = later.pooled
        demanded = pooled.inside_n > 0
        rate = pooled.inside_x / np.maximum(pooled.inside_n, 1.0)
        ratio = np.where(demanded, rate, memory.ratio)
        known = demanded | (memory.known > 0)
        slope = ratio_slope(ratio, known, epoch.identity, self.sharpness)
        demand = pooled.inside_n / later.services.sum()
        parts, critic = self._parts(epoch, memory.critic)
        by_rates = np.concatenate([each.ravel() for each in rate_slopes(ratio, demand, slope)])
        main = standardised(epoch.advantage, epoch.mask) if self.standardise else epoch.advantage
        advantage = np.where(epoch.mask > 0, main - self.alpha * (parts @ by_rates), 0.0)
        state = ElbertState(later.counts, later.services, ratio, known.astype(float), critic)
        return advantage, state

    def _parts(self, epoch: Epoch, critic: Critic) -> tuple[np.ndarray, Critic]:
        """Advantages of supply and demand, [n, L, 2 G K], and the critic from now on."""
        ended, seen, mask = outcomes(epoch.x, epoch.inside), epoch.observation, epoch.mask
        if seen is None:  # nothing to foresee them from
            expected = np.zeros((*mask.shape, ended.shape[1]))
            found = estimates(ended, expected, mask, 1.0)
        else:
            found = estimates(ended, critic.values(seen), mask, epoch.gae_lambda)
            critic = critic.after(seen, mask, ended)
        return standardised(found, mask) if self.standardise else found, critic

    def value(self, answers: Answers, memory: ElbertState) -> np.ndarray:
        """Minus α times what each answer would have added to the squared gaps, [n, A]."""
        flat, known = answers.flat, memory.known > 0
        slope = ratio_slope(memory.ratio, known, flat.identity, self.sharpness)
        demand = memory.pooled.inside_n / memory.services.sum()
        credit = elbert_credit(flat.x, flat.inside, memory.ratio, demand, slope)
        return answers.reward - self.alpha * credit.reshape(answers.reward.shape)
