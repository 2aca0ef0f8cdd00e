"""What tests of one update share: random services, a small learner, the loss written again."""

from typing import Any, Literal

import jax
import numpy as np

from evenhand.training.policy import PolicySettings
from evenhand.training.update import Trajectories, UpdateSettings, make_learner

N, L, OBS = 8, 10, 3
POLICY = PolicySettings(hidden=(4,))
Algorithm = Literal["reinforce", "ppo"]
ALGORITHMS: tuple[Algorithm, ...] = ("reinforce", "ppo")


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def services(seed: int = 0, n: int = N, places: int = L) -> Trajectories:
    """Random services, of 1 to 5 decisions each."""
    draw = rng(seed)
    mask = np.arange(places) < draw.integers(1, 6, n)[:, None]
    return Trajectories(
        obs=draw.normal(size=(n, places, OBS)).astype(np.float32),
        action=draw.integers(0, 2, (n, places)).astype(np.int32),
        mask=mask.astype(np.float32),
    )


def grid(seed: int) -> np.ndarray:
    return rng(seed).normal(size=(N, L)).astype(np.float32)


def learner(settings: UpdateSettings, seed: int = 0):
    return make_learner(OBS, POLICY, settings, rng(seed))


def vector(state) -> np.ndarray:
    """All weights, in declared order, in double precision."""
    return np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(state.policy)]).astype(float)


def assert_same_bits(a, b) -> None:
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        np.testing.assert_array_equal(x, y)


class Reference:
    """The loss written again in NumPy, and its slope by central differences."""

    def __init__(self, trajectories, advantage, target, settings, anchor=None):
        valid = trajectories.mask > 0
        self.obs = trajectories.obs[valid].astype(float)
        self.action = trajectories.action[valid]
        self.advantage = advantage[valid].astype(float)
        self.target = target[valid].astype(float)
        self.settings = settings
        self.anchor = anchor  # weights and weight of a policy to stay near

    def outputs(self, weights):
        """Log π(a | s), probabilities and V; weights are actor W W b b, critic W W b b."""
        sizes = [(OBS, 4), (4, 2), (4,), (2,), (OBS, 4), (4, 1), (4,), (1,)]
        ends = np.cumsum([int(np.prod(size)) for size in sizes])
        parts = np.split(weights, ends[:-1])
        w1, w2, b1, b2, v1, v2, c1, c2 = (
            part.reshape(size) for part, size in zip(parts, sizes, strict=True)
        )
        logits = np.tanh(self.obs @ w1 + b1) @ w2 + b2
        log_p = logits - np.log(np.exp(logits).sum(axis=1, keepdims=True))
        value = (np.tanh(self.obs @ v1 + c1) @ v2 + c2)[:, 0]
        return log_p[np.arange(len(self.action)), self.action], log_p, value

    def loss(self, weights, old):
        log_prob, log_p, value = self.outputs(weights)
        if self.settings.algorithm == "reinforce":
            gain = np.mean(log_prob * self.advantage)
        else:
            r = np.exp(log_prob - old)
            clipped = np.clip(r, 1 - self.settings.clip, 1 + self.settings.clip)
            gain = np.mean(np.minimum(r * self.advantage, clipped * self.advantage))
        entropy = -np.mean((np.exp(log_p) * log_p).sum(axis=1))
        critic = 0.5 * np.mean((value - self.target) ** 2)
        s = self.settings
        total = -gain + s.value_coefficient * critic - s.entropy_coefficient * entropy
        if self.anchor is not None:
            held = self.outputs(self.anchor[0])[1]
            total += self.anchor[1] * np.mean((np.exp(held) * (held - log_p)).sum(axis=1))
        return total

    def gradient(self, weights, old):
        h = 1e-6
        steps = h * np.eye(len(weights))
        return np.array(
            [(self.loss(weights + d, old) - self.loss(weights - d, old)) / (2 * h) for d in steps]
        )


def plain_steps(algorithm: Algorithm, **changes: Any) -> UpdateSettings:
    """Settings under which Adam walks straight down the gradient.

    With ε far above every gradient Adam's step is -(rate / ε)·m, where m is the mean gradient:
    g₁ in the first step, (0.9·0.1 g₁ + 0.1 g₂) / (1 - 0.9²) in the second.
    """
    fixed: dict[str, Any] = {
        "learning_rate": 2e4,
        "adam_eps": 1e4,
        "max_grad_norm": 1e6,
        "normalise_advantage": False,
        "entropy_coefficient": 0.1,
    }
    return UpdateSettings(algorithm=algorithm, **{**fixed, **changes})
