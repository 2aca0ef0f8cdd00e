"""Differences within participants: scenarios against even controls, early against late.

Who gives low ratings in general gives them to controls too, so a scenario is held against the
controls of the same participant. Were a scenario no different, it would not matter which of a
participant's ratings were given to it: the permutation test exchanges them within each participant.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evenhand.methods.paper.scores import Counts
from evenhand.statistics import means
from evenhand.statistics.intervals import newcombe
from evenhand.statistics.means import Estimate
from evenhand.statistics.permutation import holm
from evenhand.study.analysis.judgements import Judged

PERMUTATIONS = 1999
_FEWEST = 299
_CELLS = 10_000_000  # exchanged ratings of a test; beyond, fewer permutations are drawn
_CHUNK = 1 << 16  # participants and permutations at once: as much as stays in the cache
_TIE = 1e-9


@dataclass(frozen=True)
class Contrast:
    """A scenario against the controls of the same participants.

    Attributes:
        name: of the set; "all" for all scenarios together.
        difference: mean over participants of the rating less that of their controls, with its t
            interval; below 0 is less fair.
        p: of the permutation test, two-sided; NaN without participants.
        p_adjusted: the same after Holm's correction over the scenarios; NaN for "all".
        permutations: how many were drawn.
    """

    name: str
    difference: Estimate
    p: float
    p_adjusted: float
    permutations: int


def mean_interval(values: NDArray[np.float64]) -> Estimate:
    """Mean with its t interval; NaN is left out.

    Where all values are the same there is no interval: they do not tell how others would differ.
    """
    found = means.mean_interval(values)
    known = values[~np.isnan(values)]
    if len(known) and np.ptp(known) == 0:
        return Estimate(found.mean, float("nan"), float("nan"), found.n)
    return found


def controls(
    judged: Judged, rng: np.random.Generator, permutations: int = PERMUTATIONS
) -> list[Contrast]:
    """Every scenario, and all together, against the controls; nothing without controls.

    Args:
        judged: what participants made of the sets.
        rng: source of randomness.
        permutations: at most; with very many participants fewer are drawn.
    """
    scenarios = np.flatnonzero(~judged.control)
    if not judged.control.any() or not len(scenarios):
        return []
    own = judged.fairness[:, judged.control]
    found = [
        (judged.sets[s], *exchange(judged.fairness[:, [s]], own, rng, permutations))
        for s in scenarios
    ]
    corrected = holm(np.array([p for _, _, p, _ in found]))
    rows = [
        Contrast(name, estimate, p, float(adjusted), drawn)
        for (name, estimate, p, drawn), adjusted in zip(found, corrected, strict=True)
    ]
    estimate, p, drawn = exchange(judged.fairness[:, scenarios], own, rng, permutations)
    return [*rows, Contrast("all", estimate, p, float("nan"), drawn)]


def exchange(
    these: NDArray[np.float64],
    others: NDArray[np.float64],
    rng: np.random.Generator,
    permutations: int = PERMUTATIONS,
) -> tuple[Estimate, float, int]:
    """Mean difference within participants, and the permutation test of it.

    Args:
        these: ratings of the sets in question, [P, a]; NaN where missing.
        others: ratings of the sets they are held against, [P, b].
        rng: source of randomness.
        permutations: at most.

    Returns:
        The difference with its t interval over participants who rated both kinds; p = (1 +
        #{|T*| >= |T|}) / (permutations + 1); permutations drawn.
    """
    both = (~np.isnan(these)).any(axis=1) & (~np.isnan(others)).any(axis=1)
    x = np.concatenate([these[both], others[both]], axis=1)
    here = (~np.isnan(these[both])).sum(axis=1)
    size = (~np.isnan(x)).sum(axis=1)
    whole = np.nansum(x, axis=1)
    observed = _differences(np.nansum(these[both], axis=1), whole, here, size)
    estimate = mean_interval(observed)
    if not len(x):
        return estimate, float("nan"), 0
    drawn = int(np.clip(_CELLS // x.size, min(_FEWEST, permutations), permutations))
    limit, reached = abs(float(observed.mean())) - _TIE, 0
    chunk = max(1, _CHUNK // len(x))
    for start in range(0, drawn, chunk):
        taken = _taken(x, here, rng, min(chunk, drawn - start))
        moved = _differences(taken, whole, here, size).mean(axis=-1)
        reached += int((np.abs(moved) >= limit).sum())
    return estimate, (1 + reached) / (drawn + 1), drawn


def _taken(
    x: NDArray[np.float64], here: NDArray[np.int64], rng: np.random.Generator, times: int
) -> NDArray[np.float64]:
    """Sums of ``here`` of the known ratings of each row, taken at random, [times, P].

    One column after another is taken with the chance that as many are still needed of those that
    are left (selection sampling: Knuth, The Art of Computer Programming 2, 3.4.2, algorithm S).
    """
    known = ~np.isnan(x)
    left = known.sum(axis=1)
    needed = np.repeat(here[None].astype(np.float32), times, axis=0)
    found = np.zeros((times, len(x)))
    for column, there in zip(x.T, known.T, strict=True):
        keys = rng.random(needed.shape, dtype=np.float32)
        # a key is below 1, so that all of the last ones are taken if all are needed
        take = (keys * left.astype(np.float32) < needed) & there
        found += np.where(take, column, 0.0)
        needed -= take
        left = left - there
    return found


def _differences(
    taken: NDArray[np.float64],
    whole: NDArray[np.float64],
    here: NDArray[np.int64],
    size: NDArray[np.int64],
) -> NDArray[np.float64]:
    return taken / here - (whole - taken) / (size - here)


# --- order ---


def by_place(judged: Judged) -> list[tuple[int, Estimate]]:
    """Ratings less the mean rating of their set, by how many sets had been seen before."""
    left = _beyond_set(judged)
    last = int(judged.place.max(initial=-1))
    return [(k, mean_interval(left[judged.place == k])) for k in range(last + 1)]


def slope(judged: Judged) -> Estimate:
    """Change of ratings from one set to the next: mean of the participants' slopes.

    Ratings are taken less the mean of their set; a slope needs three of them.
    """
    left = _beyond_set(judged)
    there = ~np.isnan(left) & (judged.place >= 0)
    n = there.sum(axis=1)
    y = np.where(there, left, 0.0)
    x = np.where(there, judged.place, 0).astype(np.float64)
    n1 = np.maximum(n, 1)
    xx = (x**2).sum(axis=1) - x.sum(axis=1) ** 2 / n1
    xy = (x * y).sum(axis=1) - x.sum(axis=1) * y.sum(axis=1) / n1
    enough = (n >= 3) & (xx > 0)
    return mean_interval(xy[enough] / xx[enough])


def early_and_late(judged: Judged) -> list[tuple[str, Counts, float, float]]:
    """How often each set was judged biased when seen early and when seen late.

    Early is the first half of a participant's sets. These are different participants, so that
    Newcombe's limits of the difference hold.

    Returns:
        For each set its id, counts (inside: early, outside: late; each [1, 1]), and the limits of
        the difference early less late; NaN where a side is empty.
    """
    biased = judged.biased
    seen = (judged.place >= 0).sum(axis=1, keepdims=True)
    early = judged.place < seen / 2
    there = ~np.isnan(biased) & (judged.place >= 0)
    found = []
    for s, name in enumerate(judged.sets):
        sides = [there[:, s] & early[:, s], there[:, s] & ~early[:, s]]
        n = [np.array([[float(side.sum())]]) for side in sides]
        x = [np.array([[float(biased[side, s].sum())]]) for side in sides]
        counts = Counts(n[0], x[0], n[1], x[1])
        low, high = newcombe(counts)
        found.append((name, counts, float(low[0, 0]), float(high[0, 0])))
    return found


def _beyond_set(judged: Judged) -> NDArray[np.float64]:
    known = ~np.isnan(judged.fairness)
    n = known.sum(axis=0)
    mean = np.where(known, judged.fairness, 0.0).sum(axis=0) / np.maximum(n, 1)
    return judged.fairness - mean
