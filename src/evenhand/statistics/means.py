"""Means with their intervals."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

SHARE = (0.0, 1.0)
"""Ends of the scale of a share."""
SCORE = (0.0, math.inf)
"""Of a total issue score, whose upper end depends on the groups."""


@dataclass(frozen=True)
class Estimate:
    """A mean with its 95 % interval; ``low`` and ``high`` are NaN when there is none."""

    mean: float
    low: float
    high: float
    n: int

    @property
    def has_interval(self) -> bool:
        """Whether there were at least two values."""
        return not math.isnan(self.low)


def mean_interval(
    values: Iterable[float],
    level: float = 0.95,
    within: tuple[float, float] = (-math.inf, math.inf),
    errors: float | None = None,
) -> Estimate:
    """Mean and interval of independent values, for instance one a seed.

    Args:
        values: NaN (not defined for that seed) is left out.
        level: coverage of the interval.
        within: least and most that the mean can be; the interval is cut there.
        errors: half the interval in standard errors; Student's quantile by default.

    Returns:
        mean ± t(n−1) · s/√n. One value has no interval, none has no mean: NaN, never 0.
    """
    x = np.asarray(list(values), dtype=np.float64)
    x = x[~np.isnan(x)]
    if len(x) == 0:
        return Estimate(math.nan, math.nan, math.nan, 0)
    mean = float(x.mean())
    if len(x) == 1:
        return Estimate(mean, math.nan, math.nan, 1)
    times = stdtrit(len(x) - 1, 0.5 + level / 2) if errors is None else errors
    half = float(times * x.std(ddof=1) / math.sqrt(len(x)))
    return Estimate(mean, max(mean - half, within[0]), min(mean + half, within[1]), len(x))
