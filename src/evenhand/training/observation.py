"""What the policy gets to see of an observation."""

from __future__ import annotations

import numpy as np

from evenhand.methods import registry
from evenhand.methods.controls.unaware import unaware
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


def view(settings: TrainSettings, observation: np.ndarray) -> np.ndarray:
    """Observations as the policy takes them: scaled.

    Args:
        settings: of the run; some methods hide who is served.
        observation: float32 [..., G + 3].

    Returns:
        Of the same shape and type.
    """
    out = observed.scale(observation)
    return unaware(out, observation.shape[-1] + task.DISTANCE) if _blind(settings) else out


def _blind(settings: TrainSettings) -> bool:
    return registry.BLINDNESS in registry.needs_of(settings.method)
