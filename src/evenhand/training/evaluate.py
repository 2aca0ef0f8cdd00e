"""Measure a robot: serve many people, then score windows of 30 services as the paper does."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from evenhand.core.errors import InputError
from evenhand.methods.paper import issues
from evenhand.methods.paper.scores import Counts, Scores, count, membership, score, scores_of
from evenhand.methods.scheme import Scheme
from evenhand.methods.services import Services
from evenhand.methods.vocabulary import LEAST
from evenhand.restaurant import floor_plan, robots, serve_people
from evenhand.restaurant.serve_people import WINDOW
from evenhand.restaurant.worlds import AnyRobot, World
from evenhand.statistics import chance

if TYPE_CHECKING:
    from evenhand.training.settings import TrainSettings
    from evenhand.training.update import LearnerState

_SHUFFLES = 4


def serve_policy(
    state: LearnerState,
    settings: TrainSettings,
    services: int,
    seed: int,
    world: World | None = None,
    *,
    threads: int = 1,
) -> Services:
    """Serve people with a trained policy, as it acted in training (by chance, not greedily).

    Args:
        state: the learner.
        settings: of its training.
        services: how many people.
        seed: of people, places and chances; choose one that training never saw.
        world: where; that of the training if None.
        threads: that step the physics; results are the same on any number.

    Raises:
        InputError: when people have other identities in this world than in training.
    """
    from evenhand.training import train  # a scripted robot is measured without JAX

    chosen = settings.world if world is None else world
    check_world(settings, chosen)
    robot = train.robot(settings, state.policy)
    return _served(chosen, robot, settings.update.algorithm, services, seed, threads)


def check_world(settings: TrainSettings, world: World) -> None:
    """Whether a policy can serve in a world that it was not trained in.

    Raises:
        InputError: when people have other identities there.
    """
    if world.groups != settings.world.groups:
        raise InputError(
            "conflict scenario",
            f"in scenario {world.name!r} people have other identities than in "
            f"{settings.scenario!r}, where the policy was trained: test it in a scenario with the "
            "same identities",
        )


def serve_scripted(
    robot: robots.ScriptedRobot, world: World, services: int, seed: int, *, threads: int = 1
) -> Services:
    """Serve people with a scripted robot."""
    return _served(world, robot, robot.name, services, seed, threads)


def serve_reference(world: World, services: int, seed: int, *, threads: int = 1) -> Services:
    """Serve people with the robot that makes up for a scenario.

    Raises:
        InputError: when the scenario has none.
    """
    return _served(world, world.robot_to_compare_with(), "reference", services, seed, threads)


def _served(
    world: World, robot: AnyRobot, name: str, services: int, seed: int, threads: int
) -> Services:
    rng = np.random.default_rng(seed)
    done = serve_people.serve_people(world, robot, services, rng, threads=threads)
    return serve_people.table(done, world, name)


def perfect(table: Services) -> np.ndarray:
    """Services with a response and without any issue, bool [n]."""
    x = issues.indicators(table)
    return (x == 0.0).all(axis=1)


def window_counts(
    table: Services, order: np.ndarray | None = None, scheme: Scheme | None = None
) -> tuple[Counts, tuple[tuple[str, str], ...], list[str]]:
    """Counts of every full window of 30 services, in order.

    Args:
        table: services.
        order: identities are taken in this order instead, int [n]: with a permutation the
            identities no longer belong to the services, and what remains is chance.
        scheme: identities and issues; by default the table's own and the paper's four.

    Returns:
        Counts [W, G, K]; (identity, category) of the G groups; names of the K issues.
    """
    x, inside, groups, names = _sides(table, scheme)
    inside = inside if order is None else inside[order]
    full = len(x) // WINDOW * WINDOW
    counts = count(
        x[:full].reshape(-1, WINDOW, x.shape[1]),
        inside[:full].reshape(-1, WINDOW, inside.shape[1]),
    )
    return counts, groups, names


def _sides(
    table: Services, scheme: Scheme | None
) -> tuple[np.ndarray, np.ndarray, tuple[tuple[str, str], ...], list[str]]:
    """Issues [n, K] and membership [n, G], with the names of groups and issues."""
    named = issues.PAPER_ISSUES if scheme is None else scheme.issues
    x, names = issues.indicators(table, named), [issue.name for issue in named]
    if scheme is None:
        who = membership(table)
        return x, who.inside, who.groups, names
    return x, scheme.inside(scheme.codes(table)), scheme.groups, names


def window_scores(
    table: Services, order: np.ndarray | None = None, scheme: Scheme | None = None
) -> Scores:
    """Scores of every full window of 30 services, in order; arguments as `window_counts`."""
    return scores_of(*window_counts(table, order, scheme))


def summary(table: Services, seed: int, scheme: Scheme | None = None) -> dict[str, Any]:
    """All numbers of a test.

    Args:
        table: services, at least one full window.
        seed: of the permutations behind ``floor``.
        scheme: identities and issues, see ``window_counts``.

    Returns:
        total and the issues (means over windows of 30, as the paper scores them), floor (the
        total that chance alone gives: identities permuted over the same services), pooled_total
        (of all services as one window), corrected_total (the same without chance, see
        ``chance.corrected_scores``), shares of perfect services (overall and of the worst of
        the 22 groups, see ``worst_group_rate``) and of responses, mean response distance (m) and
        time (steps). None where nothing is known.
    """
    windows = window_scores(table, scheme=scheme)
    rng = np.random.default_rng(seed)
    orders = (rng.permutation(len(table)) for _ in range(_SHUFFLES))
    shuffled = [window_scores(table, order, scheme).total for order in orders]
    pooled = score(table) if scheme is None else scheme.score(table)
    good = perfect(table)
    responded = table.fact("responded") == 1.0
    distance, step = table.fact("response_distance"), table.fact("response_step")
    return {
        "services": len(table),
        "total": _mean(windows.total),
        **{name: _mean(windows.overall[:, k]) for k, name in enumerate(windows.issues)},
        "floor": _mean(np.concatenate(shuffled)),
        "pooled_total": _mean(np.atleast_1d(pooled.total)),
        "corrected_total": _mean(np.atleast_1d(corrected_total(table, scheme))),
        "perfect_rate": float(good.mean()),
        "worst_group_rate": worst_group_rate(good, membership(table).inside),
        "response_rate": float(responded.mean()),
        "mean_response_distance": _mean(distance[responded]),
        "mean_response_time": _mean(step[responded]),
        "mean_service_seconds": float(table.fact("steps").mean() * floor_plan.TIMESTEP),
    }


def corrected_total(table: Services, scheme: Scheme | None = None) -> float:
    """Total issue score of all services as one window, without what chance alone gives."""
    x, inside, groups, names = _sides(table, scheme)
    return float(chance.corrected_scores(count(x, inside), groups, names).total)


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
