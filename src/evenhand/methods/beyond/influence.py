"""Credit: how much each service of an epoch moves the gaps between groups, and what that is worth.

A reward that is the same for everybody is lost when advantages are normalised, so credit has to
reach the single service. Pure arrays, with the shapes of ``issues``: n services of the current
epoch, G groups, K issues.

Rates, signs and noise come from counts pooled over the last epochs (30 services alone say little
about 22 groups), but only services of the current epoch get weights, and these are divided by the
numbers of the current epoch. This is the right scale: 1/n_g times the sum over the n_g current
services of (x - b) ∇log π estimates ∇p(g), so every epoch gives the whole gradient for the policy
that acted in it. Divided by the pooled number it would come out as many times too small as there
are windows.

A pooled rate is a less noisy baseline b. For an issue that everybody can have any b is unbiased.
For one of responses only (quality, priority), whose rate is E[x a] / E[a] with a = 1 for a
response, b ≠ p leaves (p − b) ∇log E[a]: while rates change from epoch to epoch, pooling also pulls
a little at how often the robot responds. ``windows=1`` has no such pull, and more noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from evenhand.core import palette
from evenhand.core.errors import unknown
from evenhand.methods.beyond.gaps import GapMethod, beyond_noise, checked_counts, checked_tau
from evenhand.methods.epoch import Epoch
from evenhand.methods.guidance import Guidance
from evenhand.methods.paper.scores import Counts, signed_gaps
from evenhand.methods.pooling import Pool, pooled, remember
from evenhand.methods.registry import method

OBJECTIVES = ("gap", "squared")


@dataclass(frozen=True)
class CreditSettings(GapMethod):
    """As its base, and what is lowered."""

    objective: Literal["gap", "squared"] = "gap"
    """gap: the printed score, whose pull stays the same until a gap is closed. squared: squared
    gaps, whose pull fades with the gap, so that a sign that flips by chance hardly matters."""

    def __post_init__(self) -> None:
        if self.objective not in OBJECTIVES:
            raise unknown("objective", self.objective, OBJECTIVES)
        super().__post_init__()


def push(counts: Counts, settings: CreditSettings) -> np.ndarray:
    """How the objective changes with each signed gap, times the share beyond noise, [G, K].

    ±1 for gaps (the s of Eq. 1's absolute value), 2d for squared gaps; NaN if a side is empty.
    """
    gap = signed_gaps(counts)
    slope = np.sign(gap) if settings.objective == "gap" else 2.0 * gap
    return slope * beyond_noise(counts, settings.shrink)


def _mean_over_groups(pushes: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Slopes of I [n, K] from those of the gaps [n, G, K]; missing gaps drop out, as in Eq. 2."""
    known = ~np.isnan(pushes)
    summed = (np.where(known, pushes, 0.0) * slopes).sum(axis=1)
    return summed / np.maximum(known.sum(axis=0), 1)


# --- influence -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Influence:
    """Derivatives by the log-weight of each service: weights of ∇log π in policy gradients.

    Attributes:
        gap: of the signed gap of each group, [n, G, K].
        push: how the objective changes with each signed gap, [G, K], NaN where it is missing.
        issue: of each component of I over all groups, without tau, [n, K].
        total: of the total issue score, Σ_k tau_k I_k, [n].
    """

    gap: np.ndarray
    push: np.ndarray
    issue: np.ndarray
    total: np.ndarray

    def over(self, columns: np.ndarray | Sequence[int]) -> np.ndarray:
        """The same as ``issue`` for I over some groups, such as one identity's, [n, K]."""
        return _mean_over_groups(self.push[columns], self.gap[:, columns])


def influence(
    x: np.ndarray,
    inside: np.ndarray,
    tau: Sequence[float] | np.ndarray,
    counts: Counts | None = None,
    settings: CreditSettings | None = None,
) -> Influence:
    """What the total issue score gains when a service becomes more likely, exactly.

    w_i = 1/|G| Σ_g Σ_k τ_k s_kg [1(i∈g)(x_ik - p_k(g))/n_g - 1(i∉g)(x_ik - p_k(¬g))/n_¬g],
    so that ∇ Σ_k τ_k I_k ≈ Σ_i w_i ∇log π(service i) (score function of a ratio of means). An
    issue that does not apply to a service gives it no weight, and n_g counts the services to
    which it applies: p_k(g) is a rate among these. A gap that is missing is left out of the mean
    over groups; an issue without any gap gives nobody weight.

    Args:
        x: indicators of the current epoch, [n, K], NaN where an issue does not apply.
        inside: membership, [n, G], NaN where unknown.
        tau: weight of each issue, [K].
        counts: pooled counts that include the current epoch; by default the current ones alone.
        settings: shrinking and objective. With ``shrink=0`` and the objective ``gap`` this is
            exactly the derivative of the printed score; shrunk gaps are weighed as they stand.

    Raises:
        InputError: shapes differ, tau is not [K] finite numbers of at least 0, or the counts hold
            fewer services than the epoch.
    """
    weights = checked_tau(x, tau)
    counts, now = checked_counts(x, inside, counts)
    return influence_of(x, inside, weights, counts, now, settings or CreditSettings())


def influence_of(
    x: np.ndarray,
    inside: np.ndarray,
    weights: np.ndarray,
    counts: Counts,
    now: Counts,
    settings: CreditSettings,
) -> Influence:
    """`influence` of services that need not be those of the epoch, from checked arguments.

    Gaps and rates are those of ``counts``, numbers of the epoch those of ``now``.
    """
    pushes = push(counts, settings)
    _, centred = _slopes(x, inside, counts, now, charged=False)
    issue = _mean_over_groups(pushes, centred)
    return Influence(gap=centred, push=pushes, issue=issue, total=issue @ weights)


def _slopes(
    x: np.ndarray, inside: np.ndarray, counts: Counts, now: Counts, charged: bool
) -> tuple[np.ndarray, np.ndarray]:
    """What an issue of service i does to each signed gap, and that times (x - rate), [n, G, K].

    Services to which an issue does not apply get 0; if ``charged``, what they would get with it.
    """
    applies = ~np.isnan(x)[:, None, :]
    asked = applies | charged
    value = np.where(applies, x[:, None, :], 1.0)
    more = (asked & ~applies).astype(float)  # such a service would have been one more
    side_in = np.nan_to_num(inside)[:, :, None] * asked / np.maximum(now.inside_n + more, 1.0)
    side_out = np.nan_to_num(1.0 - inside)[:, :, None] * asked
    side_out = side_out / np.maximum(now.outside_n + more, 1.0)
    rate_in = counts.inside_x / np.maximum(counts.inside_n, 1.0)
    rate_out = counts.outside_x / np.maximum(counts.outside_n, 1.0)
    known = ~np.isnan(signed_gaps(counts))
    having = (side_in - side_out) * known
    centred = (side_in * (value - rate_in) - side_out * (value - rate_out)) * known
    return having, centred


# --- rewards -------------------------------------------------------------------------------------


def influence_reward(
    x: np.ndarray,
    inside: np.ndarray,
    tau: Sequence[float] | np.ndarray,
    counts: Counts | None = None,
    settings: CreditSettings | None = None,
) -> np.ndarray:
    """What evenness pays each service, with the guard that no issue is ever paid for, [n].

    -μ n w_i, to be added to a service reward: the policy gradient of the mean reward is then
    that of the service minus μ times the total issue score. The guard: an issue of a service
    whose people are better off would raise evenness, and the exact influence would pay for it
    (levelling down); such issues get no weight, so only those that widen gaps cost. And where an
    issue does not apply, it costs as if the service had it: else ignoring somebody would spare
    the cost of being late. So, rates held, another issue never raises a service's reward.

    Arguments and errors as for `influence`.
    """
    settings = settings or CreditSettings()
    weights = checked_tau(x, tau)
    counts, now = checked_counts(x, inside, counts)
    return influence_pays(x, inside, weights, counts, now, len(x), settings)


def influence_pays(
    x: np.ndarray,
    inside: np.ndarray,
    weights: np.ndarray,
    counts: Counts,
    now: Counts,
    services: int,
    settings: CreditSettings,
) -> np.ndarray:
    """What `influence_reward` pays, [n], from checked arguments.

    Gaps and rates are those of ``counts``, numbers of a window those of ``now``.
    """
    pushes = push(counts, settings)
    having, centred = _slopes(x, inside, counts, now, charged=True)
    widens = _mean_over_groups(pushes, having) > 0.0
    guarded = np.where(widens, _mean_over_groups(pushes, centred), 0.0)
    return -settings.strength * services * (guarded @ weights)


@method("influence", label="influence", colour=palette.BLUE, marker="^", own=True)
@dataclass(frozen=True)
class InfluenceReward(CreditSettings):
    """Each service costs what it adds to the total issue score."""

    strength: float = 0.5
    """μ: weight of evenness beside a service reward of about 1."""

    def teach(self, epoch: Epoch, memory: Pool) -> tuple[Guidance, Pool]:
        """Gaps are those of the last epochs, this one included."""
        memory = remember(memory, epoch.counts)
        if not self.counts_now(epoch):
            return Guidance(), memory
        now = self.weighed(epoch)
        paid = influence_reward(epoch.x, epoch.inside, epoch.tau, pooled(memory), now)
        return Guidance(evenness=paid), memory

    def pay(self, services: Epoch, window: Epoch, memory: Pool) -> np.ndarray:
        """Gaps and rates are those of the windows before, [m].

        How many services of each side the open window will have is not known: their mean over
        these windows stands in. A service does not move the gaps that it is paid by.
        """
        if not self.counts_now(window):
            return np.zeros(len(services))
        mean = Counts(*np.moveaxis(memory.windows.sum(axis=0) / memory.filled, -1, 0))
        counts, now = pooled(memory), self.weighed(services)
        return influence_pays(
            services.x, services.inside, services.tau, counts, mean, len(window), now
        )
