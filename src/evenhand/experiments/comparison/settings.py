"""What can be set of a comparison: arms, algorithms, runs; imports nothing heavy."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evenhand.core.errors import InputError, unknown, whole
from evenhand.core.processors import CORES
from evenhand.experiments.settings import SERVICES, WORKERS
from evenhand.methods import registry
from evenhand.training.learners import LEARNERS

SCENARIOS = ("even", "prejudiced", "perception", "minority", "tips", "everyday", "hidden", "hurry")
"""Those of Evenhand, as ``worlds`` registers them, but for what-ifs."""
ALGORITHMS = tuple(LEARNERS)
"""What learns."""
NO_ALGORITHM = "none"
"""Algorithm of an arm that learns nothing."""


CONTROLS = ("reference", "untrained")
"""What learns nothing: the reference robot of the scenario, and the policy before
training (in ``prejudiced``, after imitation). They are the same for every algorithm."""
BLIND = "blind"
"""The control that every arm is compared with, beside training on service alone."""
UNTUNED = ("r_ppo",)
"""Methods whose strength nobody has tuned for the comparison (``results/tuning.csv``)."""
ARMS = (*CONTROLS, *(name for name in registry.BUILT_IN if name not in UNTUNED))
"""What is compared unless somebody says otherwise."""


def learns(arm: str) -> bool:
    """Whether an arm learns anything."""
    return arm not in CONTROLS


def method_of(arm: str) -> tuple[str, float | None]:
    """Method, or control, and strength of an arm: ``levelup@2`` is level-up at strength 2.

    Raises:
        InputError: for an unknown name, or a strength that is none.
    """
    name, mark, text = arm.partition("@")
    if name in CONTROLS:
        if mark:
            raise InputError("unsupported strength", f"{arm}: {name} has no strength, drop @{text}")
        return name, None
    if name not in registry.names():
        hint = unknown("arm", name, (*CONTROLS, *registry.names()))
        raise InputError("unknown arm", f"{hint}; the file of an own method is named by --plugin")
    return registry.parted(arm)


def arm_of(method: str, strength: float | None) -> str:
    """The inverse of ``method_of``: the one way in which an arm is written."""
    return registry.spelled(method, strength)


def plain(arm: str) -> str:
    """An arm without a strength that it has anyway: ``levelup@5`` is ``levelup``."""
    name, strength = method_of(arm)
    if strength is None or strength == registry.strength_of(registry.create(name)):
        return name
    return arm_of(name, strength)


@dataclass(frozen=True, order=True)
class Cell:
    """One run: a seed of an arm in a scenario."""

    scenario: str
    algorithm: str
    arm: str
    seed: int

    def __str__(self) -> str:
        return f"{self.scenario}, {self.algorithm}, {self.arm}, seed {self.seed}"

    def folder(self, out: Path) -> Path:
        """Where it is kept."""
        return out / "runs" / self.scenario / self.algorithm / self.arm / f"seed-{self.seed:02d}"


def checked(cell: Cell) -> Cell:
    """A run that there can be, its scenario and arm written in the one way.

    Raises:
        InputError: for an unknown scenario, algorithm or arm, or an algorithm that does not go
            with the arm.
    """
    from evenhand.restaurant import worlds  # brings the physics along

    method, strength = method_of(cell.arm)
    algorithms = ALGORITHMS if learns(method) else (NO_ALGORITHM,)
    if cell.algorithm not in algorithms:
        raise unknown(f"algorithm of arm {cell.arm}", cell.algorithm, algorithms)
    arm = arm_of(method, strength)
    return replace(cell, scenario=worlds.ordered(cell.scenario), arm=arm)


@dataclass(frozen=True)
class CompareSettings:
    """The comparison."""

    out: Path = Path("out/compare")
    """Folder of the tables, figures and runs."""

    scenarios: tuple[str, ...] = SCENARIOS
    """Where unevenness comes from."""

    arms: tuple[str, ...] = ARMS
    """Ways to serve, see ``ARMS`` and ``method_of``."""

    algorithms: tuple[str, ...] = ("ppo", "reinforce")
    """What learns."""

    seeds: int = 10
    """Runs of every arm, with seeds that follow each other."""

    first_seed: int = 0
    """The first of them."""

    earlier: Path | None = None
    """Table of an earlier comparison; its runs are taken from there."""

    epochs: int = 300
    """Updates of every run; an epoch is 30 services."""

    services: int = 5000
    """Services in the test of every run."""

    workers: int = CORES
    """Processes that work at the same time."""

    def __post_init__(self) -> None:
        from evenhand.restaurant import worlds  # brings the physics along

        one_way = {"scenarios": worlds.ordered, "arms": lambda name: arm_of(*method_of(name))}
        for kind in ("scenarios", "arms", "algorithms"):
            names = getattr(self, kind)
            one = kind.removesuffix("s")
            if not names:
                raise InputError(f"missing {kind}", f"no {one} is given: name at least one")
            if kind in one_way:
                names = tuple(one_way[kind](name) for name in names)
                object.__setattr__(self, kind, names)
            alike = tuple(map(plain, names)) if kind == "arms" else names
            if len(set(alike)) < len(alike):
                raise InputError(
                    f"duplicate {kind}", f"an entry of {kind} is given twice: {', '.join(alike)}"
                )
        for name in self.algorithms:
            if name not in ALGORITHMS:
                raise unknown("algorithm", name, ALGORITHMS)
        whole("seeds", self.seeds, 1, 1000)
        whole("first_seed", self.first_seed, 0, 100_000)
        whole("epochs", self.epochs, 2, 100_000)
        whole("services", self.services, *SERVICES)
        whole("workers", self.workers, *WORKERS)

    def cells(self) -> Iterator[Cell]:
        """Every run, a seed of everything before the next, so that what is there is balanced."""
        for seed in range(self.first_seed, self.first_seed + self.seeds):
            for scenario in self.scenarios:
                for arm in self.arms:
                    for algorithm in self.algorithms if learns(arm) else (NO_ALGORITHM,):
                        yield Cell(scenario, algorithm, arm, seed)


def place(cell: Cell) -> tuple[object, ...]:
    """Sorts cells as they are listed above; others come after these, by name."""

    def rank(name: str, names: tuple[str, ...]) -> tuple[int, str]:
        return (names.index(name) if name in names else len(names), name)

    method, strength = method_of(cell.arm)
    return (
        rank(cell.scenario, SCENARIOS),
        rank(cell.algorithm, (NO_ALGORITHM, *ALGORITHMS)),
        rank(method, (*CONTROLS, *registry.names())),
        -1.0 if strength is None else strength,
        cell.seed,
    )


def computed(noted: Mapping[str, Any]) -> float | None:
    """Seconds of computing of a comparison and of those that it took runs from, if noted."""
    found, one = [], noted
    while isinstance(one, Mapping):
        found.append(one.get("run_seconds"))
        one = one.get("earlier")
    if not all(isinstance(seconds, (int, float)) for seconds in found):
        return None
    return float(sum(found))
