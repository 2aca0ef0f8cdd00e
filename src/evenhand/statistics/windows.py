"""Tests of many windows at once.

:func:`find_in_windows` gives the verdict of the permutation test on thousands of windows, for
simulations and for the epochs of a training.
"""

from dataclasses import fields

import numpy as np

from evenhand.core.errors import InputError
from evenhand.methods.paper.scores import Counts
from evenhand.statistics.chance import check_level
from evenhand.statistics.permutation import TIE, check_rows, settled, studentised

SERVICES = 100_000  # services in memory at once, times a small factor
MOST_ISSUES = 10  # each triples a table
TOGETHER = 8  # permutations of a window at once


def most_exceedances(permutations: int, alpha: float) -> int:
    """How many permutations may reach the observed statistic for a disparity to be found.

    Raises:
        InputError: when so few permutations cannot find one at this level.
    """
    check_level("alpha", alpha)
    p = np.arange(1, permutations + 2) / (permutations + 1)
    most = int((settled(p, permutations) <= alpha).sum()) - 1
    if most < 0:
        raise InputError(
            "range permutations",
            f"{permutations} permutations cannot reach a level of {alpha}: draw more",
        )
    return most


def find_in_windows(
    x: np.ndarray,
    inside: np.ndarray,
    rng: np.random.Generator,
    permutations: int = 199,
    alpha: float = 0.05,
    cell: tuple[int, int] | None = None,
) -> np.ndarray:
    """In which of many windows the max-T test finds a disparity, bool [W].

    Decides like :func:`permutation_test` with the settled p-value, but a window is left as soon as
    too many permutations have reached its statistic to find one any more (Besag and Clifford
    1991): the decision is the same, and an even window takes some 30 permutations instead of 199.

    Args:
        x: indicators, [W, n, K].
        inside: membership, [W, n, G].
        rng: source of randomness.
        permutations: most permutations for a window.
        alpha: level.
        cell: look only whether this (group, issue) is found, held against the greatest of all
            (single step); by default whether anything is.

    Raises:
        InputError: for rows that do not match, other values than 0, 1 and NaN, more than ten
            issues, or too few permutations for the level.
    """
    most = most_exceedances(permutations, alpha)
    check_rows(x, inside)
    found = np.zeros(len(x), bool)
    for rows in _chunks(x):
        active, groups = np.arange(len(x))[rows], inside.shape[-1]
        code, sides = _coded(x[rows]), _sides(inside[rows])
        first = _statistics(_counts(code, sides, groups, x.shape[-1]))[:, 0]
        limit = (first.max(axis=(1, 2)) if cell is None else first[:, *cell]) * (1 - TIE) - TIE
        reached = np.zeros(len(active), int)
        for begin in range(0, permutations, TOGETHER):
            copies = np.repeat(code, min(TOGETHER, permutations - begin), axis=2)
            shuffled = _counts(rng.permuted(copies, axis=1), sides, groups, x.shape[-1])
            drawn = _statistics(shuffled).max(axis=(2, 3))
            reached += (drawn >= limit[:, None]).sum(axis=1)
            stay = reached <= most
            if not stay.all():
                active, limit, reached = active[stay], limit[stay], reached[stay]
                code, sides = code[stay], sides[stay]
            if not len(active):
                break
        found[active] = True
    return found


def count_windows(x: np.ndarray, inside: np.ndarray) -> Counts:
    """The counts of many windows, as `methods.paper.scores.count` gives them, but faster.

    Args:
        x: indicators, [W, n, K].
        inside: membership, [W, n, G].

    Raises:
        InputError: for rows that do not match, other values than 0, 1 and NaN, or more than
            ten issues.
    """
    check_rows(x, inside)
    parts = [
        _counts(_coded(x[rows]), _sides(inside[rows]), inside.shape[-1], x.shape[-1])
        for rows in _chunks(x)
    ]
    return Counts(
        *(
            np.concatenate([getattr(part, field.name)[:, 0] for part in parts])
            for field in fields(Counts)
        )
    )


def _chunks(x: np.ndarray) -> list[slice]:
    size = max(1, SERVICES // x.shape[1])
    return [slice(start, start + size) for start in range(0, len(x), size)]


def _coded(x: np.ndarray) -> np.ndarray:
    """What happened in a service as one number, int64 [W, n, 1]: a shuffle moves one a row."""
    if x.shape[-1] > MOST_ISSUES:
        raise InputError(
            "range issues", f"{x.shape[-1]} issues are too many: test at most {MOST_ISSUES} at once"
        )
    digits = np.where(np.isnan(x), 2, x).astype(np.int64)
    return (digits @ 3 ** np.arange(x.shape[-1]))[..., None]


def _sides(inside: np.ndarray) -> np.ndarray:
    """Who is in each group and below that whose side is known, float32 [W, G + G or 1, n].

    One row is enough where every side is known. Sums are exact up to 16 million services.
    """
    known = ~np.isnan(inside)
    if known.all():
        known = known[..., :1]
    both = np.concatenate([np.nan_to_num(inside).astype(np.float32), known], axis=2)
    return np.ascontiguousarray(both.swapaxes(1, 2), np.float32)


def _counts(code: np.ndarray, sides: np.ndarray, groups: int, issues: int) -> Counts:
    """Counts of b codings of the same services: code [W, n, b] -> [W, b, G, K]."""
    windows, n, b = code.shape
    outcome = np.arange(3**issues)[:, None] // 3 ** np.arange(issues) % 3
    table = np.concatenate([outcome != 2, outcome == 1], axis=1).astype(np.float32)
    rows = np.take(table, code, axis=0, mode="clip").reshape(windows, n, -1)
    summed = (sides @ rows).astype(float).reshape(windows, -1, b, 2, issues).swapaxes(1, 2)
    here = summed[:, :, :groups]
    there = summed[:, :, groups:] - here
    return Counts(here[..., 0, :], here[..., 1, :], there[..., 0, :], there[..., 1, :])


def _statistics(counts: Counts) -> np.ndarray:
    return np.nan_to_num(np.abs(studentised([counts])))
