"""The guard over time: evenness gives way while it seems to be bought with worse service.

``credit`` never pays a service for an issue. That is a promise about rewards, not about what a
policy makes of them, so the outcome is watched as well: whether any group meets an issue more
often than it used to. Pure arrays, with the shapes of ``issues``; an issue here may also be "not
a perfect service", and a group may be everybody (a column of ones).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import betaln

from evenhand.core.errors import InputError, whole
from evenhand.methods.paper.scores import Counts, count
from evenhand.methods.pooling import Pool, pooled, remember

BACK_OFF = 0.5
"""Evenness weighs so many times as much after an alarm."""

REGAIN = 0.05
"""What its weight regains, of 1, in every epoch without one."""


@dataclass(frozen=True)
class GuardSettings:
    """When service counts as having become worse."""

    level: float = 0.01
    """Chance of an alarm at one look, over all groups and issues, when nothing has changed."""

    windows: int = 4
    """Recent epochs that are compared with those before them."""

    keep: float = 0.98
    """What an older epoch still weighs after one more; 0.98 remembers about 50 epochs."""

    def __post_init__(self) -> None:
        if not 0.0 < self.level < 1.0:
            raise InputError(
                "range level", f"level is {self.level}: give a chance above 0 and below 1"
            )
        whole("windows", self.windows, 1, 1_000)
        if not 0.0 <= self.keep < 1.0:
            raise InputError("range keep", f"keep is {self.keep}: give a number from 0 to below 1")


@dataclass(frozen=True)
class Guard:
    """What the guard remembers.

    Attributes:
        recent: counts of the last epochs.
        reference: services and those with the issue in the epochs before these, discounted,
            [G, K, 2].
        strength: factor that falls while service becomes worse, in [0, 1].
    """

    recent: Pool
    reference: np.ndarray
    strength: float = 1.0

    @classmethod
    def new(cls, groups: int, issues: int, settings: GuardSettings) -> Guard:
        """A guard that has seen nothing."""
        return cls(Pool.empty(settings.windows, groups, issues), np.zeros((groups, issues, 2)))


def weight(guard: Guard) -> float:
    """What the strength of evenness is multiplied by, in [0, 1].

    The guard's strength times the share of services without the issue, of everybody (the last
    group), in the last epochs. A robot that serves nobody well is even in the emptiest way, and a
    strong pull to evenness would keep it there: first comes service. It is 0 before any epoch.
    """
    everybody = pooled(guard.recent)
    n, x = everybody.inside_n[-1].sum(), everybody.inside_x[-1].sum()
    return guard.strength * (1.0 - float(x) / float(n)) if n > 0 else 0.0


def worse(n: np.ndarray, x: np.ndarray, before_n: np.ndarray, before_x: np.ndarray) -> np.ndarray:
    """How likely at least x issues in n services are, if nothing has changed since before.

    The tail of the beta-binomial distribution Beta-Binomial(n, ½ + before_x, ½ + before_n -
    before_x): what a binomial rate with Jeffreys' prior leads one to expect after ``before``. It
    holds for few services too, where a z-score would not; without any before it says nothing.

    Args:
        n: services, whole numbers, any shape.
        x: of those, with the issue.
        before_n: services before; may be discounted.
        before_x: of those, with the issue.

    Returns:
        Probabilities in (0, 1], of the same shape.
    """
    a, b = (0.5 + before_x)[..., None], (0.5 + before_n - before_x)[..., None]
    n, x = n[..., None], x[..., None]
    i = np.arange(n.max(initial=0) + 1)
    rest = np.maximum(n - i, 1)
    # P(0) = B(a, n + b) / B(a, b), and P(i + 1) / P(i) = (n - i)(a + i) / ((i + 1)(n - i - 1 + b))
    rise = np.log(rest * (a + i) / ((i + 1) * (rest - 1 + b)))
    log = betaln(a, n + b) - betaln(a, b) + np.cumsum(rise, axis=-1) - rise
    return np.minimum((np.exp(log) * ((i >= x) & (i <= n))).sum(axis=-1), 1.0)


def watch(guard: Guard, counts: Counts, settings: GuardSettings) -> tuple[Guard, np.ndarray]:
    """Look at one more epoch.

    The rule: the last epochs, pooled, are compared with the discounted sum of those before them,
    for every group and issue. If one issue has become more frequent than chance explains (below
    ``level`` divided by the number of comparisons), the strength of evenness is halved; else it
    regains 0.05, up to 1. The reference goes on learning either way, so that a lasting change of
    the task silences evenness for a while, not for ever. Only a group's own earlier service is
    compared: a group that gets better service faster than others raises no alarm.

    Args:
        guard: so far.
        counts: of the epoch, [G, K]; only the inside counts are read.
        settings: when to speak of worse.

    Returns:
        The guard from now on, whose `weight` multiplies μ; and the chance of each rate if
        nothing has changed, [G, K], 1 where there is nothing to compare.
    """
    leaving = guard.recent.windows[0, :, :, :2]
    reference = settings.keep * guard.reference + leaving
    recent = remember(guard.recent, counts)
    now = pooled(recent)
    chance = worse(now.inside_n, now.inside_x, reference[..., 0], reference[..., 1])
    compared = (now.inside_n > 0) & (reference[..., 0] > 0)
    chance = np.where(compared, chance, 1.0)
    if (chance < settings.level / max(int(compared.sum()), 1)).any():
        strength = BACK_OFF * guard.strength
    else:
        strength = min(1.0, guard.strength + REGAIN)
    return Guard(recent, reference, strength), chance


GUARD = GuardSettings()
"""As training and wrappers use it."""


@dataclass(frozen=True, eq=False)
class Watch:
    """A look at one more epoch, taken when somebody asks.

    Attributes:
        before: the guard so far; its groups are those of the epoch, and everybody.
        x: issues of the services of the epoch, [n, K].
        inside: membership, [n, G].
    """

    before: Guard
    x: np.ndarray
    inside: np.ndarray

    @cached_property
    def after(self) -> Guard:
        """The guard with this epoch in it: a service without any issue is a perfect one."""
        everybody = np.concatenate([self.inside, np.ones((len(self.x), 1))], axis=1)
        imperfect = (self.x == 1.0).any(axis=1, keepdims=True).astype(float)
        return watch(self.before, count(imperfect, everybody), GUARD)[0]

    @property
    def weight(self) -> float:
        """What evenness weighs, see `weight`."""
        return weight(self.after)


@dataclass(frozen=True)
class Held:
    """A guard as it stands, without a look at more."""

    guard: Guard

    @property
    def weight(self) -> float:
        """What evenness weighs, see `weight`."""
        return weight(self.guard)
