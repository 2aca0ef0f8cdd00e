"""Time to train one PPO arm of the restaurant: Evenhand, and Stable-Baselines3 in three ways.

All do the same work: they serve as many people by the same untrained behaviour, and take as many
gradient steps, each on as many decisions. The learning rate is next to nothing, so that behaviour,
and with it the work, stays the same on all sides; a step takes as long whatever it moves. Sides
take turns, and every ratio is a median over rounds, of wall time: the learners may use all cores.
Each turn has a process of its own, as where people train: beside PyTorch and the other environments
Evenhand would take up to a third longer. It is a whole training: in a fraction of a second Evenhand
would be measured while the processors wake. PyTorch has one thread or all, whatever is faster in a
short try.
"""

# pyright: reportMissingImports=false
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

from benchmarks import environment
from evenhand.adapters import JudgeSettings
from evenhand.adapters.restaurant import SCHEME, facts_of
from evenhand.core import extras
from evenhand.core import terminal as display
from evenhand.core.errors import whole
from evenhand.core.processes import Task, Tell, run_all
from evenhand.core.processors import CORES, Others
from evenhand.methods import detector_file
from evenhand.restaurant.env import RestaurantEnv
from evenhand.training import train
from evenhand.training.jax_setup import set_up_jax
from evenhand.training.settings import TrainSettings, settings_of

STILL = 1e-12
"""Learning rate."""
_ROUNDS = 3
_TRY = 8
"""Rollouts by which the number of threads is chosen."""
SIDES = {
    "evenhand": "Evenhand",
    "adapter": "Stable-Baselines3, adapter",
    "guided": "the same, guided and examined",
    "sync": "Stable-Baselines3, Gymnasium's SyncVectorEnv",
    "dummy": "Stable-Baselines3, its DummyVecEnv",
}
"""Who takes part, in the order of turns, and what the table calls them."""


@dataclass(frozen=True)
class Turn:
    """What one side did in its turn."""

    seconds: float
    services: int
    decisions: int
    gradient_steps: int


def measure(epochs: int = 300) -> dict[str, Any]:
    """Train in turns.

    Args:
        epochs: of 30 services, in a turn; as many as ``evenhand train`` takes.

    Returns:
        ``sb3_physics_s``: seconds that a bare loop of ``mj_step`` (``bench.bare``) takes for 1,000
        such services; ``sb3_ratio``: wall time of Stable-Baselines3 over Gymnasium's
        ``SyncVectorEnv`` to Evenhand's; ``sb3_ratio_dummy``: over its own ``DummyVecEnv``, to
        Evenhand's; ``sb3_ratio_adapter``: over the adapter, to Evenhand's;
        ``sb3_ratio_callback``: over the adapter with guidance and self-reflection, to the same
        without; ``sb3_others``: share of the processors that other work took meanwhile, None
        where not known; and for each side seconds for 1,000 services, decisions a second,
        decisions of a service, gradient steps and their size.

    Raises:
        InputError: when Stable-Baselines3 is not there or too old, or for no epochs.
        WorkerLostError: when a process died.
    """
    whole("epochs", epochs, 2, 1000)
    extras.require("sb3", "this measurement")
    settings = settings_of("service", "ppo", "service", epochs=epochs)
    update = replace(settings.update, learning_rate=STILL, anneal_updates=None)
    settings = replace(settings, update=update, reflect=False)
    turns: dict[str, list[Turn]] = {name: [] for name in SIDES}
    bare, rates, others = environment.bare(), [], Others()
    first = _apart("evenhand", settings, 1)
    steps = round(first.decisions / first.services)  # as long as services are
    for _ in range(_ROUNDS):
        began = perf_counter()
        rates.append(bare(1.0)[0] / (perf_counter() - began))
        for name in SIDES:
            turns[name].append(_apart(name, settings, steps))

    def ratio(a: str, b: str) -> float:
        pairs = zip(turns[a], turns[b], strict=True)
        each = [(x.seconds / x.services) / (y.seconds / y.services) for x, y in pairs]
        return round(float(np.median(each)), 2)

    driven = 1000 * first.decisions / first.services * settings.world.interval
    return {
        "sb3_physics_s": round(driven / float(np.median(rates)), 2),
        "sb3_ratio": ratio("sync", "evenhand"),
        "sb3_ratio_dummy": ratio("dummy", "evenhand"),
        "sb3_ratio_adapter": ratio("adapter", "evenhand"),
        "sb3_ratio_callback": ratio("guided", "adapter"),
        "sb3_others": others.share(),
        "sb3_sides": {name: _told(each) for name, each in turns.items()},
    }


def _apart(name: str, settings: TrainSettings, steps: int) -> Turn:
    """A turn in a process of its own."""
    arguments = {"name": name, "settings": settings, "steps": steps}
    [turn] = run_all([Task(SIDES[name], _turn, arguments)], 1, lambda *_: None, apart=True)
    return turn


def _turn(*, tell: Tell, name: str, settings: TrainSettings, steps: int) -> Turn:
    """A turn of one side; what getting ready takes is not counted."""
    del tell
    if name == "evenhand":
        set_up_jax()
        _evenhand(settings)  # compiles
        return _evenhand(settings)
    make = {"sync": _sync, "dummy": _dummy}.get(name, _adapter)
    return _sb3(settings, make, steps, guided=name == "guided")


def _adapter(lanes: int) -> Any:
    """The whole room at once."""
    from evenhand.adapters import sb3

    return sb3.restaurant(lanes, seed=0)


def _sync(lanes: int) -> Any:
    """Single environments in a vector environment of Gymnasium."""
    from stable_baselines3.common.vec_env import VecMonitor

    from evenhand.adapters.sb3 import ServiceVecEnv

    mode = {"autoreset_mode": AutoresetMode.SAME_STEP}
    envs = gym.make_vec(
        "evenhand/Restaurant-v0", lanes, vectorization_mode="sync", vector_kwargs=mode
    )
    return VecMonitor(ServiceVecEnv(envs))


def _dummy(lanes: int) -> Any:
    """Single environments in a vector environment of Stable-Baselines3."""
    from stable_baselines3.common.env_util import make_vec_env

    return make_vec_env(RestaurantEnv, lanes, seed=0)


def _told(turns: list[Turn]) -> dict[str, float]:
    services = sum(turn.services for turn in turns)
    decisions = sum(turn.decisions for turn in turns)
    steps = sum(turn.gradient_steps for turn in turns)
    seconds = [turn.seconds / turn.services for turn in turns]
    return {
        "seconds_per_1000_services": round(1000 * float(np.median(seconds)), 2),
        "decisions_per_s": round(decisions / sum(turn.seconds for turn in turns)),
        "decisions_per_service": round(decisions / services, 1),
        "gradient_steps": steps,
        "decisions_per_gradient_step": round(decisions * 4 / steps),
    }


def _evenhand(settings: TrainSettings) -> Turn:
    judge = detector_file.load(detector_file.SHIPPED)
    began, physics = perf_counter(), 0
    for record in train.train(settings, judge, threads=CORES):
        physics += record.numbers["physics_steps"]
    spent = perf_counter() - began
    # a service that is answered ends by a decision in which nobody drives
    services = settings.people * settings.epochs
    steps = settings.epochs * settings.update.passes * settings.update.minibatches
    return Turn(spent, services, physics // settings.world.interval + services, steps)


def _sb3(settings: TrainSettings, make: Callable[[int], Any], steps: int, guided: bool) -> Turn:
    """Train by Stable-Baselines3 with the same network and settings."""
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback, CallbackList
    from stable_baselines3.common.logger import Logger

    from evenhand.adapters.sb3 import EvennessCallback

    class Until(BaseCallback):
        """Stops when so many services have ended."""

        def __init__(self, services: int) -> None:
            super().__init__()
            self.services, self.ended = services, 0

        def _on_step(self) -> bool:
            self.ended += int(self.locals["dones"].sum())
            return self.ended < self.services

    update, wanted = settings.update, settings.people * settings.epochs
    while steps * settings.people % update.minibatches:  # steps of one size
        steps += 1
    model = PPO(
        "MlpPolicy",
        make(settings.people),
        learning_rate=STILL,
        n_steps=steps,
        batch_size=steps * settings.people // update.minibatches,
        n_epochs=update.passes,
        gamma=update.gamma or 0.0,
        gae_lambda=update.gae_lambda,
        clip_range=update.clip,
        ent_coef=update.entropy_coefficient,
        vf_coef=update.value_coefficient,
        max_grad_norm=update.max_grad_norm,
        policy_kwargs={"net_arch": list(settings.policy.hidden)},
        device="cpu",
        seed=0,
    )
    model.set_logger(Logger(None, []))  # else each call of learn leaves a folder
    rate = settings.policy.initial_response_rate
    policy: Any = model.policy
    with torch.no_grad():
        policy.action_net.bias.copy_(torch.log(torch.tensor([1 - rate, rate])))

    def learns(threads: int) -> float:
        torch.set_num_threads(threads)
        began = perf_counter()
        model.learn(_TRY * steps * settings.people)
        return perf_counter() - began

    learns(1)  # to get warm
    torch.set_num_threads(min({1, CORES}, key=learns))
    until = Until(wanted)
    callbacks: list[BaseCallback] = [until]
    if guided:
        chosen = JudgeSettings(method="levelup")
        callbacks.append(EvennessCallback(SCHEME, facts_of, settings=chosen))
    updates = model._n_updates
    began = perf_counter()
    model.learn(10**9, CallbackList(callbacks))
    spent = perf_counter() - began
    taken = (model._n_updates - updates) * update.minibatches
    return Turn(spent, until.ended, model.num_timesteps, taken)


def show(found: dict[str, Any]) -> None:
    """Print the measurements."""
    sides, others = found["sb3_sides"], found["sb3_others"]
    busy = "" if others is None else f" (other work took {others:.0%} of {CORES} cores)"
    display.table(
        f"Training by PPO: Gymnasium's environments take {found['sb3_ratio']} times as long as "
        f"Evenhand, those of Stable-Baselines3 {found['sb3_ratio_dummy']}, the adapter "
        f"{found['sb3_ratio_adapter']}; the callback {found['sb3_ratio_callback']} times that"
        + busy,
        (
            "",
            "s for 1,000 services",
            "decisions a second",
            "decisions a service",
            "a gradient step",
        ),
        [
            (
                label,
                sides[name]["seconds_per_1000_services"],
                sides[name]["decisions_per_s"],
                sides[name]["decisions_per_service"],
                sides[name]["decisions_per_gradient_step"],
            )
            for name, label in SIDES.items()
        ]
        + [("bare mj_step, nobody learns", found["sb3_physics_s"], "", "", "")],
    )
