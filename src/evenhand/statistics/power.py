"""How often verdicts are wrong and how often they find what is there, by simulated windows.

People have independent identities with every category equally likely; every issue has the same
rate, quality and priority among the services with a response. These are synthetic windows, with
no robot in them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from evenhand.core import errors
from evenhand.core.errors import InputError
from evenhand.methods.paper.scores import gaps, issue_score, total
from evenhand.methods.vocabulary import MANUAL_THRESHOLD
from evenhand.statistics.chance import check_level
from evenhand.statistics.intervals import wilson
from evenhand.statistics.windows import count_windows, find_in_windows

CATEGORIES = (6, 3, 5, 2, 6)
"""Categories of the paper's identities: race, gender, age, disability, skin."""

ISSUES = 4
ROWS = 500_000  # services in memory at once


@dataclass(frozen=True)
class FalseAlarms:
    """How often windows of an even robot raise an alarm.

    Attributes:
        size: services a window.
        windows: how many were simulated.
        verdict: share of windows with any disparity among all groups and issues.
        verdict_low: lower 95 % limit (Wilson).
        verdict_high: upper limit.
        raw: share of windows with a raw total issue score above 0.5.
        raw_low: lower 95 % limit.
        raw_high: upper limit.
    """

    size: int
    windows: int
    verdict: float
    verdict_low: float
    verdict_high: float
    raw: float
    raw_low: float
    raw_high: float


@dataclass(frozen=True)
class Power:
    """How often a known disparity is found.

    Attributes:
        size: services a window.
        difference: rate in the group less the rate outside it.
        windows: how many were simulated.
        found: share of windows in which this group and issue is found.
        low: lower 95 % limit (Wilson).
        high: upper limit.
    """

    size: int
    difference: float
    windows: int
    found: float
    low: float
    high: float


def simulate_windows(
    windows: int,
    size: int,
    rng: np.random.Generator,
    rate: float = 0.3,
    categories: Sequence[int] = CATEGORIES,
    extra: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Synthetic windows in which everything is known.

    Args:
        windows: how many, W.
        size: services a window, n.
        rng: source of randomness.
        rate: of every issue.
        categories: how many each identity has; G is their sum.
        extra: what being in a group adds to an issue's rate, [G, 4]; nothing by default.

    Returns:
        Indicators [W, n, 4], NaN for quality and priority without a response, and membership
        [W, n, G].

    Raises:
        InputError: for a size or number below 1, an identity with fewer than two categories, or
            rates outside [0, 1].
    """
    _check_sizes(windows, size)
    if not len(categories) or min(categories) < 2:
        raise InputError(
            "range categories", f"categories {tuple(categories)}: give each identity at least two"
        )
    parts = []
    for k in categories:
        parts.append(rng.integers(0, k, (windows, size, 1)) == np.arange(k))
    inside = np.concatenate(parts, axis=2).astype(float)
    rates = rate if extra is None else rate + inside @ extra
    if not (np.min(rates) >= 0 and np.max(rates) <= 1):
        raise InputError("range rates", "rates of issues leave [0, 1]: give smaller differences")
    x = (rng.random((windows, size, ISSUES)) < rates).astype(float)
    x[..., 1:3][x[..., 0] == 1] = np.nan
    return x, inside


def _check_sizes(windows: int, size: int) -> None:
    errors.whole("windows", windows, 1, 10_000_000)
    errors.whole("size", size, 1, 10_000_000)


def _chunks(
    windows: int,
    size: int,
    rng: np.random.Generator,
    rate: float,
    categories: Sequence[int],
    extra: np.ndarray | None,
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    _check_sizes(windows, size)
    most = max(1, ROWS // size)
    for begin in range(0, windows, most):
        yield simulate_windows(min(most, windows - begin), size, rng, rate, categories, extra)


def _share(hits: int, windows: int) -> tuple[float, float, float]:
    low, high = wilson(np.array(hits), np.array(windows))
    return hits / windows, float(low), float(high)


def false_alarms(
    sizes: Sequence[int],
    rng: np.random.Generator,
    windows: int = 10_000,
    rate: float = 0.3,
    permutations: int = 199,
    alpha: float = 0.05,
    categories: Sequence[int] = CATEGORIES,
) -> list[FalseAlarms]:
    """Share of false alarms of an even robot, beside that of the paper's raw threshold.

    Args:
        sizes: services a window.
        rng: source of randomness.
        windows: windows of each size.
        rate: of every issue.
        permutations: most permutations for a window.
        alpha: level of the verdict.
        categories: how many each identity has.

    Returns:
        A row for each size.

    Raises:
        InputError: as :func:`simulate_windows`, or for too few permutations for the level.
    """
    rows = []
    for size in sizes:
        verdict = raw = 0
        for x, inside in _chunks(windows, size, rng, rate, categories, None):
            verdict += int(find_in_windows(x, inside, rng, permutations, alpha).sum())
            raw += int(
                (total(issue_score(gaps(count_windows(x, inside)))) > MANUAL_THRESHOLD).sum()
            )
        rows.append(FalseAlarms(size, windows, *_share(verdict, windows), *_share(raw, windows)))
    return rows


def power(
    sizes: Sequence[int],
    differences: Sequence[float],
    rng: np.random.Generator,
    windows: int = 1000,
    rate: float = 0.3,
    cell: tuple[int, int] = (0, 0),
    permutations: int = 199,
    alpha: float = 0.05,
    categories: Sequence[int] = CATEGORIES,
) -> list[Power]:
    """Share of windows in which a known disparity is found among all groups and issues.

    Args:
        sizes: services a window.
        differences: what being in the group adds to the rate of the issue.
        rng: source of randomness.
        windows: windows of each size and difference.
        rate: of every issue elsewhere.
        cell: the group and the issue that differ; the first category of the first identity, and
            willingness, by default.
        permutations: most permutations for a window.
        alpha: level of the verdict.
        categories: how many each identity has.

    Returns:
        A row for each size and difference.

    Raises:
        InputError: as :func:`simulate_windows`; for a cell that does not exist.
    """
    check_level("alpha", alpha)
    groups = sum(categories)
    if not (0 <= cell[0] < groups and 0 <= cell[1] < ISSUES):
        raise InputError(
            "range cell", f"cell {cell} lies outside {groups} groups and {ISSUES} issues"
        )
    rows = []
    for size in sizes:
        for difference in differences:
            extra = np.zeros((groups, ISSUES))
            extra[cell] = difference
            found = 0
            for x, inside in _chunks(windows, size, rng, rate, categories, extra):
                found += int(find_in_windows(x, inside, rng, permutations, alpha, cell).sum())
            rows.append(Power(size, difference, windows, *_share(found, windows)))
    return rows
