"""What wrapping costs: steps of Gymnasium's CartPole, bare and judged, side by side in one run.

CartPole's own vector environment is one of the fastest that Gymnasium has, so that this is close
to the worst case. Two sides take turns of the same length with the same actions, and who begins
changes; every ratio is a median over pairs of turns, in processor time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from time import process_time
from typing import Any

import gymnasium as gym
import numpy as np

from evenhand.adapters.episodes import Ended
from evenhand.adapters.guidance import JudgeSettings
from evenhand.adapters.sampler import invented
from evenhand.adapters.wrappers import JudgeVectorServices
from evenhand.core import terminal as display
from evenhand.core.errors import whole
from evenhand.methods.scheme import Fact, Identity, Scheme, own_issue

LANES = (8, 16, 32)
_STEPS = 400
"""Of one turn."""

SCHEME = Scheme(
    identities=(Identity("side", ("left", "right")), Identity("team", ("a", "b", "c"))),
    facts=(Fact("steps", int, least=1), Fact("fell", bool), Fact("angle", float)),
    issues=(
        own_issue("fell", ["fell"], lambda fell: fell == 1),
        own_issue("short", ["steps"], lambda steps: steps < 100),
        own_issue("tilted", ["angle"], lambda angle: np.abs(angle) > 0.1),
    ),
)


def facts_of(ended: Ended) -> Mapping[str, Any]:
    """What a CartPole episode was."""
    return {
        "steps": ended.steps,
        "fell": ended.terminated,
        "angle": ended.observation[:, 2],
    }


def measure(turns: int = 40) -> dict[str, Any]:
    """Processor time of judged steps over that of bare ones.

    Args:
        turns: pairs of turns for each ratio, each of 400 steps.

    Returns:
        ``adapter_bare_us``, microseconds of a bare step; ``adapter_ratio``, recording and judging
        without guidance; ``adapter_ratio_short``, the same where actions are random and episodes
        therefore some 20 steps long; ``adapter_ratio_guided``, with level-up. Each: lanes ->
        number. Without ``_short`` a controller balances the pole, for up to 500 steps.

    Raises:
        InputError: for no turns or too many.
    """
    whole("turns", turns, 1, 10_000)
    found: dict[str, dict[int, float]] = {
        name: {} for name in ("bare_us", "ratio", "ratio_short", "ratio_guided")
    }
    for lanes in LANES:
        bare, found["ratio"][lanes] = _compare(lanes, turns, JudgeSettings(), skilled=True)
        _, found["ratio_short"][lanes] = _compare(lanes, turns, JudgeSettings(), skilled=False)
        levelup = JudgeSettings(method="levelup")
        _, found["ratio_guided"][lanes] = _compare(lanes, turns, levelup, skilled=True)
        found["bare_us"][lanes] = round(1e6 * bare, 1)
    return {f"adapter_{name}": values for name, values in found.items()}


def _compare(lanes: int, turns: int, settings: JudgeSettings, skilled: bool) -> tuple[float, float]:
    """Seconds of a bare step, and the ratio."""
    rng = np.random.default_rng(0)
    scout, bare, inner = (
        gym.make_vec("CartPole-v1", lanes, vectorization_mode="vector_entry_point")
        for _ in range(3)
    )
    judged = JudgeVectorServices(
        inner, SCHEME, facts_of, sampler=invented(SCHEME), rng=rng, settings=settings
    )
    seen = scout.reset(seed=1)[0]
    for env in (bare, judged):
        env.reset(seed=1)

    def actions() -> Iterator[np.ndarray]:
        # all three see the same, so that what is chosen here is right for the others
        nonlocal seen
        for _ in range(_STEPS):
            chosen = _balanced(seen) if skilled else rng.integers(0, 2, lanes)
            yield chosen
            seen = scout.step(chosen)[0]

    def seconds(env: Any, chosen: list[np.ndarray]) -> float:
        began = process_time()
        for action in chosen:
            env.step(action)
        return process_time() - began

    pairs = []
    for turn in range(turns + 1):
        chosen = list(actions())
        first = seconds(judged if turn % 2 else bare, chosen)
        second = seconds(bare if turn % 2 else judged, chosen)
        if turn:  # the first one is warm-up
            pairs.append((second, first) if turn % 2 else (first, second))
    each = np.array(pairs)
    ratio = float(np.median(each[:, 1] / each[:, 0]))
    return float(np.median(each[:, 0])) / _STEPS, round(ratio, 3)


def _balanced(observation: np.ndarray) -> np.ndarray:
    """A push towards where the pole falls; it holds for hundreds of steps."""
    return (observation @ np.array([0.05, 0.15, 1.0, 0.4]) > 0).astype(np.int64)


def show(found: dict[str, Any]) -> None:
    """Print the measurements."""
    display.table(
        "A wrapped step, to a bare one of CartPole's vector environment",
        ("lanes", "bare step, µs", "judged", "judged, short episodes", "guided by level-up"),
        [
            (
                lanes,
                found["adapter_bare_us"][lanes],
                found["adapter_ratio"][lanes],
                found["adapter_ratio_short"][lanes],
                found["adapter_ratio_guided"][lanes],
            )
            for lanes in found["adapter_bare_us"]
        ],
    )
