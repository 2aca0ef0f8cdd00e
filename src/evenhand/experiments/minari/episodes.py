"""Services of a robot as episodes of the Gymnasium environment, each with a seed of its own.

So each can be had again: ``reset`` with its seed, and take its actions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from evenhand.core.errors import InputError
from evenhand.methods import registry
from evenhand.restaurant import people, robots
from evenhand.restaurant.env_base import FACT_NAMES
from evenhand.restaurant.simulation import serve
from evenhand.restaurant.vector import RestaurantVectorEnv

if TYPE_CHECKING:
    from evenhand.training.settings import TrainSettings
    from evenhand.training.update import LearnerState

ENVIRONMENT = "evenhand/Restaurant-v0"
_LANES = 240


@dataclass(frozen=True)
class Server:
    """A robot, and the world that it serves in.

    Attributes:
        name: of its algorithm, or of the scripted robot.
        about: how it came about, for the description of the dataset.
        world: settings of the environment.
        robot: from who asks, int64 [n, 5], and a generator for each of them to the robot.
        facts: what else the dataset notes of it, as JSON can hold it.
    """

    name: str
    about: str
    world: dict[str, Any]
    robot: Callable[[np.ndarray, Sequence[np.random.Generator]], serve.Robot]
    facts: dict[str, Any]


def trained(state: LearnerState, settings: TrainSettings, population: str | None = None) -> Server:
    """The robot of a run, which acts by chance as in training, in the world of its training.

    Raises:
        InputError: for a world that the environment cannot be set to.
    """
    from evenhand.training import train

    world = settings.elsewhere(None, population)
    if world.missed or world.shares or world.groups != people.GROUPS:
        raise InputError(
            "unsupported scenario",
            f"people of scenario {settings.scenario!r} are its own, and a dataset is made by the "
            "Gymnasium environment, which knows the paper's five identities only: choose a run in "
            "another scenario",
        )
    guidance = registry.name_of(settings.method)
    step = int(state.step)
    return Server(
        name=settings.update.algorithm,
        about=(
            f"a policy trained with {settings.update.algorithm} for {step} of {settings.epochs} "
            f"epochs (preset {settings.preset}, guidance {guidance}, scenario "
            f"{settings.scenario}, seed {settings.seed})"
        ),
        world={
            name: getattr(world, name)
            for name in ("population", "interval", "noise", "dropout", "perception", "needs")
        },
        robot=lambda asking, rngs: train.robot(settings, state.policy),
        facts={
            "preset": settings.preset,
            "guidance": guidance,
            "scenario": settings.scenario,
            "training_seed": settings.seed,
            "epochs_trained": step,
        },
    )


def scripted(name: str, strength: float, population: str) -> Server:
    """A scripted robot in the plain world.

    Raises:
        InputError: for an unknown robot or population, or a strength outside 0 to 1.
    """
    one = robots.ScriptedRobot(name, strength)
    people.population(population)
    return Server(
        name=f"scripted-{name}",
        about=f"the scripted robot {name}, strength {strength:g}",
        world={"population": population},
        robot=lambda asking, rngs: _of_each(one, asking, rngs),
        facts={"strength": strength},
    )


def _of_each(
    one: robots.ScriptedRobot, asking: np.ndarray, rngs: Sequence[np.random.Generator]
) -> serve.Robot:
    """A robot whose manner towards everybody comes from a generator of its own."""
    alone = [one.robot(asking[i : i + 1], rng) for i, rng in enumerate(rngs)]
    only = np.zeros(1, np.int64)

    def respond(seen: np.ndarray, rows: np.ndarray) -> np.ndarray:
        return np.array([alone[row](seen[k : k + 1], only)[0] for k, row in enumerate(rows)])

    return respond


@dataclass(frozen=True)
class Episode:
    """One service, T decisions long.

    Attributes:
        seed: that ``reset`` was given.
        observations: float32 [T + 1, 25].
        actions: int64 [T].
        rewards: float64 [T].
        terminations: bool [T]; the last one is true.
        identities: codes of who asked, int64 [5].
        facts: of the service, as the environment tells them; NaN where there is none.
    """

    seed: int
    observations: np.ndarray
    actions: np.ndarray
    rewards: np.ndarray
    terminations: np.ndarray
    identities: np.ndarray
    facts: dict[str, Any]


def episodes(server: Server, services: int, seed: int) -> Iterator[Episode]:
    """Let a robot serve, each service with a seed of its own.

    Args:
        server: who serves, and where.
        services: how many.
        seed: of the first service; the second has the next one, and so on. The robot's own chances
            come from the service's seed too.
    """
    for first in range(seed, seed + services, _LANES):
        seeds = range(first, min(first + _LANES, seed + services))
        yield from _served(server, seeds)


def _served(server: Server, seeds: Sequence[int]) -> Iterator[Episode]:
    """Services side by side; the first of every lane counts, what a lane serves then does not."""
    n = len(seeds)
    venv = RestaurantVectorEnv(n, **server.world)
    observation, info = venv.reset(seed=list(seeds))
    asking = np.array(info["identities"])
    # independent of the environment's stream, which has the seed alone
    rngs = [np.random.default_rng([one, 1]) for one in seeds]
    robot = server.robot(asking, rngs)
    seen = [[row] for row in observation]
    actions: list[list[int]] = [[] for _ in seeds]
    rewards: list[list[float]] = [[] for _ in seeds]
    facts: list[dict[str, Any]] = [{} for _ in seeds]
    going = np.arange(n)
    while len(going):
        responds = np.zeros(n, np.int64)
        chance = np.array([rngs[lane].random() for lane in going])
        responds[going] = chance < robot(observation[going], going)
        observation, reward, ended, _, info = venv.step(responds)
        for lane in going:
            seen[lane].append(observation[lane])
            actions[lane].append(int(responds[lane]))
            rewards[lane].append(float(reward[lane]))
            if ended[lane]:
                told = info["facts"]
                facts[lane] = {name: told[name][lane].item() for name in FACT_NAMES}
        going = going[~ended[going]]
    venv.close()
    for lane, one in enumerate(seeds):
        length = len(actions[lane])
        yield Episode(
            seed=one,
            observations=np.array(seen[lane], np.float32),
            actions=np.array(actions[lane], np.int64),
            rewards=np.array(rewards[lane]),
            terminations=np.arange(length) == length - 1,
            identities=asking[lane],
            facts=facts[lane],
        )
