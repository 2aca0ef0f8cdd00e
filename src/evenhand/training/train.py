"""Training: where world and judgement meet, and nowhere else.

An epoch is 30 services: serve, score (Eq. 1-2), judge (Eq. 3), reward (Eq. 4-5), update
(Eq. 6-8). ``train`` is a generator of ``EpochRecord``; whoever calls it shows, stores or stops.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from evenhand.core import forks
from evenhand.core.errors import InputError
from evenhand.methods.beyond import guard, levelup
from evenhand.methods.paper.detector import Detector
from evenhand.methods.paper.scores import Scores
from evenhand.methods.services import Interactions
from evenhand.restaurant import floor_plan, people
from evenhand.restaurant.simulation import layout, native, serve, task
from evenhand.restaurant.simulation.lanes import Lanes
from evenhand.restaurant.simulation.recording import Recording, renumbered
from evenhand.training import advantages, imitation, reflection_gradients
from evenhand.training.epoch import ISSUES, Epoch, judged_by
from evenhand.training.memory import Past
from evenhand.training.observation import as_network, view
from evenhand.training.policy import Actor, ActorCritic, state_values
from evenhand.training.settings import TrainSettings
from evenhand.training.update import Anchor, LearnerState, Trajectories, make_learner, update


@dataclass(frozen=True)
class EpochRecord:
    """What one epoch was.

    Attributes:
        epoch: number, from 0.
        numbers: everything that is counted, by name; None where it is missing.
        interactions: its services.
        state: the learner after the update.
        past: what the next epoch has to remember beside it.
        rng: state of the generator where the next epoch begins.
        seen: what was to be seen of its services, if they were recorded.
    """

    epoch: int
    numbers: dict[str, Any]
    interactions: Interactions
    state: LearnerState
    past: Past
    rng: Mapping[str, Any]
    seen: Recording | None = None


def untrained(settings: TrainSettings) -> LearnerState:
    """A learner that has seen nothing."""
    rng = np.random.default_rng([settings.seed, 0])
    return make_learner(task.OBSERVATION_SIZE, settings.policy, settings.update, rng)


@functools.lru_cache(maxsize=1)  # imitation takes seconds, and its result is needed twice
def begin(settings: TrainSettings) -> LearnerState:
    """The learner at the beginning of a run: untrained, or after imitating biased robots."""
    state, world = untrained(settings), settings.world
    if world.prejudice == 0.0:
        return state
    rng = np.random.default_rng([settings.seed, 2])
    shown = imitation.demonstrate(
        world.prejudice, world.population, settings.task, settings.sensor, settings.needs, rng
    )
    seen = view(settings, np.asarray(shown.obs))
    return imitation.imitate(state, shown._replace(obs=seen), rng)


def anchor(settings: TrainSettings) -> Anchor | None:
    """What training is held near: the policy that imitated biased robots, if any did."""
    prejudice = settings.world.prejudice
    if prejudice == 0.0:
        return None
    return Anchor(begin(settings).policy, imitation.PULL * prejudice)


def robot(settings: TrainSettings, policy: ActorCritic) -> serve.Robot:
    """A policy as a robot that acts by chance, as in training."""
    actor = Actor(policy)
    return lambda seen, _: actor.probability(view(settings, seen))


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
    past: Past | None = None,
    recorded: bool = False,
    threads: int = 1,
) -> Iterator[EpochRecord]:
    """Train epoch by epoch.

    Args:
        settings: of the run.
        detector: judges every epoch.
        state: where to go on from; by default the beginning of the run.
        rng: as it was then; the run's own stream by default. It runs ahead of what is yielded.
        first_epoch: number of the next epoch.
        past: as it was then; empty by default.
        recorded: keep what was to be seen of the services.
        threads: that step the physics; results are the same on any number.

    Yields:
        A record after every update.

    Raises:
        InputError: as ``check_detector``, for no threads, or in a process that was forked after
            threads or JAX were used.
    """
    check_detector(detector)
    state = begin(settings) if state is None else state
    rng = stream(settings) if rng is None else rng
    past = Past.empty(settings) if past is None else past
    near, looks_back = anchor(settings), advantages.looks_back(settings)
    engines = native.Engines(settings.people, threads) if native.found() else None
    lanes = Lanes(settings.people, settings.task, threads if engines is None else 1)
    served, following = _drawn(settings, lanes, rng)
    for number in range(first_epoch, settings.epochs):
        forks.check_jax()
        began = perf_counter()
        before, asking = state.policy, served.setups.asking
        if engines is None:
            done = serve.run(lanes, served, robot(settings, before), recorded=recorded)
        else:
            policy = as_network(settings, before)
            done = engines.run(served, policy, settings.task, recorded=recorded)
        first = number * settings.people
        seen = None if done.seen is None else renumbered(done.seen, first)
        done = replace(done, observation=view(settings, done.observation))
        # JAX computes while Python goes on, here and after the update
        value = state_values(before, done.observation)
        served_at = perf_counter()
        epoch = judged_by(done, asking, detector)
        if looks_back:
            past = advantages.remembered(settings, epoch, past)
        taught, past = advantages.learn_from(settings, before, value, epoch, past, following)
        trajectories = Trajectories(done.observation, done.action, done.mask)
        updating_at = perf_counter()
        state, report = update(
            state,
            trajectories,
            taught.advantage,
            taught.target,
            settings.update,
            rng,
            taught.fair,
            near,
        )
        if not looks_back:  # then it can wait until here
            past = advantages.remembered(settings, epoch, past)
        examined = None
        if settings.reflect:
            examined = _examined(settings, before, state.policy, trajectories, epoch)
        drawn = rng.bit_generator.state
        if number + 1 < settings.epochs:
            served, following = _drawn(settings, lanes, rng)
        table = serve.record(
            done.facts,
            asking,
            epoch=number,
            scenario=settings.scenario,
            robot=settings.update.algorithm,
            first_service=first,
        )
        numbers = _numbers(settings, done.facts, epoch.scores, taught.even)
        numbers |= {
            "biased_detector": epoch.biased,
            "biased_threshold": bool(epoch.scores.total > settings.threshold),
            # -inf, which becomes a missing number, when nothing could be judged
            "probability": np.nan_to_num(epoch.verdict.probability, nan=-np.inf).max(),
            "guard_strength": past.guard.strength,
            "guard_weight": guard.weight(past.guard),
        }
        numbers |= {f"update_{name}": float(x) for name, x in vars(report).items()}
        updated_at = perf_counter()
        if examined is not None:
            found, remembered = examined.conclude(past.reflection, settings.reflection)
            past = replace(past, reflection=remembered)
            numbers |= found.numbers()
        numbers |= {
            "time_serving": served_at - began,
            "time_updating": updated_at - updating_at,
            "time_reflecting": perf_counter() - updated_at,
        }
        yield EpochRecord(number, _plain(numbers), table, state, past, drawn, seen)


def _drawn(
    settings: TrainSettings, lanes: Lanes, rng: np.random.Generator
) -> tuple[serve.Drawn, layout.Setups]:
    """The services of an epoch, and the person after them: where Eq. 6 looks on to (S_T)."""
    population = people.population(settings.world.population)
    setups = layout.draw(population, settings.people + 1, rng)
    served = serve.draw(lanes, setups[:-1], rng, settings.sensor, settings.needs)
    return served, setups[-1:]


def check_detector(detector: Detector) -> None:
    """Whether a detector can judge services in the restaurant.

    Raises:
        InputError: when it judges other issues or asks for them in another order, or was taught
            with identities that nobody here has.
    """
    if detector.issues != ISSUES:
        raise InputError(
            f"the detector judges {', '.join(detector.issues)}, and training scores "
            f"{', '.join(ISSUES)}, in this order: fit a detector to judgements of these issues"
        )
    known = [identity.name for identity in people.IDENTITIES]
    if not detector.identities or not {*detector.identities} <= {*known}:
        raise InputError(
            f"the detector was taught with {', '.join(detector.identities) or 'no identity'}, and "
            f"people in the restaurant have {', '.join(known)}: fit a detector to judgements of "
            "these identities"
        )


def _examined(
    settings: TrainSettings,
    before: ActorCritic,
    after: ActorCritic,
    trajectories: Trajectories,
    epoch: Epoch,
) -> reflection_gradients.Examination:
    """Examine an update by the epoch's own counts: pooled ones would raise false alarms."""
    tau, exact = settings.guidance.tau, levelup.CreditSettings(shrink=0.0)
    influence = levelup.influence(epoch.x, epoch.inside, tau, settings=exact)
    return reflection_gradients.examine(
        before, after, trajectories, influence, people.GROUPS, ISSUES, tau
    )


def _numbers(
    settings: TrainSettings, facts: serve.Facts, scores: Scores, even: np.ndarray
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
        "seconds_simulated": float(facts.steps.sum() * floor_plan.TIMESTEP),
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
