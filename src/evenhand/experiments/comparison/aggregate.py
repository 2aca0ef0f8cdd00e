"""Statistics of several seeds: interquartile mean, bootstrap, improvement, fronts, hypervolume.

Few seeds are the rule in learning, so single lucky runs must not carry a result. The protocol is
that of Agarwal et al., "Deep reinforcement learning at the edge of the statistical precipice",
NeurIPS 2021. Pure functions on arrays.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from evenhand.core.errors import InputError, whole

RESAMPLES = 10_000
"""Bootstrap samples."""


@dataclass(frozen=True)
class Estimate:
    """A statistic with its interval.

    Attributes:
        value: of the values themselves; NaN when there are none.
        low: lower limit; NaN unless every stratum has two values or more.
        high: upper limit, likewise.
        n: how many values.
    """

    value: float
    low: float
    high: float
    n: int


def iqm(values: np.ndarray, axis: int = -1) -> np.ndarray:
    """Interquartile mean: the mean of the middle half of the values.

    A value that lies on the edge of the middle half counts by the part of it inside: of 10 values,
    the third and the eighth count half. With 4, 8, 12 ... values this is the 25 % trimmed mean.

    Args:
        values: [..., n, ...], finite, n at least 1.
        axis: of the n values.

    Returns:
        Without that axis.

    Raises:
        InputError: when there are no values, or one is not finite.
    """
    ordered = np.sort(np.moveaxis(np.asarray(values, float), axis, -1), axis=-1)
    n = ordered.shape[-1]
    if n == 0 or not np.isfinite(ordered).all():
        raise InputError(
            "range values",
            "an interquartile mean needs finite values: leave out what is missing",
        )
    place = np.arange(n)
    inside = np.minimum(place + 1, 0.75 * n) - np.maximum(place, 0.25 * n)
    return ordered @ (np.maximum(inside, 0.0) / (0.5 * n))


def bootstrap(
    strata: Sequence[np.ndarray],
    statistic: Callable[[list[np.ndarray]], np.ndarray],
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
    level: float = 0.95,
) -> Estimate:
    """A statistic of all values, and its stratified percentile interval.

    Seeds are drawn anew within each stratum (a scenario), so that every sample holds as many of
    each as there are. What belongs to one seed stays together: rows are drawn, not cells.

    Args:
        strata: values of each stratum, [n_s] or [n_s, C], C the same for all.
        statistic: from a list of strata, [R, n_s] or [R, n_s, C] each, to [R].
        rng: draws the samples.
        resamples: how many samples.
        level: of the interval.

    Returns:
        The estimate. The limits are missing when a stratum has a single value, for then nothing
        says how far its seeds scatter, or when the statistic of a sample is missing.

    Raises:
        InputError: for no resamples or a level outside (0, 1).
    """
    whole("resamples", resamples, 1, 10_000_000)
    if not 0.0 < level < 1.0:
        raise InputError("range level", f"level is {level}: give a number between 0 and 1")
    known = [np.asarray(values, float) for values in strata if len(values)]
    n = sum(map(len, known))
    if not n:
        return Estimate(nan, nan, nan, 0)
    value = float(statistic([values[None] for values in known])[0])
    if min(map(len, known)) < 2:
        return Estimate(value, nan, nan, n)
    drawn = [v[rng.integers(len(v), size=(resamples, len(v)))] for v in known]
    found = statistic(drawn)
    low, high = np.quantile(found, [(1 - level) / 2, (1 + level) / 2])
    return Estimate(value, float(low), float(high), n)


def mean_of(strata: Sequence[np.ndarray], rng: np.random.Generator) -> Estimate:
    """Interquartile mean of all values with its 95 % stratified bootstrap interval.

    Args:
        strata: [n_s] each.
        rng: draws the samples.
    """
    return bootstrap(strata, lambda drawn: iqm(np.concatenate(drawn, axis=1), 1), rng)


def difference(strata: Sequence[np.ndarray], rng: np.random.Generator) -> Estimate:
    """Interquartile mean of X − Y, paired by seed, with its interval.

    Args:
        strata: columns X and Y, [n_s, 2] each.
        rng: draws the samples.
    """
    return mean_of([pairs[:, 0] - pairs[:, 1] for pairs in strata], rng)


def improvement(strata: Sequence[np.ndarray], rng: np.random.Generator) -> Estimate:
    """Probability of improvement: P(X > Y) + P(X = Y) / 2 of any two seeds, with its interval.

    The Mann-Whitney statistic of each stratum, averaged over strata, as Agarwal et al. define it:
    a seed of one arm has nothing to do with the same seed of another that learned otherwise.

    Args:
        strata: columns X and Y, greater is better, [n_s, 2] each.
        rng: draws the samples.
    """

    def beats(drawn: list[np.ndarray]) -> np.ndarray:
        shares = [
            (0.5 + 0.5 * np.sign(pairs[:, :, None, 0] - pairs[:, None, :, 1])).mean(axis=(1, 2))
            for pairs in drawn
        ]
        return np.mean(shares, axis=0)

    return bootstrap(strata, beats, rng)


def share(strata: Sequence[np.ndarray], rng: np.random.Generator) -> Estimate:
    """How much of what can be attained is attained: (S − A) / (S − B), with its interval.

    Values are normalised by the means of S and B in their own stratum before they are pooled, as
    Agarwal et al. do: else a scenario that is more uneven than others would count for more.

    Args:
        strata: columns S (where one starts), A (what came out) and B (the best there is), smaller
            is better, paired by seed, [n_s, 3] each.
        rng: draws the samples.

    Returns:
        The interquartile mean. Missing where S − B is not above 0 in a stratum, for then nothing
        can be attained; so the limits are missing unless it is above 0 in every sample.
    """

    def attained(drawn: list[np.ndarray]) -> np.ndarray:
        parts, possible = [], np.ones(len(drawn[0]), bool)
        for x in drawn:
            start, best = iqm(x[..., 0], 1), iqm(x[..., 2], 1)
            room = start - best
            possible &= room > 0
            parts.append((start[:, None] - x[..., 1]) / np.where(room > 0, room, 1.0)[:, None])
        return np.where(possible, iqm(np.concatenate(parts, axis=1), 1), nan)

    return bootstrap(strata, attained, rng)


# --- two aims at once ---------------------------------------------------------------------------


def pareto_front(points: np.ndarray) -> np.ndarray:
    """Which points no other point dominates: at least as good in all, better in one.

    Args:
        points: greater is better, [n, C]; one with a missing number is on no front.

    Returns:
        bool [n]; of equal points, all or none.
    """
    points = np.asarray(points, float)
    known = ~np.isnan(points).any(axis=1)
    as_good = (points[:, None] >= points[None]).all(axis=2)
    better = (points[:, None] > points[None]).any(axis=2)
    # a comparison with a missing number is false, so such a point dominates none
    return known & ~np.any(as_good & better, axis=0)


def hypervolume(points: np.ndarray, worst: tuple[float, float]) -> float:
    """Area that a set of points dominates (Zitzler and Thiele 1999, here in two dimensions).

    Args:
        points: (evenness, service), greater is better, [n, 2].
        worst: reference point; what is not better than it in both adds nothing.

    Returns:
        The area between the points and the reference point; 0 without points.

    Raises:
        InputError: when the points are not pairs of finite numbers.
    """
    points = np.asarray(points, float)
    if len(points) and (points.shape[1:] != (2,) or not np.isfinite(points).all()):
        raise InputError(
            "range points",
            "a hypervolume needs pairs of finite numbers: leave out what is missing",
        )
    area, reached = 0.0, worst[1]
    # from the most even on, each point adds the strip of service above what was reached before
    for evenness, service in sorted(points.tolist(), reverse=True):
        if evenness > worst[0] and service > reached:
            area += (evenness - worst[0]) * (service - reached)
            reached = service
    return area
