# pyright: reportMissingImports=false
"""PPO of Stable-Baselines3 in the restaurant, for service alone and guided towards evenness.

Some guests need another service: they notice a response only from nearby, or need more room. Both
robots see whom they serve. One learns from service quality alone; of the other, level-up guidance
makes issues of worse-off groups cost more. People are drawn and simulated. Run it with

    pip install '.[sb3]'
    python examples/sb3_restaurant.py out/sb3

and open ``out/sb3/report.html``. It takes some minutes; ``--quick`` takes one, and shows less.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import torch
from gymnasium.vector import AutoresetMode
from stable_baselines3 import A2C, PPO

from evenhand.adapters import JudgeSettings, JudgeVectorServices, Ledger
from evenhand.adapters.page import write
from evenhand.adapters.restaurant import SCHEME, facts_of
from evenhand.adapters.sb3 import EvennessCallback, restaurant
from evenhand.restaurant.observation import ScaleVectorObservation
from evenhand.restaurant.vector import RestaurantVectorEnv

WORLD: dict[str, Any] = {"needs": 1.0}
LANES, STEPS = 30, 32
RESPONDS = 0.04
"""How often the untrained robot responds: at one half it would never come near anybody."""


def learn(algorithm: str, guidance: str, rollouts: int, seed: int) -> tuple[Any, EvennessCallback]:
    """A robot, and what was seen of its learning."""
    shared = {"n_steps": STEPS, "gamma": 1.0, "ent_coef": 0.01, "seed": seed, "device": "cpu"}
    env = restaurant(LANES, seed=seed, **WORLD)

    def rate(left: float) -> float:
        return 1e-3 * left

    if algorithm == "ppo":
        batch = LANES * STEPS // 4
        model = PPO("MlpPolicy", env, rate, batch_size=batch, n_epochs=4, **shared)
    else:
        model = A2C("MlpPolicy", env, rate, gae_lambda=0.95, normalize_advantage=True, **shared)
    policy: Any = model.policy
    with torch.no_grad():
        policy.action_net.bias.copy_(torch.log(torch.tensor([1 - RESPONDS, RESPONDS])))
    callback = EvennessCallback(
        SCHEME, facts_of, settings=JudgeSettings(method=guidance), verbose=1
    )
    return model.learn(rollouts * LANES * STEPS, callback), callback


def test(model: Any, services: int, seed: int) -> Ledger:
    """Services of a robot that has learned, for people that it was not trained on."""
    envs = RestaurantVectorEnv(LANES, AutoresetMode.SAME_STEP, **WORLD)
    # observations scaled as in training
    env = JudgeVectorServices(ScaleVectorObservation(envs), SCHEME, facts_of)
    seen, _ = env.reset(seed=seed)
    while len(env.ledger) < services:
        for _ in range(100):
            seen = env.step(model.predict(seen)[0])[0]
    return env.ledger


def main(folder: Path, algorithm: str, rollouts: int, services: int, seed: int) -> Path:
    """Learn twice, test both, write the report."""
    runs, tests, updates = {}, {}, {}
    for name, guidance in (("service alone", "service"), ("with level-up", "levelup")):
        model, callback = learn(algorithm, guidance, rollouts, seed)
        runs[name], updates[name] = callback.ledger, callback.examined
        tests[name] = test(model, services, 1_000_000 + seed)
    return write(
        folder,
        runs,
        tests=tests,
        updates=updates,
        title=f"{algorithm.upper()} of Stable-Baselines3 in the restaurant",
        note=(
            "People, guests and their needs are simulated. One seed: this shows how the parts "
            "fit together, and is no evidence for or against a method; evenhand compare is."
        ),
        command=f"python examples/sb3_restaurant.py --algorithm {algorithm}",
    )


if __name__ == "__main__":
    asked = argparse.ArgumentParser(description="Train, guided and unguided, and report.")
    asked.add_argument("folder", nargs="?", type=Path, default=Path("out/sb3"))
    asked.add_argument("--algorithm", choices=("ppo", "a2c"), default="ppo")
    asked.add_argument("--rollouts", type=int, default=300)
    asked.add_argument("--services", type=int, default=3000, help="of the test of each robot")
    asked.add_argument("--seed", type=int, default=0)
    asked.add_argument("--quick", action="store_true", help="30 rollouts and 600 services")
    given = asked.parse_args()
    if given.quick:
        given.rollouts, given.services = 30, 600
    print(main(given.folder, given.algorithm, given.rollouts, given.services, given.seed))
