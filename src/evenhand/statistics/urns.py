"""Random tables with given margins by the thousand, from hypergeometric numbers by the million.

How many of the balls taken from an urn are good: the same law and method as NumPy's
``Generator.hypergeometric``, in half the time: factorials of common sizes are looked up, and urns
in which nothing is open cost next to nothing.
"""

from __future__ import annotations

from functools import partial
from math import floor, log, sqrt

import numpy as np
from scipy.special import gammaln

from evenhand.core.machine_code import compiled

FEW = 10
"""Balls up to which they are taken one by one."""

LOG_FACTORIALS = gammaln(np.arange(1 << 17) + 1.0)


def deal(
    columns: np.ndarray, amounts: np.ndarray, permutations: int, rng: np.random.Generator
) -> np.ndarray:
    """Tables with the margins that are given, each as likely as shuffling would make it.

    Each row is dealt to halves of the columns, to quarters, and so on, until one is left; the last
    row is what remains. Other threads may run meanwhile.

    Args:
        columns: sums of the I columns, whole numbers, together as many as ``amounts``, below 2^31.
        amounts: sums of the J rows; quickest with the smallest first.
        permutations: how many tables, b.
        rng: source of randomness, of this call alone while it runs.

    Returns:
        int32 [J, I, b].
    """
    drawn = np.empty((len(amounts), len(columns), permutations), np.int32)
    columns, amounts = (np.ascontiguousarray(a, np.int64) for a in (columns, amounts))
    _deal(columns, amounts, LOG_FACTORIALS, rng, drawn)
    return drawn


# nogil: several threads draw at once; numpy: divisors are never 0 here, nobody need ask
_compiled = partial(compiled, nogil=True, error_model="numpy")


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
def _good(g: int, b: int, n: int, known: np.ndarray, rng: np.random.Generator) -> int:
    """Of n balls taken from an urn without putting any back, how many are of the g good ones."""
    # The same law with fewer balls: of those left behind, and of the rarer kind.
    behind = 2 * n > g + b
    m = g + b - n if behind else n
    few, many = min(g, b), max(g, b)
    if few == 0 or m == 0:
        k = 0
    elif m <= FEW:
        k = _one_by_one(few, many, m, rng)
    elif few <= FEW:
        k = _one_by_one(m, g + b - m, few, rng)
    else:
        k = _by_ratio(few, many, m, known, rng)
    if g > b:
        k = m - k
    return g - k if behind else k


@_compiled
def _deal(
    columns: np.ndarray,
    amounts: np.ndarray,
    known: np.ndarray,
    rng: np.random.Generator,
    drawn: np.ndarray,
) -> None:
    # A tree: the children of node i are 2i and 2i + 1, the columns are its I leaves from I on.
    leaves, last = len(columns), len(amounts) - 1
    full = np.empty(2 * leaves, np.int64)
    full[leaves:] = columns
    for node in range(leaves - 1, 0, -1):
        full[node] = full[2 * node] + full[2 * node + 1]
    dealt = np.empty_like(full)
    for p in range(drawn.shape[2]):
        left = full.copy()
        for row in range(last):
            dealt[1] = amounts[row]
            for node in range(1, leaves):
                first = _good(left[2 * node], left[2 * node + 1], dealt[node], known, rng)
                dealt[2 * node], dealt[2 * node + 1] = first, dealt[node] - first
            for node in range(1, 2 * leaves):
                left[node] -= dealt[node]
            for column in range(leaves):
                drawn[row, column, p] = dealt[leaves + column]
        for column in range(leaves):
            drawn[last, column, p] = left[leaves + column]
