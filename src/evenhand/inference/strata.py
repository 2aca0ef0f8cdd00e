"""Differences of rates within strata: like compared with like.

Where one site is slower and has more older guests, the rates of all sites together say that older
guests wait longer. Mantel and Haenszel's difference weighs the difference inside each stratum by
w = n m / N (n in the group, m outside, N both), so that only people of one stratum are compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from evenhand.inference.chance import check_counts, check_level
from evenhand.issues import Counts


@dataclass(frozen=True, eq=False)
class Within:
    """Differences within strata, arrays of [..., G, K]; NaN where no stratum has both sides.

    Attributes:
        difference: Σ w d / Σ w, with d the difference of the rates in a stratum.
        low: lower limit.
        high: upper limit.
        even_difference: what chance alone gives on average, E|difference|, were everybody of a
            stratum served alike (normal approximation).
    """

    difference: np.ndarray
    low: np.ndarray
    high: np.ndarray
    even_difference: np.ndarray


def mantel_haenszel(parts: Sequence[Counts], level: float = 0.95) -> Within:
    """Mantel and Haenszel's difference with the limits of Sato, Greenland and Robins (1989).

    Var = (δ ΣP + ΣQ) / (Σw)², P = (n² y − m² x + n m (m − n) / 2) / N²,
    Q = (x (m − y) + y (n − x)) / (2 N), with x cases of n inside and y of m outside; sound both
    for few large and for many small strata.

    Args:
        parts: counts of each stratum, [..., G, K].
        level: coverage of each pair of limits.

    Raises:
        InputError: for impossible counts or a level outside (0, 1).
    """
    check_level("level", level)
    shape = np.shape(parts[0].inside_n)
    weight, risen, p, q, chance = (np.zeros(shape) for _ in range(5))
    for counts in parts:
        check_counts(counts)
        n, x = np.asarray(counts.inside_n, float), np.asarray(counts.inside_x, float)
        m, y = np.asarray(counts.outside_n, float), np.asarray(counts.outside_x, float)
        both = (n > 0) & (m > 0)
        size = np.where(both, n + m, 1.0)
        weight += np.where(both, n * m / size, 0.0)
        risen += np.where(both, (x * m - y * n) / size, 0.0)
        p += np.where(both, (n**2 * y - m**2 * x + n * m * (m - n) / 2) / size**2, 0.0)
        q += np.where(both, (x * (m - y) + y * (n - x)) / (2 * size), 0.0)
        cases = x + y
        spread = n * m * cases * (n + m - cases) / (size**2 * np.maximum(size - 1, 1.0))
        chance += np.where(both, spread, 0.0)
    known = weight > 0
    total = np.where(known, weight, 1.0)
    difference = risen / total
    half = ndtri(0.5 + level / 2) * np.sqrt(np.maximum(difference * p + q, 0.0)) / total
    limits = np.clip([difference - half, difference + half], -1.0, 1.0)
    even = np.sqrt(2 / np.pi * chance) / total
    found = (np.where(known, values, np.nan) for values in (difference, *limits, even))
    return Within(*found)
