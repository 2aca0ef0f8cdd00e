"""How long groups wait, from counts, with services without a response counted as censored.

The formulas of :mod:`evenhand.inference.survival`, on the number of responses and of people
still waiting at each step: what it costs depends on the number of different times, not of services.
Strata are not looked at: waiting is compared in the whole log.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr, ndtri

from evenhand.audits.results import WaitFinding
from evenhand.audits.tally import Identity, Tally, Waits
from evenhand.inference.intervals import recovered_limits, wilson
from evenhand.inference.windows import holm

ROUNDING = 1e-12
"""A product of shares that is exactly one half may come out this much above it."""


def compare(tally: Tally, alpha: float = 0.05) -> tuple[WaitFinding, ...]:
    """Waiting of every group against all others; nothing where the log does not tell it.

    Args:
        tally: counts of the log.
        alpha: 1 − the level of the limits: of each share by itself, of all differences together.
    """
    if tally.waits is None or not len(tally.waits.n):
        return ()
    waits, names = tally.waits, tally.names()
    steps, events, at_risk = life_table(waits, tally.identities)
    n, responses = at_risk[0], events.sum(axis=0)
    all_events = _everybody(events, tally.identities)
    all_at_risk = _everybody(at_risk, tally.identities)
    both = np.concatenate([events, all_events - events], axis=1)
    risk = np.concatenate([at_risk, all_at_risk - at_risk], axis=1)
    share = np.cumprod(1 - both / np.maximum(risk, 1), axis=0)
    alone = [side[: len(names)] for side in _at(waits.late, steps, both, risk, share, 1 - alpha)]
    value, low, high = _at(waits.late, steps, both, risk, share, 1 - alpha / len(names))
    (p, q), (p_low, q_low), (p_high, q_high) = (np.split(a, 2) for a in (value, low, high))
    limits = recovered_limits(p, (p_low, p_high), q, (q_low, q_high))
    test = holm(log_rank(events, at_risk, all_events, all_at_risk)[:, None])[:, 0]
    reached = (share[:, : len(names)] <= 0.5 + ROUNDING) & (n > 0)
    median = np.where(reached.any(axis=0), steps[reached.argmax(axis=0)] * waits.seconds, np.nan)
    return tuple(
        WaitFinding(
            identity=identity,
            group=group,
            n=int(n[g]),
            responses=int(responses[g]),
            median=float(median[g]),
            unserved=float(p[g]),
            unserved_low=float(alone[1][g]),
            unserved_high=float(alone[2][g]),
            rest_unserved=float(q[g]),
            difference=float(p[g] - q[g]),
            low=float(limits[0][g]),
            high=float(limits[1][g]),
            p=float(test[g]),
        )
        for g, (identity, group) in enumerate(names)
    )


def life_table(
    waits: Waits, identities: tuple[Identity, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Responses at each step, and people who were seen to wait at least so long.

    Returns:
        Steps that occur, in order, [T]; responses, [T, G]; people at risk of one, [T, G].
    """
    steps, place = np.unique(waits.step, return_inverse=True)
    place = place.ravel()
    events, ended = [], []
    for d, one in enumerate(identities):
        cells = len(steps) * len(one.groups)
        cell = place * len(one.groups) + waits.codes[:, d]
        for table, weights in ((events, waits.n * waits.responded), (ended, waits.n)):
            counted = np.bincount(cell, weights=weights, minlength=cells)
            table.append(counted.reshape(len(steps), -1))
    at_risk = np.concatenate(ended, axis=1)[::-1].cumsum(axis=0)[::-1]
    return steps, np.concatenate(events, axis=1), at_risk


def log_rank(
    events: np.ndarray, at_risk: np.ndarray, all_events: np.ndarray, all_at_risk: np.ndarray
) -> np.ndarray:
    """Two-sided p-value of Mantel's log-rank test of each group against all others, [G].

    E = Σ d_j n_j(g)/n_j and V = Σ d_j n_j(g) (n_j − n_j(g)) (n_j − d_j) / (n_j² (n_j − 1)) (Mantel
    1966), normal in large logs.

    Args:
        events: responses d_j(g), [T, G].
        at_risk: people n_j(g), [T, G].
        all_events: the same of everybody, [T, G] or [T, 1].
        all_at_risk: likewise.

    Returns:
        NaN where a side is empty, 1 where nothing can be compared.
    """
    n, d, here = np.maximum(all_at_risk, 1), all_events, at_risk
    expected = (d * here / n).sum(axis=0)
    spread = d * here * (all_at_risk - here) * (all_at_risk - d)
    variance = (spread / np.maximum(n**2 * (n - 1), 1)).sum(axis=0)
    difference = events.sum(axis=0) - expected
    z = difference / np.sqrt(np.where(variance > 0, variance, np.inf))
    both = (at_risk[0] > 0) & (all_at_risk[0] > at_risk[0])
    return np.where(both, 2 * ndtr(-np.abs(z)), np.nan)


def _everybody(columns: np.ndarray, identities: tuple[Identity, ...]) -> np.ndarray:
    """The sum over all groups of a column's identity, that is everybody, [T, G] -> [T, G]."""
    ends = np.cumsum([len(one.groups) for one in identities])[:-1]
    parts = np.split(columns, ends, axis=1)
    sums = [np.broadcast_to(a.sum(axis=1, keepdims=True), a.shape) for a in parts]
    return np.concatenate(sums, axis=1)


def _at(
    late: int,
    steps: np.ndarray,
    events: np.ndarray,
    at_risk: np.ndarray,
    share: np.ndarray,
    level: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Share still waiting after step ``late`` with its limits, of each column.

    S = Π (1 − d_j/n_j); limits from log(−log S) ± z sqrt(Σ d_j/(n_j (n_j − d_j))) / |log S|
    (Greenwood); where S is 1 or 0, Wilson's for the people still at risk, or for all who were
    answered. NaN without people, and where everybody left is out of sight before.
    """
    columns = events.shape[1]
    done = np.searchsorted(steps, late, side="right")
    later = np.searchsorted(steps, late, side="left")
    now = at_risk[later] if later < len(steps) else np.zeros(columns)
    value = share[done - 1] if done else np.ones(columns)
    left = at_risk - events
    terms = np.where(left > 0, events / np.maximum(at_risk * left, 1), 0.0)
    greenwood, answered = terms[:done].sum(axis=0), events[:done].sum(axis=0)
    certain = (value == 0) | (value == 1)
    log_share = np.log(np.where(certain, 0.5, value))
    width = np.exp(-ndtri((1 - level) / 2) * np.sqrt(greenwood) / np.abs(log_share))
    few = wilson(np.where(value == 1, now, 0), np.where(value == 1, now, answered), level)
    low = np.where(certain, few[0], np.exp(log_share * width))
    high = np.where(certain, few[1], np.exp(log_share / width))
    seen = (now > 0) | ((value == 0) & (answered > 0))
    return (
        np.where(seen, value, np.nan),
        np.where(seen, low, np.nan),
        np.where(seen, high, np.nan),
    )
