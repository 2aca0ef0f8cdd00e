"""Continuous measures: means and medians of every group against all others, with p-values.

Were everybody served alike, any assignment of the values to the people of a stratum would have
been as likely. Two sums over each group are held against that: of the values, for the means; and
of their signs about the median of the stratum, for the medians (a median test, in which a value
on the median itself counts for neither side). Both are studentised by their exact variance, and
adjusted over the groups by the greatest statistic (step-down max-T).

* Up to ``SHUFFLED`` services, values are shuffled indeed: p-values are exact but for the number
  of permutations.
* Beyond, the sums over large groups are drawn from a normal law with the exact means, variances
  and covariances of shuffled sums (sampling from a finite population: Hájek 1960 for the
  normal shape). For people of groups with fewer than ``SMALL`` services, for which the shape
  matters, values are drawn from the log, and the others share what they leave. Where these are
  more than a twentieth of their stratum, they are taken as normal too.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from evenhand.audits.count.tally import Tally, Values, membership
from evenhand.audits.judge.results import MeasureFinding
from evenhand.statistics.permutation import CELLS, adjusted, exceedances, orders

SHUFFLED = 20_000
"""Services up to which values are shuffled."""

SMALL = 200
"""Services below which the sum over a group is not taken as normal."""

SHARE = 0.05  # drawing with replacement: few enough that hardly a value comes twice
FLAT = 1e-12  # a spread this small, relative to the values, is rounding


@dataclass(frozen=True, eq=False)
class _Scored:
    """A measure ready for testing: V rows, I kinds of people, G groups.

    Attributes:
        inside: membership of the kinds, float64 [I, G].
        kind: of each row, [V]; rows are sorted by stratum.
        starts: first row of each stratum, and V.
        score: value and sign, centred within the stratum and of spread 1, [V, 2].
        n: services, [V].
    """

    inside: np.ndarray
    kind: np.ndarray
    starts: np.ndarray
    score: np.ndarray
    n: np.ndarray


def compare(
    tally: Tally, rng: np.random.Generator, permutations: int = 2000
) -> tuple[MeasureFinding, ...]:
    """Every measure and group of a log, against all others."""
    return tuple(
        one
        for values in tally.values
        if len(values.n)
        for one in _measure(tally, values, rng, permutations)
    )


def _measure(
    tally: Tally, values: Values, rng: np.random.Generator, permutations: int
) -> list[MeasureFinding]:
    p = p_values(tally, values, rng, permutations)
    order = np.argsort(values.value, kind="stable")
    value, mean = values.value[order], values.mean[order]
    n, codes = values.n[order], values.codes[order]
    found, column = [], 0
    for d, one in enumerate(tally.identities):
        for code, group in enumerate(one.groups):
            inside = codes[:, d] == code
            here, rest = np.where(inside, n, 0), np.where(inside, 0, n)
            found.append(
                MeasureFinding(
                    measure=values.name,
                    identity=one.name,
                    group=group,
                    n=int(here.sum()),
                    mean=_mean(mean, here),
                    rest_mean=_mean(mean, rest),
                    mean_p=float(p[column, 0]),
                    median=median(value, here),
                    rest_median=median(value, rest),
                    median_p=float(p[column, 1]),
                )
            )
            column += 1
    return found


def median(value: np.ndarray, n: np.ndarray) -> float:
    """Median of sorted values that occur n times each; NaN if none does."""
    reached = np.cumsum(n)
    if not len(reached) or not reached[-1]:
        return float("nan")
    middle = np.array([(reached[-1] - 1) // 2, reached[-1] // 2])
    return float(value[np.searchsorted(reached, middle, side="right")].mean())


def p_values(
    tally: Tally, values: Values, rng: np.random.Generator, permutations: int
) -> np.ndarray:
    """Adjusted p-values of means and of medians, [G, 2]; NaN where a side is empty."""
    rows = _scored(tally, values)
    sums, variance, n = _moments(rows)
    spread = np.sqrt(np.where(variance > FLAT, variance, np.inf))
    observed = np.abs(sums) / spread
    few = int(rows.n.sum()) <= SHUFFLED
    greater = np.zeros(observed.shape)
    for drawn in (_shuffled if few else _drawn)(rows, rng, permutations):
        for s in range(2):
            greater[:, s] += exceedances(np.abs(drawn[..., s]) / spread[:, s], observed[:, s])[1]
    p = np.stack([adjusted(greater[:, s], observed[:, s], permutations) for s in range(2)], axis=1)
    both = (n > 0) & (n < rows.n.sum())
    return np.where(both[:, None], p, np.nan)


def _scored(tally: Tally, values: Values) -> _Scored:
    order = np.lexsort((values.value, values.stratum))
    value, mean = values.value[order], values.mean[order]
    n, stratum = values.n[order], values.stratum[order]
    cuts = np.flatnonzero(np.diff(stratum)) + 1
    starts = np.concatenate([[0], cuts, [len(value)]])
    # One number a kind of people, for rows may be many and sorting rows of codes is slow.
    code = np.zeros(len(value), np.int64)
    for d, one in enumerate(tally.identities):
        if code.max() > 2**62 // len(one.groups):
            code = np.unique(code, return_inverse=True)[1].ravel()
        code = code * len(one.groups) + values.codes[order, d]
    _, first, kind = np.unique(code, return_index=True, return_inverse=True)
    score = np.empty((len(value), 2))
    for a, b in pairwise(starts):
        score[a:b, 0] = mean[a:b]
        score[a:b, 1] = np.sign(value[a:b] - median(value[a:b], n[a:b]))
        score[a:b] -= n[a:b] @ score[a:b] / n[a:b].sum()
    size = np.sqrt(n @ score**2 / n.sum())
    flat = size <= FLAT * np.array([np.abs(mean).max(), 1.0])
    return _Scored(
        inside=membership(values.codes[order][first], tally.identities),
        kind=kind.ravel(),
        starts=starts,
        score=np.where(flat, 0.0, score / np.where(flat, 1.0, size)),
        n=n,
    )


def _strata(rows: _Scored) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """Rows of each stratum, services of each kind in it, [I], and squares of its scores, [2]."""
    for a, b in pairwise(rows.starts):
        own = slice(a, b)
        n = np.bincount(rows.kind[own], weights=rows.n[own], minlength=len(rows.inside))
        yield own, n, rows.n[own] @ rows.score[own] ** 2


def _moments(rows: _Scored) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sums over the groups, [G, 2]; their variance when shuffled, [G, 2]; services, [G].

    Var = Σ n_s (N_s − n_s) / (N_s (N_s − 1)) Σ a² over the strata; the mean is 0.
    """
    sums = np.stack(
        [
            np.bincount(rows.kind, weights=rows.n * a, minlength=len(rows.inside))
            for a in rows.score.T
        ],
        axis=1,
    )
    variance, services = np.zeros((rows.inside.shape[1], 2)), np.zeros(rows.inside.shape[1])
    for _, kinds, squares in _strata(rows):
        size, n = kinds.sum(), rows.inside.T @ kinds
        variance += np.outer(n * (size - n) / (size * max(size - 1, 1)), squares)
        services += n
    return rows.inside.T @ sums, variance, services


def _shuffled(rows: _Scored, rng: np.random.Generator, permutations: int) -> Iterator[np.ndarray]:
    """Sums over the groups of shuffled values, [b, G, 2]."""
    each = np.repeat(np.arange(len(rows.n)), rows.n)
    strata = np.searchsorted(rows.starts, each, side="right")
    inside, score = rows.inside[rows.kind[each]], rows.score[each]
    size = max(1, CELLS // len(each))
    for start in range(0, permutations, size):
        order = orders(len(each), min(size, permutations - start), rng, strata)
        yield np.stack([a[order] @ inside for a in score.T], axis=2)


def _drawn(rows: _Scored, rng: np.random.Generator, permutations: int) -> Iterator[np.ndarray]:
    """Sums over the groups as shuffling would make them, [b, G, 2]; see the head of this room."""
    groups = rows.inside.shape[1]
    total = sum((rows.inside.T @ kinds for _, kinds, _ in _strata(rows)), np.zeros(groups))
    small = (rows.inside[:, total < SMALL] > 0).any(axis=1)
    plans = []
    for own, kinds, squares in _strata(rows):
        apart = np.where(small, kinds, 0).astype(int)
        if apart.sum() > SHARE * kinds.sum():
            apart[:] = 0
        rest = kinds - apart
        n = rows.inside.T @ rest
        pairs = rows.inside.T @ (rest[:, None] * rows.inside) - np.outer(n, n) / rest.sum()
        ends = np.cumsum(rows.n[own])
        plans.append((own, apart, rest.sum(), n, _root(pairs), squares, ends))
    most = max(max(int(plan[1].sum()) for plan in plans), groups)
    size = max(1, CELLS // (4 * most))
    for start in range(0, permutations, size):
        b = min(size, permutations - start)
        sums = np.zeros((b, groups, 2))
        for own, apart, left, n, root, squares, ends in plans:
            taken, taken_squares = np.zeros((b, 2)), np.zeros((b, 2))
            if apart.any():
                place = np.searchsorted(
                    ends, rng.integers(0, ends[-1], (b, apart.sum())), side="right"
                )
                inside = np.repeat(rows.inside, apart, axis=0)
                for s in range(2):
                    a = rows.score[own, s][place]
                    sums[..., s] += a @ inside
                    taken[:, s], taken_squares[:, s] = a.sum(axis=1), (a**2).sum(axis=1)
            mean = -taken / left
            spread = np.maximum(squares - taken_squares - left * mean**2, 0.0)
            scale = np.sqrt(spread / max(left - 1, 1))
            normal = rng.standard_normal((b, 2, root.shape[1])) @ root.T
            sums += (mean[:, :, None] * n + scale[:, :, None] * normal).swapaxes(1, 2)
        yield sums


def _root(covariance: np.ndarray) -> np.ndarray:
    """R with R Rᵀ = covariance, which may be singular: the groups of an identity add up."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.where(values > FLAT * values.max(), values, 0.0))


def _mean(value: np.ndarray, n: np.ndarray) -> float:
    return float(value @ n / n.sum()) if n.any() else float("nan")
