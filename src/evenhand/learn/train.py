"""Training: where world and judgement meet, and nowhere else.

An epoch is 30 services: serve, score (Eq. 1-2), judge (Eq. 3), reward (Eq. 4-5), update
(Eq. 6-8). ``train`` is a generator of ``EpochRecord``; whoever calls it shows, stores or stops.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any, Literal

import numpy as np

from evenhand import guidance, issues, people
from evenhand.detector import Detector
from evenhand.errors import InputError, unknown, whole
from evenhand.interactions import Interactions
from evenhand.learn import losses
from evenhand.learn.policy import Actor, ActorCritic, PolicySettings, state_values
from evenhand.learn.update import (
    LearnerState,
    Trajectories,
    UpdateSettings,
    make_learner,
    update,
)
from evenhand.restaurant import layout, plan, senses, serve, task
from evenhand.restaurant.lanes import Lanes

PRESETS = ("paper", "service")


@dataclass(frozen=True)
class TrainSettings:
    """One run of training."""

    preset: Literal["paper", "service"] = "paper"
    """paper: the reward is Eq. 4/5 and nothing else, and the advantage runs over people (Eq. 6).
    service: service quality plus Eq. 4/5, and every service is an episode."""

    seed: int = 0
    """Of everything random in the run."""

    epochs: int = 300
    """Updates."""

    people: int = 30
    """Services in one epoch."""

    population: str = "uniform"
    """Where people are drawn from."""

    evenness_weight: float = 1.0
    """service preset: weight of Eq. 4/5, scaled to at most 1, beside a perfect service's 1."""

    threshold: float = 0.5
    """Manual threshold on the total issue score, which is counted beside the detector."""

    guidance: guidance.GuidanceSettings = field(default_factory=guidance.GuidanceSettings)
    """What the robot is told about its evenness."""

    update: UpdateSettings = field(default_factory=UpdateSettings)
    """How it learns."""

    policy: PolicySettings = field(default_factory=PolicySettings)
    """The network."""

    task: task.TaskSettings = field(default_factory=task.TaskSettings)
    """How often it decides."""

    sense: senses.SenseSettings = field(default_factory=senses.SenseSettings)
    """The distance sensor."""

    def __post_init__(self) -> None:
        if self.preset not in PRESETS:
            raise unknown("preset", self.preset, PRESETS)
        people.population(self.population)
        whole("seed", self.seed, 0, 2**32 - 1)
        whole("epochs", self.epochs, 1, 1_000_000)
        whole("people", self.people, 2, 10_000)
        if not 0.0 <= self.evenness_weight < np.inf:
            raise InputError(f"evenness_weight is {self.evenness_weight}: give 0 or more")
        if not 0.0 <= self.threshold < np.inf:
            raise InputError(f"threshold is {self.threshold}: give 0 or more")


def preset(
    name: str,
    algorithm: str,
    guided: bool,
    *,
    seed: int = 0,
    epochs: int = 300,
    population: str = "uniform",
) -> TrainSettings:
    """The settings of one arm of the experiment.

    Args:
        name: paper or service.
        algorithm: reinforce or ppo.
        guided: with the detector's penalty (Eq. 5) or with Eq. 4 alone.
        seed: of the run.
        epochs: updates.
        population: where people are drawn from.
    """
    if name not in PRESETS:
        raise unknown("preset", name, PRESETS)
    whole("epochs", epochs, 1, 1_000_000)
    # a service is short: discounting inside it would only pay for haste
    gamma = 0.99 if name == "paper" else 1.0
    return TrainSettings(
        preset=name,  # type: ignore[arg-type]
        seed=seed,
        epochs=epochs,
        population=population,
        guidance=guidance.GuidanceSettings(kind="penalty" if guided else "score"),
        update=replace(UpdateSettings(), algorithm=algorithm, gamma=gamma, anneal_updates=epochs),
    )


@dataclass(frozen=True)
class EpochRecord:
    """What one epoch was.

    Attributes:
        epoch: number, from 0.
        numbers: everything that is counted, by name; None where it is missing.
        interactions: its services.
        state: the learner after the update.
    """

    epoch: int
    numbers: dict[str, Any]
    interactions: Interactions
    state: LearnerState


def begin(settings: TrainSettings) -> LearnerState:
    """The untrained learner of a run."""
    rng = np.random.default_rng([settings.seed, 0])
    return make_learner(task.OBSERVATION_SIZE, settings.policy, settings.update, rng)


def stream(settings: TrainSettings) -> np.random.Generator:
    """The generator that all epochs of a run draw from; its state goes into checkpoints."""
    return np.random.default_rng([settings.seed, 1])


def train(
    settings: TrainSettings,
    detector: Detector,
    *,
    state: LearnerState | None = None,
    rng: np.random.Generator | None = None,
    first_epoch: int = 0,
) -> Iterator[EpochRecord]:
    """Train epoch by epoch.

    Args:
        settings: of the run.
        detector: judges every epoch.
        state: where to go on from; untrained by default.
        rng: as it was then; the run's own stream by default.
        first_epoch: number of the next epoch.

    Yields:
        A record after every update.
    """
    state = begin(settings) if state is None else state
    rng = stream(settings) if rng is None else rng
    lanes = Lanes(settings.people, settings.task)
    population = people.population(settings.population)
    for epoch in range(first_epoch, settings.epochs):
        began = perf_counter()
        # one more person than is served: where Eq. 6 looks on to (S_T)
        setups = layout.draw(population, settings.people + 1, rng)
        served, following = setups[:-1], setups[-1:]
        actor = Actor(state.policy)
        done = serve.serve(
            lanes, served, lambda seen, _, a=actor: a.probability(seen), rng, settings.sense
        )
        table = serve.record(
            done.facts,
            served.asking,
            epoch=epoch,
            scenario="even",
            robot=settings.update.algorithm,
            first_service=epoch * settings.people,
        )
        served_at = perf_counter()
        scores, inside = _score(table)
        # only what the detector was taught: each identity more raises the false alarms
        known = {name: scores.by_identity[name] for name in detector.identities}
        verdict = detector.judge_window(known)
        biased = bool(verdict.biased)
        even = guidance.person_rewards(scores, inside, biased, settings.guidance)
        advantage, target = _advantages(settings, state.policy, done, even, following)
        trajectories = Trajectories(done.observation, done.action, done.mask)
        updating_at = perf_counter()
        state, report = update(state, trajectories, advantage, target, settings.update, rng)
        numbers = _numbers(settings, done.facts, scores, even)
        numbers |= {
            "biased_detector": biased,
            "biased_threshold": bool(scores.total > settings.threshold),
            # -inf, which becomes a missing number, when nothing could be judged
            "probability": np.nan_to_num(verdict.probability, nan=-np.inf).max(),
            "time_serving": served_at - began,
            "time_updating": perf_counter() - updating_at,
        }
        numbers |= {f"update_{name}": value for name, value in vars(report).items()}
        yield EpochRecord(epoch, _plain(numbers), table, state)


def _score(table: Interactions) -> tuple[issues.Scores, np.ndarray]:
    who = issues.membership(table)
    counts = issues.count(issues.indicators(table), who.inside)
    names = [issue.name for issue in issues.PAPER_ISSUES]
    return issues.scores_of(counts, who.groups, names), who.inside


def _advantages(
    settings: TrainSettings,
    policy: ActorCritic,
    done: serve.Services,
    even: np.ndarray,
    following: layout.Setups,
) -> tuple[np.ndarray, np.ndarray]:
    """Advantage and critic target of every decision, both [N, L]."""
    value = np.asarray(state_values(policy, done.observation))
    if settings.preset == "paper":
        first = np.zeros(1, np.int64)
        ahead = task.observe(first, following.one_hot, following.start_distance, first, np.zeros(1))
        value_next = float(state_values(policy, ahead)[0])
        gamma = settings.update.gamma
        returns = np.asarray(losses.people_returns(even, value_next, gamma))
        advantage = np.asarray(losses.people_advantages(even, value, value_next, gamma))
        return advantage, np.broadcast_to(returns[:, None], value.shape)
    scale = sum(settings.guidance.tau)
    earned = done.facts.reward + settings.evenness_weight * even / scale
    reward = np.zeros_like(value)
    last = done.mask.sum(axis=1).astype(int) - 1
    reward[np.arange(len(last)), last] = earned
    update_settings = settings.update
    advantage = np.asarray(
        losses.gae(reward, value, done.mask, update_settings.gamma, update_settings.gae_lambda)
    )
    return advantage, advantage + value


def _numbers(
    settings: TrainSettings, facts: serve.Facts, scores: issues.Scores, even: np.ndarray
) -> dict[str, Any]:
    """Scores and service of the epoch, by name."""
    answered = facts.responded
    out: dict[str, Any] = {
        "total": scores.total,
        **dict(zip(scores.issues, scores.overall, strict=True)),
        **{f"total_{name}": scores.total_of(name) for name in scores.by_identity},
        "missing_gaps": int(scores.missing.sum()),
        "perfect_rate": facts.perfect.mean(),
        "response_rate": answered.mean(),
        "mean_response_distance": facts.distance[answered].mean() if answered.any() else None,
        "mean_response_step": facts.steps[answered].mean() if answered.any() else None,
        "contact_rate": (facts.contact_steps > 0).mean(),
        "mean_evenness_reward": even.mean(),
        "mean_service_reward": facts.reward.mean(),
        "physics_steps": int(facts.steps.sum()),
        "seconds_simulated": float(facts.steps.sum() * plan.TIMESTEP),
        "services": settings.people,
    }
    return out


def _plain(numbers: dict[str, Any]) -> dict[str, Any]:
    """Numbers as JSON can hold them; what is not finite is missing."""
    out: dict[str, Any] = {}
    for name, value in numbers.items():
        if value is None or isinstance(value, (bool, int, str)):
            out[name] = value
        else:
            number = float(value)
            out[name] = number if np.isfinite(number) else None
    return out
