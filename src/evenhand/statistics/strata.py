"""Differences of rates within strata: like compared with like.

Where one site is slower and has more older guests, the rates of all sites together say that older
guests wait longer. Mantel and Haenszel's difference weighs the difference inside each stratum by
w = n m / N (n in the group, m outside, N both), so that only people of one stratum are compared.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evenhand.methods.paper.scores import Counts
from evenhand.statistics.chance import check_counts, check_level
from evenhand.statistics.intervals import ShareLimits, recovered_limits, wilson


@dataclass(frozen=True, eq=False)
class Within:
    """Differences within strata, arrays of [..., G, K]; NaN where no stratum has both sides.

    Attributes:
        difference: Σ w d / Σ w, with d the difference of the rates in a stratum.
        low: lower limit.
        high: upper limit.
        even_difference: what chance alone gives on average, E|difference|, were everybody of a
            stratum served alike (normal approximation).
        weight: Σ w, 0 where no stratum has both sides: what the strata know of the difference.
            Of one stratum it is the smaller side, s times the larger one, divided by 1 + s.
    """

    difference: np.ndarray
    low: np.ndarray
    high: np.ndarray
    even_difference: np.ndarray
    weight: np.ndarray


def mantel_haenszel(
    parts: Sequence[Counts], level: float = 0.95, of_a_share: ShareLimits = wilson
) -> Within:
    """Mantel and Haenszel's difference with stratified Newcombe limits.

    Each side has the rate r = Σ w x/n / Σ w. Its variance is that of one sample of the size
    (Σ w)² / Σ (w²/n), whose limits are combined as Newcombe does: in the manner of Yan and
    Su (Statistics in Biopharmaceutical Research 2, 2010). With one stratum these are Newcombe's
    own limits; a side without cases stays as unsure as its size makes it.

    Args:
        parts: counts of each stratum, [..., G, K].
        level: coverage of each pair of limits.
        of_a_share: limits of each side, see :func:`evenhand.statistics.intervals.newcombe`.

    Raises:
        InputError: for impossible counts or a level outside (0, 1).
    """
    check_level("level", level)
    shape = np.shape(parts[0].inside_n)
    weight, inside, outside, spread_in, spread_out, chance = (np.zeros(shape) for _ in range(6))
    for counts in parts:
        check_counts(counts)
        n, x = np.asarray(counts.inside_n, float), np.asarray(counts.inside_x, float)
        m, y = np.asarray(counts.outside_n, float), np.asarray(counts.outside_x, float)
        both = (n > 0) & (m > 0)
        size = np.where(both, n + m, 1.0)
        w = np.where(both, n * m / size, 0.0)
        weight += w
        # w/n = m/N and w/m = n/N
        inside += np.where(both, x * m / size, 0.0)
        outside += np.where(both, y * n / size, 0.0)
        spread_in += w * np.where(both, m / size, 0.0)
        spread_out += w * np.where(both, n / size, 0.0)
        cases = x + y
        spread = n * m * cases * (n + m - cases) / (size**2 * np.maximum(size - 1, 1.0))
        chance += np.where(both, spread, 0.0)
    known = weight > 0
    total = np.where(known, weight, 1.0)
    rates, limits = [], []
    for risen, spread in ((inside, spread_in), (outside, spread_out)):
        rate = risen / total
        size = np.where(known, total**2 / np.where(known, spread, 1.0), 0.0)
        rates.append(rate)
        limits.append(of_a_share(rate * size, size, level))
    low, high = recovered_limits(rates[0], limits[0], rates[1], limits[1])
    even = np.sqrt(2 / np.pi * chance) / total
    found = (np.where(known, values, np.nan) for values in (rates[0] - rates[1], low, high, even))
    difference, low, high, even = found
    return Within(difference, low, high, even, weight)
