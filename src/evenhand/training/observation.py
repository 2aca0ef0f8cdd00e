"""What the policy gets to see of an observation."""

from __future__ import annotations

import functools

import numpy as np

from evenhand.methods import registry
from evenhand.methods.controls.unaware import unaware
from evenhand.methods.rivals.counterfactual import without_identity
from evenhand.restaurant import floor_plan, serve_people, walks, worlds
from evenhand.restaurant import observation as observed
from evenhand.restaurant.simulation import task
from evenhand.restaurant.simulation.driving import Network
from evenhand.training.policy import ActorCritic
from evenhand.training.settings import TrainSettings


def as_network(settings: TrainSettings, policy: ActorCritic) -> Network:
    """The actor with its view of observations, as machine code."""
    actor = policy.actor
    centre, scale = observed.numbers(len(settings.world.groups))
    if _blind(settings):
        scale[: task.DISTANCE] = 0.0
    return Network(
        weights=tuple(np.array(w, np.float32) for w in actor.weights),
        biases=tuple(np.array(b, np.float32) for b in actor.biases),
        centre=centre,
        scale=scale,
        relu=actor.activation == "relu",
    )


def affine(settings: TrainSettings) -> bool:
    """Whether what the policy sees is a scaled observation, as `as_network` needs it."""
    return not _preprocessed(settings)


def view(settings: TrainSettings, observation: np.ndarray) -> np.ndarray:
    """Observations as the policy takes them: scaled.

    Args:
        settings: of the run; some methods hide who is served, or what depends on it.
        observation: float32 [..., G + 3].

    Returns:
        Of the same shape and type.
    """
    if _preprocessed(settings):
        observation = _of_anybody(settings, observation)
    out = observed.scale(observation)
    hidden = _blind(settings) or _preprocessed(settings)
    return unaware(out, observation.shape[-1] + task.DISTANCE) if hidden else out


def _blind(settings: TrainSettings) -> bool:
    return registry.BLINDNESS in registry.needs_of(settings.method)


def _preprocessed(settings: TrainSettings) -> bool:
    return registry.PREPROCESSING in registry.needs_of(settings.method)


_WALKS = 3000
"""Walks that tell what identity does to readings."""
_SEED = 2_000_000


def _of_anybody(settings: TrainSettings, observation: np.ndarray) -> np.ndarray:
    """Observations whose distance is what it would be of anybody on average."""
    world = settings.world
    effect = identity_effects(settings.scenario, settings.population)
    found = np.array(observation, np.float32)
    step = np.rint(found[..., task.STEPS] * floor_plan.MAX_STEPS / world.interval).astype(int)
    found[..., task.DISTANCE] = without_identity(
        found[..., task.DISTANCE], found[..., : task.DISTANCE], effect,
        np.minimum(step, len(effect) - 1),
    )  # fmt: skip
    return found


@functools.lru_cache(maxsize=16)
def identity_effects(scenario: str, population: str | None) -> np.ndarray:
    """What identity does to the distance in an observation, [T, G].

    Least squares of the readings of walking robots at each step on identities, effects that add
    up. A robot that walks sees the same whatever its policy, so this is measured once.

    Args:
        scenario: where.
        population: where people are drawn from instead.
    """
    world = worlds.scenario(scenario, population)
    engine = serve_people.engine(world, _WALKS)
    ahead = serve_people.draw(world, _WALKS, np.random.default_rng(_SEED), engine)
    seen = walks.walk(engine, ahead).observation
    identity = seen[:, 0, : task.DISTANCE].astype(float)
    centre = identity.mean(axis=0)
    distance = seen[..., task.DISTANCE].astype(float)
    slope = np.linalg.lstsq(identity - centre, distance - distance.mean(axis=0), rcond=None)[0]
    return slope.T - (slope.T @ centre)[:, None] / len(world.identities)
