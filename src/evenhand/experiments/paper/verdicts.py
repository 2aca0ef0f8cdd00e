"""Rules of the verdicts on the paper's claims: numbers in, a word out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

REPRODUCED, CONTRADICTED = "reproduced", "contradicted"
UNTOLD = "cannot be told"
"""It was tested, and the interval holds the number, or there is no interval."""
UNTESTED = "cannot be tested"
"""There is nothing to test: nothing printed, or nothing that could become less."""
SAME = 1e-12
"""Seeds that differ by less are alike."""
Claim = dict[str, Any]


def claim(
    name: str,
    text: str,
    paper: Any,
    ours: Any,
    ci95: Sequence[Any] | None,
    seeds: int | None,
    status: str,
    evidence: str,
) -> Claim:
    """One row of ``claims.json``."""
    return {
        "id": name,
        "claim": text,
        "paper": paper,
        "ours": ours,
        "ci95": None if ci95 is None else list(ci95),
        "seeds": seeds,
        "status": status,
        "evidence": evidence,
    }


def reduction(without: np.ndarray, with_guidance: np.ndarray) -> tuple[float, float, float]:
    """Share by which guidance lowers a mean, with a 95 % interval over paired seeds.

    The interval is Student's t of the paired differences, divided by the mean without guidance.

    Args:
        without: one number a seed, [S].
        with_guidance: of the same seeds, [S].

    Returns:
        Estimate, lower and upper end; NaN for the ends with one seed, and for all three when
        the mean without guidance is 0.
    """
    base = float(without.mean())
    if base == 0.0:
        return float("nan"), float("nan"), float("nan")
    difference = without - with_guidance
    estimate = float(difference.mean()) / base
    n = len(difference)
    if n < 2:
        return estimate, float("nan"), float("nan")
    half = float(stats.t.ppf(0.975, n - 1)) * float(difference.std(ddof=1)) / np.sqrt(n) / base
    return estimate, estimate - half, estimate + half


def at_least(low: float, high: float, bound: float) -> str:
    """Verdict on "at least ``bound``": the interval lies above, below, or around it."""
    if no_interval(low, high):
        return UNTOLD
    if low >= bound:
        return REPRODUCED
    return CONTRADICTED if high < bound else UNTOLD


def contains(low: float, high: float, number: float) -> str:
    """Verdict on "equals ``number``" for an estimate with an interval."""
    return REPRODUCED if low <= number <= high else CONTRADICTED


def above_zero(low: float, high: float) -> str:
    """Verdict on "greater than 0": the interval lies above, below, or around it."""
    if no_interval(low, high):
        return UNTOLD
    if low > 0:
        return REPRODUCED
    return CONTRADICTED if high < 0 else UNTOLD


def no_interval(low: float, high: float) -> bool:
    """Whether seeds say nothing of how they vary: an end is NaN, or all of them are alike."""
    return bool(np.isnan(low) or np.isnan(high) or high - low < SAME)


def undecided(status: str, low: float, high: float, bound: float) -> str:
    """Why a verdict is "cannot be told" or "cannot be tested"; nothing for another one."""
    if status == UNTESTED:
        return "Without guidance there was nothing to lower."
    if status != UNTOLD:
        return ""
    if np.isnan(low):
        return "One seed gives no interval: run more seeds."
    if no_interval(low, high):
        return "The difference is the same in every seed, which gives no interval: run more seeds."
    return f"The interval holds {bound:.3g}: these seeds cannot tell."


def t_interval(values: np.ndarray) -> tuple[float, float]:
    """Student's 95 % interval of a mean, [n]; NaN for fewer than two values."""
    if len(values) < 2:
        return float("nan"), float("nan")
    half = stats.t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    return float(values.mean() - half), float(values.mean() + half)


def number(value: float) -> float | None:
    """The number, or None for NaN, which JSON cannot hold."""
    return None if np.isnan(value) else value


def interval(low: float, high: float) -> tuple[float, float] | None:
    """Both ends, or None if one is NaN."""
    return None if np.isnan(low) or np.isnan(high) else (low, high)
