"""PPO in one file, on the restaurant: everything that is learned with stands below.

The style is CleanRL's: no learner to import, nothing hidden, so that the place where evenness comes
in can be seen: the environment is wrapped, and rewards arrive with what evenness adds to them.
Run it with

    python examples/ppo_single_file.py --guidance levelup --out out/ppo

and open ``out/ppo/report.html``. It takes about two minutes. People and needs are simulated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
import tyro
from gymnasium.vector import AutoresetMode

from evenhand.adapters import JudgeSettings, JudgeVectorServices
from evenhand.adapters.page import write
from evenhand.adapters.restaurant import SCHEME, facts_of
from evenhand.restaurant.observation import ScaleVectorObservation
from evenhand.restaurant.vector import RestaurantVectorEnv


@dataclass(frozen=True)
class Args:
    """Train a robot by PPO, test it on other people, and report."""

    out: Path = Path("out/ppo")
    """Folder of the report."""
    guidance: str = "levelup"
    """What evenness adds to rewards."""
    needs: float = 1.0
    """How much some guests need another service, 0 to 1."""
    seed: int = 0
    rollouts: int = 300
    num_envs: int = 30
    num_steps: int = 32
    """Decisions of each environment in a rollout."""
    passes: int = 4
    minibatches: int = 4
    learning_rate: float = 1e-3
    """Falls to 0 while it learns."""
    gamma: float = 1.0
    gae_lambda: float = 0.95
    clip: float = 0.2
    entropy_coefficient: float = 0.01
    value_coefficient: float = 0.5
    max_grad_norm: float = 0.5
    responds: float = 0.04
    """How often the untrained robot responds; at one half it would never come near anybody."""
    services: int = 3000
    """Of the test."""


def make_envs(args: Args, guidance: str) -> JudgeVectorServices[np.ndarray, np.ndarray]:
    """Restaurants whose services are written down, judged, and paid for evenness.

    Observations are scaled: a policy has to tell 1.0 m from 1.5 m, which are close together in
    plain observations, and would need many times more services to learn it.
    """
    envs = RestaurantVectorEnv(args.num_envs, AutoresetMode.SAME_STEP, needs=args.needs)
    settings = JudgeSettings(method=guidance)
    return JudgeVectorServices(ScaleVectorObservation(envs), SCHEME, facts_of, settings=settings)


# --- the agent: two networks of two hidden layers -------------------------------------------------


def network(rng: np.random.Generator, inputs: int, outputs: int, gain: float) -> list[Any]:
    """Orthogonal weights and no bias, a pair a layer."""
    layers = []
    for rows, columns, scale in ((inputs, 64, 2**0.5), (64, 64, 2**0.5), (64, outputs, gain)):
        q, r = np.linalg.qr(rng.normal(size=(max(rows, columns), min(rows, columns))))
        q = q * np.sign(np.diag(r))
        weight = scale * (q if rows >= columns else q.T)
        layers.append((jnp.asarray(weight, jnp.float32), jnp.zeros(columns, jnp.float32)))
    return layers


def apply(layers: list[Any], x: jax.Array) -> jax.Array:
    """What a network says."""
    for weight, bias in layers[:-1]:
        x = jnp.tanh(x @ weight + bias)
    weight, bias = layers[-1]
    return x @ weight + bias


@jax.jit
def act(agent: Any, seen: Any, key: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Actions by chance, their log probabilities, and values."""
    log_p = jax.nn.log_softmax(apply(agent["actor"], seen))
    action = jax.random.categorical(key, log_p)
    chosen = jnp.take_along_axis(log_p, action[:, None], axis=1)[:, 0]
    return action, chosen, apply(agent["critic"], seen)[:, 0]


# --- learning -------------------------------------------------------------------------------------


def loss(agent: Any, batch: dict[str, jax.Array], args: Args) -> jax.Array:
    """The clipped objective of PPO, the critic's error, and entropy."""
    log_p = jax.nn.log_softmax(apply(agent["actor"], batch["seen"]))
    chosen = jnp.take_along_axis(log_p, batch["action"][:, None], axis=1)[:, 0]
    ratio = jnp.exp(chosen - batch["log_prob"])
    clipped = jnp.clip(ratio, 1 - args.clip, 1 + args.clip)
    gain = jnp.minimum(ratio * batch["advantage"], clipped * batch["advantage"]).mean()
    error = 0.5 * jnp.square(apply(agent["critic"], batch["seen"])[:, 0] - batch["target"]).mean()
    entropy = -(jnp.exp(log_p) * log_p).sum(axis=1).mean()
    return -gain + args.value_coefficient * error - args.entropy_coefficient * entropy


def optimiser(args: Args) -> optax.GradientTransformation:
    """Adam with a falling rate and short gradients."""
    steps = args.rollouts * args.passes * args.minibatches
    rate = optax.linear_schedule(args.learning_rate, 0.0, steps)
    return optax.chain(optax.clip_by_global_norm(args.max_grad_norm), optax.adam(rate, eps=1e-5))


@partial(jax.jit, static_argnames="args")
def gradient_step(agent: Any, state: Any, batch: dict[str, jax.Array], args: Args) -> Any:
    """One step on one minibatch."""
    change, state = optimiser(args).update(jax.grad(loss)(agent, batch, args), state)
    return optax.apply_updates(agent, change), state


def advantages(
    reward: np.ndarray, value: np.ndarray, ended: np.ndarray, args: Args
) -> tuple[np.ndarray, np.ndarray]:
    """Generalised advantage estimates and critic targets, [T, n]; value is [T + 1, n]."""
    advantage, ahead = np.zeros_like(reward), np.zeros(reward.shape[1])
    for t in reversed(range(len(reward))):
        goes_on = 1.0 - ended[t]
        delta = reward[t] + args.gamma * value[t + 1] * goes_on - value[t]
        ahead = delta + args.gamma * args.gae_lambda * goes_on * ahead
        advantage[t] = ahead
    return advantage, advantage + value[:-1]


def train(args: Args) -> tuple[Any, JudgeVectorServices[np.ndarray, np.ndarray]]:
    """An agent that has learned, and the environments with all their services."""
    rng, key = np.random.default_rng(args.seed), jax.random.key(args.seed)
    envs = make_envs(args, args.guidance)
    seen, _ = envs.reset(seed=args.seed)
    inputs = seen.shape[1]
    agent = {"actor": network(rng, inputs, 2, 0.01), "critic": network(rng, inputs, 1, 1.0)}
    weight, _ = agent["actor"][-1]
    agent["actor"][-1] = (weight, jnp.log(jnp.array([1 - args.responds, args.responds])))
    state = optimiser(args).init(agent)
    for rollout in range(args.rollouts):
        rows: dict[str, list[Any]] = {
            name: [] for name in ("seen", "action", "log_prob", "value", "reward", "ended")
        }
        for _ in range(args.num_steps):
            key, now = jax.random.split(key)
            action, log_prob, value = (np.asarray(x) for x in act(agent, seen, now))
            following, reward, terminated, truncated, _ = envs.step(action)
            kept = (seen, action, log_prob, value, reward, terminated | truncated)
            for name, one in zip(rows, kept, strict=True):
                rows[name].append(one)
            seen = following
        store = {name: np.array(values) for name, values in rows.items()}
        last = np.asarray(act(agent, seen, key)[2])
        value = np.vstack([store["value"], last])
        advantage, target = advantages(store["reward"], value, store["ended"], args)
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        data = {name: store[name] for name in ("seen", "action", "log_prob")}
        data |= {"advantage": advantage.astype(np.float32), "target": target.astype(np.float32)}
        flat = {name: x.reshape(-1, *x.shape[2:]) for name, x in data.items()}
        for _ in range(args.passes):
            order = rng.permutation(args.num_steps * args.num_envs)
            for part in np.array_split(order, args.minibatches):
                batch = {name: jnp.asarray(x[part]) for name, x in flat.items()}
                agent, state = gradient_step(agent, state, batch, args)
        if (rollout + 1) % 20 == 0 and len(envs.windows):
            lately = envs.windows.excess.total[-20:].mean()
            print(f"rollout {rollout + 1}: {len(envs.services):,} services, score {lately:.3f}")
    return agent, envs


def main(args: Args) -> Path:
    """Learn, test on people that nobody was trained on, report."""
    agent, envs = train(args)
    tests, key = make_envs(args, "service"), jax.random.key(args.seed + 1)
    seen, _ = tests.reset(seed=1_000_000 + args.seed)
    while len(tests.ledger) < args.services:
        for _ in range(100):
            key, now = jax.random.split(key)
            seen = tests.step(np.asarray(act(agent, seen, now)[0]))[0]
    return write(
        args.out,
        {args.guidance: envs.ledger},
        tests={args.guidance: tests.ledger},
        title="PPO in one file",
        note="People and needs are simulated. One seed: no evidence for or against a method.",
        command=f"python examples/ppo_single_file.py --guidance {args.guidance}",
    )


if __name__ == "__main__":
    print(main(tyro.cli(Args)))
