"""A sweep read from its TOML file, with every mistake and its line."""

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

from evenhand.core import plugins
from evenhand.core.errors import InputError, nearest, unknown, whole
from evenhand.core.toml_file import Mistake, Place, Table, content_of, located, text_of
from evenhand.experiments.comparison import compare
from evenhand.experiments.comparison.settings import (
    ALGORITHMS,
    NO_ALGORITHM,
    Cell,
    arm_of,
    learns,
    method_of,
    plain,
)
from evenhand.experiments.settings import SERVICES
from evenhand.experiments.sweep import settings as sweep_settings
from evenhand.experiments.sweep.settings import Job, Sweep, Value, Variant
from evenhand.restaurant import people, worlds
from evenhand.training.policy import PolicySettings
from evenhand.training.update import UpdateSettings

UPDATE = (
    "learning_rate", "adam_eps", "passes", "minibatches", "clip", "entropy_coefficient",
    "value_coefficient", "max_grad_norm", "gamma", "gae_lambda", "normalise_advantage",
)  # fmt: skip
"""Of ``learn.update.UpdateSettings``."""
POLICY = ("hidden", "activation", "initial_response_rate")
"""Of ``learn.policy.PolicySettings``."""
WORLD = ("population",)
"""Of ``learn.settings.TrainSettings``."""
SETTINGS = (*UPDATE, *POLICY, *WORLD)
_GRID = ("scenarios", "arms", "algorithms", "seeds", "epochs", "people", "services")
_KEYS = ("plugin", *_GRID, "settings", "runs")
_SEEDS = (0, 100_000)
_COUNTS = (1, 1000)


def examine(path: str | os.PathLike[str]) -> tuple[Sweep | None, list[Mistake]]:
    """Read a sweep and collect all its mistakes; there is no sweep when there is any."""
    text = text_of(path)
    content = content_of(text)
    if isinstance(content, Mistake):
        return None, [content]
    wrong: list[tuple[Place, str]] = []
    top = Table(content, (), wrong)
    _load_plugins(top, Path(path).parent)
    jobs = _jobs(top)
    if not wrong:
        return Sweep(tuple(jobs), text), []
    return None, located(text, wrong, _key)


def _load_plugins(top: Table, folder: Path) -> None:
    """Files that the sweep names, beside its own, add methods and scenarios to it."""
    given = top.get("plugin")
    for name in [] if given is None else given if isinstance(given, list) else [given]:
        try:
            plugins.load_plugin(folder / _text("plugin", name))
        except InputError as error:
            top.note("plugin", str(error))


def _key(place: Place) -> str:
    return ".".join(str(word + 1) if isinstance(word, int) else word for word in place)


@dataclass(frozen=True)
class _Block:
    """Values of each key, as far as they are said, and whatever is wrong with none of them."""

    values: dict[str, tuple[Any, ...]]
    learner: dict[str, tuple[Any, ...]]


def _jobs(top: Table) -> list[Job]:
    common = _block(top)
    tables = top.tables("runs")
    top.done()
    found: dict[tuple[object, ...], tuple[Job, str]] = {}
    for table in tables or [top]:
        own = common if table is top else _block(table)
        if table is not top:
            table.done()
        values = {"algorithms": ("ppo",)} | common.values | own.values
        lacking = [key for key in ("scenarios", "arms", "seeds") if key not in values]
        told = [str(at[-1]) for at, _ in top.wrong if at and at[:-1] in ((), table.place)]
        for key in lacking:
            if not any(nearest(word, _KEYS) == key for word in told):
                top.wrong.append((table.place, f"{key} is missing: add it"))
        if top.wrong:
            continue
        for job in _grid(values, common.learner | own.learner):
            if len(found) >= sweep_settings.MOST:
                said = f"there are more than {sweep_settings.MOST:,} runs: make several sweeps"
                top.wrong.append((table.place, said))
                return []
            earlier, where = found.setdefault(job.same, (job, _key(table.place)))
            if earlier is not job:
                top.wrong.append((table.place, _twice(job, earlier, where)))
                break
    return sorted((job for job, _ in found.values()), key=lambda job: job.cell.seed)


def _twice(job: Job, earlier: Job, where: str) -> str:
    where = f" (first in {where})" if where else ""
    if job.variant == earlier.variant:
        if job.cell == earlier.cell:
            return f"the run {job} stands there twice{where}: take it out once"
        why = f"that is the strength of {plain(job.cell.arm)} anyway"
    else:
        why = "reinforce knows no passes, minibatches and clip"
    return f"the runs {earlier} and {job} would be the same{where}, for {why}: take one out"


def _grid(values: dict[str, tuple[Any, ...]], learner: dict[str, tuple[Any, ...]]) -> Iterator[Job]:
    sizes = product(*(values.get(n, (getattr(Variant, n),)) for n in _GRID[-3:]))
    settings = [tuple(zip(learner, chosen, strict=True)) for chosen in product(*learner.values())]
    for (epochs, served, services), chosen in product(sizes, settings):
        differs = tuple(sorted(one for one in chosen if one[1] != _default(one[0])))
        variant = Variant(epochs, served, services, differs)
        for scenario, arm, seed in product(values["scenarios"], values["arms"], values["seeds"]):
            for algorithm in values["algorithms"] if learns(arm) else (NO_ALGORITHM,):
                yield Job(variant, Cell(scenario, algorithm, arm, seed))


def _block(table: Table) -> _Block:
    """What one table says, each value checked."""
    checks: dict[str, Callable[[Any], Any]] = {
        "scenarios": _scenario,
        "arms": _arm,
        "algorithms": lambda name: _name("algorithm", name, ALGORITHMS),
        "seeds": lambda n: _whole("seed", n, _SEEDS),
        "epochs": lambda n: _whole("epochs", n, sweep_settings.EPOCHS),
        "people": lambda n: _whole("people", n, sweep_settings.PEOPLE),
        "services": lambda n: _whole("services", n, SERVICES),
    }
    values = {}
    for key in _GRID:
        given = table.get(key)
        if given is None:
            continue
        if key == "seeds" and not isinstance(given, list):
            given = _counted(table, given)
        values[key] = _several(table, key, given, checks[key])
    inside = table.table("settings", needed=False)
    learner = {}
    for key in SETTINGS:
        given = inside.get(key)
        if given is None:
            continue
        if key == "hidden" and _is_hidden(given):
            given = [given]  # one value, which is a list
        learner[key] = _several(inside, key, given, lambda v, k=key: _setting(k, v))
    inside.done()
    return _Block(values, learner)


def _several(table: Table, key: str, given: Any, check: Callable[[Any], Any]) -> tuple[Any, ...]:
    found: list[Any] = []
    items = given if isinstance(given, list) else [given]
    if not items:
        table.note(key, "it is empty: give at least one")
    for item in items:
        try:
            value = check(item)
        except InputError as error:
            table.note(key, str(error))
            continue
        if value in found:
            table.note(key, f"{item!r} stands there twice: take it out once")
        found.append(value)
    return tuple(found)


def _counted(table: Table, given: Any) -> list[int]:
    try:
        return list(range(_whole("seeds", given, _COUNTS)))
    except InputError as error:
        table.note("seeds", f"{error}, or a list of seeds")
        return [0]


def _whole(name: str, value: Any, span: tuple[int, int]) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(
            f"type {name}", f"{name} is {value!r}: give a whole number from {span[0]} to {span[1]}"
        )
    whole(name, value, *span)
    return value


def _text(kind: str, value: Any) -> str:
    if not isinstance(value, str):
        raise InputError(f"type {kind}", f'{kind} is {value!r}: give a name, in quotes "..."')
    return value


def _name(kind: str, value: Any, choices: Iterable[str]) -> str:
    names = list(choices)
    if _text(kind, value) not in names:
        raise unknown(kind, value, names)
    return value


def _scenario(value: Any) -> str:
    return worlds.ordered(_text("scenario", value))


def _arm(value: Any) -> str:
    """An arm in the one way in which it is written, with a strength that it can have."""
    arm = arm_of(*method_of(_text("arm", value)))
    compare.training_of(Cell("even", "ppo", arm, 0), Variant.epochs)
    return arm


def _is_hidden(value: Any) -> bool:
    return isinstance(value, list) and not any(isinstance(one, list) for one in value)


def _default(key: str) -> Value | None:
    base = compare.training_of(Cell("even", "ppo", "service", 0), Variant.epochs)
    if key in WORLD:
        return getattr(base, key)
    return getattr(base.update if key in UPDATE else base.policy, key)


def _setting(key: str, value: Any) -> Value:
    if key == "population":
        people.population(_text(key, value))
        return value
    kind = UpdateSettings if key in UPDATE else PolicySettings
    default = _default(key)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise InputError(
                f"type {key}", f"{key} is {value!r}: give true or false, without quotes"
            )
    elif isinstance(default, int):
        if not number or not isinstance(value, int):
            raise InputError(f"type {key}", f"{key} is {value!r}: give a whole number")
    elif isinstance(default, str):
        _text(key, value)
    elif isinstance(default, tuple):
        if not isinstance(value, list) or not all(type(one) is int for one in value):
            raise InputError(
                f"type {key}", f"{key} is {value!r}: give a list of whole numbers, as [64, 64]"
            )
        value = tuple(value)
    elif not number:
        raise InputError(f"type {key}", f"{key} is {value!r}: give a number")
    else:
        value = float(value)
    replace(kind(), **{key: value})
    return value
