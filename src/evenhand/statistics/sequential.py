"""An alarm for streams that may be looked at at any time, by betting against evenness.

A stream of signed gaps g_1, g_2, ... in [−1, 1], each from services that are in no other: a pair of
one person inside and one outside a group, or the signed gap of a batch, an epoch for instance.
If groups are served alike, each gap is 0 on average whatever came before, and nobody gets rich by
betting on its sign: wealth starts at 1 and, by Ville's inequality, reaches 1/alpha with a
probability of at most alpha, however long and however often one looks. Nothing is assumed about
the rates themselves: they may drift, as long as they drift for everybody.

Chugg, Cortes-Gomez, Wilder and Ramdas, Auditing Fairness by Betting, NeurIPS 2023:
K_t = K_{t−1}(1 − λ_t g_t), the bets λ_t by the online Newton step.

Streams that share services (groups, issues) are combined by averaging their wealth at the same
time. For that each step of all streams must come from the same batch: a service that waits for
its partner while other streams already know it would let one look ahead.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from evenhand.core.errors import InputError

NEWTON = 2.0 / (2.0 - np.log(3.0))  # of the online Newton step for bets in [−1/2, 1/2]
LARGEST_BET = 0.5


@dataclass(frozen=True, eq=False)
class Wealth:
    """Where the betting stands; arrays of one shape, [...], a number a stream.

    Attributes:
        log_wealth: natural logarithm of K.
        bet: λ, the share of the wealth put on the next gap being negative.
        squares: sum of the squared derivatives, Σz².
        steps: gaps seen so far.
    """

    log_wealth: np.ndarray
    bet: np.ndarray
    squares: np.ndarray
    steps: np.ndarray


def start(*shape: int) -> Wealth:
    """Wealth 1 and no bet, for streams of this shape."""
    return Wealth(np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros(shape, np.int64))


def bet(wealth: Wealth, gap: np.ndarray) -> Wealth:
    """Settle the bets on one gap of each stream and choose the next.

    K ← K(1 − λg), z = g/(1 − λg), λ ← clip(λ − c z/(1 + Σz²), ±1/2), c = 2/(2 − ln 3).

    Args:
        wealth: before, [...].
        gap: signed gaps in [−1, 1], [...]; NaN leaves a stream as it was.

    Returns:
        Wealth after, [...].

    Raises:
        InputError: for a gap outside [−1, 1] or of another shape.
    """
    gap = np.asarray(gap, float)
    if gap.shape != wealth.bet.shape:
        raise InputError(
            "shape gaps",
            f"gaps {gap.shape} do not match streams {wealth.bet.shape}: give one gap each",
        )
    if (np.abs(gap) > 1).any():
        raise InputError("range gaps", "a gap lies outside -1 to 1: give differences of rates")
    seen = ~np.isnan(gap)
    g = np.where(seen, gap, 0.0)
    factor = 1.0 - wealth.bet * g
    z = g / factor
    squares = wealth.squares + z**2
    moved = wealth.bet - NEWTON * z / (1.0 + squares)
    return Wealth(
        log_wealth=wealth.log_wealth + np.log(factor),
        bet=np.where(seen, np.clip(moved, -LARGEST_BET, LARGEST_BET), wealth.bet),
        squares=squares,
        steps=wealth.steps + seen,
    )


def watch(gaps: np.ndarray, wealth: Wealth | None = None) -> tuple[np.ndarray, Wealth]:
    """Log wealth after each gap of whole streams.

    Args:
        gaps: signed gaps, [T, ...]; NaN where a stream has none.
        wealth: where earlier betting stands; by default it starts.

    Returns:
        Log wealth, [T, ...], and where the betting stands, to go on from.

    Raises:
        InputError: for a gap outside [−1, 1].
    """
    gaps = np.asarray(gaps, float)
    if gaps.ndim == 0:
        raise InputError("shape gaps", "one number is no stream: give gaps in order of time")
    now = wealth or start(*gaps.shape[1:])
    path = np.empty(gaps.shape)
    for t, gap in enumerate(gaps):
        now = bet(now, gap)
        path[t] = now.log_wealth
    return path, now


def combined(log_wealth: np.ndarray, axis: int | tuple[int, ...] = (-2, -1)) -> np.ndarray:
    """Log of the average wealth of streams that bet on the same batches; groups × issues.

    Evidence against all of them being even: an average of such wealths is one again.

    Args:
        log_wealth: [..., G, K], for instance.
        axis: the streams.
    """
    axes = (axis,) if isinstance(axis, int) else axis
    streams = int(np.prod([log_wealth.shape[a] for a in axes]))
    if streams == 0:
        raise InputError(
            "empty streams", "there are no streams to combine: give at least one group and issue"
        )
    return np.asarray(logsumexp(log_wealth, axis=axis) - np.log(streams))
