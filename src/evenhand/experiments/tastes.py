"""What simulated people mind: windows that vary one manner at a time, and a crowd that judges them.

In the paper's demonstrations several issues rise together, so answers cannot tell what people mind.
Here every window has one robot that serves some groups of one identity worse in one manner, and
errs in all manners alike to everybody. A crowd minds some of five issues (``methods.asked``) and no
others. Both are assumptions: they show that weights can be recovered, not what people mind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evenhand.core.errors import InputError, unknown
from evenhand.methods import asked
from evenhand.methods.paper.issues import PAPER_ISSUES
from evenhand.methods.paper.scores import count, scores_of
from evenhand.methods.scheme import Scheme, paper_facts
from evenhand.methods.vocabulary import IDENTITIES
from evenhand.report.table import Row
from evenhand.restaurant import robots, serve_people, worlds
from evenhand.restaurant.people import IDENTITIES as ALL
from evenhand.restaurant.serve_people import WINDOW

SLOPPIEST = 0.3
"""Every robot errs alike to everybody, in up to this share of services."""
STEEPNESS, THRESHOLD, LAPSE = 12.0, 0.25, 0.03
"""Of the crowd: log-odds for each point of what it minds, where it is undecided, and the share of
answers at random."""
MINDED = asked.ASKED
_SEED = 103


@dataclass(frozen=True)
class Windows:
    """W windows of one manner each.

    Attributes:
        manner: index into ``robots.MANNERS``; 0 is even, int64 [W].
        shown: index into ``vocabulary.IDENTITIES`` of the identity that the robot goes by and that
            the window is shown about, int64 [W].
        scores: I of that identity in the five issues, [W, 5]; NaN where Eq. 1 cannot say.
    """

    manner: np.ndarray
    shown: np.ndarray
    scores: np.ndarray


def serve(windows: int, seed: int, population: str = "uniform") -> Windows:
    """Serve windows of 30 people.

    Args:
        windows: how many.
        seed: of everything random.
        population: where people are drawn from.
    """
    rng = np.random.default_rng([seed, _SEED])
    manner = np.arange(windows) % len(robots.MANNERS)
    shown = rng.integers(len(IDENTITIES), size=windows)
    strength, sloppiness = rng.random(windows), SLOPPIEST * rng.random(windows)
    # at random one or more groups of the identity, not all of them, are served worse
    worse = [_some(len(ALL[one].groups), rng) for one in shown]

    def choose(codes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        window = np.repeat(np.arange(windows), WINDOW)
        hit = np.array([worse[w][codes[i, shown[w]]] for i, w in enumerate(window)])
        odds = np.zeros((len(codes), len(robots.MANNERS)))
        odds[:, 1:] = (sloppiness[window] / (len(robots.MANNERS) - 1))[:, None]
        badly = np.where(hit & (manner[window] > 0), strength[window], 0.0)
        odds *= 1.0 - badly[:, None]
        odds[np.arange(len(codes)), manner[window]] += badly
        odds[:, 0] = 0.0
        odds[:, 0] = 1.0 - odds.sum(axis=1)
        return robots.draw_manners(odds, rng)

    world = worlds.scenario("even", population)
    done = serve_people.serve_people(world, robots.Mannered(choose), windows * WINDOW, rng)
    scheme = Scheme(world.identities, paper_facts(), asked.split(PAPER_ISSUES))
    x, inside = world.indicators(done, scheme), scheme.inside(done.codes)
    counts = count(x.reshape(windows, WINDOW, -1), inside.reshape(windows, WINDOW, -1))
    found = scores_of(counts, scheme.groups, scheme.issue_names).by_identity
    scores = np.stack([found[name] for name in IDENTITIES], axis=1)
    return Windows(manner, shown, scores[np.arange(windows), shown])


def _some(groups: int, rng: np.random.Generator) -> np.ndarray:
    chosen = np.zeros(groups, bool)
    chosen[rng.permutation(groups)[: rng.integers(1, groups)]] = True
    return chosen


def check(minds: Sequence[str]) -> None:
    """Whether somebody can mind these issues.

    Raises:
        InputError: for a name that is none of the five, or stands twice.
    """
    for name in minds:
        if name not in MINDED:
            raise unknown("issue to mind", name, MINDED, "minds")
    if len(set(minds)) < len(minds):
        raise InputError("duplicate minds", f"an issue is minded twice: {', '.join(minds)}")


def judge(seen: Windows, minds: Sequence[str], seed: int) -> np.ndarray:
    """What a crowd says that minds some issues and no others: biased or not, bool [W].

    Args:
        seen: the windows; a missing score counts as none.
        minds: names of the issues; nobody minds anything without any.
        seed: of the answers.

    Raises:
        InputError: as `check`.
    """
    check(minds)
    rng = np.random.default_rng([seed, _SEED, 1])
    columns = [MINDED.index(name) for name in minds]
    evidence = np.nan_to_num(seen.scores[:, columns]).sum(axis=1)
    odds = STEEPNESS * (evidence - THRESHOLD) if columns else np.full(len(evidence), -np.inf)
    says = rng.random(len(evidence)) < 1.0 / (1.0 + np.exp(-odds))
    lapses = rng.random(len(evidence)) < LAPSE
    return np.where(lapses, rng.random(len(evidence)) < 0.5, says)


def judgements(seen: Windows, biased: np.ndarray) -> list[Row]:
    """One row a window, as ``evenhand train --judges`` reads them; missing scores are empty."""
    return [
        {
            "window": str(w),
            "manner": robots.MANNERS[seen.manner[w]],
            "shown": IDENTITIES[seen.shown[w]],
            "biased": bool(biased[w]),
            **dict(zip(MINDED, seen.scores[w], strict=True)),
        }
        for w in range(len(biased))
    ]
