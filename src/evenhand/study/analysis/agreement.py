"""How far people agree: Krippendorff's alpha, from counts.

alpha = 1 - D_o / D_e, the observed disagreement within units against the one that chance would give
(Krippendorff, Computing Krippendorff's Alpha-Reliability, 2011). With n_uc answers c to unit u, n_u
answers in all, units of at least two answers, and n_c = sum_u n_uc:

    D_o = sum_u sum_ck n_uc n_uk d_ck / (n_u - 1) / n      D_e = sum_ck n_c n_k d_ck / (n (n - 1))

so that it takes counts of answers, never pairs of people: 10,000 of them cost what ten do. Missing
answers are simply not counted. The difference d_ck between two answers is

    nominal    1 where c and k differ
    ordinal    (sum_{g=c..k} n_g - (n_c + n_k) / 2)^2
    interval   (c - k)^2

The interval is the percentile bootstrap over units (Zapf, Castell, Morawietz and Karch, BMC Medical
Research Methodology 16:93, 2016): it says what other units of the kind would give. With few units
it is wide, and rather too narrow than too wide.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenhand.core import errors
from evenhand.core.errors import InputError, unknown
from evenhand.statistics.chance import check_level

Level = Literal["nominal", "ordinal", "interval"]
LEVELS = ("nominal", "ordinal", "interval")
BOOTSTRAPS = 2000
_CELLS = 2_000_000  # numbers of a chunk of bootstrap samples


@dataclass(frozen=True)
class Agreement:
    """Krippendorff's alpha of one question.

    Attributes:
        alpha: 1 is complete agreement, 0 what chance gives; NaN where all answers are the same or
            no unit has two, since nothing can be said then.
        low: lower limit of its interval; NaN with fewer than two units, or without alpha.
        high: upper limit.
        level: of measurement.
        units: that were answered at least twice.
        answers: to these units.
        bootstraps: samples of units whose alpha is defined, out of those drawn.
    """

    alpha: float
    low: float
    high: float
    level: str
    units: int
    answers: int
    bootstraps: int


def alpha(counts: ArrayLike, level: Level, values: ArrayLike | None = None) -> NDArray[np.float64]:
    """Krippendorff's alpha.

    Args:
        counts: how often each value was answered to each unit, [..., U, C], in the order of the
            values; leading axes are carried along.
        level: of measurement.
        values: the C values, for the interval level; 0, 1, 2... by default.

    Returns:
        [...]; NaN where all answers are the same or no unit has two.

    Raises:
        InputError: for counts that are negative or not whole, an unknown level, or values that
            do not match.
    """
    n_uc, points = _checked(counts, level, values)
    per_unit = n_uc.sum(axis=-1, keepdims=True)
    n_uc = np.where(per_unit >= 2, n_uc, 0.0)
    n_u = np.where(per_unit >= 2, per_unit, 2.0)[..., 0]
    n_c = n_uc.sum(axis=-2)
    n = n_c.sum(axis=-1)
    # d is made of [..., C, C]; the sums over units of n_uc n_uk / (n_u - 1) are the coincidences
    coincidences = np.einsum("...uc,...uk->...ck", n_uc / (n_u - 1)[..., None], n_uc)
    d = _difference(n_c, level, points)
    observed = (coincidences * d).sum(axis=(-2, -1))
    expected = (n_c[..., :, None] * n_c[..., None, :] * d).sum(axis=(-2, -1))
    known = expected > 0
    share = observed * np.maximum(n - 1, 0.0) / np.where(known, expected, 1.0)
    return np.where(known, 1.0 - share, np.nan)


def agreement(
    counts: ArrayLike,
    level: Level,
    rng: np.random.Generator,
    values: ArrayLike | None = None,
    confidence: float = 0.95,
    bootstraps: int = BOOTSTRAPS,
) -> Agreement:
    """Krippendorff's alpha with its bootstrap interval over units.

    Args:
        counts: [U, C], as :func:`alpha`.
        level: of measurement.
        rng: source of randomness.
        values: as :func:`alpha`.
        confidence: coverage of the interval.
        bootstraps: samples, at least 99.

    Raises:
        InputError: as :func:`alpha`, or too few samples, or a coverage outside (0, 1).
    """
    check_level("confidence", confidence)
    errors.whole("bootstraps", bootstraps, 99, 1_000_000)
    n_uc, _ = _checked(counts, level, values)
    if n_uc.ndim != 2:
        raise InputError("shape counts", f"counts have shape {n_uc.shape}: give one row a unit")
    n_uc = n_uc[n_uc.sum(axis=1) >= 2]
    found = float(alpha(n_uc, level, values)) if len(n_uc) else math.nan
    low = high = math.nan
    defined = 0
    if len(n_uc) >= 2 and not math.isnan(found):
        drawn = _bootstrapped(n_uc, level, values, rng, bootstraps)
        drawn = drawn[~np.isnan(drawn)]
        defined = len(drawn)
        if defined:
            low, high = np.quantile(drawn, [(1 - confidence) / 2, (1 + confidence) / 2]).tolist()
    return Agreement(found, low, high, level, len(n_uc), int(n_uc.sum()), defined)


def counted(
    units: NDArray[np.int64], codes: NDArray[np.int64], n_units: int, n_values: int
) -> NDArray[np.int64]:
    """Counts [U, C] of answers that are given one by one.

    Args:
        units: of each answer, [n], from 0; -1 is left out.
        codes: value of each answer, [n], from 0; -1 is a missing answer and is left out.
        n_units: U.
        n_values: C.
    """
    there = (codes >= 0) & (units >= 0)
    cells = units[there] * n_values + codes[there]
    return np.bincount(cells, minlength=n_units * n_values).reshape(n_units, n_values)


def _bootstrapped(
    n_uc: NDArray[np.float64],
    level: Level,
    values: ArrayLike | None,
    rng: np.random.Generator,
    bootstraps: int,
) -> NDArray[np.float64]:
    units, width = n_uc.shape
    size = max(1, _CELLS // (units * width + width * width))
    found = []
    for start in range(0, bootstraps, size):
        chosen = rng.integers(units, size=(min(size, bootstraps - start), units))
        found.append(alpha(n_uc[chosen], level, values))
    return np.concatenate(found)


def _difference(
    n_c: NDArray[np.float64], level: Level, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Squared differences d_ck, [..., C, C]."""
    if level == "nominal":
        return np.broadcast_to(1.0 - np.eye(len(points)), (*n_c.shape, len(points)))
    if level == "interval":
        between = (points[:, None] - points[None, :]) ** 2
        return np.broadcast_to(between, (*n_c.shape, len(points)))
    # with R_c = n_1 + ... + n_c - n_c / 2, the middle of c's ranks: d_ck = (R_c - R_k)^2
    ranks = np.cumsum(n_c, axis=-1) - n_c / 2
    return (ranks[..., :, None] - ranks[..., None, :]) ** 2


def _checked(
    counts: ArrayLike, level: str, values: ArrayLike | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if level not in LEVELS:
        raise unknown("level of measurement", level, LEVELS)
    n_uc = np.asarray(counts, dtype=np.float64)
    if n_uc.ndim < 2:
        raise InputError(
            "shape counts",
            f"counts have shape {n_uc.shape}: give one row a unit, one column a value",
        )
    if not np.isfinite(n_uc).all() or (n_uc < 0).any() or (n_uc != np.rint(n_uc)).any():
        raise InputError("range counts", "counts of answers must be whole numbers of at least 0")
    width = n_uc.shape[-1]
    points = np.arange(width) if values is None else np.asarray(values, dtype=np.float64)
    if points.shape != (width,):
        raise InputError(
            "shape values", f"there are {points.size} values for {width} columns of counts"
        )
    return n_uc, points.astype(np.float64)
