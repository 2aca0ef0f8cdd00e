"""What the policy gets to see of an observation."""

from __future__ import annotations

import numpy as np

from evenhand.restaurant.simulation import task
from evenhand.restaurant.simulation.native import Network
from evenhand.training.policy import ActorCritic
from evenhand.training.rivals import formulas
from evenhand.training.settings import TrainSettings

_CENTRE, _SCALE = (0.3, 0.3, 0.0), (6.0, 3.0, 1.0)
"""Of distance, time and age, behind the groups: a policy has to tell 1.0 m from 1.5 m, which in an
observation are 0.2 and 0.3. Spread out like this, 0.6 apart, they are learned in a fraction of the
services. The time likewise."""


def as_network(settings: TrainSettings, policy: ActorCritic) -> Network:
    """The actor with its view of observations, for services as machine code."""
    actor = policy.actor
    centre, scale = _numbers(len(settings.world.groups))
    if settings.unaware:
        scale[: task.DISTANCE] = 0.0
    return Network(
        weights=tuple(np.array(w, np.float32) for w in actor.weights),
        biases=tuple(np.array(b, np.float32) for b in actor.biases),
        centre=centre,
        scale=scale,
        relu=actor.activation == "relu",
    )


def view(settings: TrainSettings, observation: np.ndarray) -> np.ndarray:
    """Observations as the policy takes them: distance and time centred and spread out.

    Args:
        settings: of the run; ``unaware`` hides who is served.
        observation: float32 [..., G + 3].

    Returns:
        Of the same shape and type.
    """
    groups = observation.shape[-1] + task.DISTANCE
    centre, scale = _numbers(groups)
    out = (observation - centre) * scale
    return formulas.unaware(out, groups) if settings.unaware else out


def _numbers(groups: int) -> tuple[np.ndarray, np.ndarray]:
    """What is taken from an observation of so many groups, and what it is multiplied by then."""
    return (
        np.array([*np.zeros(groups), *_CENTRE], np.float32),
        np.array([*np.ones(groups), *_SCALE], np.float32),
    )
