"""Find the odds of the biased robots, so that their issue scores come close to the paper's.

First every manner of serving is measured in the simulator; then odds are searched on windows put
together from these measured services. What comes out is a value to start from: ``robots.BIASES``
holds the odds that are used, and ``evenhand demos`` measures these in the simulator.
"""

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from evenhand.core.errors import unknown
from evenhand.core.processes import Tell
from evenhand.methods.paper import issues
from evenhand.methods.paper.scores import count, gaps, issue_score
from evenhand.methods.vocabulary import WINDOW
from evenhand.restaurant import people, robots, worlds
from evenhand.restaurant.serve_people import serve_people

SIGNATURES = {
    "racist": (0.49, 0.25, 0.38, 0.43),
    "ageist": (0.42, 0.68, 0.54, 0.49),
    "ableist": (0.05, 0.66, 0.00, 0.00),
}
"""What the paper prints for racism, ageism, ableism (section "Bias detection validation")."""

EVERY = "all"
"""Instead of a robot's name: every robot that the paper prints a signature of."""
POPULATION = "uniform"
UNSEEN = 2000
"""Windows on which odds are measured that the search has come to; it has not seen these."""
_BOUNDS = (-6.0, 3.0)
"""Of the logarithm of a manner's odds against those of serving properly, where a search begins."""
_GENERATIONS, _TRIALS = 30, 800
"""Of a round: how long it looks everywhere, and how often it tries where it found most."""
_NOBODY_ANSWERED = 1e15
"""Cost of odds that leave nothing to compare."""
_SEED = 103


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


@dataclass(frozen=True)
class Served:
    """What a robot with certain odds does, on windows that no search has seen.

    Attributes:
        odds: improper manners of those served worse and of the others, [2, 5].
        score: I of the identity that the robot goes by, [4].
        distance: mean distance of a response, metres.
        step: mean physics step of a response.
        ignored: share of services without a response.
    """

    odds: np.ndarray
    score: np.ndarray
    distance: float
    step: float
    ignored: float


@dataclass(frozen=True)
class Calibration:
    """What a search has come to for one robot."""

    name: str
    found: Served
    used: Served

    @property
    def target(self) -> np.ndarray:
        """The signature that the paper prints, [4]."""
        return np.array(SIGNATURES[self.name])


def chosen(robot: str) -> tuple[str, ...]:
    """Robots to search odds of.

    Raises:
        InputError: when the paper prints no signature of this robot.
    """
    if robot == EVERY:
        return tuple(SIGNATURES)
    if robot not in SIGNATURES:
        raise unknown("robot with a signature in the paper", robot, [EVERY, *SIGNATURES], "robot")
    return (robot,)


def calibrate(
    names: Sequence[str],
    *,
    seed: int,
    services: int,
    windows: int,
    rounds: int,
    tell: Tell,
) -> list[Calibration]:
    """Measure, search, and measure on other windows what was found.

    Args:
        names: of robots with a signature.
        seed: of everything random; what is found for a robot does not depend on the others.
        services: measured in each manner.
        windows: put together for each trial.
        rounds: searches, each from another start; the best counts.
        tell: told of one unit for every manner measured and for every round.
    """
    pool = measure(services, np.random.default_rng([seed, _SEED]), tell)

    def served(name: str, odds: np.ndarray) -> Served:
        # the seed after the search's: other windows, the same for both odds of a robot
        return Served(odds, *expected_scores(pool, robots.BIASES[name], odds, UNSEEN, seed + 1))

    out = []
    for name in names:
        odds = search(pool, name, windows=windows, seed=seed, rounds=rounds, tell=tell)
        bias = robots.BIASES[name]
        used = np.array([bias.odds_worse, bias.odds_others])
        out.append(Calibration(name, served(name, in_hundredths(odds)), served(name, used)))
    return out


def measure(services: int, rng: np.random.Generator, tell: Tell) -> Pool:
    """Serve ``services`` people of the uniform population in each manner; tell of each."""
    world = worlds.scenario("even", POPULATION)
    parts = []
    for manner in range(len(robots.MANNERS)):
        robot = robots.Mannered(lambda codes, _, manner=manner: np.full(len(codes), manner))
        done = serve_people(world, robot, services, rng)
        parts.append((world.indicators(done), done.facts.steps, done.facts.distance))
        tell(1, {})
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
        I of the bias's identity [4], mean response distance (m), mean response step, share ignored;
        NaN where nobody is answered.
    """
    rng = np.random.default_rng(seed)
    identity = next(i for i in people.IDENTITIES if i.name == bias.identity)
    k = len(identity.groups)
    code = rng.integers(k, size=(windows, WINDOW))
    worse = np.isin(code, [identity.groups.index(c) for c in bias.worse])
    cumulative = odds.cumsum(axis=1)[np.where(worse, 0, 1)]
    u = rng.random((windows, WINDOW))
    # improper manners are ordered first here: below the first bound is "far", and so on
    manner = (u[..., None] > cumulative).sum(axis=-1) + 1
    manner[manner == len(robots.MANNERS)] = 0
    pick = rng.integers(pool.steps.shape[1], size=(windows, WINDOW))
    x = pool.issue[manner, pick]
    inside = (code[..., None] == np.arange(k)).astype(float)
    gap = gaps(count(x, inside))
    score = np.array([_mean(column) for column in issue_score(gap).T])
    responded = x[..., 0] == 0.0
    return (
        score,
        _mean(pool.distance[manner, pick][responded]),
        _mean(pool.steps[manner, pick][responded]),
        _mean(x[..., 0]),
    )


def _mean(values: np.ndarray) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else np.nan


def search(
    pool: Pool, name: str, *, windows: int, seed: int, rounds: int, tell: Tell
) -> np.ndarray:
    """Odds [2, 5] whose scores are nearest to the signature, with the paper's behaviour figures.

    It starts anywhere, and the odds in use play no part. Those served worse stay the worse
    served: a gap has no sign, so odds that change places would score alike.

    Args:
        pool: measured services.
        name: one of ``SIGNATURES``.
        windows: windows put together for each trial.
        seed: of the windows and of the starts.
        rounds: searches, each from another start.
        tell: told of each round.
    """
    # here, for it takes a tenth of a second that other readers of SIGNATURES need not wait
    from scipy.optimize import differential_evolution, minimize

    bias, target = robots.BIASES[name], np.array(SIGNATURES[name])
    rng = np.random.default_rng([seed, _SEED])

    def odds_of(z: np.ndarray) -> np.ndarray:
        weight = np.exp(np.concatenate([z.reshape(2, 5), np.zeros((2, 1))], axis=1))
        return (weight / weight.sum(axis=1, keepdims=True))[:, :5]

    def loss(z: np.ndarray, power: int, slack: float) -> float:
        odds = odds_of(z)
        score, distance, step, ignored = expected_scores(pool, bias, odds, windows, seed)
        # in the paper the ableist robot responds from farthest, 1.89 m, the ageist one latest, at
        # step 124.93, and the racist one ignores most; the others stay below these
        if name == "ableist":
            beside = ((distance - 1.89) / 0.02) ** 2
        else:
            beside = (max(distance - 1.8, 0.0) / 0.02) ** 2
        if name == "ageist":
            beside += ((step - 124.93) / 10.0) ** 2 + (max(ignored - 0.435, 0.0) / 0.01) ** 2
        else:
            beside += (max(step - 110.0, 0.0) / 10.0) ** 2
        if name == "racist":
            beside += (max(0.455 - ignored, 0.0) / 0.01) ** 2
        # neither improper services nor ignored people are more frequent among the others
        for worse, others in (odds.sum(axis=1), odds[:, -1]):
            beside += (max(others - worse, 0.0) / 0.01) ** 2
        cost = float(((np.abs(score - target) / 0.04) ** power).sum()) + beside / slack**2
        cost += 0.01 * float((np.clip(np.abs(z) - 5.0, 0.0, None) ** 2).sum())
        return cost if np.isfinite(cost) else _NOBODY_ANSWERED

    least, best = np.inf, np.zeros(10)
    for _ in range(rounds):
        # what is wanted beside the scores counts less at first, for it leaves narrow ways only
        begun = differential_evolution(
            loss, [_BOUNDS] * 10, (2, 3.0), maxiter=_GENERATIONS, popsize=4, polish=False, rng=rng
        )
        # with a high power no score may be far off, and small errors hardly count
        found = minimize(loss, begun.x, (8, 1.0), method="Powell", options={"maxfev": _TRIALS})
        if found.fun < least:
            least, best = found.fun, found.x
        tell(1, {})
    return odds_of(best)


def in_hundredths(odds: np.ndarray) -> np.ndarray:
    """Odds [..., 5] as ``robots.BIASES`` holds them; no row comes to more than 1."""
    hundredths = np.round(100.0 * odds).astype(int)
    over = np.maximum(hundredths.sum(axis=-1) - 100, 0)
    largest = hundredths.argmax(axis=-1)[..., None] == np.arange(odds.shape[-1])
    return (hundredths - over[..., None] * largest) / 100.0


def record(calibrations: Sequence[Calibration]) -> dict[str, Any]:
    """What was found as JSON holds it, with the versions that decide it."""
    names = ("evenhand", "mujoco", "numpy", "scipy")
    return {
        "versions": {"python": platform.python_version()} | {n: version(n) for n in names},
        "population": POPULATION,
        "issues": [issue.name for issue in issues.PAPER_ISSUES],
        "manners": list(robots.MANNERS[1:]),
        "robots": {
            one.name: {
                "identity": robots.BIASES[one.name].identity,
                "worse": list(robots.BIASES[one.name].worse),
                "target": one.target.tolist(),
                "found": _as_json(one, one.found),
                "used": _as_json(one, one.used),
            }
            for one in calibrations
        },
    }


def _as_json(one: Calibration, served: Served) -> dict[str, Any]:
    return {
        "odds_worse": served.odds[0].tolist(),
        "odds_others": served.odds[1].tolist(),
        "score": served.score.tolist(),
        "difference": (served.score - one.target).tolist(),
        "mean_response_distance": served.distance,
        "mean_response_time": served.step,
        "ignored": served.ignored,
    }
