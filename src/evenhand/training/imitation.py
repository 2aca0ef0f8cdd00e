"""Imitation: a policy that first learns from biased scripted robots (scenario ``prejudiced``).

Behaviour cloning (Pomerleau 1991): the likelihood of what the robots did is raised. Each service is
given by one of the biased robots, so what is learned is a mixture of their prejudices, as a policy
would take it over from logs of unlike staff. Training is then held near what was imitated, as is
usual where a policy is to keep its manners (kickstarting, Schmitt et al. 2018): without that, a
service reward alone repairs the prejudice within some epochs. Demonstrations are synthetic.

That society's bias reaches robots by demonstration is measured for drivers: Black pedestrians wait
32 % longer and are passed by twice as many cars (Goddard et al. 2015).
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax

from evenhand.methods.paper import losses
from evenhand.restaurant import robots
from evenhand.restaurant.serve_people import serve_people
from evenhand.restaurant.worlds import World
from evenhand.training.batches import Decisions, Trajectories, pack
from evenhand.training.policy import ActorCritic, of_networks
from evenhand.training.update import LearnerState

SERVICES = 900
"""Demonstrations."""
PULL = 0.3
"""How strongly training is held near what was imitated, see ``update.Anchor``."""
_STEPS, _BATCH, _RATE = 300, 2048, 3e-3


def demonstrate(world: World, rng: np.random.Generator) -> Trajectories:
    """Services of biased robots, each given by one of them.

    Args:
        world: where; its ``prejudice`` is the strength of their bias.
        rng: source of all randomness.
    """
    biased = [robots.ScriptedRobot(name, world.prejudice) for name in robots.BIASES]

    def choose(codes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        each = np.stack([one.odds(codes) for one in biased])
        odds = each[rng.integers(len(each), size=SERVICES), np.arange(SERVICES)]
        return robots.draw_manners(odds, rng)

    done = serve_people(world, robots.Mannered(choose), SERVICES, rng)
    return Trajectories(done.observation, done.action, done.mask)


def imitate(state: LearnerState, shown: Trajectories, rng: np.random.Generator) -> LearnerState:
    """Raise the likelihood of what was shown.

    Args:
        state: an untrained learner.
        shown: demonstrations.
        rng: draws the batches.

    Returns:
        The learner with another actor; its optimiser and its critic are untouched. A policy
        without an actor of its own is changed as a whole.
    """
    nothing = np.zeros(np.shape(shown.mask), np.float32)
    decisions, count = pack(shown, nothing, nothing)
    chosen = rng.integers(count, size=(_STEPS, _BATCH)).astype(np.int32)
    cloned = _clone(state.policy, decisions, chosen)
    if of_networks(cloned):
        return eqx.tree_at(lambda s: s.policy.actor, state, cloned.actor)
    return eqx.tree_at(lambda s: s.policy, state, cloned)


@jax.jit
def _clone(policy: ActorCritic, decisions: Decisions, order: jax.Array) -> ActorCritic:
    optimiser = optax.adam(_RATE)

    def loss(policy: ActorCritic, chosen: jax.Array) -> jax.Array:
        batch = jax.tree.map(lambda x: jnp.take(x, chosen, axis=0), decisions)
        log_probabilities = policy.log_probabilities(batch.obs)
        each = jnp.take_along_axis(log_probabilities, batch.action[:, None], axis=1)[:, 0]
        return losses.reinforce_loss(each, jnp.ones_like(each), batch.mask)

    def step(
        carry: tuple[ActorCritic, optax.OptState], chosen: jax.Array
    ) -> tuple[tuple[ActorCritic, optax.OptState], None]:
        policy, memory = carry
        change, memory = optimiser.update(jax.grad(loss)(policy, chosen), memory)
        return (eqx.apply_updates(policy, change), memory), None

    start = policy, optimiser.init(eqx.filter(policy, eqx.is_array))
    return jax.lax.scan(step, start, order)[0][0]
