"""How long groups wait, with services that got no response counted as censored.

"Late among those who were answered" mixes waiting up with willingness: a robot that ignores its
slow cases looks fast. Here a service without a response counts for what is known of it: that the
person had waited until the service ended. The share still waiting at a step is estimated by
Kaplan and Meier (1958). Times are physics steps, or any unit that is used throughout. A row
whose waiting or response is not known (NaN) counts nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from evenhand.core import errors
from evenhand.core.errors import InputError
from evenhand.methods.services import Interactions
from evenhand.statistics.chance import check_level
from evenhand.statistics.intervals import recovered_limits, wilson
from evenhand.statistics.permutation import CELLS, adjusted, exceedances, orders


@dataclass(frozen=True, eq=False)
class Waiting:
    """The share still waiting after some steps, in C columns of people.

    Attributes:
        steps: when, [J].
        share: Pr(waiting > step), [J, C]; NaN for a column without people, or where everybody
            left is out of sight (censored) before the step.
        low: lower limit.
        high: upper limit.
        at_risk: people known to wait at least until the step, [J, C].
    """

    steps: np.ndarray
    share: np.ndarray
    low: np.ndarray
    high: np.ndarray
    at_risk: np.ndarray


@dataclass(frozen=True, eq=False)
class WaitingGap:
    """Who still waits at one step, group against the others; arrays are [G].

    Attributes:
        step: when.
        inside: share still waiting in the group.
        outside: the same of the others.
        gap: inside − outside; NaN where either is missing.
        low: lower limit of the gap.
        high: upper limit.
    """

    step: float
    inside: np.ndarray
    outside: np.ndarray
    gap: np.ndarray
    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True, eq=False)
class LogRank:
    """Whether a group waits otherwise than the others, over all steps; arrays are [G].

    Attributes:
        observed: responses to the group.
        expected: the same if the group waited like the others.
        z: (observed − expected) / sqrt(variance); above 0, the group is answered sooner; NaN
            where a side is empty, 0 where nothing can be compared.
        p: two-sided, from the normal distribution; for large windows.
    """

    observed: np.ndarray
    expected: np.ndarray
    z: np.ndarray
    p: np.ndarray


@dataclass(frozen=True, eq=False)
class LogRankPermutation:
    """The log-rank test against shuffled identities; arrays are [G].

    Attributes:
        p: two-sided p-value of each group by itself; NaN where a side is empty.
        p_adjusted: adjusted for all groups (step-down max-T).
        permutations: how many were drawn.
    """

    p: np.ndarray
    p_adjusted: np.ndarray
    permutations: int


def waiting(interactions: Interactions) -> tuple[np.ndarray, np.ndarray]:
    """How long each person was seen to wait, and whether that ended with a response, [n] each.

    Without a response, waiting is seen until the end of the service (fact ``steps``).

    Raises:
        InputError: when a fact is absent.
    """
    responded = interactions.fact("responded")
    answered, ended = interactions.fact("response_step"), interactions.fact("steps")
    return np.where(responded == 1, answered, ended), responded


def kaplan_meier(
    waited: np.ndarray,
    responded: np.ndarray,
    member: np.ndarray | None = None,
    steps: np.ndarray | None = None,
    level: float = 0.95,
) -> Waiting:
    """The share still waiting, with Greenwood's variance and log-log limits.

    S(t) = Π (1 − d_j/n_j) over the response times t_j <= t; log(−log S) ± z sqrt(Σ d_j/(n_j(n_j −
    d_j))) / |log S|. Where S is 1 or 0 the variance is 0 without anything being certain: the limits
    are then Wilson's, for the people still at risk or for all who were answered.

    Args:
        waited: steps until the response, or until the service ended without one, [n].
        responded: 1 response, 0 none (censored), [n].
        member: 1 for a column's people, else 0; NaN counts nowhere; [n, C]. By default
            everybody, C = 1.
        steps: when to look, [J]; by default at 0 and at every time of a response.
        level: of each interval.

    Raises:
        InputError: for rows that do not match, negative times, other values than 0 and 1, or a
            level outside (0, 1).
    """
    check_level("level", level)
    waited, responded, columns = _checked(waited, responded, member)
    times = np.unique(waited[responded == 1])
    look = np.concatenate([[0.0], times]) if steps is None else np.asarray(steps, float)
    events, at_risk = _table(waited, responded, columns, times)

    left = at_risk - events
    share = np.cumprod(1 - events / np.maximum(at_risk, 1), axis=0)
    terms = np.where(left > 0, events / np.maximum(at_risk * left, 1), 0.0)
    first = np.ones((1, columns.shape[1]))
    place = np.searchsorted(times, look, side="right")
    value = np.concatenate([first, share])[place]
    greenwood = np.concatenate([0 * first, terms.cumsum(axis=0)])[place]
    answered = np.concatenate([0 * first, events.cumsum(axis=0)])[place]
    now = _at_least(waited, columns, look)

    z = -ndtri((1 - level) / 2)
    certain = (value == 0) | (value == 1)
    log_share = np.log(np.where(certain, 0.5, value))
    width = np.exp(z * np.sqrt(greenwood) / np.abs(log_share))
    few_low, few_high = wilson(
        np.where(value == 1, now, 0), np.where(value == 1, now, answered), level
    )
    low = np.where(certain, few_low, np.exp(log_share * width))
    high = np.where(certain, few_high, np.exp(log_share / width))
    seen = (now > 0) | ((value == 0) & (answered > 0))
    share, low, high = (np.where(seen, a, np.nan) for a in (value, low, high))
    return Waiting(look, share, low, high, now)


def waiting_gap(
    waited: np.ndarray,
    responded: np.ndarray,
    inside: np.ndarray,
    step: float = 200.0,
    level: float = 0.95,
) -> WaitingGap:
    """Who still waits at a step: groups against the others, with limits of the difference.

    Args:
        waited: steps, [n].
        responded: 1 response, 0 none, [n].
        inside: membership, [n, G], NaN where unknown.
        step: when; the paper's limit of a late response by default.
        level: of each interval; both sides' limits are squared and added as Newcombe's are.

    Raises:
        InputError: as :func:`kaplan_meier`.
    """
    look = np.array([step], float)
    here = kaplan_meier(waited, responded, inside, look, level)
    there = kaplan_meier(waited, responded, 1.0 - np.asarray(inside, float), look, level)
    p, q = here.share[0], there.share[0]
    low, high = recovered_limits(p, (here.low[0], here.high[0]), q, (there.low[0], there.high[0]))
    return WaitingGap(step, p, q, p - q, low, high)


def log_rank(waited: np.ndarray, responded: np.ndarray, inside: np.ndarray) -> LogRank:
    """Mantel's log-rank test of each group against the others.

    E = Σ d_j n_j(g)/n_j and V = Σ d_j n_j(g) (n_j − n_j(g)) (n_j − d_j) / (n_j² (n_j − 1)) over the
    times of responses (Mantel 1966).

    Args:
        waited: steps, [n].
        responded: 1 response, 0 none, [n].
        inside: membership, [n, G], NaN where unknown.

    Raises:
        InputError: as :func:`kaplan_meier`.
    """
    waited, responded, inside = _checked(waited, responded, inside)
    here, there = np.nan_to_num(inside), np.nan_to_num(1.0 - inside)
    times = np.unique(waited[responded == 1])
    d_here, n_here = _table(waited, responded, here, times)
    d_there, n_there = _table(waited, responded, there, times)
    d, n = d_here + d_there, n_here + n_there
    observed = d_here.sum(axis=0)
    expected = (d * n_here / np.maximum(n, 1)).sum(axis=0)
    variance = (d * n_here * n_there * (n - d) / np.maximum(n**2 * (n - 1), 1)).sum(axis=0)
    z = (observed - expected) / np.sqrt(np.where(variance > 0, variance, np.inf))
    both = (here.sum(axis=0) > 0) & (there.sum(axis=0) > 0)
    z = np.where(both, z, np.nan)
    return LogRank(observed, expected, z, 2 * ndtr(-np.abs(z)))


def log_rank_permutation(
    waited: np.ndarray,
    responded: np.ndarray,
    inside: np.ndarray,
    rng: np.random.Generator,
    permutations: int = 999,
) -> LogRankPermutation:
    """The log-rank test for windows of any size: identity vectors shuffled against waiting.

    A group's observed − expected is the sum of its people's scores, response − cumulative hazard
    of all people at the time they waited; the scores are shuffled. Studentised by the variance of
    such sums, for people whose side is known.

    Args:
        waited: steps, [n].
        responded: 1 response, 0 none, [n].
        inside: membership, [n, G], NaN where unknown.
        rng: source of randomness.
        permutations: how many to draw, at least 99.

    Raises:
        InputError: as :func:`kaplan_meier`, or for too few permutations.
    """
    errors.whole("permutations", permutations, 99, 10_000_000)
    waited, responded, inside = _checked(waited, responded, inside)
    here, known = np.nan_to_num(inside), (~np.isnan(inside)).astype(float)
    everybody = np.ones((len(waited), 1))
    times = np.unique(waited[responded == 1])
    events, at_risk = _table(waited, responded, everybody, times)
    hazard = np.concatenate([[0.0], np.cumsum(events[:, 0] / at_risk[:, 0])])
    score = responded - hazard[np.searchsorted(times, waited, side="right")]

    n, size = here.sum(axis=0), known.sum(axis=0)

    def values(order: np.ndarray) -> np.ndarray:
        shuffled = score[order]
        total, squares = shuffled @ known, shuffled**2 @ known
        spread = squares - total**2 / np.maximum(size, 1)
        variance = n * (size - n) / np.maximum(size * (size - 1), 1) * spread
        difference = shuffled @ here - n * total / np.maximum(size, 1)
        return np.abs(difference) / np.sqrt(np.where(variance > 1e-9, variance, np.inf))

    observed = values(np.arange(len(score)))
    above, above_max = np.zeros(len(n)), np.zeros(len(n))
    chunk = max(1, CELLS // max(1, len(score)))
    for begin in range(0, permutations, chunk):
        order = orders(len(score), min(chunk, permutations - begin), rng)
        one, greatest = exceedances(values(order), observed)
        above, above_max = above + one, above_max + greatest
    both = (n > 0) & (size > n)
    return LogRankPermutation(
        p=np.where(both, (1 + above) / (permutations + 1), np.nan),
        p_adjusted=np.where(both, adjusted(above_max, observed, permutations), np.nan),
        permutations=permutations,
    )


def _checked(
    waited: np.ndarray, responded: np.ndarray, member: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The three as floats, without rows whose waiting or response is not known."""
    waited, responded = np.asarray(waited, float), np.asarray(responded, float)
    columns = np.ones((len(waited), 1)) if member is None else np.asarray(member, float)
    if waited.ndim != 1 or waited.shape != responded.shape or columns.ndim != 2:
        raise InputError("waiting, responses and members do not match: give one row a service")
    if len(columns) != len(waited):
        raise InputError(f"{len(waited)} services and {len(columns)} members do not match")
    rows = ~np.isnan(waited) & ~np.isnan(responded)
    waited, responded, columns = waited[rows], responded[rows], columns[rows]
    if not np.isfinite(waited).all() or (waited < 0).any():
        raise InputError("a time of waiting is negative or endless: give steps from the request on")
    for name, values in (("responses", responded), ("members", columns)):
        if not np.isin(values[~np.isnan(values)], (0.0, 1.0)).all():
            raise InputError(f"{name} hold other values than 0, 1 and missing")
    return waited, responded, columns


def _at_least(waited: np.ndarray, columns: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """People seen to wait at least so long, [J, C]."""
    order = np.argsort(waited)
    later = np.cumsum(np.nan_to_num(columns)[order][::-1], axis=0)[::-1]
    later = np.concatenate([later, np.zeros((1, columns.shape[1]))])
    return later[np.searchsorted(waited[order], steps, side="left")]


def _table(
    waited: np.ndarray, responded: np.ndarray, columns: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Responses at each time, and people at risk of one, [J, C] each."""
    events = np.zeros((len(times), columns.shape[1]))
    answered = responded == 1
    places = np.searchsorted(times, waited[answered])
    np.add.at(events, places, np.nan_to_num(columns)[answered])
    return events, _at_least(waited, columns, times)
