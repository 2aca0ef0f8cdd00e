"""What the policy gets to see of an observation."""

from __future__ import annotations

import numpy as np

from evenhand.restaurant import observation as observed
from evenhand.restaurant.simulation import task
from evenhand.restaurant.simulation.native import Network
from evenhand.training.policy import ActorCritic
from evenhand.training.rivals import formulas
from evenhand.training.settings import TrainSettings


def as_network(settings: TrainSettings, policy: ActorCritic) -> Network:
    """The actor with its view of observations, for services as machine code."""
    actor, scale = policy.actor, observed.SCALE.copy()
    if settings.unaware:
        scale[: task.N_GROUPS] = 0.0
    return Network(
        weights=tuple(np.array(w, np.float32) for w in actor.weights),
        biases=tuple(np.array(b, np.float32) for b in actor.biases),
        centre=observed.CENTRE,
        scale=scale,
        relu=actor.activation == "relu",
    )


def view(settings: TrainSettings, observation: np.ndarray) -> np.ndarray:
    """Observations as the policy takes them: scaled.

    Args:
        settings: of the run; ``unaware`` hides who is served.
        observation: float32 [..., 25].

    Returns:
        Of the same shape and type.
    """
    out = observed.scale(observation)
    return formulas.unaware(out, task.N_GROUPS) if settings.unaware else out
