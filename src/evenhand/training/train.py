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
from evenhand.methods import detector_file, guard, registry
from evenhand.methods.beyond.influence import CreditSettings, influence
from evenhand.methods.epoch import Epoch
from evenhand.methods.paper.detector import Detector
from evenhand.methods.paper.scores import Scores
from evenhand.methods.services import Services
from evenhand.restaurant import floor_plan, serve_people, walks
from evenhand.restaurant.simulation import serve
from evenhand.restaurant.simulation.engine import Engine
from evenhand.restaurant.simulation.recording import Recording, renumbered
from evenhand.training import advantages, all_answers, imitation, reflection_gradients
from evenhand.training.epoch import epoch_of
from evenhand.training.memory import Memory
from evenhand.training.observation import affine, as_network, view
from evenhand.training.policy import ActorCritic, of_networks, respond, state_values
from evenhand.training.settings import TrainSettings
from evenhand.training.update import Anchor, LearnerState, Trajectories, make_learner, update


@dataclass(frozen=True)
class EpochRecord:
    """What one epoch was.

    Attributes:
        epoch: number, from 0.
        numbers: everything that is counted, by name; None where it is missing.
        services: its services.
        state: the learner after the update.
        memory: what the next epoch has to remember beside it.
        rng: state of the generator where the next epoch begins.
        seen: what was to be seen of its services, if they were recorded.
    """

    epoch: int
    numbers: dict[str, Any]
    services: Services
    state: LearnerState
    memory: Memory
    rng: Mapping[str, Any]
    seen: Recording | None = None


def untrained(settings: TrainSettings) -> LearnerState:
    """A learner that has seen nothing."""
    rng = np.random.default_rng([settings.seed, 0])
    return make_learner(settings.world.observation_size, settings.policy, settings.update, rng)


@functools.lru_cache(maxsize=1)  # imitation takes seconds, and its result is needed twice
def begin(settings: TrainSettings) -> LearnerState:
    """The learner at the beginning of a run: untrained, or after imitating biased robots."""
    state, world = untrained(settings), settings.world
    if world.prejudice == 0.0:
        return state
    rng = np.random.default_rng([settings.seed, 2])
    shown = imitation.demonstrate(world, rng)
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
    probability = respond(policy)
    return lambda seen, _: probability(view(settings, seen))


def acting(settings: TrainSettings, policy: ActorCritic) -> serve.Robot:
    """The same as machine code where it is a network."""
    known = of_networks(policy) and affine(settings)
    return as_network(settings, policy) if known else robot(settings, policy)


def stream(settings: TrainSettings) -> np.random.Generator:
    """The generator that all epochs of a run draw from; its state goes into checkpoints."""
    return np.random.default_rng([settings.seed, 1])


def train(
    settings: TrainSettings,
    detector: Detector | None,
    *,
    state: LearnerState | None = None,
    rng: np.random.Generator | None = None,
    first_epoch: int = 0,
    memory: Memory | None = None,
    recorded: bool = False,
    threads: int = 1,
) -> Iterator[EpochRecord]:
    """Train epoch by epoch.

    Args:
        settings: of the run.
        detector: judges every epoch; without one, none is called biased.
        state: where to go on from; by default the beginning of the run.
        rng: as it was then; the run's own stream by default. It runs ahead of what is yielded.
        first_epoch: number of the next epoch.
        memory: as it was then; that of the beginning by default.
        recorded: keep what was to be seen of the services.
        threads: that step the physics; results are the same on any number.

    Yields:
        A record after every update.

    Raises:
        InputError: as ``check_detector``, for no threads, or in a process that was forked after
            threads or JAX were used.
    """
    check_detector(detector, settings)
    state = begin(settings) if state is None else state
    rng = stream(settings) if rng is None else rng
    memory = Memory.begin(settings) if memory is None else memory
    near, world, n = anchor(settings), settings.world, settings.people
    engine = serve_people.engine(world, n, threads)
    # one person more, who is not served: where Eq. 6 looks on to (S_T)
    ahead = serve_people.draw(world, n, rng, engine, following=1)
    for number in range(first_epoch, settings.epochs):
        forks.check_jax()
        began = perf_counter()
        before, following = state.policy, ahead.following
        served, walked = _serve(settings, before, engine, ahead, recorded)
        first = number * settings.people
        seen = None if served.seen is None else renumbered(served.seen, first)
        done = replace(served, observation=view(settings, served.observation))
        # JAX computes while Python goes on, here and after the update
        value = np.zeros(done.mask.shape) if walked else state_values(before, done.observation)
        served_at = perf_counter()
        epoch, watch = epoch_of(settings, done, detector, value, memory.guard, number)
        trajectories = Trajectories(done.observation, done.action, done.mask)
        if walked is None:
            taught, kept = advantages.learn_from(
                settings, before, value, epoch, memory.method, following
            )
            evenness, updating_at = taught.evenness, perf_counter()
            state, report = update(
                state, trajectories, taught.advantage, taught.target, settings.update, rng,
                taught.fair, near,
            )  # fmt: skip
        else:
            weighed, kept = advantages.weigh_answers(settings, walked, epoch, memory.method)
            evenness, updating_at = weighed.evenness, perf_counter()
            state, report = all_answers.update(
                state, view(settings, walked.observation), weighed.worth, settings.update, rng,
                weighed.fair, near,
            )  # fmt: skip
        memory = replace(memory, guard=watch.after, method=kept)
        examined = None
        if settings.reflect:
            examined = _examined(settings, before, state.policy, trajectories, epoch)
        drawn = rng.bit_generator.state
        if number + 1 < settings.epochs:
            ahead = serve_people.draw(world, n, rng, engine, following=1)
        table = serve_people.table(
            done, world, settings.update.algorithm, epoch=number, first=first
        )
        numbers = _numbers(settings, done.facts, epoch.judged, evenness)
        numbers |= {
            "biased_detector": epoch.biased,
            "biased_threshold": bool(epoch.judged.total > settings.threshold),
            # -inf, which becomes a missing number, when nothing could be judged
            "probability": np.nan_to_num(epoch.verdict.probability, nan=-np.inf).max(),
            "guard_strength": memory.guard.strength,
            "guard_weight": guard.weight(memory.guard),
        }
        numbers |= {f"update_{name}": float(x) for name, x in vars(report).items()}
        updated_at = perf_counter()
        if examined is not None:
            found, remembered = examined.conclude(memory.reflection, settings.reflection)
            memory = replace(memory, reflection=remembered)
            numbers |= found.numbers()
        numbers |= {
            "time_serving": served_at - began,
            "time_updating": updated_at - updating_at,
            "time_reflecting": perf_counter() - updated_at,
        }
        yield EpochRecord(number, _plain(numbers), table, state, memory, drawn, seen)


def _serve(
    settings: TrainSettings,
    policy: ActorCritic,
    engine: Engine,
    ahead: serve_people.Ahead,
    recorded: bool,
) -> tuple[serve.Trajectories, walks.Walks | None]:
    """The services of an epoch, and where all answers count, the walks that they come from."""
    robot = acting(settings, policy)
    if not settings.all_answers:
        return engine.run(ahead.drawn, robot, recorded=recorded), None
    walked = walks.walk(engine, ahead, recorded=recorded)
    return walked.given(walked.answers(robot)), walked


def shipped_detector(settings: TrainSettings) -> Detector | None:
    """The detector that comes with Evenhand; None in a world of which it knows too little.

    Raises:
        InputError: as ``check_detector``.
    """
    found = detector_file.load(detector_file.SHIPPED)
    known = {*found.issues} <= {*settings.world.scheme.issue_names}
    chosen = found if known and {*found.identities} & {*settings.world.scheme.names} else None
    check_detector(chosen, settings)
    return chosen


def check_detector(detector: Detector | None, settings: TrainSettings) -> None:
    """Whether a detector can judge services in the world of a run.

    Raises:
        InputError: when it judges other issues, was taught with identities that nobody there has,
            or there is none and the guidance asks for its verdicts.
    """
    scheme = settings.world.scheme
    if detector is None:
        if registry.VERDICT in registry.needs_of(settings.method):
            raise InputError(
                "missing detector",
                f"method {registry.name_of(settings.method)} asks a detector, and the one that "
                "comes with Evenhand does not know the issues or identities of scenario "
                f"{settings.scenario!r}: fit one, or choose a method that asks none, such as "
                "levelup",
            )
        return
    if not {*detector.issues} <= {*scheme.issue_names}:
        raise InputError(
            "conflict detector",
            f"the detector judges {', '.join(detector.issues)}, and training scores "
            f"{', '.join(scheme.issue_names)}: fit a detector to judgements of these issues",
        )
    if not {*detector.identities} & {*scheme.names}:
        raise InputError(
            "conflict detector",
            f"the detector was taught with {', '.join(detector.identities) or 'no identity'}, and "
            f"people in scenario {settings.scenario!r} have {', '.join(scheme.names)}: fit a "
            "detector to judgements of these identities",
        )


def check_steering(settings: TrainSettings) -> None:
    """Whether a detector that somebody chose can change a run.

    Raises:
        InputError: when the method asks for no verdict.
    """
    if registry.VERDICT not in registry.needs_of(settings.method):
        name = registry.name_of(settings.method)
        raise InputError(
            "unsupported detector",
            f"method {name} asks for no verdict, so a detector would change nothing: let it weigh "
            "the issues (judges), or choose a method that asks, such as penalty",
        )


def _examined(
    settings: TrainSettings,
    before: ActorCritic,
    after: ActorCritic,
    trajectories: Trajectories,
    epoch: Epoch,
) -> reflection_gradients.Examination:
    """Examine an update by the epoch's own counts: pooled ones would raise false alarms."""
    scheme, tau = settings.scheme, settings.tau
    found = influence(epoch.x, epoch.inside, tau, settings=CreditSettings(shrink=0.0))
    return reflection_gradients.examine(
        before, after, trajectories, found, scheme.groups, scheme.issue_names, tau
    )


def _numbers(
    settings: TrainSettings, facts: serve.Facts, scores: Scores, even: np.ndarray
) -> dict[str, Any]:
    """Scores and service of the epoch, by name."""
    answered = facts.responded
    steps = _simulated(settings, facts.steps)
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
        "physics_steps": steps,
        "seconds_simulated": steps * floor_plan.TIMESTEP,
        "services": settings.people,
    }
    return out


def _simulated(settings: TrainSettings, steps: np.ndarray) -> int:
    """Physics steps of an epoch whose services ended at these steps of their clocks, [n]."""
    if settings.all_answers:  # a walk to the end costs all of them, however soon a response comes
        return floor_plan.MAX_STEPS * len(steps)
    party, interval = settings.world.party, settings.world.interval
    waits = np.arange(len(steps)) % party > 0  # its clock began with the first of the party
    before = np.minimum(np.roll(steps, 1), floor_plan.MAX_STEPS - interval)
    return int((steps - np.where(waits, before, 0)).sum())


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
