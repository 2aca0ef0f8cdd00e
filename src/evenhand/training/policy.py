"""The robot's policy: an actor A(S) and a critic C(S), and the actor's NumPy twin for acting.

The paper gives the robot "an Actor-Critic network denoted as A(S_t), C(S_t, a_t)". Two things
are repaired or chosen here:

* the critic is V(S), without the action: a baseline that depends on the action that it judges
  would bias the gradient of Eq. 6-8 (repaired);
* size, activation and initial values (chosen; the paper is silent).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.special import expit

from evenhand.core import forks, plugins
from evenhand.core.errors import InputError, unknown

WALK = 0
RESPOND = 1
MOST_HIDDEN = (16, 4096)
"""Most hidden layers, and most units of one: larger networks fill the memory of a machine."""

_ACTIVATIONS: dict[str, Callable[[jax.Array], jax.Array]] = {"tanh": jnp.tanh, "relu": jax.nn.relu}


def _numpy_relu(x: np.ndarray, out: np.ndarray) -> np.ndarray:
    return np.maximum(x, 0.0, out=out)


_NUMPY_ACTIVATIONS: dict[str, Callable[..., np.ndarray]] = {"tanh": np.tanh, "relu": _numpy_relu}


@dataclass(frozen=True)
class PolicySettings:
    """Size and first behaviour of actor and critic."""

    kind: str = "mlp"
    """Which network: mlp, or one of your own, see ``register_policy``."""

    hidden: tuple[int, ...] = (64, 64)
    """Units of each hidden layer, the same for actor and critic."""

    activation: Literal["tanh", "relu"] = "tanh"
    """Activation of the hidden layers."""

    initial_response_rate: float = 0.04
    """Probability that the untrained robot responds at one decision. With 0.5 it would end nearly
    every service within three decisions and never come near anybody; with 0.04 it takes 23
    decisions on average (2.3 s at 10 Hz) and meets every distance from the start to the person."""

    def __post_init__(self) -> None:
        if self.kind not in names():
            raise unknown("policy", self.kind, names())
        layers, units = MOST_HIDDEN
        if not 1 <= len(self.hidden) <= layers or not all(1 <= n <= units for n in self.hidden):
            raise InputError(
                "range hidden",
                f"hidden is {self.hidden}; give 1 to {layers} layers, each of 1 to {units:,} units",
            )
        if self.activation not in _ACTIVATIONS:
            raise unknown("activation", self.activation, _ACTIVATIONS)
        if not 0.0 < self.initial_response_rate < 1.0:
            raise InputError(
                "range initial_response_rate",
                f"initial_response_rate is {self.initial_response_rate}; "
                "give a probability above 0 and below 1",
            )


class Policy(Protocol):
    """What can be trained: an Equinox module, or any other tree of arrays, that tells these."""

    def log_probabilities(self, obs: jax.Array) -> jax.Array:
        """Log π(a | s) of walk and respond, [..., 2], for observations [..., O]."""
        ...

    def value(self, obs: jax.Array) -> jax.Array:
        """V(s), [...], for observations [..., O]."""
        ...


Make = Callable[[int, PolicySettings, np.random.Generator], Any]
"""(numbers in an observation, settings, source of the weights) -> an untrained policy."""


class _Registered(NamedTuple):
    make: Make
    place: str
    source: str | None


GROUP = "evenhand.policies"
"""Entry point by which packages bring policies."""
_POLICIES: dict[str, _Registered] = {}


def register_policy(name: str, make: Make) -> None:
    """Add a kind of policy, which can then be chosen by its name (``PolicySettings.kind``).

    Args:
        name: letters, digits, ``_``, ``-`` and dots.
        make: makes an untrained ``Policy`` from the size of an observation, settings and a source
            of randomness.

    Raises:
        InputError: for a name that is taken or cannot be one.
    """
    plugins.check_name("policy", name)
    place, source = plugins.origin(sys._getframe(1), make)
    if name in _POLICIES and _POLICIES[name].place != place:
        raise InputError(
            "duplicate policy",
            f"there is a policy {name!r} already: register yours by another name",
        )
    _POLICIES[name] = _Registered(make, place, source)


def names() -> tuple[str, ...]:
    """Of all kinds of policies."""
    plugins.ready(GROUP)
    return tuple(_POLICIES)


def sources(name: str) -> dict[str, str]:
    """Fingerprint of the file of a policy that is not Evenhand's own."""
    text = _POLICIES[name].source
    return {} if text is None else {f"policy {name}": text}


def make_policy(obs_size: int, settings: PolicySettings, rng: np.random.Generator) -> Any:
    """An untrained policy of the kind that the settings name.

    Raises:
        InputError: when it does not tell two probabilities and a value of an observation.
    """
    made = _POLICIES[settings.kind].make(obs_size, settings, rng)
    if of_networks(made):
        return made
    odd = [leaf for leaf in jax.tree.leaves(made) if not isinstance(leaf, jax.Array | np.ndarray)]
    if odd:
        raise InputError(
            "type policy",
            f"policy {settings.kind!r} holds {odd[0]!r} among its weights: keep arrays there, and "
            "everything else in static fields (equinox.field(static=True))",
        )
    seen = jax.ShapeDtypeStruct((1, obs_size), jnp.float32)
    try:
        found = jax.eval_shape(lambda p, x: (p.log_probabilities(x), p.value(x)), made, seen)
    except AttributeError as error:
        raise InputError(
            "missing policy",
            f"policy {settings.kind!r}: what its function makes lacks log_probabilities or value "
            f"({error})",
        ) from error
    shapes = [one.shape for one in found]
    if shapes != [(1, 2), (1,)]:
        raise InputError(
            "shape policy",
            f"policy {settings.kind!r} gives log_probabilities of shape {list(shapes[0])} and "
            f"value of shape {list(shapes[1])} for one observation: give [1, 2] and [1]",
        )
    return made


class Network(eqx.Module):
    """A plain multilayer perceptron.

    Attributes:
        weights: one matrix a layer, shape [inputs, outputs].
        biases: one vector a layer, shape [outputs].
        activation: of every layer but the last.
    """

    weights: tuple[jax.Array, ...]
    biases: tuple[jax.Array, ...]
    activation: str = eqx.field(static=True)

    def __call__(self, x: jax.Array) -> jax.Array:
        """Outputs [..., outputs] for inputs [..., inputs]."""
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = _ACTIVATIONS[self.activation](x @ weight + bias)
        return x @ self.weights[-1] + self.biases[-1]


class ActorCritic(eqx.Module):
    """Separate networks for what to do and for how good the state is.

    Attributes:
        actor: two outputs, the logits of {walk, respond}: the paper's A(S_t).
        critic: one output, the expected return of the state: the paper's C(S_t, a_t) without a_t.
    """

    actor: Network
    critic: Network

    def log_probabilities(self, obs: jax.Array) -> jax.Array:
        """Log π(a | s) of both actions, [..., 2], for observations [..., O]."""
        return jax.nn.log_softmax(self.actor(obs))

    def value(self, obs: jax.Array) -> jax.Array:
        """V(s), [...], for observations [..., O]."""
        return self.critic(obs)[..., 0]


def orthogonal(rows: int, columns: int, gain: float, rng: np.random.Generator) -> np.ndarray:
    """A random matrix whose shorter side is orthogonal, times ``gain``.

    Done in NumPy because a compiled JAX function that runs LAPACK can hang for ever on two cores.

    Returns:
        float32 [rows, columns]; with W for the result, WᵀW = gain²·1 when rows >= columns, else
        WWᵀ = gain²·1.
    """
    tall = rng.standard_normal((max(rows, columns), min(rows, columns)))
    q, r = np.linalg.qr(tall)
    q = q * np.sign(np.diag(r))  # makes the draw uniform over orthogonal matrices
    return (gain * (q if rows >= columns else q.T)).astype(np.float32)


def _network(
    sizes: Sequence[int],
    head_gain: float,
    head_bias: Sequence[float],
    activation: str,
    rng: np.random.Generator,
) -> Network:
    gains = [math.sqrt(2.0)] * (len(sizes) - 2) + [head_gain]
    weights = [
        orthogonal(rows, columns, gain, rng)
        for rows, columns, gain in zip(sizes[:-1], sizes[1:], gains, strict=True)
    ]
    biases = [np.zeros(size, np.float32) for size in sizes[1:-1]]
    biases.append(np.asarray(head_bias, np.float32))
    return Network(
        weights=tuple(jnp.asarray(w) for w in weights),
        biases=tuple(jnp.asarray(b) for b in biases),
        activation=activation,
    )


def mlp(obs_size: int, settings: PolicySettings, rng: np.random.Generator) -> ActorCritic:
    """An untrained policy.

    Orthogonal weights with gain √2 in hidden layers, 0.01 in the actor's head and 1 in the
    critic's (the usual choice for PPO); biases 0, except the actor's head, which gives
    ``settings.initial_response_rate``.

    Args:
        obs_size: numbers in one observation.
        settings: size and first behaviour.
        rng: source of the weights; the actor's layers are drawn first, then the critic's.

    Raises:
        InputError: ``obs_size`` is below 1, or in a process that was forked after JAX was used.
    """
    forks.check_jax()
    if obs_size < 1:
        raise InputError(
            "range obs_size", f"obs_size is {obs_size}; an observation has at least 1 number"
        )
    rate = settings.initial_response_rate
    half_odds = 0.5 * math.log(rate / (1.0 - rate))
    sizes = [obs_size, *settings.hidden]
    actor = _network([*sizes, 2], 0.01, [-half_odds, half_odds], settings.activation, rng)
    critic = _network([*sizes, 1], 1.0, [0.0], settings.activation, rng)
    return ActorCritic(actor=actor, critic=critic)


@jax.jit
def response_probability(policy: ActorCritic, obs: Any) -> jax.Array:
    """π(respond | s), float32 [...], for observations [..., O]: the reference for `Actor`."""
    return jnp.exp(policy.log_probabilities(jnp.asarray(obs, jnp.float32))[..., RESPOND])


@jax.jit
def state_values(policy: ActorCritic, obs: Any) -> jax.Array:
    """V(s), float32 [...], for observations [..., O]; compiles once for each shape."""
    return policy.value(jnp.asarray(obs, jnp.float32))


def of_networks(policy: Any) -> bool:
    """Whether a policy is a plain ``ActorCritic``, which NumPy and machine code can follow."""
    return type(policy) is ActorCritic and isinstance(policy.actor, Network)


def respond(policy: Any) -> Callable[[np.ndarray], np.ndarray]:
    """π(respond | s), [N], for observations [N, O], as fast as the policy allows."""
    if of_networks(policy):
        return Actor(policy).probability
    return lambda obs: np.asarray(response_probability(policy, obs))


class Actor:
    """A NumPy copy of the actor for use inside the control loop.

    For 30 observations it answers in about 25 µs, where a call into JAX costs more than 100 µs.
    It does not follow later updates of the policy: make a new one for every epoch.
    """

    def __init__(self, policy: ActorCritic) -> None:
        network = policy.actor
        self._hidden = [
            (np.array(w, np.float32), np.array(b, np.float32))
            for w, b in zip(network.weights[:-1], network.biases[:-1], strict=True)
        ]
        self._activate = _NUMPY_ACTIVATIONS[network.activation]
        # With two actions only the difference of the logits matters.
        head = np.array(network.weights[-1], np.float32)
        bias = np.array(network.biases[-1], np.float32)
        self._head = head[:, RESPOND] - head[:, WALK]
        self._bias = bias[RESPOND] - bias[WALK]

    def probability(self, obs: np.ndarray) -> np.ndarray:
        """π(respond | s), float32 [N], for observations [N, O]."""
        x = np.asarray(obs, np.float32)
        for weight, bias in self._hidden:
            x = x @ weight
            x += bias
            self._activate(x, out=x)
        odds = x @ self._head
        odds += self._bias
        return expit(odds)


register_policy("mlp", mlp)
