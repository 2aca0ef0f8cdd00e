"""Three-state verdicts: disparity, no evidence, insufficient data; and how many would be enough.

For every group and issue of a window:

1. *disparity*: the p-value, adjusted for all groups and issues, is at most alpha. A p-value from
   permutations has its own standard error added first, so that another seed rarely turns the
   verdict (:func:`evenhand.statistics.permutation.settled`); that makes the test a little stricter
   than alpha.
2. else *insufficient data*: a side is empty, or the smaller side has fewer services than it takes
   to find a relevant difference ``delta`` with the stated power. Within strata only services count
   that have others of the same stratum to be compared with.
3. else *no evidence*: a difference of ``delta`` would probably have been found, and was not.

No evidence is not evidence of evenness for differences smaller than ``delta``.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from evenhand.core import errors
from evenhand.core.errors import InputError
from evenhand.methods.paper.scores import Counts, count, signed_gaps
from evenhand.statistics.chance import check_counts, check_level
from evenhand.statistics.count_tables import Table
from evenhand.statistics.intervals import clopper_pearson, newcombe
from evenhand.statistics.permutation import PermutationTest, permutation_test
from evenhand.statistics.strata import Within, mantel_haenszel

DISPARITY, NO_EVIDENCE, INSUFFICIENT = VERDICTS = (
    "disparity",
    "no evidence",
    "insufficient data",
)


@dataclass(frozen=True)
class VerdictSettings:
    """When a gap is called a disparity, and when data are called enough.

    Attributes:
        alpha: greatest chance of any false disparity in a window that is served evenly.
        delta: relevant difference of rates; one service in ten. What matters is a question to the
            operator, not to statistics: there is no legal meaning in it.
        power: chance with which a difference of ``delta`` shall be found.
        permutations: how many to draw where there are rows.
    """

    alpha: float = 0.05
    delta: float = 0.1
    power: float = 0.8
    permutations: int = 999

    def __post_init__(self) -> None:
        for name in ("alpha", "delta", "power"):
            check_level(name, getattr(self, name))
        if self.power <= self.alpha:
            raise InputError(
                "range power",
                f"power {self.power} is not above alpha {self.alpha}: "
                "no window would ever be too small",
            )
        errors.whole("permutations", self.permutations, 99, 10_000_000)


@dataclass(frozen=True, eq=False)
class Verdicts:
    """What can be said of a window, or of many. Arrays are [..., G, K].

    Attributes:
        counts: services and issues on both sides.
        gap: signed difference of the rates; NaN where a side is empty.
        low: lower limit of the gap (Newcombe's, from Clopper and Pearson's limits of the sides);
            all limits are meant to hold together with probability 1 − alpha (Bonferroni), so that
            they speak like the verdict.
        high: upper limit.
        p: p-value of each gap by itself; NaN where a side is empty.
        p_adjusted: p-value adjusted for all groups and issues.
        verdict: one of ``VERDICTS``.
        needed_side: services that the smaller side needs for ``delta``; never missing.
        needed: services that the whole window needs if both sides grow alike, in every stratum;
            NaN where a side is empty or no stratum has both, for its share is not known.
    """

    counts: Counts
    gap: np.ndarray
    low: np.ndarray
    high: np.ndarray
    p: np.ndarray
    p_adjusted: np.ndarray
    verdict: np.ndarray
    needed_side: np.ndarray
    needed: np.ndarray


def judge(
    x: np.ndarray,
    inside: np.ndarray,
    rng: np.random.Generator,
    settings: VerdictSettings | None = None,
    strata: np.ndarray | None = None,
) -> Verdicts:
    """Verdicts on one window from its rows, by permutation.

    Args:
        x: indicators, [n, K], NaN where an issue does not apply.
        inside: membership, [n, G], NaN where unknown.
        rng: source of randomness.
        settings: level, relevant difference, power.
        strata: whole numbers [n]; services are compared within one only, and so are the gap and
            its limits, see :mod:`evenhand.statistics.strata`.

    Raises:
        InputError: for rows that do not match, or values other than 0, 1 and NaN.
    """
    chosen = settings or VerdictSettings()
    test = permutation_test(x, inside, rng, chosen.permutations, strata)
    x, inside = np.asarray(x, float), np.asarray(inside, float)
    apart = [] if strata is None else [strata == one for one in np.unique(strata)]
    within = _within([count(x[rows], inside[rows]) for rows in apart], chosen)
    counts = count(x, inside)
    return _verdicts(counts, test.p, test.p_adjusted, test.p_settled, chosen, within)


def judge_table(
    x: np.ndarray,
    inside: np.ndarray,
    n: np.ndarray,
    rng: np.random.Generator,
    settings: VerdictSettings | None = None,
    strata: np.ndarray | None = None,
    who: np.ndarray | None = None,
    totalled: int | None = None,
) -> tuple[Verdicts, PermutationTest]:
    """Verdicts on a log of any size from its counts, by permutation; and the test behind them.

    With strata, the gap, its limits and what chance gives are those within strata, see
    :mod:`evenhand.statistics.strata`; the total stays that of the whole log.

    Args:
        x: indicators, [C, K], NaN where an issue does not apply.
        inside: membership, [C, G], or of identity vectors, [I, G], if ``who`` is given.
        n: services that each row stands for, [C].
        rng: source of randomness.
        settings: level, relevant difference, power.
        strata: whole numbers [C]; as in :func:`judge`.
        who: row of ``inside`` for each row of ``x``, [C].
        totalled: the total issue score is that of the first so many groups; of all by default.

    Raises:
        InputError: as :meth:`evenhand.statistics.count_tables.Table.of`.
    """
    chosen = settings or VerdictSettings()
    table = Table.of(x, inside, n, strata, who)
    test = table.test(rng, chosen.permutations, totalled)
    within = _within([one.observed() for one in table.strata], chosen)
    counts = table.counts()
    found = _verdicts(counts, test.p, test.p_adjusted, test.p_settled, chosen, within)
    if within is not None:
        test = replace(test, even_gap=within.even_difference)
    return found, test


def _within(parts: Sequence[Counts], settings: VerdictSettings) -> Within | None:
    """What the strata say, [G, K]; nothing unless there are several."""
    if len(parts) < 2:
        return None
    level = 1 - settings.alpha / np.size(parts[0].inside_n)
    return mantel_haenszel(parts, level, clopper_pearson)


def _verdicts(
    counts: Counts,
    p: np.ndarray,
    adjusted: np.ndarray,
    held: np.ndarray,
    settings: VerdictSettings,
    within: Within | None = None,
) -> Verdicts:
    smaller = np.minimum(counts.inside_n, counts.outside_n)
    larger = np.maximum(counts.inside_n, counts.outside_n)
    side = needed_side(counts, settings)
    some = smaller > 0
    if within is None:
        gap, useful = signed_gaps(counts), smaller
        comparisons = side.shape[-1] * side.shape[-2]
        low, high = newcombe(counts, 1 - settings.alpha / comparisons, clopper_pearson)
    else:
        gap, low, high = within.difference, within.low, within.high
        # the smaller side of a window without strata that knows as much; whole if strata are alike
        useful = np.round(within.weight * (1 + smaller / np.where(larger > 0, larger, 1)), 6)
        some = some & (useful > 0)
    growth = (1 + larger / np.where(some, smaller, 1)) * (smaller / np.where(some, useful, 1))
    verdict = np.select(
        [np.nan_to_num(held, nan=np.inf) <= settings.alpha, useful < side],
        [DISPARITY, INSUFFICIENT],
        NO_EVIDENCE,
    )
    return Verdicts(
        counts=counts,
        gap=gap,
        low=low,
        high=high,
        p=p,
        p_adjusted=adjusted,
        verdict=verdict,
        needed_side=side,
        needed=np.where(some, np.ceil(side * growth), np.nan),
    )


def needed_side(counts: Counts, settings: VerdictSettings | None = None) -> np.ndarray:
    """Services that the smaller side needs to find a difference of ``delta``.

    n = [z_a sqrt(r̄(1−r̄)(1 + s)) + z_b sqrt(p₁(1−p₁) + s p₂(1−p₂))]² / delta², two-sided, with s
    the smaller side as a share of the larger, r̄ their pooled rate (Fleiss, Levin and Paik 2003,
    section 4.3, without continuity correction), z_a at alpha / (G K), z_b at the power. p₂, the
    rate of the larger side, is the window's own rate with two services of either kind added, so
    that a window that saw no issue is not thought certain; p₁ lies delta from it towards 1/2,
    where more services are needed.

    Args:
        counts: [..., G, K].
        settings: level, relevant difference, power.

    Returns:
        Whole numbers of at least 2 as floats, [..., G, K]; never missing. With an empty side the
        other counts as endless; with both empty they count as equal.

    Raises:
        InputError: for impossible counts.
    """
    check_counts(counts)
    chosen = settings or VerdictSettings()
    both = counts.inside_n + counts.outside_n
    comparisons = both.shape[-1] * both.shape[-2]
    z_a = -ndtri(chosen.alpha / comparisons / 2)
    z_b = -ndtri(1 - chosen.power)
    smaller = np.minimum(counts.inside_n, counts.outside_n)
    larger = np.maximum(counts.inside_n, counts.outside_n)
    share = np.where(larger > 0, smaller / np.where(larger > 0, larger, 1), 1.0)
    rate = (counts.inside_x + counts.outside_x + 2) / (both + 4)
    other = np.clip(np.where(rate <= 0.5, rate + chosen.delta, rate - chosen.delta), 0.0, 1.0)
    pooled = (share * other + rate) / (1 + share)
    chance = z_a * np.sqrt(pooled * (1 - pooled) * (1 + share))
    spread = z_b * np.sqrt(other * (1 - other) + share * rate * (1 - rate))
    return np.maximum(2.0, np.ceil(((chance + spread) / chosen.delta) ** 2))
