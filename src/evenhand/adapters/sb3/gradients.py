"""The gradients behind self-reflection, of a policy of Stable-Baselines3; see ``reflection``."""

# pyright: reportMissingImports=false
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn
from torch.func import functional_call

Weights = Mapping[str, torch.Tensor]

AT_ONCE = 8
"""Directions in one backward pass; more take more memory."""


def weights_of(policy: ActorCriticPolicy) -> Weights:
    """A copy of all weights of a policy that can learn."""
    return {name: one.detach().clone() for name, one in policy.named_parameters()}


def examine(
    policy: ActorCriticPolicy,
    before: Weights,
    observations: Any,
    actions: torch.Tensor,
    service: np.ndarray,
    directions: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Products of the step that a policy took with the gradients of the services.

    Args:
        policy: after the update.
        before: its weights before it, when it acted.
        observations: of the B decisions, a tensor or a dict of tensors.
        actions: as ``policy.evaluate_actions`` takes them.
        service: which of the n services each decision belongs to, -1 for none, int64 [B].
        directions: weight of each service in each direction, [n, D].

    Returns:
        <step, ∇ log π> of each service [n], length of each direction [D], length of the step. Only
        weights count that the probabilities of actions depend on: the actor's.
    """
    told = torch.as_tensor(service, device=policy.device)
    there = told >= 0
    scorer, n = _Scorer(policy), len(directions)

    def sums(weights: Weights) -> torch.Tensor:
        named = {f"policy.{name}": one for name, one in weights.items()}
        each = functional_call(scorer, named, (observations, actions))
        zero = torch.zeros(n, dtype=each.dtype, device=each.device)
        return zero.index_add(0, told[there], each[there])

    training = policy.training
    policy.set_training_mode(False)  # as it acted
    try:
        start = {name: one.clone().requires_grad_() for name, one in before.items()}
        total = sums(start)
        # the derivative of Σ v_i S_i, which is linear in v: derived by v once more, it gives the
        # product of every service's gradient with the step in two backward passes
        v = torch.ones(n, dtype=total.dtype, device=total.device, requires_grad=True)
        found = torch.autograd.grad(
            total, list(start.values()), v, create_graph=True, allow_unused=True
        )
        actor = {
            name: gradient
            for name, gradient in zip(start, found, strict=True)
            if gradient is not None
        }
        now = dict(policy.named_parameters())
        step = {name: now[name].detach() - before[name] for name in actor}
        product = torch.stack([(actor[name] * step[name]).sum() for name in actor]).sum()
        (along,) = torch.autograd.grad(product, v, retain_graph=True)
        wanted = torch.as_tensor(directions.T, dtype=total.dtype, device=total.device)
        lengths = [
            _lengths(total, [start[name] for name in actor], part) for part in wanted.split(AT_ONCE)
        ]
    finally:
        policy.set_training_mode(training)
    length = torch.stack([one.square().sum() for one in step.values()]).sum().sqrt()
    return _plain(along), _plain(torch.cat(lengths)), float(length)


def _lengths(total: torch.Tensor, weights: list[torch.Tensor], part: torch.Tensor) -> torch.Tensor:
    found = torch.autograd.grad(total, weights, part, retain_graph=True, is_grads_batched=True)
    return torch.stack([one.flatten(1).square().sum(dim=1) for one in found]).sum(dim=0).sqrt()


def _plain(values: torch.Tensor) -> np.ndarray:
    return values.detach().cpu().numpy().astype(float)


class _Scorer(nn.Module):
    """The log probability of actions, as a module that can be called with other weights."""

    def __init__(self, policy: ActorCriticPolicy) -> None:
        super().__init__()
        self.policy = policy

    def forward(self, observations: Any, actions: torch.Tensor) -> torch.Tensor:
        return self.policy.evaluate_actions(observations, actions)[1]
