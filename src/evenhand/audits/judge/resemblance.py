"""What the detector says of a log: does it look like a discrimination that people know?

The detector was taught by judgements of short windows, so it is asked about short windows: 30
services drawn from the log, many times. Chance alone makes short windows look uneven, so that it is
asked as often about windows in which outcomes are shuffled among the people of a stratum.

The detector sees the four scores I of Eq. 2 of an identity, and not which identity it is. So every
identity of the log is asked about, also those that it was not taught with; what is named for them
is a likeness of the scores, not of the people. As where it was taught, a service whose identity
is unknown counts nowhere.

A likeness is told only where a disparity was found in the identity, and the share of windows
called biased is above that of the shuffled ones by a one-sided z-test of two shares at
``ALPHA``. The second alone would not do: windows drawn from one short log share its chances.
"""

from collections.abc import Collection

import numpy as np
from scipy.special import ndtri

from evenhand.audits.count.tally import UNKNOWN, Tally
from evenhand.audits.judge.results import Resemblance
from evenhand.methods import detector_file
from evenhand.methods.paper.detector import Detector
from evenhand.methods.paper.scores import Counts, gaps, issue_score
from evenhand.methods.vocabulary import WINDOW
from evenhand.statistics.permutation import orders
from evenhand.statistics.windows import count_windows

ALPHA = 0.01
"""Level of the comparison with shuffled windows."""

SHORT = 5_000  # Up to so many services, the whole log is shuffled for every window.
TOGETHER = 250  # windows at once


def unasked(tally: Tally, detector: Detector) -> str | None:
    """Why the detector cannot be asked about a log, in a sentence; None if it can."""
    missing = [issue for issue in detector.issues if issue not in tally.issues]
    if missing:
        return (
            f"The detector judges {', '.join(detector.issues)} together, and the log does not "
            f"tell {', '.join(missing)}."
        )
    if tally.services < WINDOW:
        return (
            f"The detector judges windows of {WINDOW} services, and the log has {tally.services}."
        )
    return None


def ask(
    tally: Tally,
    rng: np.random.Generator,
    uneven: Collection[str],
    windows: int = 1000,
    detector: Detector | None = None,
) -> tuple[Resemblance, ...]:
    """Ask the detector about every identity of a log; nothing where it cannot be asked.

    Args:
        tally: counts of the log.
        rng: source of randomness.
        uneven: identities in which a disparity was found.
        windows: how many to draw of either kind.
        detector: the one that comes with Evenhand by default.
    """
    judge = detector or detector_file.load(detector_file.SHIPPED)
    if unasked(tally, judge):
        return ()
    x = tally.x[:, [tally.issues.index(issue) for issue in judge.issues]]
    inside = _inside(tally)
    whole = _scores(_counted(x, inside, tally.n), tally)
    people, outcomes = drawn_windows(tally, rng, windows)
    drawn, even = ([], [])
    for begin in range(0, windows, TOGETHER):
        rows, others = people[begin : begin + TOGETHER], outcomes[begin : begin + TOGETHER]
        drawn.append(_scores(count_windows(x[rows], inside[rows]), tally))
        even.append(_scores(count_windows(x[others], inside[rows]), tally))
    return tuple(
        _resemblance(
            one.name,
            whole[d],
            np.concatenate([part[d] for part in drawn]),
            np.concatenate([part[d] for part in even]),
            judge,
            one.name in uneven,
        )
        for d, one in enumerate(tally.identities)
    )


def clearly_above(share: float, other: float, n: int) -> bool:
    """Whether one share of n is above another at ``ALPHA``: z-test with the pooled share."""
    pooled = (share + other) / 2
    spread = np.sqrt(2 * pooled * (1 - pooled) / n)
    return bool(share - other > -ndtri(ALPHA) * spread)


def drawn_windows(
    tally: Tally, rng: np.random.Generator, windows: int
) -> tuple[np.ndarray, np.ndarray]:
    """Windows of services, and for each the outcomes that shuffling within strata gives them.

    In a log of more than ``SHORT`` services a shuffled outcome is drawn by itself from its
    stratum, so that it may, rarely, come twice in a window.

    Args:
        tally: counts of the log, at least ``WINDOW`` of them.
        rng: source of randomness.
        windows: how many.

    Returns:
        Rows of the tally that the people come from, and those that their shuffled outcomes come
        from, int64 [windows, WINDOW] each. Without shuffling, outcomes come from the first.
    """
    order = np.argsort(tally.stratum, kind="stable")
    ends = np.cumsum(tally.n[order])
    stratum = tally.stratum[order]
    last = np.flatnonzero(np.append(np.diff(stratum) != 0, True))
    strata_ends = ends[last]
    strata_starts = np.concatenate([[0], strata_ends[:-1]])

    def rows_of(place: np.ndarray) -> np.ndarray:
        return order[np.searchsorted(ends, place, side="right")]

    services = int(ends[-1])
    if services <= SHORT:
        within = np.searchsorted(strata_ends, np.arange(services), side="right")
        place = np.argsort(rng.random((windows, services)), axis=1)[:, :WINDOW]
        shuffled = np.concatenate(
            [
                np.take_along_axis(orders(services, len(part), rng, within), part, axis=1)
                for part in np.array_split(place, max(1, windows // TOGETHER))
            ]
        )
        return rows_of(place), rows_of(shuffled)
    place = rng.integers(0, services, (windows, WINDOW))
    while len(twice := np.flatnonzero((np.diff(np.sort(place, axis=1)) == 0).any(axis=1))):
        place[twice] = rng.integers(0, services, (len(twice), WINDOW))
    s = np.searchsorted(strata_ends, place, side="right")
    return rows_of(place), rows_of(rng.integers(strata_starts[s], strata_ends[s]))


def _resemblance(
    name: str,
    whole: np.ndarray,
    drawn: np.ndarray,
    even: np.ndarray,
    judge: Detector,
    uneven: bool,
) -> Resemblance:
    called = judge.judge(drawn)
    biased, biased_even = float(called.mean()), float(judge.judge(even).mean())
    kind = None
    if uneven and judge.kinds and clearly_above(biased, biased_even, len(drawn)):
        named = judge.looks_like(drawn[called]).argmax(axis=1)
        kind = judge.kinds[int(np.bincount(named, minlength=len(judge.kinds)).argmax())]
    return Resemblance(name, tuple(float(value) for value in whole), biased, biased_even, kind)


def _inside(tally: Tally) -> np.ndarray:
    """Membership, [C, G]; NaN in all groups of an identity where it is unknown."""
    inside, column = tally.inside(), 0
    for d, one in enumerate(tally.identities):
        unknown = np.array([group == UNKNOWN for group in one.groups])
        inside[unknown[tally.codes[:, d]], column : column + len(one.groups)] = np.nan
        column += len(one.groups)
    return inside


def _counted(x: np.ndarray, inside: np.ndarray, n: np.ndarray) -> Counts:
    applies, happened = n[:, None] * ~np.isnan(x), n[:, None] * np.nan_to_num(x)
    here, there = np.nan_to_num(inside).T, np.nan_to_num(1.0 - inside).T
    return Counts(here @ applies, here @ happened, there @ applies, there @ happened)


def _scores(counts: Counts, tally: Tally) -> list[np.ndarray]:
    """I of each identity, [..., K] each."""
    ends = np.cumsum([len(one.groups) for one in tally.identities])[:-1]
    return [issue_score(part) for part in np.split(gaps(counts), ends, axis=-2)]
