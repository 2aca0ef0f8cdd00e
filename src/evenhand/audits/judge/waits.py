"""How long groups wait, from counts, with services without a response counted as censored.

The formulas work on the number of responses and of people still waiting at each step: what they
cost depends on the number of different times, not of services.

Within strata, log-rank sums and their variances are added up (Mantel 1966), and differences of the
shares still waiting are weighed by Mantel and Haenszel, as those of rates are
(:mod:`evenhand.statistics.strata`). Shares and medians of a group are of the whole log.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from evenhand.audits.count.tally import Identity, Tally, Waits
from evenhand.audits.judge.results import WaitFinding
from evenhand.statistics.intervals import recovered_limits, wilson
from evenhand.statistics.permutation import holm

ROUNDING = 1e-12
"""A product of shares that is exactly one half may come out this much above it."""


@dataclass(frozen=True, eq=False)
class _Life:
    """A life table; columns are the G groups, then the others of each.

    Attributes:
        steps: that occur, in order, [T].
        events: responses at each, [T, 2G].
        at_risk: people who were seen to wait at least so long, [T, 2G].
    """

    steps: np.ndarray
    events: np.ndarray
    at_risk: np.ndarray


@dataclass(frozen=True, eq=False)
class _Left:
    """Share still waiting after a step, of each column, [2G].

    Attributes:
        value: NaN without people, and where everybody left is out of sight before.
        greenwood: its variance divided by its square; 0 where it is 0 or 1.
        size: people without censoring who would have that variance; where the share is 1, those
            still at risk, and where it is 0, all who were answered.
    """

    value: np.ndarray
    greenwood: np.ndarray
    size: np.ndarray


def compare(tally: Tally, alpha: float = 0.05) -> tuple[WaitFinding, ...]:
    """Waiting of every group against all others; nothing where the log does not tell it.

    Args:
        tally: counts of the log.
        alpha: 1 − the level of the limits: of each share by itself, of all differences together.
    """
    if tally.waits is None or not len(tally.waits.n):
        return ()
    waits, names = tally.waits, tally.names()
    whole = _life(waits, tally.identities)
    n, responses = whole.at_risk[0], whole.events.sum(axis=0)
    share = _share(whole)
    reached = (share <= 0.5 + ROUNDING) & (n > 0)
    median = np.where(
        reached.any(axis=0), whole.steps[reached.argmax(axis=0)] * waits.seconds, np.nan
    )
    left = _left(waits.late, whole)
    alone = _limits(left, 1 - alpha)
    rank, within = _compared(waits, tally.identities, whole, left)
    low, high = _limits(within, 1 - alpha / len(names))
    (p, q), (p_low, q_low), (p_high, q_high) = (np.split(a, 2) for a in (within.value, low, high))
    limits = recovered_limits(p, (p_low, p_high), q, (q_low, q_high))
    test = holm(rank)
    return tuple(
        WaitFinding(
            identity=identity,
            group=group,
            n=int(n[g]),
            responses=int(responses[g]),
            median=float(median[g]),
            unserved=float(left.value[g]),
            unserved_low=float(alone[0][g]),
            unserved_high=float(alone[1][g]),
            rest_unserved=float(left.value[len(names) + g]),
            difference=float(p[g] - q[g]),
            low=float(limits[0][g]),
            high=float(limits[1][g]),
            p=float(test[g]),
        )
        for g, (identity, group) in enumerate(names)
    )


def _compared(
    waits: Waits, identities: tuple[Identity, ...], whole: _Life, left: _Left
) -> tuple[np.ndarray, _Left]:
    """P-value of the log-rank test of each group, [G], and the shares that are compared, [2G]."""
    if (waits.stratum == waits.stratum[0]).all():
        return _p_value(*_log_rank(whole)), left
    sums, lefts, people = [], [], []
    for part in _strata(waits):
        life = _life(part, identities)
        sums.append(_log_rank(life))
        lefts.append(_left(waits.late, life))
        people.append(life.at_risk[0])
    difference, variance, both = (np.sum(each, axis=0) for each in zip(*sums, strict=True))
    return _p_value(difference, variance, both), _pooled(lefts, np.array(people))


def _strata(waits: Waits) -> Iterator[Waits]:
    order = np.argsort(waits.stratum, kind="stable")
    cuts = np.flatnonzero(np.diff(waits.stratum[order])) + 1
    for rows in np.split(order, cuts):
        yield waits.only(rows)


def _life(waits: Waits, identities: tuple[Identity, ...]) -> _Life:
    steps, place = np.unique(waits.step, return_inverse=True)
    place = place.ravel()
    events, at_risk = [], []
    for d, one in enumerate(identities):
        cells = len(steps) * len(one.groups)
        rows = waits.codes[:, d] >= 0
        cell = place[rows] * len(one.groups) + waits.codes[rows, d]
        n = waits.n[rows]
        tables = []
        for weights in (n * waits.responded[rows], n):
            counted = np.bincount(cell, weights=weights, minlength=cells)
            tables.append(counted.reshape(len(steps), -1))
        events.append(tables[0])
        at_risk.append(tables[1][::-1].cumsum(axis=0)[::-1])
    sides = (
        np.concatenate([*parts, *(a.sum(axis=1, keepdims=True) - a for a in parts)], axis=1)
        for parts in (events, at_risk)
    )
    return _Life(steps, *sides)


def _share(life: _Life) -> np.ndarray:
    """Kaplan and Meier's share still waiting after each step, Π (1 − d_j/n_j), [T, 2G]."""
    return np.cumprod(1 - life.events / np.maximum(life.at_risk, 1), axis=0)


def _log_rank(life: _Life) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sums of Mantel's log-rank test of each group against all others, [G] each.

    E = Σ d_j n_j(g)/n_j and V = Σ d_j n_j(g) (n_j − n_j(g)) (n_j − d_j) / (n_j² (n_j − 1)) (Mantel
    1966).

    Returns:
        Responses − E, V, and whether there is somebody on both sides.
    """
    (events, rest_events), (here, rest) = (
        np.split(a, 2, axis=1) for a in (life.events, life.at_risk)
    )
    d, all_here = events + rest_events, here + rest
    n = np.maximum(all_here, 1)
    expected = (d * here / n).sum(axis=0)
    spread = d * here * rest * (all_here - d)
    variance = (spread / np.maximum(n**2 * (n - 1), 1)).sum(axis=0)
    return events.sum(axis=0) - expected, variance, (here[0] > 0) & (rest[0] > 0)


def _p_value(difference: np.ndarray, variance: np.ndarray, both: np.ndarray) -> np.ndarray:
    """Two-sided, normal in large logs; NaN where ``both`` is 0, 1 where nothing can be compared."""
    z = difference / np.sqrt(np.where(variance > 0, variance, np.inf))
    return np.where(both > 0, 2 * ndtr(-np.abs(z)), np.nan)


def _left(late: int, life: _Life) -> _Left:
    """Share still waiting after step ``late``, Greenwood's Σ d_j/(n_j (n_j − d_j))."""
    done = np.searchsorted(life.steps, late, side="right")
    later = np.searchsorted(life.steps, late, side="left")
    nobody = np.zeros(life.events.shape[1])
    now = life.at_risk[later] if later < len(life.steps) else nobody
    value = _share(life)[done - 1] if done else nobody + 1
    left = life.at_risk - life.events
    terms = np.where(left > 0, life.events / np.maximum(life.at_risk * left, 1), 0.0)
    greenwood, answered = terms[:done].sum(axis=0), life.events[:done].sum(axis=0)
    sure = (value == 0) | (value == 1)
    odds = np.where(sure, 1.0, (1 - value) / np.where(sure, 1.0, value * greenwood))
    size = np.where(value == 1, now, np.where(value == 0, answered, odds))
    seen = (now > 0) | ((value == 0) & (answered > 0))
    return _Left(np.where(seen, value, np.nan), greenwood, size)


def _pooled(strata: list[_Left], people: np.ndarray) -> _Left:
    """Shares of both sides, weighed alike over the strata that have both.

    Each stratum weighs w = n m / (n + m), n and m people on the two sides at the start. A side's
    variance is that of one sample of the size (Σ w)² / Σ (w²/size), as that of rates is.

    Args:
        strata: S shares.
        people: at the start, [S, 2G].
    """
    value, size = np.array([one.value for one in strata]), np.array([one.size for one in strata])
    n, m = np.split(people, 2, axis=1)
    p, q = np.split(value, 2, axis=1)
    weight = np.where(np.isnan(p) | np.isnan(q), 0.0, n * m / np.maximum(n + m, 1))
    total = weight.sum(axis=0)
    part = np.tile(weight / np.where(total > 0, total, 1.0), 2)
    used = part > 0
    mean = (part * np.where(used, value, 0.0)).sum(axis=0)
    # shares that are all 0 or all 1 stay so
    mean = np.where(mean < ROUNDING, 0.0, np.where(mean > 1 - ROUNDING, 1.0, mean))
    spread = (part**2 / np.where(used, size, np.inf)).sum(axis=0)
    known = np.tile(total > 0, 2)
    sure = (mean == 0) | (mean == 1)
    greenwood = np.where(sure, 0.0, (1 - mean) * spread / np.where(sure, 1.0, mean))
    alike = 1 / np.where(known, spread, 1.0)
    return _Left(np.where(known, mean, np.nan), greenwood, alike)


def _limits(left: _Left, level: float) -> tuple[np.ndarray, np.ndarray]:
    """Limits from log(−log S) ± z sqrt(greenwood) / |log S|; Wilson's where S is 1 or 0."""
    value = left.value
    certain = (value == 0) | (value == 1)
    log_share = np.log(np.where(certain | np.isnan(value), 0.5, value))
    width = np.exp(-ndtri((1 - level) / 2) * np.sqrt(left.greenwood) / np.abs(log_share))
    few = wilson(np.where(value == 1, left.size, 0), left.size, level)
    low = np.where(certain, few[0], np.exp(log_share * width))
    high = np.where(certain, few[1], np.exp(log_share / width))
    known = ~np.isnan(value)
    return np.where(known, low, np.nan), np.where(known, high, np.nan)
