"""Intervals of shares and of differences of shares.

Pure functions on arrays of any shape; a share of nothing is missing (NaN), never 0.
"""

from collections.abc import Callable

import numpy as np
from scipy.special import betaincinv, ndtri

from evenhand.methods.paper.scores import Counts
from evenhand.statistics.chance import check_counts, check_level

ShareLimits = Callable[[np.ndarray, np.ndarray, float], tuple[np.ndarray, np.ndarray]]
"""From cases, of how many, and a level to the lower and upper limit of the share."""


def wilson(x: np.ndarray, n: np.ndarray, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
    """Wilson's limits of a share x/n.

    Args:
        x: how many, any shape.
        n: of how many.
        level: of the interval.

    Returns:
        Lower and upper limit; NaN where n is 0.

    Raises:
        InputError: for a level outside (0, 1).
    """
    check_level("level", level)
    z = float(-ndtri((1 - level) / 2))
    size = np.where(np.asarray(n) > 0, n, np.nan)
    share = x / size
    middle = share + z**2 / (2 * size)
    half = z * np.sqrt(share * (1 - share) / size + z**2 / (4 * size**2))
    whole = 1 + z**2 / size
    # Rounding must push no limit past the share itself, nor out of [0, 1].
    low = np.clip((middle - half) / whole, 0.0, share)
    return low, np.clip((middle + half) / whole, share, 1.0)


def clopper_pearson(
    x: np.ndarray, n: np.ndarray, level: float = 0.95
) -> tuple[np.ndarray, np.ndarray]:
    """Exact limits of a share x/n: each is wrong in at most (1 − level)/2 of all samples.

    Clopper and Pearson (Biometrika 1934), as quantiles of beta distributions.

    Args:
        x: how many, any shape.
        n: of how many; need not be whole.
        level: of the interval.

    Returns:
        Lower and upper limit; NaN where n is 0.

    Raises:
        InputError: for a level outside (0, 1).
    """
    check_level("level", level)
    x, n = np.asarray(x, float), np.asarray(n, float)
    tail, some = (1 - level) / 2, n > 0
    rest = np.where(some, n - x, 1.0)
    low = np.where(x > 0, betaincinv(np.where(x > 0, x, 1.0), rest + 1, tail), 0.0)
    high = np.where(rest > 0, betaincinv(x + 1, np.where(rest > 0, rest, 1.0), 1 - tail), 1.0)
    return np.where(some, low, np.nan), np.where(some, high, np.nan)


def newcombe(
    counts: Counts, level: float = 0.95, of_a_share: ShareLimits = wilson
) -> tuple[np.ndarray, np.ndarray]:
    """Limits of a signed gap, from the limits of the shares of both sides.

    With d = p − q: d − sqrt((p − l_p)² + (u_q − q)²) and d + sqrt((u_p − p)² + (q − l_q)²)
    (Newcombe, Statistics in Medicine 1998, method 10).

    Args:
        counts: [..., G, K].
        level: of each interval by itself.
        of_a_share: limits of each side. Wilson's, Newcombe's own choice, are good at the usual
            levels. At the levels of many limits that shall hold together they fail far too often
            where issues are rare, and ``clopper_pearson`` is the one to take.

    Returns:
        Lower and upper limit, [..., G, K], in [−1, 1]; NaN where a side is empty.

    Raises:
        InputError: for impossible counts or a level outside (0, 1).
    """
    check_counts(counts)
    inside = of_a_share(counts.inside_x, counts.inside_n, level)
    outside = of_a_share(counts.outside_x, counts.outside_n, level)
    p = counts.inside_x / np.where(counts.inside_n > 0, counts.inside_n, np.nan)
    q = counts.outside_x / np.where(counts.outside_n > 0, counts.outside_n, np.nan)
    return recovered_limits(p, inside, q, outside)


def recovered_limits(
    p: np.ndarray,
    p_limits: tuple[np.ndarray, np.ndarray],
    q: np.ndarray,
    q_limits: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Limits of p − q from the limits of two independent estimates (Newcombe's square and add).

    Args:
        p: first estimate, any shape.
        p_limits: its lower and upper limit.
        q: second estimate.
        q_limits: its lower and upper limit.
    """
    low = p - q - np.hypot(p - p_limits[0], q_limits[1] - q)
    high = p - q + np.hypot(p_limits[1] - p, q - q_limits[0])
    return low, high
