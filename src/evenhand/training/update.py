"""One update of the policy from the services of one epoch: REINFORCE or PPO.

What the services were worth comes from outside, as advantages and critic targets: the update
knows nothing of rewards, groups or issues, so any guidance can shape it.

All gradient steps of an update run in one compiled function. It compiles once for each settings
and each size of packed decisions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax

from evenhand.core.errors import InputError, unknown, whole
from evenhand.methods.paper import losses
from evenhand.training import diagnostics, surgery
from evenhand.training.batches import Decisions, Trajectories, deal, pack
from evenhand.training.policy import ActorCritic, PolicySettings, make_policy

ALGORITHMS = ("reinforce", "ppo")
CREDITS = ("sampled", "all_answers")
MOST_STEPS = 10_000
"""Most passes, and most minibatches of a pass: with more a run would never end."""


@dataclass(frozen=True)
class UpdateSettings:
    """How the policy learns from one epoch."""

    algorithm: Literal["reinforce", "ppo"] = "ppo"
    """reinforce: one gradient step an epoch on all its decisions. ppo: several passes over them
    in minibatches with the clipped objective."""

    credit: Literal["sampled", "all_answers"] = "sampled"
    """sampled: decisions that were taken are credited with what came of them. all_answers: every
    service is simulated to its end, and every moment of responding is weighed by what would have
    come of it, see ``training.all_answers``; reinforce then takes ``passes`` steps an epoch."""

    learning_rate: float | None = None
    """Step size of Adam; none means 0.001 for ppo. For reinforce, which takes one step where ppo
    takes many, 0.003, or 0.005 with all answers."""

    anneal_updates: int | None = None
    """The learning rate falls evenly to 0 over so many updates; 0 keeps it as it is. None means
    the epochs of the run."""

    adam_eps: float = 1e-5
    """Term in Adam's denominator."""

    passes: int = 4
    """PPO: passes over the decisions of one epoch."""

    minibatches: int = 4
    """PPO: gradient steps in one pass."""

    clip: float = 0.2
    """PPO: ε, how far the probability ratio may move before its gain is cut off."""

    entropy_coefficient: float = 0.01
    """Weight of the policy's entropy, which keeps it exploring."""

    value_coefficient: float = 0.5
    """Weight of the critic's loss."""

    max_grad_norm: float = 0.5
    """Longer gradients are shortened to this length."""

    gamma: float | None = None
    """Discount from person to person (Eq. 6, preset paper) or from decision to decision (preset
    service). None means 0.99 and 1: a service is short, discounting would only pay for haste."""

    gae_lambda: float = 0.95
    """Trace decay of generalised advantage estimates; 1 is reward-to-go minus the critic."""

    normalise_advantage: bool = True
    """Scale the advantages of an epoch to mean 0 and standard deviation 1 over its decisions."""

    def __post_init__(self) -> None:
        if self.algorithm not in ALGORITHMS:
            raise unknown("algorithm", self.algorithm, ALGORITHMS)
        if self.credit not in CREDITS:
            raise unknown("credit", self.credit, CREDITS)
        above = "give a number above 0"
        if self.learning_rate is not None:
            self._require("learning_rate", 0.0 < self.learning_rate < np.inf, above)
        for name in ("adam_eps", "clip", "max_grad_norm"):
            self._require(name, 0.0 < getattr(self, name) < np.inf, above)
        for name in ("entropy_coefficient", "value_coefficient"):
            self._require(name, 0.0 <= getattr(self, name) < np.inf, "give 0 or a number above 0")
        for name in ("gamma", "gae_lambda"):
            value = getattr(self, name)
            self._require(name, value is None or 0.0 <= value <= 1.0, "give a number from 0 to 1")
        if self.anneal_updates is not None:
            whole("anneal_updates", self.anneal_updates, 0, 1_000_000)
        for name in ("passes", "minibatches"):
            whole(name, getattr(self, name), 1, MOST_STEPS)

    @property
    def step_size(self) -> float:
        """The learning rate in use."""
        if self.learning_rate is not None:
            return self.learning_rate
        if self.algorithm == "ppo":
            return 1e-3
        return 3e-3 if self.credit == "sampled" else 5e-3

    @property
    def gradient_steps(self) -> int:
        """In one update."""
        if self.algorithm == "ppo":
            return self.passes * self.minibatches
        return 1 if self.credit == "sampled" else self.passes

    def _require(self, name: str, good: bool, remedy: str) -> None:
        if not good:
            raise InputError(f"range {name}", f"{name} is {getattr(self, name)}; {remedy}")


class LearnerState(eqx.Module):
    """Everything that an update changes.

    Attributes:
        policy: actor and critic.
        opt_state: of Adam.
        step: number of updates so far, int32 scalar.
    """

    policy: ActorCritic
    opt_state: optax.OptState
    step: jax.Array


class Anchor(NamedTuple):
    """A policy to stay near: its teacher, as in kickstarting (Schmitt et al. 2018).

    Attributes:
        policy: its actor counts.
        weight: of the mean divergence KL(anchor ‖ policy) over decisions, added to the loss.
    """

    policy: ActorCritic
    weight: float


@dataclass(frozen=True)
class UpdateReport:
    """What one update did; averages over its gradient steps or over all valid decisions.

    Scalars that may still be computed while Python goes on; ``float`` waits for them. Not a number
    where the learner has no such thing: with all answers there is no critic and nothing is clipped.
    """

    policy_loss: jax.Array
    """Mean over gradient steps of the loss of REINFORCE or of Eq. 7 (negated)."""
    value_loss: jax.Array
    """Mean over gradient steps of half the critic's squared error."""
    entropy: jax.Array
    """Entropy of the policy in nats, after the update."""
    approx_kl: jax.Array
    """How far the policy moved in this update, in nats."""
    clip_fraction: jax.Array
    """Share of decisions whose probability ratio left [1-ε, 1+ε] in this update."""
    explained_variance: jax.Array
    """Of the critic before the update; not a number when all targets are alike."""
    grad_norm: jax.Array
    """Mean length of the gradient before shortening."""


def _learning_rate(settings: UpdateSettings) -> optax.ScalarOrSchedule:
    if not settings.anneal_updates:
        return settings.step_size
    steps = settings.anneal_updates * settings.gradient_steps
    return optax.linear_schedule(settings.step_size, 0.0, steps)


def optimiser(settings: UpdateSettings) -> optax.GradientTransformation:
    """Adam on shortened gradients."""
    return optax.chain(
        optax.clip_by_global_norm(settings.max_grad_norm),
        optax.adam(_learning_rate(settings), eps=settings.adam_eps),
    )


def make_learner(
    obs_size: int,
    policy_settings: PolicySettings,
    update_settings: UpdateSettings,
    rng: np.random.Generator,
) -> LearnerState:
    """An untrained policy with a fresh optimiser.

    Args:
        obs_size: numbers in one observation.
        policy_settings: size and first behaviour of the policy.
        update_settings: how it will learn.
        rng: source of the weights.
    """
    policy = make_policy(obs_size, policy_settings, rng)
    opt_state = optimiser(update_settings).init(eqx.filter(policy, eqx.is_array))
    return LearnerState(policy=policy, opt_state=opt_state, step=jnp.zeros((), jnp.int32))


def _log_prob(log_probabilities: jax.Array, action: jax.Array) -> jax.Array:
    return jnp.take_along_axis(log_probabilities, action[:, None], axis=1)[:, 0]


def _objective(
    policy: ActorCritic,
    batch: Decisions,
    old_log_prob: jax.Array,
    anchor: Anchor | None,
    settings: UpdateSettings,
) -> tuple[jax.Array, tuple[jax.Array, jax.Array]]:
    """The number that a gradient step lowers, with its policy and value parts."""
    log_probabilities = policy.log_probabilities(batch.obs)
    log_prob = _log_prob(log_probabilities, batch.action)
    if settings.algorithm == "reinforce":
        policy_part = losses.reinforce_loss(log_prob, batch.advantage, batch.mask)
    else:
        policy_part = losses.ppo_loss(
            log_prob, old_log_prob, batch.advantage, batch.mask, settings.clip
        )
    value_part = losses.value_loss(policy.value(batch.obs), batch.target, batch.mask)
    total = (
        policy_part
        + settings.value_coefficient * value_part
        - settings.entropy_coefficient * diagnostics.entropy(log_probabilities, batch.mask)
    )
    if anchor is not None:
        held = anchor.policy.log_probabilities(batch.obs)
        total = total + anchor.weight * diagnostics.divergence(held, log_probabilities, batch.mask)
    return total, (policy_part, value_part)


def _unevenness(
    policy: ActorCritic, batch: Decisions, old_log_prob: jax.Array, settings: UpdateSettings
) -> jax.Array:
    """What falls as the policy becomes more even: the policy loss with the fair advantages."""
    log_prob = _log_prob(policy.log_probabilities(batch.obs), batch.action)
    if settings.algorithm == "reinforce":
        return losses.reinforce_loss(log_prob, batch.fair, batch.mask)
    return losses.ppo_loss(log_prob, old_log_prob, batch.fair, batch.mask, settings.clip)


@partial(jax.jit, static_argnames=("settings", "with_surgery"))
def _steps(
    state: LearnerState,
    decisions: Decisions,
    order: jax.Array,
    settings: UpdateSettings,
    with_surgery: bool,
    anchor: Anchor | None,
) -> tuple[LearnerState, dict[str, jax.Array]]:
    mask = decisions.mask
    if settings.normalise_advantage:
        # The same scale for both, so that the weight of evenness keeps its meaning.
        _, std = losses.spread(decisions.advantage, mask)
        scaled = decisions.fair / jnp.where(std > 0, std, 1.0)
        decisions = decisions._replace(fair=jnp.where(mask > 0, scaled, 0.0))
        # Over the whole epoch, so that a decision weighs the same in whichever minibatch it falls.
        decisions = decisions._replace(advantage=losses.normalise(decisions.advantage, mask))
    before = _log_prob(state.policy.log_probabilities(decisions.obs), decisions.action)
    value_before = state.policy.value(decisions.obs)
    adam = optimiser(settings)

    def step(
        carry: tuple[ActorCritic, optax.OptState], chosen: jax.Array
    ) -> tuple[tuple[ActorCritic, optax.OptState], tuple[jax.Array, jax.Array, jax.Array]]:
        policy, opt_state = carry
        # Left-over places point behind the end and are filled with zeros, mask included.
        batch, old = jax.tree.map(
            lambda x: jnp.take(x, chosen, axis=0, mode="fill", fill_value=0), (decisions, before)
        )
        (_, (policy_part, value_part)), gradient = jax.value_and_grad(_objective, has_aux=True)(
            policy, batch, old, anchor, settings
        )
        length = optax.tree.norm(gradient)
        if with_surgery:
            # Of the whole epoch: what is even in a minibatch may be uneven in the others.
            uneven = jax.grad(_unevenness)(policy, decisions, before, settings)
            # Both are gradients of losses; the rule is about ascents, and the signs cancel.
            fair = surgery.surgery(uneven, gradient)
            gradient = jax.tree.map(jnp.add, gradient, fair)
        change, opt_state = adam.update(gradient, opt_state)
        if with_surgery:
            change = surgery.off_bias(change, uneven)
        policy = eqx.apply_updates(policy, change)
        return (policy, opt_state), (policy_part, value_part, length)

    (policy, opt_state), (policy_loss, value_loss, grad_norm) = jax.lax.scan(
        step, (state.policy, state.opt_state), order
    )
    log_probabilities = policy.log_probabilities(decisions.obs)
    after = _log_prob(log_probabilities, decisions.action)
    report = {
        "policy_loss": jnp.mean(policy_loss),
        "value_loss": jnp.mean(value_loss),
        "entropy": diagnostics.entropy(log_probabilities, mask),
        "approx_kl": diagnostics.approx_kl(after, before, mask),
        "clip_fraction": diagnostics.clip_fraction(after, before, mask, settings.clip),
        "explained_variance": diagnostics.explained_variance(value_before, decisions.target, mask),
        "grad_norm": jnp.mean(grad_norm),
    }
    return LearnerState(policy=policy, opt_state=opt_state, step=state.step + 1), report


def update(
    state: LearnerState,
    trajectories: Trajectories,
    advantage: Any,
    target: Any,
    settings: UpdateSettings,
    rng: np.random.Generator,
    fair: Any = None,
    anchor: Anchor | None = None,
) -> tuple[LearnerState, UpdateReport]:
    """Change the policy so that decisions with a high advantage become more likely.

    The probabilities of the policy that acted (π_old of Eq. 8) are those of ``state.policy``, so
    the services must come from it.

    Args:
        state: before the update; it stays as it is.
        trajectories: the services of the epoch.
        advantage: how much better each decision was than expected, [N, L].
        target: what the critic should have said, [N, L].
        settings: how to learn.
        rng: deals the decisions into minibatches; only PPO draws from it.
        fair: advantage of each decision towards evenness, [N, L]: its gradient is added by
            gradient surgery, see ``surgery``. None leaves it out.
        anchor: a policy to stay near; None leaves it out.

    Returns:
        The new state and what happened, both perhaps still being computed.

    Raises:
        ValueError: no decision happened, shapes differ, or a number at a decision that happened
            is not finite.
    """
    decisions, count = pack(trajectories, advantage, target, fair)
    capacity = len(decisions.mask)
    if settings.algorithm == "reinforce":
        order = np.arange(capacity, dtype=np.int32)[None]
    else:
        order = deal(count, capacity, settings.passes, settings.minibatches, rng)
    state, report = _steps(state, decisions, order, settings, fair is not None, anchor)
    return state, UpdateReport(**report)
