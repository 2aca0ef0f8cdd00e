"""One update that weighs every moment of responding by what would have come of it.

Where a response ends a service and changes nothing before it, a walk to the end tells the worth
R_ik of every answer k of service i: a response at decision k, or none (k = L). The expected worth
is then an exact function of the policy's probabilities h_ik of responding,

    J = 1/n Σ_i Σ_k P_ik R_ik,   P_ik = h_ik Π_{j<k} (1 - h_ij),   P_iL = Π_j (1 - h_ij),

and its gradient is the policy gradient over all actions (Petit et al. 2019) with the course of the
service as the baseline's input (Mao et al. 2018): no critic, no sampled action, no ratio of
probabilities. Entropy and the distance to an anchor are means over decisions, each weighed by the
probability of reaching it, which they do not pull at.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax

from evenhand.training import diagnostics, surgery
from evenhand.training.batches import deal
from evenhand.training.policy import ActorCritic
from evenhand.training.update import Anchor, LearnerState, UpdateReport, UpdateSettings, optimiser


class Weighed(NamedTuple):
    """N services of L decisions with what every answer is worth.

    Attributes:
        obs: float32 [N, L, O], at every decision, whether or not it was reached.
        worth: float32 [N, L + 1], R; the last is no response.
        fair: float32 [N, L + 1], worth towards evenness alone, for gradient surgery; else 0.
        counts: float32 [N], 1; 0 for places that are left over.
    """

    obs: Any
    worth: Any
    fair: Any
    counts: Any


def log_answers(log_probabilities: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Log-probability of every answer, and of reaching every decision.

    Args:
        log_probabilities: of walking and responding, [..., L, 2].

    Returns:
        log P, [..., L + 1], and log reach, [..., L].
    """
    walking = jnp.cumsum(log_probabilities[..., 0], axis=-1)
    reach = jnp.concatenate([jnp.zeros_like(walking[..., :1]), walking], axis=-1)
    responding = reach[..., :-1] + log_probabilities[..., 1]
    return jnp.concatenate([responding, reach[..., -1:]], axis=-1), reach[..., :-1]


def expected_worth(log_probabilities: jax.Array, worth: jax.Array, counts: jax.Array) -> jax.Array:
    """J, a scalar.

    Args:
        log_probabilities: [N, L, 2].
        worth: R, [N, L + 1].
        counts: 1 for services that count, [N].
    """
    answers, _ = log_answers(log_probabilities)
    # what every answer is worth alike teaches nothing, and would cost digits
    each = jnp.sum(jnp.exp(answers) * (worth - worth[..., -1:]), axis=-1) + worth[..., -1]
    return jnp.sum(each * counts) / jnp.maximum(jnp.sum(counts), 1.0)


def reached(log_probabilities: jax.Array, counts: jax.Array) -> jax.Array:
    """Probability of reaching each decision, as a weight without a gradient, [N, L]."""
    _, reach = log_answers(log_probabilities)
    return jax.lax.stop_gradient(jnp.exp(reach)) * counts[:, None]


def _objective(
    policy: ActorCritic, batch: Weighed, anchor: Anchor | None, settings: UpdateSettings
) -> tuple[jax.Array, jax.Array]:
    """The number that a gradient step lowers, and -J."""
    log_probabilities = policy.log_probabilities(batch.obs)
    loss = -expected_worth(log_probabilities, batch.worth, batch.counts)
    weight = reached(log_probabilities, batch.counts)
    total = loss - settings.entropy_coefficient * diagnostics.entropy(log_probabilities, weight)
    if anchor is not None:
        held = anchor.policy.log_probabilities(batch.obs)
        total = total + anchor.weight * diagnostics.divergence(held, log_probabilities, weight)
    return total, loss


def _unevenness(policy: ActorCritic, services: Weighed) -> jax.Array:
    """What falls as the policy becomes more even."""
    return -expected_worth(policy.log_probabilities(services.obs), services.fair, services.counts)


@partial(jax.jit, static_argnames=("settings", "with_surgery"))
def _steps(
    state: LearnerState,
    services: Weighed,
    order: jax.Array,
    settings: UpdateSettings,
    with_surgery: bool,
    anchor: Anchor | None,
) -> tuple[LearnerState, dict[str, jax.Array]]:
    before = state.policy.log_probabilities(services.obs)
    adam = optimiser(settings)

    def step(
        carry: tuple[ActorCritic, optax.OptState], chosen: jax.Array
    ) -> tuple[tuple[ActorCritic, optax.OptState], tuple[jax.Array, jax.Array]]:
        policy, opt_state = carry
        # left-over places point behind the end and count nothing
        batch = jax.tree.map(
            lambda x: jnp.take(x, chosen, axis=0, mode="fill", fill_value=0), services
        )
        (_, loss), gradient = jax.value_and_grad(_objective, has_aux=True)(
            policy, batch, anchor, settings
        )
        length = optax.tree.norm(gradient)
        uneven = None
        if with_surgery:
            # as in `update`: of the whole epoch, and the signs of both gradients cancel
            uneven = jax.grad(_unevenness)(policy, services)
            gradient = jax.tree.map(jnp.add, gradient, surgery.surgery(uneven, gradient))
        change, opt_state = adam.update(gradient, opt_state)
        if with_surgery:
            change = surgery.off_bias(change, uneven)
        return (eqx.apply_updates(policy, change), opt_state), (loss, length)

    (policy, opt_state), (loss, length) = jax.lax.scan(step, (state.policy, state.opt_state), order)
    after = policy.log_probabilities(services.obs)
    none = jnp.full((), jnp.nan)
    report = {
        "policy_loss": jnp.mean(loss),
        "value_loss": none,
        "entropy": diagnostics.entropy(after, reached(after, services.counts)),
        "approx_kl": diagnostics.divergence(before, after, reached(before, services.counts)),
        "clip_fraction": none,
        "explained_variance": none,
        "grad_norm": jnp.mean(length),
    }
    return LearnerState(policy=policy, opt_state=opt_state, step=state.step + 1), report


def update(
    state: LearnerState,
    observation: Any,
    worth: Any,
    settings: UpdateSettings,
    rng: np.random.Generator,
    fair: Any = None,
    anchor: Anchor | None = None,
) -> tuple[LearnerState, UpdateReport]:
    """Change the policy so that worthier answers become more likely.

    REINFORCE takes ``passes`` steps on all services; PPO deals them into minibatches.

    Args:
        state: before the update; it stays as it is.
        observation: as the policy takes it, float32 [N, L, O].
        worth: of every answer, no response last, [N, L + 1].
        settings: how to learn.
        rng: deals the services into minibatches; only PPO draws from it.
        fair: worth of every answer towards evenness, whose gradient is added by gradient surgery,
            [N, L + 1]. None leaves it out.
        anchor: a policy to stay near; None leaves it out.

    Returns:
        The new state and what happened, both perhaps still being computed.

    Raises:
        ValueError: shapes differ or a number is not finite.
    """
    seen, value = np.asarray(observation, np.float32), np.asarray(worth, np.float32)
    n, length = seen.shape[:2]
    other = np.zeros_like(value) if fair is None else np.asarray(fair, np.float32)
    for name, array in (("worth", value), ("fair", other)):
        if array.shape != (n, length + 1):
            raise ValueError(f"{name} has shape {array.shape} for services {(n, length)}")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} is not finite")
    services = Weighed(seen, value, other, np.ones(n, np.float32))
    if settings.algorithm == "reinforce":
        order = np.broadcast_to(np.arange(n, dtype=np.int32), (settings.passes, n))
    else:
        order = deal(n, n, settings.passes, settings.minibatches, rng)
    state, report = _steps(state, services, order, settings, fair is not None, anchor)
    return state, UpdateReport(**report)
