"""Strengths of all methods and controls, tuned alike: the grid, the runs, and what is chosen.

Every method with a strength gets the same number of settings, seeds and scenarios. The scenarios
are combinations that no comparison evaluates, the seeds lie above those of any evaluation.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.experiments.comparison.settings import method_of
from evenhand.methods import registry

SCENARIOS = ("perception+tips", "minority+tips")
"""Where strengths are tuned; neither is evaluated in this form."""
LEARNERS = ("ppo", "ppo-all")
FIRST_SEED, SEEDS = 100, 3
_WIDE = (0.0625, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
_GAPS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 40.0, 80.0)
GRIDS: Mapping[str, tuple[float, ...]] = {
    "score": (0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0),
    "penalty": (0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0),
    "influence": _WIDE,
    "surgery": _WIDE,
    "levelup": _GAPS,
    "blind": _WIDE,
    "blind_spend": _GAPS,
    "lagrangian": (0.0, 0.0125, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8),
    "a_ppo": (0.01, 0.02, 0.05, 0.1, 0.15, 0.3, 0.6, 1.2),
    "elbert": (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1),
    "group_dro": (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0),
    "ggf": (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99),
    "fair_ppo": (0.03, 0.06, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0),
}
"""Strengths that are tried, of every method that has one and is compared."""
WORSE = 0.01
"""Perfect services that a strength may cost against service alone."""


def arms() -> tuple[str, ...]:
    """All arms of the tuning: service alone, and every strength of every method."""
    tried = [registry.spelled(name, one) for name, grid in GRIDS.items() for one in grid]
    return ("reference", "service", *tried)


@dataclass(frozen=True)
class Choice:
    """What was chosen of a method.

    Attributes:
        method: its name.
        strength: that was chosen.
        total: its mean corrected total over scenarios, learners and seeds.
        perfect: its mean share of perfect services.
        edge: whether it lies at an end of the grid, so that a larger one is needed.
    """

    method: str
    strength: float
    total: float
    perfect: float
    edge: bool


def choose(rows: Iterable[Mapping[str, Any]]) -> list[Choice]:
    """The strength of every method: the lowest mean corrected total at no cost of service.

    Among strengths whose share of perfect services is not lower than that of service alone by more
    than one point; else the highest share.

    Args:
        rows: of ``results.csv``: scenario, algorithm, arm, seed, metric, value.
    """
    found: dict[tuple[str, str], list[float]] = {}
    for row in rows:
        if row["metric"] in ("corrected_total", "perfect_rate") and row["value"] not in ("", None):
            found.setdefault((row["arm"], row["metric"]), []).append(float(row["value"]))
    mean = {key: float(np.mean(values)) for key, values in found.items()}
    least = mean["service", "perfect_rate"] - WORSE
    chosen = []
    for name in dict.fromkeys(method_of(arm)[0] for arm, _ in mean):
        tried = sorted(
            strength
            for method, strength in (method_of(arm) for arm, _ in mean)
            if method == name and strength is not None
        )
        if tried:
            chosen.append(_chosen(name, list(dict.fromkeys(tried)), mean, least))
    return chosen


def _chosen(
    name: str, tried: Sequence[float], mean: Mapping[tuple[str, str], float], least: float
) -> Choice:
    numbers = {
        one: (mean[arm, "corrected_total"], mean[arm, "perfect_rate"])
        for one, arm in ((one, registry.spelled(name, one)) for one in tried)
    }
    good = [one for one in tried if numbers[one][1] >= least]
    if good:
        best = min(good, key=lambda one: numbers[one][0])
    else:
        best = max(tried, key=lambda one: numbers[one][1])
    return Choice(name, best, *numbers[best], edge=best in (tried[0], tried[-1]))
