"""The restaurant's services as an epoch that methods learn from."""

from __future__ import annotations

import numpy as np
from jax.typing import ArrayLike

from evenhand.methods.guard import Guard, Watch
from evenhand.methods.paper import issues, losses
from evenhand.methods.paper.detector import Detector
from evenhand.methods.paper.epoch import Epoch, judge_of
from evenhand.restaurant import people
from evenhand.restaurant.scenarios import tips
from evenhand.restaurant.scheme import SCHEME
from evenhand.restaurant.simulation import serve
from evenhand.restaurant.simulation.lanes import Facts
from evenhand.statistics import chance
from evenhand.training.settings import TrainSettings

ISSUES = SCHEME.issue_names


def epoch_of(
    settings: TrainSettings,
    done: serve.Services,
    codes: np.ndarray,
    detector: Detector,
    value: ArrayLike,
    guard: Guard,
    number: int = 0,
) -> tuple[Epoch, Watch]:
    """Finished services, to be counted, scored and judged when somebody asks.

    Args:
        settings: of the run.
        done: the services; observations as the policy saw them.
        codes: identities of the people served, int64 [n, 5].
        detector: judges them, by what it was taught.
        value: of the critic at every decision, [n, L].
        guard: before these services.
        number: of the epoch.

    Returns:
        The epoch, and what becomes of the guard.
    """
    x = issues.indicators(_Columns(done.facts))
    inside = people.encode(codes).astype(float)
    watch = Watch(guard, x, inside)
    epoch = Epoch(
        x=x,
        inside=inside,
        reward=tips.reward(settings.world.tips, codes, done.facts.terms, done.facts.steps),
        mask=done.mask,
        groups=people.GROUPS,
        issues=ISSUES,
        tau=np.array(settings.tau),
        advantages_of=lambda rewards: over_decisions(settings, done.mask, value, rewards),
        excess_of=excess,
        judge=judge_of(detector, detector.identities),
        guard=watch,
        number=number,
    )
    return epoch, watch


def over_decisions(
    settings: TrainSettings, mask: np.ndarray, value: ArrayLike, rewards: np.ndarray
) -> np.ndarray:
    """Advantages of decisions, [n, L]: each service is an episode, paid at its end."""
    values = np.asarray(value)
    reward = np.zeros_like(values)
    last = mask.sum(axis=1).astype(int) - 1
    reward[np.arange(len(last)), last] = rewards
    chosen = settings.update
    return np.asarray(losses.gae(reward, values, mask, chosen.gamma, chosen.gae_lambda))


def excess(counts: issues.Counts) -> float:
    """Total issue score without what chance alone gives."""
    return float(chance.excess_scores(counts, people.GROUPS, ISSUES).total)


class _Columns:
    """Facts as rules read them, without a table in between."""

    def __init__(self, facts: Facts) -> None:
        answered = facts.responded
        self._columns = {
            "responded": answered.astype(float),
            "response_step": np.where(answered, facts.steps, np.nan),
            "response_distance": np.where(answered, facts.distance, np.nan),
            "min_distance": facts.min_distance,
        }

    def __contains__(self, name: str) -> bool:
        return name in self._columns

    def fact(self, name: str) -> np.ndarray:
        return self._columns[name]
