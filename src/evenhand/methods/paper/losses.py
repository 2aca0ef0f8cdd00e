"""The mathematics of learning: Eq. 6 to 8 of the paper and what every implementation adds.

Pure functions on arrays. Shapes: N services (one person each) in the order in which they were
served, L decisions at most a service. ``mask`` is 1 for decisions that happened and 0 after the
end of a service; what stands at masked places changes no result, and no gradient as long as it is
a number. Every average is over valid decisions, so a service counts by the number of its decisions,
as in the policy gradient of the total return.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike


def masked_mean(x: ArrayLike, mask: ArrayLike) -> jax.Array:
    """Mean of ``x`` where ``mask`` is 1; 0 when it is nowhere 1."""
    valid = jnp.asarray(mask) > 0
    total = jnp.sum(jnp.where(valid, jnp.asarray(x), 0.0))
    return total / jnp.maximum(jnp.sum(valid), 1)


def spread(x: ArrayLike, mask: ArrayLike) -> tuple[jax.Array, jax.Array]:
    """Mean and standard deviation over valid entries; a spread within rounding is 0."""
    x = jnp.asarray(x)
    mean = masked_mean(x, mask)
    std = jnp.sqrt(masked_mean(jnp.square(x - mean), mask))
    # float32 cannot tell a constant from this little: dividing by it would blow up noise.
    return mean, jnp.where(std > 1e-6 * jnp.abs(mean), std, 0.0)


# --- advantages and critic targets ---------------------------------------------------------------


@jax.jit
def people_returns(reward: ArrayLike, value_next: ArrayLike, gamma: ArrayLike) -> jax.Array:
    """Discounted return over people, the reward part of Eq. 6 (repaired).

    return_t = Σ_{k=t}^{T-1} γ^{k-t} r_k + γ^{T-t} C(S_T), where t counts people. The paper prints
    the exponent of γ on r_{T-1} as T-t+1; it must be T-t-1.

    Args:
        reward: r_t, one number a person, [N].
        value_next: C(S_T), the critic's value of the state after the last person; 0 for none.
        gamma: discount from one person to the next.

    Returns:
        [N].
    """

    def step(following: jax.Array, r: jax.Array) -> tuple[jax.Array, jax.Array]:
        current = r + gamma * following
        return current, current

    start = jnp.asarray(value_next, jnp.float32)
    return jax.lax.scan(step, start, jnp.asarray(reward, jnp.float32), reverse=True)[1]


@jax.jit
def people_advantages(
    reward: ArrayLike, value: ArrayLike, value_next: ArrayLike, gamma: ArrayLike
) -> jax.Array:
    """Eq. 6: the advantage of person t, Â_t = return_t - C(S).

    All decisions of a service share the return of its person; each is compared with the critic's
    value of its own state.

    Args:
        reward: r_t, [N].
        value: C of the state at each decision, [N, L].
        value_next: C(S_T), as in `people_returns`.
        gamma: discount from one person to the next.

    Returns:
        [N, L]. The critic's target is `people_returns`, the same for all decisions of a service.
    """
    return people_returns(reward, value_next, gamma)[:, None] - jnp.asarray(value, jnp.float32)


@jax.jit
def gae(
    reward: ArrayLike, value: ArrayLike, mask: ArrayLike, gamma: ArrayLike, lam: ArrayLike
) -> jax.Array:
    """Generalised advantage estimate with each service as an episode (Schulman et al. 2016).

    δ_t = r_t + γ V_{t+1} - V_t and Â_t = δ_t + γ λ Â_{t+1}, where t counts decisions. The last
    valid decision is terminal, also after a time-out: time is part of the state, so nothing is
    added for what might have followed.

    Args:
        reward: of each decision, [N, L].
        value: V of the state at each decision, [N, L].
        mask: [N, L]; the decisions that happened come first in each row.
        gamma: discount from one decision to the next.
        lam: trace decay; 1 gives reward-to-go minus V.

    Returns:
        [N, L], 0 where masked.
    """
    valid = jnp.asarray(mask) > 0
    rewards = jnp.where(valid, jnp.asarray(reward, jnp.float32), 0.0)
    values = jnp.where(valid, jnp.asarray(value, jnp.float32), 0.0)

    def step(
        following: tuple[jax.Array, jax.Array], now: tuple[jax.Array, jax.Array]
    ) -> tuple[tuple[jax.Array, jax.Array], jax.Array]:
        advantage_next, v_next = following
        r, v = now
        advantage = r + gamma * v_next - v + gamma * lam * advantage_next
        return (advantage, v), advantage

    zero = jnp.zeros(rewards.shape[0], jnp.float32)
    advantage = jax.lax.scan(step, (zero, zero), (rewards.T, values.T), reverse=True)[1].T
    return jnp.where(valid, advantage, 0.0)


def normalise(advantage: ArrayLike, mask: ArrayLike) -> jax.Array:
    """Advantages with mean 0 and standard deviation 1 over valid decisions; 0 where masked.

    Advantages that are all alike carry no information and become 0. That is why a reward that
    is the same for all people, or a λ that scales it for all, has no effect by itself.
    """
    advantage = jnp.asarray(advantage)
    mean, std = spread(advantage, mask)
    scale = jnp.where(std > 0, 1.0 / jnp.where(std > 0, std, 1.0), 0.0)
    return jnp.where(jnp.asarray(mask) > 0, (advantage - mean) * scale, 0.0)


# --- losses --------------------------------------------------------------------------------------


def ratio(log_prob: ArrayLike, old_log_prob: ArrayLike, mask: ArrayLike) -> jax.Array:
    """Eq. 8: r(θ) = π_θ(a | S) / π_old(a | S); 1 where masked."""
    difference = jnp.subtract(log_prob, old_log_prob)
    return jnp.exp(jnp.where(jnp.asarray(mask) > 0, difference, 0.0))


def reinforce_loss(log_prob: ArrayLike, advantage: ArrayLike, mask: ArrayLike) -> jax.Array:
    """REINFORCE with a baseline (Williams 1992): minus the mean of log π(a | S) Â."""
    return -masked_mean(jnp.multiply(log_prob, advantage), mask)


def ppo_loss(
    log_prob: ArrayLike,
    old_log_prob: ArrayLike,
    advantage: ArrayLike,
    mask: ArrayLike,
    clip: float,
) -> jax.Array:
    """Eq. 7, negated: minus the mean of min(r Â, clip(r, 1-ε, 1+ε) Â), with r of Eq. 8.

    Args:
        log_prob: log π_θ of the actions taken, any shape.
        old_log_prob: the same for the policy that acted.
        advantage: Â.
        mask: valid decisions.
        clip: ε.
    """
    advantage = jnp.asarray(advantage)
    r = ratio(log_prob, old_log_prob, mask)
    clipped = jnp.clip(r, 1.0 - clip, 1.0 + clip)
    return -masked_mean(jnp.minimum(r * advantage, clipped * advantage), mask)


def value_loss(value: ArrayLike, target: ArrayLike, mask: ArrayLike) -> jax.Array:
    """Half the mean squared error of the critic."""
    return 0.5 * masked_mean(jnp.square(jnp.subtract(value, target)), mask)
