"""The restaurant's services as an epoch that methods learn from."""

from __future__ import annotations

import numpy as np
from jax.typing import ArrayLike

from evenhand.methods.epoch import Answers, Epoch, judge_of
from evenhand.methods.guard import Guard, Watch
from evenhand.methods.paper import losses
from evenhand.methods.paper.detector import Detector
from evenhand.restaurant import walks
from evenhand.restaurant.scenarios import tips
from evenhand.restaurant.simulation import serve
from evenhand.restaurant.worlds import World
from evenhand.statistics import chance
from evenhand.training.settings import TrainSettings


def epoch_of(
    settings: TrainSettings,
    done: serve.Trajectories,
    detector: Detector | None,
    value: ArrayLike,
    guard: Guard,
    number: int = 0,
) -> tuple[Epoch, Watch]:
    """Finished services, to be counted, scored and judged when somebody asks.

    Args:
        settings: of the run.
        done: the services; observations as the policy saw them.
        detector: judges them, by what it was taught; None where none knows this world.
        value: of the critic at every decision, [n, L].
        guard: before these services.
        number: of the epoch.

    Returns:
        The epoch, and what becomes of the guard.
    """
    world, scheme = settings.world, settings.scheme
    x, inside = indicators(settings, done), scheme.inside(done.codes)
    scored = None
    if settings.judges is not None:
        scored = (world.scheme.issue_names, world.indicators(done))
    watch = Watch(guard, x, inside)
    epoch = Epoch(
        x=x,
        inside=inside,
        reward=earned(world, done),
        mask=done.mask,
        groups=scheme.groups,
        issues=scheme.issue_names,
        tau=np.array(settings.tau),
        advantages_of=lambda rewards: over_decisions(
            settings, done.mask, value, to_go(rewards, world.party)
        ),
        corrected_of=lambda counts: float(
            chance.corrected_scores(counts, scheme.groups, scheme.issue_names).total
        ),
        judge=judge_of(detector, () if detector is None else detector.identities),
        guard=watch,
        number=number,
        scored=scored,
        observation=done.observation,
        value=None if settings.all_answers else np.asarray(value),
        gae_lambda=settings.update.gae_lambda,
    )
    return epoch, watch


def indicators(settings: TrainSettings, done: serve.Trajectories) -> np.ndarray:
    """Which service has which issue that evenness weighs, [n, K]."""
    return settings.world.indicators(done, settings.scheme)


def answers_of(settings: TrainSettings, walked: walks.Walks, epoch: Epoch) -> Answers:
    """What each service would have been with each answer.

    Args:
        settings: of the run.
        walked: the services to their end.
        epoch: the same as they were.
    """
    world, every = settings.world, walked.every
    n = len(epoch)
    x = indicators(settings, every)
    return Answers(
        x=x.reshape(n, -1, x.shape[1]), reward=earned(world, every).reshape(n, -1), window=epoch
    )


def earned(world: World, done: serve.Trajectories) -> np.ndarray:
    """What services earn, evenness apart, [n]."""
    facts = done.facts
    return tips.reward(world.tips, world.known(done.codes), facts.terms, facts.steps)


def to_go(rewards: np.ndarray, party: int) -> np.ndarray:
    """Reward of each service and of those after it in its party, [n].

    Time that one service takes is time that the others lack, so they count as well.

    Args:
        rewards: of the services, [n].
        party: so many in a row belong together.
    """
    found = np.array(rewards, float)
    for i in range(len(found) - 2, -1, -1):
        if (i + 1) % party:
            found[i] += found[i + 1]
    return found


def over_decisions(
    settings: TrainSettings, mask: np.ndarray, value: ArrayLike, rewards: np.ndarray
) -> np.ndarray:
    """Advantages of decisions, [n, L]: each service is an episode, paid at its end."""
    values = np.asarray(value)
    reward = np.zeros_like(values)
    last = mask.sum(axis=1).astype(int) - 1
    reward[np.arange(len(last)), last] = rewards
    chosen = settings.update
    return np.asarray(losses.gae(reward, values, mask, chosen.gamma, chosen.gae_lambda))
