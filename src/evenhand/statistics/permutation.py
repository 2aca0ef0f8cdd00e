"""Is a gap more than chance? Permutation tests that keep whole identity vectors together.

Were everybody served alike, who somebody is would say nothing about what happened to them: any
assignment of the services' outcomes to the people would have been as likely. So the rows of
outcomes are shuffled against the rows of identities. A person's identities stay together, and so
do a service's issues; what does not apply (NaN) travels with its row. The greatest statistic of
each shuffle holds the error over all groups and issues together (max-T; Westfall and Young 1993),
exactly so where nothing depends on who somebody is.

Each gap is studentised with the hypergeometric variance of Mantel and Haenszel (1959), added over
strata: then a rare issue in a small group and a frequent one in a large group are on one scale,
and a gap keeps its error near the stated one although other gaps are real (DiCiccio et al. 2020).

For many windows at once: :mod:`evenhand.statistics.windows`; for
logs of any size, as counts: :mod:`evenhand.statistics.count_tables`.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from evenhand.core import errors
from evenhand.core.errors import InputError
from evenhand.methods.paper.scores import Counts, count, gaps, issue_score, total

# Equal statistics can differ in the last digits; a tie must count as at least as great.
TIE = 1e-9
CELLS = 4_000_000  # numbers in memory at once, times a small factor


@dataclass(frozen=True, eq=False)
class PermutationTest:
    """What the permutations say of one window.

    Attributes:
        statistic: signed and studentised gap, [G, K]; NaN where a side is empty, 0 where
            everybody or nobody had the issue.
        p: two-sided p-value of each gap by itself, [G, K]; NaN where a side is empty.
        p_adjusted: the same, adjusted for all groups and issues (step-down max-T).
        even_gap: mean gap |d| over the permutations, [G, K]; what chance alone gives.
        total: raw total issue score of the window; NaN when no gap is defined.
        even_total: its mean over the permutations.
        p_total: share of permutations with as great a raw total.
        permutations: how many were drawn.
    """

    statistic: np.ndarray
    p: np.ndarray
    p_adjusted: np.ndarray
    even_gap: np.ndarray
    total: float
    even_total: float
    p_total: float
    permutations: int

    @property
    def p_settled(self) -> np.ndarray:
        """Adjusted p-values with the error of drawing added, [G, K]; see :func:`settled`."""
        return settled(self.p_adjusted, self.permutations)


def settled(p: np.ndarray, permutations: int) -> np.ndarray:
    """A p-value plus its own standard error, so that another seed rarely turns a verdict.

    Args:
        p: from drawn permutations.
        permutations: how many were drawn.
    """
    return np.minimum(1.0, p + np.sqrt(p * (1 - p) / (permutations + 1)))


def holm(p: np.ndarray) -> np.ndarray:
    """Holm's step-down adjustment (1979) of p-values, [n]; NaN stays NaN and counts as no test."""
    adjusted = np.full(len(p), np.nan)
    known = np.flatnonzero(~np.isnan(p))
    order = known[np.argsort(p[known], kind="stable")]
    steps = p[order] * np.arange(len(order), 0, -1)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(steps))
    return adjusted


def check_rows(x: np.ndarray, inside: np.ndarray) -> None:
    """Check indicators [..., n, K] against membership [..., n, G].

    Raises:
        InputError: for other shapes, no services, or values other than 0, 1 and NaN.
    """
    if x.ndim < 2 or inside.ndim != x.ndim or x.shape[:-1] != inside.shape[:-1]:
        raise InputError(
            "shape indicators",
            f"indicators {x.shape} and membership {inside.shape} do not match: "
            "give one row a service to both",
        )
    if 0 in x.shape or 0 in inside.shape:
        raise InputError(
            "empty window", "the window has no services, no groups or no issues: nothing to test"
        )
    for name, values in (("indicators", x), ("membership", inside)):
        if not ((values == 0) | (values == 1) | np.isnan(values)).all():
            raise InputError(f"range {name}", f"{name} hold other values than 0, 1 and missing")


def studentised(parts: Sequence[Counts]) -> np.ndarray:
    """Mantel and Haenszel's statistic of each gap: Σ(x − E) / sqrt(ΣV) over the strata.

    E = n X / N and V = n m X (N − X) / (N² (N − 1)) of the issues in the group, X of N in all.

    Args:
        parts: counts of each stratum, [..., G, K]; one for a window without strata.

    Returns:
        [..., G, K]; NaN where no stratum has somebody on both sides, 0 where nothing varies.
    """
    difference: np.ndarray | float = 0.0
    variance: np.ndarray | float = 0.0
    comparable: np.ndarray | bool = False
    for c in parts:
        n, both = c.inside_n, c.inside_n + c.outside_n
        cases = c.inside_x + c.outside_x
        size, less = np.maximum(both, 1.0), np.maximum(both - 1.0, 1.0)
        difference = difference + c.inside_x - n * cases / size
        variance = variance + n * c.outside_n * cases * (both - cases) / (size**2 * less)
        comparable = comparable | ((n > 0) & (c.outside_n > 0))
    value = difference / np.sqrt(np.where(np.asarray(variance) > 0, variance, np.inf))
    return np.where(comparable, value, np.nan)


def orders(
    n: int, permutations: int, rng: np.random.Generator, strata: np.ndarray | None = None
) -> np.ndarray:
    """Random orders of n rows, each row staying in its stratum, int64 [permutations, n].

    Args:
        n: rows.
        permutations: how many orders.
        rng: source of randomness.
        strata: a whole number for each row's stratum, [n].
    """
    rows = np.tile(np.arange(n), (permutations, 1))
    if strata is None:
        return rng.permuted(rows, axis=1)
    for stratum in np.unique(strata):
        own = np.flatnonzero(strata == stratum)
        rows[:, own] = rng.permuted(rows[:, own], axis=1)
    return rows


def exceedances(drawn: np.ndarray, observed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How often drawn statistics reach the observed ones.

    Args:
        drawn: of each permutation, at least 0, [b, M].
        observed: [M].

    Returns:
        How often each one's own statistic does, [M], and how often the greatest statistic of
        those that are observed no greater does (stepping down), [M].
    """
    ranked = np.argsort(-observed, kind="stable")
    limit = observed * (1 - TIE) - TIE
    greatest = np.empty_like(drawn)
    greatest[:, ranked] = np.maximum.accumulate(drawn[:, ranked[::-1]], axis=1)[:, ::-1]
    return (drawn >= limit).sum(axis=0), (greatest >= limit).sum(axis=0)


def adjusted(above_max: np.ndarray, observed: np.ndarray, permutations: int) -> np.ndarray:
    """Step-down p-values, [M]: the smaller statistic never has the smaller p-value.

    Args:
        above_max: second result of :func:`exceedances`, summed over all permutations.
        observed: [M].
        permutations: how many.
    """
    ranked = np.argsort(-observed, kind="stable")
    p = np.empty(len(observed))
    p[ranked] = np.maximum.accumulate((1 + above_max[ranked]) / (permutations + 1))
    return p


def permutation_test(
    x: np.ndarray,
    inside: np.ndarray,
    rng: np.random.Generator,
    permutations: int = 999,
    strata: np.ndarray | None = None,
) -> PermutationTest:
    """Test every group and issue of one window; p = (1 + #{T* >= T}) / (permutations + 1).

    Args:
        x: indicators, [n, K], NaN where an issue does not apply.
        inside: membership, [n, G], NaN where unknown.
        rng: source of randomness.
        permutations: how many to draw, at least 99.
        strata: whole numbers [n]; services are only exchanged within one, for instance within
            a scenario or a place.

    Raises:
        InputError: for rows that do not match, other values than 0, 1 and NaN, or too few
            permutations.
    """
    errors.whole("permutations", permutations, 99, 10_000_000)
    x, inside = np.asarray(x, float), np.asarray(inside, float)
    check_rows(x, inside)
    if strata is not None and np.shape(strata) != (len(x),):
        raise InputError(
            "shape strata",
            f"strata {np.shape(strata)} do not match {len(x)} services: give one each",
        )

    def chunks() -> Iterator[np.ndarray]:
        size = max(1, CELLS // (len(x) * (x.shape[1] + 2)))
        for start in range(0, permutations, size):
            yield orders(len(x), min(size, permutations - start), rng, strata)

    return against_orders(x, inside, chunks(), strata)


def against_orders(
    x: np.ndarray,
    inside: np.ndarray,
    chunks: Iterable[np.ndarray],
    strata: np.ndarray | None = None,
) -> PermutationTest:
    """The test against given orders of the rows of indicators; all of them make it exact.

    Args:
        x: indicators, [n, K].
        inside: membership, [n, G].
        chunks: orders, each [b, n], that leave every row in its stratum.
        strata: whole numbers [n].
    """
    own = (
        [np.arange(len(x))]
        if strata is None
        else [np.flatnonzero(strata == s) for s in np.unique(strata)]
    )

    def parts_of(order: np.ndarray) -> list[Counts]:
        return [count(x[order[..., rows]], inside[rows]) for rows in own]

    return against_parts(parts_of(np.arange(len(x))), (parts_of(order) for order in chunks))


def against_parts(
    observed_parts: list[Counts],
    drawn_parts: Iterable[list[Counts]],
    totalled: int | None = None,
) -> PermutationTest:
    """The test from the counts of each stratum, as they are and as permutations make them.

    Args:
        observed_parts: of each stratum, [G, K].
        drawn_parts: chunks of permutations: of each stratum, [b, G, K].
        totalled: the total is that of the first so many groups; of all by default.
    """

    def summary(parts: list[Counts]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        gap = gaps(sum(parts[1:], parts[0]))
        return (
            np.nan_to_num(np.abs(studentised(parts))),
            gap,
            total(issue_score(gap[..., :totalled, :])),
        )

    signed = studentised(observed_parts)
    observed, _, raw_total = summary(observed_parts)
    above, above_max = np.zeros(observed.size), np.zeros(observed.size)
    gap_sum, gap_n = np.zeros(observed.shape), np.zeros(observed.shape)
    total_sum, total_n, total_above, drawn = 0.0, 0, 0, 0
    for parts in drawn_parts:
        values, gap, totals = summary(parts)
        one, greatest = exceedances(values.reshape(len(values), -1), observed.ravel())
        above, above_max = above + one, above_max + greatest
        gap_sum += np.nan_to_num(gap).sum(axis=0)
        gap_n += (~np.isnan(gap)).sum(axis=0)
        total_sum += float(np.nansum(totals))
        total_n += int((~np.isnan(totals)).sum())
        total_above += int((~(totals < raw_total - TIE)).sum())  # missing counts as above
        drawn += len(values)

    missing = np.isnan(signed)
    p = ((1 + above) / (drawn + 1)).reshape(observed.shape)
    stepped = adjusted(above_max, observed.ravel(), drawn)
    known = not np.isnan(raw_total)
    return PermutationTest(
        statistic=signed,
        p=np.where(missing, np.nan, p),
        p_adjusted=np.where(missing, np.nan, stepped.reshape(observed.shape)),
        even_gap=np.where(gap_n > 0, gap_sum / np.maximum(gap_n, 1), np.nan),
        total=float(raw_total),
        even_total=total_sum / total_n if total_n else float("nan"),
        p_total=(1 + total_above) / (drawn + 1) if known else float("nan"),
        permutations=drawn,
    )
