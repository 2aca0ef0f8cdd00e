"""Evenness on an environment that knows nothing of it: CartPole, with invented passengers.

Each episode carries a passenger. Who that is, is MADE UP for this example: most sit upright, some
lean, and a leaning passenger bends what the tilt sensor says. A linear controller, which does not
know who rides, is learned by an evolution strategy: once for the environment's own reward alone
and once with level-up guidance, by which issues of worse-off passengers cost more. Run it with

    python examples/cartpole.py out/cartpole

and open ``out/cartpole/report.html``. It takes about half a minute.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from evenhand.adapters import (
    Ended,
    Fact,
    Identity,
    JudgeSettings,
    JudgeVectorServices,
    Ledger,
    Scheme,
    invented,
    own_issue,
)
from evenhand.adapters.page import write
from evenhand.methods.paper import detector

# --- what is compared: two invented identities, three issues --------------------------------------

SCHEME = Scheme(
    identities=(Identity("posture", ("upright", "leaning")), Identity("hat", ("none", "red"))),
    facts=(
        Fact("steps", int, least=1),
        Fact("fell", bool),
        Fact("place", float),
    ),
    issues=(
        own_issue("fall", ["fell"], lambda fell: fell == 1),
        own_issue("early fall", ["fell", "steps"], lambda fell, n: (fell == 1) & (n < 100)),
        # only a ride that did not end in a fall can end far from the middle
        own_issue(
            "adrift",
            ["place", "fell"],
            lambda place, _: np.abs(place) > 1.0,
            where=lambda _, fell: fell == 0,
        ),
    ),
)
PASSENGERS = invented(SCHEME, {"posture": (0.75, 0.25)})
BEND = np.array([0.0, 0.2])
"""What each posture adds to the sensed tilt, rad; a hat adds nothing."""

LANES, LONGEST, ROUNDS, SPREAD, STEP = 64, 200, 60, 0.3, 0.15


def facts_of(ended: Ended) -> dict[str, Any]:
    """What is known of rides that have ended; cart position is the first number observed."""
    return {
        "steps": ended.steps,
        "fell": ended.terminated,
        "place": ended.observation[:, 0].astype(float),
    }


# --- a detector of these issues, from made-up judgements ------------------------------------------


def made_up_detector(rng: np.random.Generator) -> detector.Detector:
    """Learned from simulated respondents, who call a window biased by its total and some noise."""
    scores = rng.uniform(0.0, 0.6, (1000, len(SCHEME.issues)))
    biased = scores.sum(axis=1) + rng.normal(0.0, 0.1, 1000) > 0.9
    return detector.fit(
        scores,
        biased,
        source="simulated respondents",
        seed=0,
        issues=SCHEME.issue_names,
        identities=SCHEME.names,
    )


# --- riding and learning --------------------------------------------------------------------------


def rides(method: str, judge: detector.Detector, seed: int) -> JudgeVectorServices:
    """CartPole, judged; method 'service' leaves its rewards as they are."""
    env = gym.make_vec(
        "CartPole-v1", LANES, vectorization_mode="vector_entry_point", max_episode_steps=LONGEST
    )
    # a ride earns up to 200, so that evenness weighs as much
    return JudgeVectorServices(
        env,
        SCHEME,
        facts_of,
        sampler=PASSENGERS,
        rng=np.random.default_rng(seed),
        settings=JudgeSettings(method=method),
        detector=judge,
    )


def push(weights: np.ndarray, seen: np.ndarray, posture: np.ndarray) -> np.ndarray:
    """Left or right, from what is sensed: four gains and an offset."""
    sensed = seen.astype(float)
    sensed[:, 2] += BEND[posture]
    return ((sensed * weights[:, :4]).sum(axis=1) + 0.1 * weights[:, 4] > 0).astype(np.int64)


def first_rides(env: JudgeVectorServices, weights: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """What the first ride of each lane earns, evenness included, [n]."""
    earned, riding = np.zeros(LANES), np.ones(LANES, bool)
    while riding.any():
        people = env.people
        assert people is not None
        seen, rewards, terminated, truncated, _ = env.step(push(weights, seen, people[:, 0]))
        earned += np.where(riding, rewards, 0.0)
        riding &= ~(terminated | truncated)
    return earned


def learn(method: str, judge: detector.Detector, seed: int) -> tuple[np.ndarray, Ledger]:
    """Weights after an evolution strategy with mirrored noise, and all rides on the way."""
    rng = np.random.default_rng(seed)
    env = rides(method, judge, seed)
    weights = np.zeros(5)
    for number in range(ROUNDS):
        noise = rng.normal(size=(LANES // 2, 5))
        noise = np.concatenate([noise, -noise])
        seen, _ = env.reset(seed=seed * ROUNDS + number)
        earned = first_rides(env, weights + SPREAD * noise, seen)
        spread = earned.std() or 1.0
        weights += STEP * (noise * ((earned - earned.mean()) / spread)[:, None]).mean(axis=0)
    return weights, env.ledger


def test(weights: np.ndarray, judge: detector.Detector, seed: int) -> Ledger:
    """Rides of a controller that has learned, on passengers that it was not trained on."""
    env = rides("service", judge, seed)
    for number in range(30):
        seen, _ = env.reset(seed=10_000 + seed + number)
        first_rides(env, np.tile(weights, (LANES, 1)), seen)
    return env.ledger


def main(folder: Path) -> Path:
    """Learn twice, test both, write the report."""
    judge = made_up_detector(np.random.default_rng(0))
    runs, tests = {}, {}
    for name, method in (("reward alone", "service"), ("with level-up", "levelup@200")):
        weights, runs[name] = learn(method, judge, seed=1)
        tests[name] = test(weights, judge, seed=99)
    return write(
        folder,
        runs,
        tests=tests,
        title="CartPole with invented passengers",
        note=(
            "Passengers and their groups are made up, and so are the judgements that the detector "
            "learned from (simulated respondents). One seed: this shows how the parts fit "
            "together, and is no evidence for or against a method."
        ),
        command="python examples/cartpole.py",
    )


if __name__ == "__main__":
    print(main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/cartpole")))
