"""What can be set of a run of training, and the settings of the experiments' arms."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from evenhand.core.errors import InputError, unknown, whole
from evenhand.methods import guidance, registry
from evenhand.methods.beyond.reflection import ReflectionSettings
from evenhand.methods.issue_weights import IssueWeights
from evenhand.methods.paper import rewards
from evenhand.methods.paper.issues import Issue
from evenhand.methods.scheme import Scheme
from evenhand.restaurant import worlds
from evenhand.training.learners import LEARNERS
from evenhand.training.policy import PolicySettings
from evenhand.training.update import UpdateSettings

PRESETS = ("paper", "service")


@dataclass(frozen=True)
class TrainSettings:
    """One run of training."""

    preset: Literal["paper", "service"] = "service"
    """paper: the reward is Eq. 4/5 and nothing else, and the advantage runs over people (Eq. 6).
    service: service quality plus Eq. 4/5, and every service is an episode."""

    seed: int = 0
    """Of everything random in the run."""

    epochs: int = 300
    """Updates."""

    people: int = 30
    """Services in one epoch."""

    scenario: str = "even"
    """Where unevenness comes from, see ``worlds``; several are joined by a plus."""

    population: str | None = None
    """Where people are drawn from; none means that of the scenario."""

    threshold: float = 0.5
    """Manual threshold on the total issue score, which is counted beside the detector."""

    method: Any = "penalty"
    """The way to serve: NAME, NAME@STRENGTH or an object, see ``methods.registry``."""

    tau: tuple[float, ...] = rewards.TAU["equal"]
    """Weight of each issue, in evenness and in self-reflection; all alike by default."""

    judges: IssueWeights | None = None
    """What people mind: the weights of the issues, in place of tau; see ``methods.issue_weights``.
    Where they were asked of too near and too far, evenness weighs these in place of quality."""

    reflect: bool = True
    """Examine every update along the bias gradient."""

    reflection: ReflectionSettings = field(default_factory=ReflectionSettings)
    """When an update is abnormal."""

    update: UpdateSettings = field(default_factory=UpdateSettings)
    """How it learns."""

    policy: PolicySettings = field(default_factory=PolicySettings)
    """The network."""

    def __post_init__(self) -> None:
        if self.preset not in PRESETS:
            raise unknown("preset", self.preset, PRESETS)
        object.__setattr__(self, "method", registry.as_method(self.method))
        object.__setattr__(self, "tau", self._tau())  # a wrong scenario is said here, too
        self._check_method()
        whole("seed", self.seed, 0, 2**32 - 1)
        whole("epochs", self.epochs, 1, 1_000_000)
        if self.update.gamma is None:
            gamma = 0.99 if self.preset == "paper" else 1.0
            object.__setattr__(self, "update", replace(self.update, gamma=gamma))
        if self.update.anneal_updates is None:
            annealed = replace(self.update, anneal_updates=self.epochs)
            object.__setattr__(self, "update", annealed)
        whole("people", self.people, 2, 10_000)
        if not 0.0 <= self.threshold < np.inf:
            raise InputError("range threshold", f"threshold is {self.threshold}: give 0 or more")

    @cached_property
    def world(self) -> worlds.World:
        """Of the scenario, with the population that was chosen."""
        return worlds.scenario(self.scenario, self.population)

    @cached_property
    def scheme(self) -> Scheme:
        """Identities, facts and issues that evenness weighs; scored are those of the world."""
        scheme = self.world.scheme
        return scheme if self.judges is None else replace(scheme, issues=self._issues)

    @cached_property
    def _issues(self) -> tuple[Issue, ...]:
        issues = self.world.scheme.issues
        return issues if self.judges is None else self.judges.of(issues)

    def __getstate__(self) -> dict[str, Any]:
        # without the world, whose rules may be functions that no other process can be sent
        return {one.name: getattr(self, one.name) for one in fields(self)}

    def elsewhere(self, scenario: str | None, population: str | None) -> worlds.World:
        """Where to test what was trained; what is None is as in training."""
        if scenario is None:
            scenario, population = self.scenario, population or self.population
        return worlds.scenario(scenario, population)

    def _tau(self) -> tuple[float, ...]:
        issues = self.world.scheme.issue_names
        if self.judges is not None:
            _ = self._issues
            if tuple(self.tau) not in (rewards.TAU["equal"], self.judges.tau):
                raise InputError(
                    "conflict tau", "tau and judges both give weights of the issues: give one"
                )
            return self.judges.tau
        if tuple(self.tau) == rewards.TAU["equal"]:
            return (1.0,) * len(issues)
        if len(self.tau) != len(issues):
            raise InputError(
                "conflict tau",
                f"tau is {self.tau}, and scenario {self.scenario!r} has {len(issues)} issues "
                f"({', '.join(issues)}): leave tau out, and they weigh alike",
            )
        return tuple(rewards.check_tau(self.tau, len(issues)).tolist())

    @property
    def all_answers(self) -> bool:
        """Whether every moment of responding is weighed."""
        return self.update.credit == "all_answers"

    def _check_method(self) -> None:
        name = registry.name_of(self.method)
        if self.all_answers and self.preset == "paper":
            raise InputError(
                "conflict credit",
                "preset paper learns from decisions that were taken (Eq. 6 runs over people), and "
                "credit all_answers from all: choose credit sampled (algorithm ppo or reinforce), "
                "or the preset service",
            )
        if self.all_answers and self.world.party > 1:
            raise InputError(
                "conflict credit",
                f"in scenario {self.scenario!r} an answer takes time from the next person, and "
                "credit all_answers needs answers that change nothing but the end: choose credit "
                "sampled (algorithm ppo or reinforce)",
            )
        if self.all_answers and not guidance.weighs_answers(self.method):
            raise InputError(
                "conflict credit",
                f"method {name} says what services that happened are worth, and credit all_answers "
                "asks what others would have been: give it a worth, or choose credit sampled "
                "(algorithm ppo or reinforce)",
            )
        if self.preset == "paper" and not hasattr(self.method, "alone"):
            raise InputError(
                "conflict preset",
                f"preset paper rewards Eq. 4/5 and nothing else, and {name} needs a service "
                "reward: choose score or penalty, or the preset service",
            )
        if self.preset == "paper" and self.world.tips:
            raise InputError(
                "conflict preset",
                "preset paper rewards Eq. 4/5 and nothing else, so nobody would tip in scenario "
                f"{self.scenario!r}: choose the preset service, or a scenario without tips",
            )


def settings_of(
    name: str,
    algorithm: str,
    method: Any,
    *,
    seed: int = 0,
    epochs: int = 300,
    population: str | None = None,
) -> TrainSettings:
    """The settings of one arm of the experiment.

    Args:
        name: paper or service.
        algorithm: one of ``learners.LEARNERS``.
        method: its name, with a strength perhaps, or the method.
        seed: of the run.
        epochs: updates.
        population: where people are drawn from; that of the scenario by default.

    Raises:
        InputError: as ``TrainSettings``.
    """
    if algorithm not in LEARNERS:
        raise unknown("algorithm", algorithm, LEARNERS)
    return TrainSettings(
        preset=name,  # type: ignore[arg-type]
        seed=seed,
        epochs=epochs,
        population=population,
        method=method,
        update=UpdateSettings(*LEARNERS[algorithm]),  # type: ignore[arg-type]
    )
