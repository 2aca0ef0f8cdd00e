"""Gaps that may steer: pooled over the last epochs, and beyond noise. What such methods share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np

from evenhand.core.errors import InputError, unknown, whole
from evenhand.methods.epoch import Epoch
from evenhand.methods.paper.scores import Counts, count, signed_gaps
from evenhand.methods.pooling import Pool
from evenhand.methods.registry import VERDICT

WHEN = ("always", "biased")
Self = TypeVar("Self", bound="GapMethod")


@dataclass(frozen=True)
class GapMethod:
    """How much evenness weighs, which gaps may steer, and when."""

    strength: float = 1.0
    """μ: weight of evenness beside a service reward of about 1."""

    windows: int = 8
    """Epochs, the current one included, whose counts are pooled."""

    shrink: float = 0.5
    """A gap counts only beyond so many standard errors; 0 lets chance gaps steer too."""

    when: Literal["always", "biased"] = "always"
    """Whether evenness counts always, or in epochs that the detector calls biased."""

    guarded: bool = True
    """Whether evenness gives way while service is poor or becomes worse for a group."""

    def __post_init__(self) -> None:
        if self.when not in WHEN:
            raise unknown("when", self.when, WHEN)
        whole("windows", self.windows, 1, 1_000)
        for name in ("strength", "shrink"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise InputError(
                    f"range {name}",
                    f"{name} is {getattr(self, name)}: give a finite number from 0 up",
                )

    @property
    def needs(self) -> tuple[str, ...]:
        """A verdict, where it decides when evenness counts."""
        return (VERDICT,) if self.when == "biased" else ()

    def begin(self, scheme: Any) -> Pool:
        """No epoch yet."""
        return Pool.empty(self.windows, len(scheme.groups), len(scheme.issues))

    def counts_now(self, window: Epoch) -> bool:
        """Whether evenness counts after this window."""
        return self.when == "always" or window.biased

    def weighed(self: Self, services: Epoch) -> Self:
        """The same with what the guard leaves of its strength."""
        share = services.guard_weight if self.guarded else 1.0
        return replace(self, strength=self.strength * share)


def standard_error(counts: Counts) -> np.ndarray:
    """Of the signed gap if both sides had one rate, [G, K]; NaN if a side is empty.

    √(p(1-p)(1/n + 1/m)) with the common rate p: unlike the usual one, it is not 0 when one side
    has rate 0 or 1 by the luck of few services.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        n, m = counts.inside_n, counts.outside_n
        p = (counts.inside_x + counts.outside_x) / (n + m)
        missing = (n == 0) | (m == 0)
        return np.where(missing, np.nan, np.sqrt(p * (1.0 - p) * (1.0 / n + 1.0 / m)))


def beyond_noise(counts: Counts, shrink: float) -> np.ndarray:
    """Share of each gap that may steer, max(0, 1 - (c se / |d|)²), in [0, 1], [G, K].

    The positive part of a James–Stein estimate: 0 within c standard errors, near 1 far beyond
    them, without a jump. NaN if a side is empty.
    """
    gap = signed_gaps(counts)
    noise = shrink * standard_error(counts)
    beyond = np.abs(gap) > noise
    ratio = np.divide(noise, gap, out=np.ones_like(gap), where=beyond)
    return np.where(np.isnan(gap), np.nan, 1.0 - ratio**2)


def checked_tau(x: np.ndarray, tau: Sequence[float] | np.ndarray) -> np.ndarray:
    """Weights of the issues of a table as an array.

    Raises:
        InputError: when they are not [K] finite numbers of at least 0.
    """
    weights = np.asarray(tau, float)
    if weights.shape != np.shape(x)[-1:] or not np.isfinite(weights).all() or (weights < 0).any():
        raise InputError(
            "range tau",
            f"tau is {tau}: give {np.shape(x)[-1]} finite numbers of at least 0, one an issue",
        )
    return weights


def checked_counts(
    x: np.ndarray, inside: np.ndarray, counts: Counts | None
) -> tuple[Counts, Counts]:
    """Pooled and current counts that belong together.

    Raises:
        InputError: when they do not.
    """
    if x.ndim != 2 or inside.ndim != 2 or len(x) != len(inside):
        raise InputError(
            "shape issues",
            f"issues {x.shape} and membership {inside.shape} do not fit: give one row a service",
        )
    now = count(x, inside)
    if counts is None:
        return now, now
    if counts.inside_n.shape != now.inside_n.shape:
        raise InputError(
            "shape pooled",
            f"pooled counts are {counts.inside_n.shape} and the epoch has {now.inside_n.shape} "
            "groups and issues: pool counts of the same groups and issues",
        )
    if (counts.inside_n < now.inside_n).any() or (counts.outside_n < now.outside_n).any():
        raise InputError(
            "range pooled", "pooled counts hold fewer services than the epoch: pool it as well"
        )
    return counts, now
