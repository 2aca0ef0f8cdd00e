"""Products of a step with the gradients of services, for a linear policy by its own formula."""

# pyright: reportMissingImports=false
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from support.extras import wanted

wanted("stable_baselines3", "the extra sb3")

import torch  # noqa: E402
from stable_baselines3.common.policies import (  # noqa: E402
    ActorCriticPolicy,
    MultiInputActorCriticPolicy,
)

from evenhand.adapters.sb3.gradients import examine, weights_of  # noqa: E402

B, O, A, N = 12, 3, 2, 4
SERVICE = np.array([0, 0, 1, -1, 1, 1, 2, 3, -1, 3, 3, 0])


def moved(policy, rng, size=0.1):
    """Change all weights, the critic's too; the weights before."""
    before = weights_of(policy)
    with torch.no_grad():
        for one in policy.parameters():
            one += torch.as_tensor(size * rng.normal(size=one.shape), dtype=one.dtype)
    return before


def linear(action_space=None):
    torch.manual_seed(0)
    space = gym.spaces.Box(-5.0, 5.0, (O,))
    return ActorCriticPolicy(
        space, action_space or gym.spaces.Discrete(A), lambda _: 0.001, net_arch=[]
    )


def by_formula(weight, bias, seen, did):
    """∇ log π of each decision by W and b: (e_a − p) xᵀ and e_a − p, [B, A (O + 1)]."""
    logits = seen @ weight.T + bias
    p = np.exp(logits) / np.exp(logits).sum(axis=1, keepdims=True)
    error = np.eye(A)[did] - p
    return np.concatenate([(error[:, :, None] * seen[:, None]).reshape(len(seen), -1), error], 1)


def test_by_the_formula_of_a_linear_policy():
    rng = np.random.default_rng(0)
    policy = linear()
    before = moved(policy, rng)
    seen, did = rng.normal(size=(B, O)).astype(np.float32), rng.integers(0, A, B)
    directions = rng.normal(size=(N, 11))  # more than are taken at once
    along, lengths, step = examine(
        policy, before, torch.as_tensor(seen), torch.as_tensor(did), SERVICE, directions
    )
    weight, bias = (
        before[f"action_net.{name}"].numpy().astype(float) for name in ("weight", "bias")
    )
    each = by_formula(weight, bias, seen.astype(float), did)
    of_service = np.stack([each[i == SERVICE].sum(axis=0) for i in range(N)])
    now: Any = policy.action_net
    taken = np.concatenate(
        [
            (now.weight.detach().numpy() - weight).ravel(),
            now.bias.detach().numpy() - bias,
        ]
    )
    np.testing.assert_allclose(along, of_service @ taken, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(
        lengths, np.linalg.norm(directions.T @ of_service, axis=1), rtol=1e-4
    )
    assert step == pytest.approx(np.linalg.norm(taken), rel=1e-5)  # the critic's is not in it


@pytest.mark.parametrize("kind", ["continuous", "dict", "shared"])
def test_other_policies_against_numerical_differentiation(kind):
    torch.manual_seed(1)
    rng = np.random.default_rng(1)
    box, two = gym.spaces.Box(-5.0, 5.0, (O,)), gym.spaces.Discrete(A)
    seen = torch.as_tensor(rng.normal(size=(B, O)), dtype=torch.float32)
    did = torch.as_tensor(rng.integers(0, A, B))
    if kind == "continuous":
        policy = ActorCriticPolicy(box, gym.spaces.Box(-1.0, 1.0, (2,)), lambda _: 0.001)
        did = torch.as_tensor(rng.normal(size=(B, 2)), dtype=torch.float32)
    elif kind == "dict":
        space = gym.spaces.Dict({"a": box, "b": gym.spaces.Discrete(3)})
        policy = MultiInputActorCriticPolicy(space, two, lambda _: 0.001)
        seen = {"a": seen, "b": torch.as_tensor(rng.integers(0, 3, (B, 1)))}
    else:
        policy = ActorCriticPolicy(
            box, two, lambda _: 0.001, net_arch=[8], share_features_extractor=True
        )
    before = moved(policy, rng, 0.003)
    after = weights_of(policy)
    directions = rng.normal(size=(N, 3))
    along, lengths, _ = examine(policy, before, seen, did, SERVICE, directions)
    assert lengths.shape == (3,)
    assert (lengths > 0).all()
    for name, one in policy.named_parameters():
        np.testing.assert_array_equal(one.detach(), after[name])  # it is left as it was

    def sums(share):
        with torch.no_grad():
            for name, one in policy.named_parameters():
                one.copy_(before[name] + share * (after[name] - before[name]))
            each = policy.evaluate_actions(seen, did)[1].numpy().astype(float)
        return np.array([each[i == SERVICE].sum() for i in range(N)])

    numerical = sums(0.5) - sums(-0.5)
    np.testing.assert_allclose(along, numerical, rtol=0.02, atol=2e-4)


def test_a_policy_that_did_not_move():
    policy = linear()
    seen = torch.zeros(B, O)
    along, _, step = examine(
        policy, weights_of(policy), seen, torch.zeros(B, dtype=torch.long), SERVICE, np.ones((N, 1))
    )
    assert along.tolist() == [0.0] * N
    assert step == 0.0
