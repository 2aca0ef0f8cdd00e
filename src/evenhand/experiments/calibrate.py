"""Find the odds of the biased robots, so that their issue scores come close to the paper's.

First every manner of serving is measured in the simulator; then odds are searched on windows put
together from these measured services; ``evenhand demos`` measures the result in the simulator.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from evenhand import issues, people, robots
from evenhand.restaurant import layout, senses, serve, task
from evenhand.restaurant.lanes import Lanes

SIGNATURES = {
    "racist": (0.49, 0.25, 0.38, 0.43),
    "ageist": (0.42, 0.68, 0.54, 0.49),
    "ableist": (0.05, 0.66, 0.00, 0.00),
}
"""What the paper prints for racism, ageism, ableism (section "Bias detection validation")."""

WINDOW = 30


@dataclass(frozen=True)
class Pool:
    """Measured services of every manner.

    Attributes:
        issue: indicators, float64 [6, S, 4].
        steps: until the end, [6, S].
        distance: true distance at the end, metres, [6, S].
    """

    issue: np.ndarray
    steps: np.ndarray
    distance: np.ndarray


def measure(services: int, rng: np.random.Generator) -> Pool:
    """Serve ``services`` people of the uniform population in each manner."""
    lanes = Lanes(240, task.TaskSettings())
    population = people.population("uniform")
    parts = []
    for manner in range(len(robots.MANNERS)):
        setups = layout.draw(population, services, rng)
        robot = robots.of_manners(np.full(services, manner), rng)
        done = serve.serve(lanes, setups, robot, rng, senses.SenseSettings())
        facts = done.facts
        table = serve.record(facts, setups.asking, epoch=0, scenario="even", robot="even")
        parts.append((issues.indicators(table), facts.steps, facts.distance))
    issue, steps, distance = (np.stack(part) for part in zip(*parts, strict=True))
    return Pool(issue, steps.astype(float), distance)


def expected_scores(
    pool: Pool, bias: robots.Bias, odds: np.ndarray, windows: int, seed: int
) -> tuple[np.ndarray, float, float, float]:
    """Mean issue scores of windows put together from the pool.

    Args:
        pool: measured services.
        bias: whose identity and groups count.
        odds: improper manners of those served worse and of the others, [2, 5].
        windows: how many.
        seed: the same seed gives the same people and draws, so that odds can be compared.

    Returns:
        I of the bias's identity [4], mean response distance (m), mean response step, share ignored.
    """
    rng = np.random.default_rng(seed)
    identity = next(i for i in people.IDENTITIES if i.name == bias.identity)
    k = len(identity.categories)
    code = rng.integers(k, size=(windows, WINDOW))
    worse = np.isin(code, [identity.categories.index(c) for c in bias.worse])
    cumulative = np.cumsum(np.where(worse[..., None], odds[0], odds[1]), axis=-1)
    u = rng.random((windows, WINDOW))
    # improper manners are ordered first here: below the first bound is "far", and so on
    manner = (u[..., None] > cumulative).sum(axis=-1) + 1
    manner[manner == len(robots.MANNERS)] = 0
    pick = rng.integers(pool.steps.shape[1], size=(windows, WINDOW))
    x = pool.issue[manner, pick]
    inside = (code[..., None] == np.arange(k)).astype(float)
    gap = issues.gaps(issues.count(x, inside))
    score = np.nanmean(issues.issue_score(gap), axis=0)
    responded = x[..., 0] == 0.0
    return (
        score,
        float(pool.distance[manner, pick][responded].mean()),
        float(pool.steps[manner, pick][responded].mean()),
        float(x[..., 0].mean()),
    )


def search(pool: Pool, name: str, *, windows: int, seed: int, rounds: int) -> np.ndarray:
    """Odds [2, 5] whose scores are nearest to the signature, with the paper's behaviour figures.

    Args:
        pool: measured services.
        name: one of ``SIGNATURES``.
        windows: windows put together for each trial.
        seed: of the trials and of the random restarts.
        rounds: restarts of the search.
    """
    bias, target = robots.BIASES[name], np.array(SIGNATURES[name])
    rng = np.random.default_rng(seed)

    def odds_of(z: np.ndarray) -> np.ndarray:
        weight = np.exp(np.concatenate([z.reshape(2, 5), np.zeros((2, 1))], axis=1))
        return (weight / weight.sum(axis=1, keepdims=True))[:, :5]

    def loss(z: np.ndarray) -> float:
        score, distance, step, ignored = expected_scores(pool, bias, odds_of(z), windows, seed)
        # a high power: no component may be far off, small errors hardly count
        cost = float((((score - target) / 0.04) ** 8).sum())
        if name == "ableist":
            cost += ((distance - 1.89) / 0.02) ** 2
        if name == "ageist":
            cost += ((step - 124.93) / 10.0) ** 2 + (max(ignored - 0.435, 0.0) / 0.01) ** 2
        if name == "racist":
            cost += (max(0.455 - ignored, 0.0) / 0.01) ** 2
        return cost + 0.01 * float((np.clip(np.abs(z) - 5.0, 0.0, None) ** 2).sum())

    best = None
    for _ in range(rounds):
        known = np.array([bias.odds_worse, bias.odds_others]) + 0.01
        rest = np.maximum(1.0 - known.sum(axis=1, keepdims=True), 0.01)
        start = np.log(known / rest).ravel() + 0.5 * rng.standard_normal(10)
        found = minimize(loss, start, method="Powell", options={"maxfev": 1500})
        if best is None or found.fun < best.fun:
            best = found
    assert best is not None
    return odds_of(best.x)
