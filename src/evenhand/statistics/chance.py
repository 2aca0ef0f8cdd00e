"""What a gap is worth: chance taken out of Eq. 1 and 2, and standard errors.

Pure functions of counts (`methods.paper.scores.Counts`), so that windows can be pooled by adding
them. Shapes: G groups, K issues; leading axes, for instance many windows, are carried along. A gap
with an empty side is missing (NaN) everywhere, never 0.

By chance alone, the gap |d| of an even robot is on average sqrt(2/π) sqrt(p(1−p)(1/n + 1/m)) for n
services in the group and m outside. Two ways take that out: :func:`squared_gap` (unbiased in the
square: for verdicts, curves and constraints, from large or pooled windows) and :func:`even_gaps`
(the expected gap itself, exact: for averages over windows as small as an epoch).
"""

from collections.abc import Sequence
from dataclasses import fields

import numpy as np
from scipy.special import gammaln

from evenhand.core.errors import InputError
from evenhand.methods.paper.scores import Counts, Scores, averaged, gaps, issue_score


def check_counts(counts: Counts, whole: bool = False) -> None:
    """Check that counts can be counts.

    Args:
        counts: of one window or many.
        whole: ask for whole numbers too; else counts may be weighted.

    Raises:
        InputError: for a count that is negative, not finite, above its number of services or, if
            asked, not whole.
    """
    for side in ("inside", "outside"):
        n = np.asarray(getattr(counts, f"{side}_n"))
        x = np.asarray(getattr(counts, f"{side}_x"))
        if not (np.isfinite(n).all() and np.isfinite(x).all()) or (x < 0).any() or (x > n).any():
            raise InputError(
                "range counts",
                f"counts {side} the groups are not finite with 0 <= issues <= services: "
                "count them anew with non-negative weights",
            )
    if whole and any((np.mod(getattr(counts, f.name), 1) != 0).any() for f in fields(counts)):
        raise InputError(
            "type counts",
            "counts are not whole numbers: an exact test needs services without weights",
        )


def check_level(name: str, value: float) -> None:
    """Check a probability that must lie inside (0, 1).

    Raises:
        InputError: when it does not.
    """
    if not 0.0 < value < 1.0:
        raise InputError(f"range {name}", f"{name} is {value}: give a number between 0 and 1")


# --- the squared gap without chance -------------------------------------------------------------


def squared_gap(counts: Counts) -> np.ndarray:
    """Unbiased estimate of the squared gap (p − q)².

    d²_U = (p̂ − q̂)² − p̂(1−p̂)/(n−1) − q̂(1−q̂)/(m−1), the square less the unbiased estimates of both
    sides' variances. Its mean is the true squared gap for every n, m >= 2; so it is negative
    about as often as positive when groups are served alike. Average first, clip last.

    Args:
        counts: [..., G, K].

    Returns:
        [..., G, K]; NaN where a side has fewer than 2 services.

    Raises:
        InputError: for impossible counts.
    """
    check_counts(counts)
    n, m = np.asarray(counts.inside_n, float), np.asarray(counts.outside_n, float)
    enough = (n >= 2) & (m >= 2)
    p = counts.inside_x / np.where(enough, n, 1.0)
    q = counts.outside_x / np.where(enough, m, 1.0)
    chance = p * (1 - p) / np.where(enough, n - 1, 1.0) + q * (1 - q) / np.where(enough, m - 1, 1.0)
    return np.where(enough, (p - q) ** 2 - chance, np.nan)


def corrected_issue_score(squared: np.ndarray, axis: int | tuple[int, ...] = -2) -> np.ndarray:
    """I of Eq. 2 without chance: root of the mean squared gap, with the sign of that mean.

    The root mean square replaces the mean of |d|, since only the square has an unbiased estimate.
    So the score of an uneven robot does not depend on how many services there are, as a mean of
    |d| less chance does. The root keeps Eq. 2's unit, a difference of rates. It keeps the sign, so
    that even robots score around 0: a clipped root would find something in each of them. The root
    of few services is biased: pool counts, or give the axis of the windows too, so that all
    averaging comes first.

    Args:
        squared: from :func:`squared_gap`, [..., G, K].
        axis: what to average over; the groups by default.

    Returns:
        [..., K], in [-1, 1]; NaN where no squared gap is defined.
    """
    known = ~np.isnan(squared)
    n = known.sum(axis=axis)
    mean = np.where(known, squared, 0.0).sum(axis=axis) / np.maximum(n, 1)
    return np.where(n > 0, np.sign(mean) * np.sqrt(np.abs(mean)), np.nan)


def corrected_scores(
    counts: Counts, groups: Sequence[tuple[str, str]], issues: Sequence[str]
) -> Scores:
    """Eq. 1 and 2 with the chance of small windows taken out of the squared gaps.

    Args:
        counts: [..., G, K].
        groups: (identity, category) of each group.
        issues: names of the issues.

    Returns:
        Scores whose ``overall`` and ``by_identity`` come from :func:`corrected_issue_score`;
        ``gap`` is the root of each squared gap, likewise.

    Raises:
        InputError: for impossible counts.
    """
    squared = squared_gap(counts)
    shown = np.sign(squared) * np.sqrt(np.abs(squared))
    return averaged(shown, squared, corrected_issue_score, groups, issues)


# --- the excess over chance ---------------------------------------------------------------------


def even_gaps(counts: Counts) -> np.ndarray:
    """E|d| of an even robot: the mean gap if the issues of the window fell on anybody alike.

    The mean over all permutations of who had the issue, given the sizes of both sides. The
    issues inside the group are then hypergeometric, whose mean deviation is 2 f(k)/N with
    f(k) = k (N − X − n + k) Pr(k), k the least whole number above the mean nX/N: the terms of the
    sum telescope, N (j − nX/N) Pr(j) = f(j) − f(j+1).

    Args:
        counts: whole numbers, [..., G, K].

    Returns:
        [..., G, K]; NaN where a side is empty.

    Raises:
        InputError: for impossible or broken counts.
    """
    check_counts(counts, whole=True)
    n, m = np.asarray(counts.inside_n, float), np.asarray(counts.outside_n, float)
    total, cases = n + m, counts.inside_x + counts.outside_x
    defined = (n > 0) & (m > 0)
    safe = np.where(defined, total, 1.0)
    k = np.floor(n * cases / safe) + 1.0
    possible = defined & (k <= np.minimum(n, cases))
    deviation = np.zeros(np.broadcast(n, cases).shape)
    k, n_, cases_, total_ = (
        np.broadcast_to(a, deviation.shape)[possible] for a in (k, n, cases, total)
    )
    log_pr = _choose(cases_, k) + _choose(total_ - cases_, n_ - k) - _choose(total_, n_)
    deviation[possible] = 2.0 * k * (total_ - cases_ - n_ + k) * np.exp(log_pr) / total_
    return np.where(defined, deviation * total / np.where(defined, n * m, 1.0), np.nan)


def excess_scores(
    counts: Counts, groups: Sequence[tuple[str, str]], issues: Sequence[str]
) -> Scores:
    """Eq. 1 and 2 as excess over chance: |d| − E|d| of an even robot, averaged as in Eq. 2.

    Its mean is 0 for an even robot at any size of the window, so single values may be negative.
    No root, no clipping: fit for averages over short windows, and for a detector.

    Args:
        counts: whole numbers, [..., G, K].
        groups: (identity, category) of each group.
        issues: names of the issues.

    Raises:
        InputError: for impossible or broken counts.
    """
    excess = gaps(counts) - even_gaps(counts)
    return averaged(excess, excess, issue_score, groups, issues)


def _choose(n: np.ndarray, k: np.ndarray) -> np.ndarray:
    return gammaln(n + 1) - gammaln(k + 1) - gammaln(n - k + 1)


# --- standard errors ----------------------------------------------------------------------------


def standard_error(counts: Counts) -> np.ndarray:
    """Standard error of a signed gap, with one service of either kind added to each side.

    sqrt(p̃(1−p̃)/(n+2) + q̃(1−q̃)/(m+2)), p̃ = (x+1)/(n+2) (Agresti and Caffo, The American
    Statistician 2000). Unlike the plain formula it is never 0: three of three in a small group
    does not count as certain.

    Args:
        counts: [..., G, K].

    Returns:
        [..., G, K]; NaN where a side is empty.

    Raises:
        InputError: for impossible counts.
    """
    check_counts(counts)
    n, m = np.asarray(counts.inside_n, float) + 2, np.asarray(counts.outside_n, float) + 2
    p, q = (counts.inside_x + 1) / n, (counts.outside_x + 1) / m
    defined = (n > 2) & (m > 2)
    return np.where(defined, np.sqrt(p * (1 - p) / n + q * (1 - q) / m), np.nan)
