"""Measure a robot: serve many people, then score windows of 30 services as the paper does."""

from __future__ import annotations

from typing import Any

import numpy as np

from evenhand.methods.paper import issues
from evenhand.methods.paper.scores import Counts, Scores, count, membership, score, scores_of
from evenhand.methods.services import Interactions
from evenhand.methods.vocabulary import LEAST
from evenhand.restaurant import floor_plan, people, robots
from evenhand.restaurant.scenarios import needs, sensing
from evenhand.restaurant.simulation import layout, serve, task
from evenhand.restaurant.simulation.lanes import Lanes
from evenhand.training import train
from evenhand.training.settings import TrainSettings
from evenhand.training.update import LearnerState

WINDOW = 30
LANES = 240
_SHUFFLES = 4


def serve_policy(
    state: LearnerState,
    settings: TrainSettings,
    services: int,
    seed: int,
    population: str | None = None,
    *,
    threads: int = 1,
) -> Interactions:
    """Serve people with a trained policy, as it acted in training (by chance, not greedily).

    Args:
        state: the learner.
        settings: of its training.
        services: how many people.
        seed: of people, places and chances; choose one that training never saw.
        population: where people are drawn from; that of the training if None.
        threads: that step the physics; results are the same on any number.
    """
    rng = np.random.default_rng(seed)
    drawn_from = people.population(population or settings.world.population)
    setups = layout.draw(drawn_from, services, rng)
    return _record(
        train.robot(settings, state.policy),
        setups,
        rng,
        name=settings.update.algorithm,
        scenario=settings.scenario,
        decide=settings.task,
        sense=settings.sensor,
        wanted=settings.needs,
        threads=threads,
    )


def serve_scripted(
    name: str, strength: float, population: str, services: int, seed: int, *, threads: int = 1
) -> Interactions:
    """Serve people with a scripted robot."""
    scripted = robots.ScriptedRobot(name, strength)
    rng = np.random.default_rng(seed)
    setups = layout.draw(people.population(population), services, rng)
    return _record(scripted.robot(setups.asking, rng), setups, rng, name=name, threads=threads)


def perfect(table: Interactions) -> np.ndarray:
    """Services with a response and without any issue, bool [n]."""
    x = issues.indicators(table)
    return (x == 0.0).all(axis=1)


def window_counts(
    table: Interactions, order: np.ndarray | None = None
) -> tuple[Counts, tuple[tuple[str, str], ...], list[str]]:
    """Counts of every full window of 30 services, in order.

    Args:
        table: services.
        order: identities are taken in this order instead, int [n]: with a permutation the
            identities no longer belong to the services, and what remains is chance.

    Returns:
        Counts [W, G, K]; (identity, category) of the G groups; names of the K issues.
    """
    x = issues.indicators(table)
    who = membership(table)
    inside = who.inside if order is None else who.inside[order]
    full = len(x) // WINDOW * WINDOW
    counts = count(
        x[:full].reshape(-1, WINDOW, x.shape[1]),
        inside[:full].reshape(-1, WINDOW, inside.shape[1]),
    )
    return counts, who.groups, [issue.name for issue in issues.PAPER_ISSUES]


def window_scores(table: Interactions, order: np.ndarray | None = None) -> Scores:
    """Scores of every full window of 30 services, in order; arguments as `window_counts`."""
    return scores_of(*window_counts(table, order))


def summary(table: Interactions, seed: int) -> dict[str, Any]:
    """All numbers of a test.

    Args:
        table: services, at least one full window.
        seed: of the permutations behind ``floor``.

    Returns:
        total and the four issues (means over windows of 30, as the paper scores them), floor (the
        total that chance alone gives: identities permuted over the same services), pooled_total
        (of all services as one window), shares of perfect services (overall and of the worst of
        the 22 groups, see ``worst_group_rate``) and of responses, mean response distance (m) and
        time (steps). None where nothing is known.
    """
    windows = window_scores(table)
    rng = np.random.default_rng(seed)
    chance = [window_scores(table, rng.permutation(len(table))).total for _ in range(_SHUFFLES)]
    good = perfect(table)
    responded = table.fact("responded") == 1.0
    distance, step = table.fact("response_distance"), table.fact("response_step")
    return {
        "services": len(table),
        "total": _mean(windows.total),
        **{name: _mean(windows.overall[:, k]) for k, name in enumerate(windows.issues)},
        "floor": _mean(np.concatenate(chance)),
        "pooled_total": _mean(np.atleast_1d(score(table).total)),
        "perfect_rate": float(good.mean()),
        "worst_group_rate": worst_group_rate(good, membership(table).inside),
        "response_rate": float(responded.mean()),
        "mean_response_distance": _mean(distance[responded]),
        "mean_response_time": _mean(step[responded]),
        "mean_service_seconds": float(table.fact("steps").mean() * floor_plan.TIMESTEP),
    }


def worst_group_rate(good: np.ndarray, inside: np.ndarray) -> float | None:
    """The least share of perfect services among the groups with at least 30 services.

    Args:
        good: whether a service was perfect, bool [n].
        inside: membership, [n, G].

    Returns:
        The share; None when no group is so large.
    """
    members = [inside[:, g] == 1.0 for g in range(inside.shape[1])]
    rates = [float(good[member].mean()) for member in members if member.sum() >= LEAST]
    return min(rates) if rates else None


def _mean(values: np.ndarray) -> float | None:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else None


def _record(
    robot: serve.Robot,
    setups: layout.Setups,
    rng: np.random.Generator,
    *,
    name: str,
    scenario: str = "even",
    decide: task.TaskSettings | None = None,
    sense: sensing.SenseSettings | None = None,
    wanted: needs.NeedSettings | None = None,
    threads: int = 1,
) -> Interactions:
    services = len(setups)
    lanes = Lanes(min(LANES, services), decide or task.TaskSettings(), threads)
    done = serve.serve(lanes, setups, robot, rng, sense or sensing.SenseSettings(), wanted)
    return serve.record(
        done.facts,
        setups.asking,
        epoch=np.arange(services) // WINDOW,
        scenario=scenario,
        robot=name,
    )
