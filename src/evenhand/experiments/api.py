"""The front door: train, evaluate and compare in Python as on the command line, bit for bit."""

from __future__ import annotations

import inspect
import os
import shutil
import sys
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evenhand.core import files, plugins, terminal
from evenhand.core.errors import InputError, whole
from evenhand.core.frames import data_frame
from evenhand.core.processors import CORES, THREADS
from evenhand.experiments.settings import SEEDS, SERVICES, TEST_SEED
from evenhand.methods import detector_file, issue_weights, registry
from evenhand.methods.issue_weights import IssueWeights
from evenhand.methods.paper import issues
from evenhand.methods.paper.detector import Detector
from evenhand.methods.services import Services
from evenhand.restaurant import worlds
from evenhand.restaurant.robots import ScriptedRobot
from evenhand.restaurant.worlds import World
from evenhand.statistics.intervals import wilson
from evenhand.training import epoch_log, run_folder
from evenhand.training import evaluate as testing
from evenhand.training import train as learning
from evenhand.training.jax_setup import set_up_jax
from evenhand.training.settings import TrainSettings, settings_of
from evenhand.training.update import LearnerState

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

LAST = 40
"""Epochs at the end of a training that its summary is a mean of."""
_CURVES = {"total": "total issue score", "perfect_rate": "perfect services"}


def _table(rows: Sequence[tuple[str, str]], title: str) -> str:
    """A small table for notebooks."""
    body = "".join(f"<tr><th>{escape(a)}</th><td>{escape(b)}</td></tr>" for a, b in rows)
    return f"<table><caption>{escape(title)}</caption>{body}</table>"


def _percent(value: float | None) -> str:
    return "missing" if value is None or np.isnan(value) else f"{100 * value:.1f} %"


@dataclass(frozen=True)
class Run:
    """A finished training.

    Attributes:
        settings: of the training.
        state: what was learned.
        epochs: numbers of every epoch by name, None where missing.
        services: everybody who was served, in order.
        folder: where it is kept; None if it was not kept.
    """

    settings: TrainSettings
    state: LearnerState = field(repr=False)
    epochs: Sequence[Mapping[str, Any]] = field(repr=False)
    services: Services = field(repr=False)
    folder: Path | None = None

    @property
    def frame(self) -> pd.DataFrame:
        """A row for each epoch, a column for each number."""
        return data_frame(self.epochs)

    def plot(self) -> Figure:
        """Total issue score and share of perfect services by epoch, with their trailing mean."""
        from evenhand.report import style
        from evenhand.report.table import trailing_mean

        with style.drawing():
            figure = style.new_figure(True, 2.6)
            axes = figure.subplots(1, len(_CURVES))
            for ax, (name, label) in zip(axes, _CURVES.items(), strict=True):
                values = np.array([line[name] for line in self.epochs], float)
                ax.plot(values, color=style.GREY, linewidth=0.6)
                ax.plot(trailing_mean(values, LAST), color=style.INK)
                ax.set(xlabel="epoch", ylabel=label, ylim=(0, None))
        return figure

    def evaluate(
        self,
        scenario: str | World | None = None,
        population: str | None = None,
        *,
        services: int = 3000,
        seed: int = TEST_SEED,
        threads: int = CORES,
    ) -> Evaluation:
        """Let the trained robot serve people that it never saw.

        Args:
            scenario: where; that of the training by default.
            population: where people are drawn from; that of the scenario by default.
            services: how many people.
            seed: of people, places and chances; choose one that training has not used.
            threads: that step the physics; results are the same on any number.

        Raises:
            InputError: for unknown names, numbers out of range, or people with other identities.
        """
        return evaluate(self, scenario, population, services=services, seed=seed, threads=threads)

    def _numbers(self) -> list[tuple[str, str]]:
        last = self.epochs[-LAST:]
        means = {
            name: np.mean([line[name] for line in last if line[name] is not None] or [np.nan])
            for name in _CURVES
        }
        return [
            ("method", registry.name_of(self.settings.method)),
            ("scenario", self.settings.scenario),
            ("algorithm", self.settings.update.algorithm),
            ("epochs", f"{len(self.epochs)} of {self.settings.people} services"),
            ("seed", str(self.settings.seed)),
            (f"total issue score, last {len(last)} epochs", f"{means['total']:.3f}"),
            (f"perfect services, last {len(last)} epochs", _percent(float(means["perfect_rate"]))),
        ]

    def __repr__(self) -> str:
        return f"Run({', '.join(f'{name}: {text}' for name, text in self._numbers())})"

    def _repr_html_(self) -> str:
        return _table(self._numbers(), "Training")


@dataclass(frozen=True)
class Evaluation:
    """A test of a robot on people that it never saw.

    Attributes:
        who: served.
        world: where.
        services: everybody who was served, in order.
        seed: of people, places and chances.
    """

    who: str
    world: World
    services: Services = field(repr=False)
    seed: int

    @cached_property
    def summary(self) -> dict[str, Any]:
        """All numbers by name, those of `evenhand evaluate --json`; None where missing."""
        return testing.summary(self.services, self.seed, self.world.scheme)

    @property
    def groups(self) -> list[dict[str, Any]]:
        """A row for each group: services, share of perfect ones, rate of each issue."""
        scheme = self.world.scheme
        x = issues.indicators(self.services, scheme.issues)
        inside = scheme.inside(scheme.codes(self.services))
        good = testing.perfect(self.services)
        rows = []
        for column, (identity, group) in enumerate(scheme.groups):
            member = inside[:, column] == 1.0
            rates = {}
            for k, name in enumerate(scheme.issue_names):
                known = x[member, k][~np.isnan(x[member, k])]
                rates[name] = float(known.mean()) if len(known) else None
            perfect = float(good[member].mean()) if member.any() else None
            counted = {"services": int(member.sum()), "perfect_rate": perfect}
            rows.append({"identity": identity, "group": group} | counted | rates)
        return rows

    @property
    def frame(self) -> pd.DataFrame:
        """``groups`` as a data frame."""
        return data_frame(self.groups)

    def plot(self) -> Figure:
        """Share of perfect services of every group, with 95 % intervals (Wilson)."""
        from evenhand.report import style

        rows = [row for row in self.groups if row["services"]]
        n = np.array([row["services"] for row in rows])
        rate = np.array([row["perfect_rate"] for row in rows])
        low, high = wilson(np.round(rate * n), n)
        with style.drawing():
            figure = style.new_figure(True, 0.6 + 0.17 * len(rows))
            ax = figure.subplots()
            places = np.arange(len(rows))[::-1]
            ax.hlines(places, 100 * low, 100 * high, color=style.GREY)
            ax.plot(100 * rate, places, "o", color=style.INK)
            names = [f"{row['identity']}: {row['group']} ({row['services']:,})" for row in rows]
            ax.set_yticks(places, names)
            ax.axvline(100 * self.summary["perfect_rate"], color=style.GREY, linewidth=0.8)
            ax.set_xlabel("perfect services, % (95 % interval; line: everybody)")
        return figure

    def _numbers(self) -> list[tuple[str, str]]:
        found = self.summary
        return [
            ("robot", self.who),
            ("scenario", self.world.name),
            ("services", f"{found['services']:,}"),
            ("seed", str(self.seed)),
            ("total issue score", f"{found['total']:.3f}"),
            ("total that chance alone gives", f"{found['floor']:.3f}"),
            ("perfect services", _percent(found["perfect_rate"])),
            ("perfect services, worst-served group", _percent(found["worst_group_rate"])),
        ]

    def __repr__(self) -> str:
        return f"Evaluation({', '.join(f'{name}: {text}' for name, text in self._numbers())})"

    def _repr_html_(self) -> str:
        return _table(self._numbers(), "Test on people that training never saw")


@dataclass(frozen=True)
class Comparison:
    """Methods compared in scenarios.

    Attributes:
        folder: with every run, table and figure, and report.html.
    """

    folder: Path
    rows: Sequence[Mapping[str, Any]] = field(repr=False)

    @property
    def frame(self) -> pd.DataFrame:
        """A row for each scenario, algorithm, arm, seed and metric, with its value."""
        from evenhand.experiments.comparison.read import SCHEMAS
        from evenhand.report.read_tables import read_table

        return _data_frame_of(read_table(self.folder / "results.csv", SCHEMAS["results"]))

    @property
    def summary(self) -> pd.DataFrame:
        """A row for each scenario, algorithm and arm: interquartile means and intervals."""
        return data_frame(self.rows)

    def plot(self) -> Figure:
        """Evenness against service, a panel for each scenario, of the first algorithm."""
        from evenhand.experiments.comparison import figures
        from evenhand.report import style

        with style.drawing():
            return figures.figure_of(self.rows)

    def report(self, path: str | os.PathLike[str]) -> Path:
        """Write the report as one HTML page that needs nothing else.

        Raises:
            InputError: when the file cannot be written.
        """
        target = Path(path)
        files.write_text(target, (self.folder / "report.html").read_text(encoding="utf-8"))
        return target

    def _numbers(self) -> list[tuple[str, str]]:
        return [
            (
                f"{row['arm']} in {row['scenario']}, {row['algorithm']}",
                f"corrected total {row['corrected_total']:.3f}, perfect services "
                f"{_percent(row['perfect_rate'])} ({row['seeds']} seeds)",
            )
            for row in self.rows
        ]

    def __repr__(self) -> str:
        lines = "\n".join(f"  {name}: {text}" for name, text in self._numbers())
        return f"Comparison in {self.folder}, interquartile means over seeds:\n{lines}"

    def _repr_html_(self) -> str:
        return _table(self._numbers(), "Interquartile means over seeds")


def _data_frame_of(data: Any) -> pd.DataFrame:
    names = list(data.columns)
    return data_frame(
        [dict(zip(names, row, strict=True)) for row in zip(*data.columns.values(), strict=True)]
    )


def train(
    scenario: str = "even",
    guidance: Any = "penalty",
    *,
    preset: str = "service",
    algorithm: str = "ppo",
    epochs: int = 300,
    people: int = 30,
    population: str | None = None,
    policy: str = "mlp",
    seed: int = 0,
    settings: TrainSettings | None = None,
    detector: Detector | str | os.PathLike[str] | None = None,
    judges: IssueWeights | str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    threads: int = CORES,
    progress: bool = False,
) -> Run:
    """Train a robot, as `evenhand train` does with the same settings, bit for bit.

    Args:
        scenario: where unevenness comes from.
        guidance: the method: NAME, NAME@STRENGTH, or an object.
        preset: paper or service, what is rewarded.
        algorithm: ppo, reinforce, ppo-all or reinforce-all; with -all every moment of responding is
            weighed by what would have come of it.
        epochs: updates.
        people: services in an epoch.
        population: where people are drawn from; that of the scenario by default.
        policy: name of the network.
        seed: of everything random.
        settings: everything at once; then nothing above may be given.
        detector: judges every epoch, or its file; the one that comes with Evenhand by default.
            For a method that asks for verdicts.
        judges: what people mind, or a file of their answers or of a detector: the weights of the
            issues.
        out: a folder that keeps the run, and from which it resumes.
        threads: that step the physics; results are the same on any number.
        progress: show a bar.

    Raises:
        InputError: for settings that do not exist or do not go together, or a folder that cannot
            be used.
    """
    given = {
        "scenario": scenario, "guidance": guidance, "preset": preset, "algorithm": algorithm,
        "epochs": epochs, "people": people, "population": population, "policy": policy,
        "seed": seed, "judges": judges,
    }  # fmt: skip
    whole("threads", threads, *THREADS)
    set_up_jax()
    if settings is None:
        base = settings_of(
            preset, algorithm, guidance, seed=seed, epochs=epochs, population=population
        )
        weights = judges
        if judges is not None and not isinstance(judges, IssueWeights):
            weights = issue_weights.read(Path(judges))
        assert weights is None or isinstance(weights, IssueWeights)
        settings = replace(
            base, people=people, scenario=scenario, policy=replace(base.policy, kind=policy),
            judges=weights,
        )  # fmt: skip
    else:
        usual = inspect.signature(train).parameters
        for name, value in given.items():
            if value != usual[name].default:
                raise InputError(
                    f"conflict {name}",
                    f"{name} and settings are both given: put {name} into settings",
                )
    judge = detector
    if detector is None:
        judge = learning.shipped_detector(settings)
    else:
        learning.check_steering(settings)
        if not isinstance(detector, Detector):
            judge = detector_file.load(Path(detector))
    assert judge is None or isinstance(judge, Detector)
    with terminal.stages() if progress else terminal.silent() as stage:
        tell = stage(f"{settings.update.algorithm}, seed {settings.seed}", settings.epochs)
        if out is not None:
            folder = Path(out)
            state = run_folder.execute(
                folder,
                settings,
                judge,
                progress=lambda numbers: tell(int("epoch" in numbers), numbers),
                recorded=True,
                threads=threads,
            )
            lines = epoch_log.read(folder)
            return Run(settings, state, lines, run_folder.read_services(folder), folder)
        learning.check_detector(judge, settings)
        lines, tables, state = [], [], None
        for record in learning.train(settings, judge, threads=threads):
            tell(1, record.numbers)
            numbers = {k: v for k, v in record.numbers.items() if not k.startswith("time_")}
            lines.append({"epoch": record.epoch} | numbers)
            tables.append(record.services)
            state = record.state
    assert state is not None
    return Run(settings, state, lines, Services.concat(tables))


def evaluate(
    robot: Run | ScriptedRobot | str | os.PathLike[str],
    scenario: str | World | None = None,
    population: str | None = None,
    *,
    services: int = 3000,
    seed: int = TEST_SEED,
    threads: int = CORES,
) -> Evaluation:
    """Let a robot serve people that it never saw, as `evenhand evaluate` does, bit for bit.

    Args:
        robot: a run or its folder; or a scripted robot: even, racist, sexist, ageist or ableist.
        scenario: where; that of the training by default, or even for a scripted robot.
        population: where people are drawn from; that of the scenario by default.
        services: how many people.
        seed: of people, places and chances; choose one that training has not used.
        threads: that step the physics; results are the same on any number.

    Raises:
        InputError: for unknown names, numbers out of range, a folder without a run, or people
            with other identities than in training.
    """
    whole("services", services, 30, SERVICES[1])
    whole("seed", seed, *SEEDS)
    whole("threads", threads, *THREADS)
    set_up_jax()
    if isinstance(robot, str) and not Path(robot).is_dir():
        robot = ScriptedRobot(robot)
    if isinstance(robot, ScriptedRobot):
        world = _world(scenario or "even", population)
        table = testing.serve_scripted(robot, world, services, seed, threads=threads)
        return Evaluation(robot.name, world, table, seed)
    if isinstance(robot, Run):
        settings, state = robot.settings, robot.state
    else:
        settings, state = run_folder.load_policy(robot)
    world = (
        _world(scenario, population)
        if isinstance(scenario, World)
        else settings.elsewhere(scenario, population)
    )
    table = testing.serve_policy(state, settings, services, seed, world, threads=threads)
    return Evaluation(registry.name_of(settings.method), world, table, seed)


def _world(scenario: str | World, population: str | None) -> World:
    if not isinstance(scenario, World):
        return worlds.scenario(scenario, population)
    return scenario if population is None else replace(scenario, population=population)


def compare(
    arms: Sequence[str],
    *,
    scenarios: Sequence[str] = ("even",),
    algorithms: Sequence[str] = ("ppo",),
    seeds: int = 3,
    first_seed: int = 0,
    epochs: int = 300,
    services: int = 5000,
    out: str | os.PathLike[str] | None = None,
    workers: int = CORES,
    progress: bool = False,
) -> Comparison:
    """Compare methods in scenarios, as `evenhand compare` does with the same settings.

    Args:
        arms: methods, NAME or NAME@STRENGTH, and the controls reference and untrained.
        scenarios: where unevenness comes from.
        algorithms: what learns, as in `train`.
        seeds: runs of every arm.
        first_seed: the first of these seeds.
        epochs: updates of every run.
        services: in the test of every run.
        out: folder of the runs, which resumes; by default a temporary one, gone with the result.
        workers: processes; results do not depend on it. What the running script or session
            itself has registered is known in this process alone: then there is one.
        progress: show bars.

    Raises:
        InputError: for unknown names, or a folder that cannot be used.
    """
    from evenhand.experiments.comparison import compare as comparing
    from evenhand.experiments.comparison import tables
    from evenhand.experiments.comparison.settings import CompareSettings

    temporary = tempfile.mkdtemp(prefix="evenhand-compare-") if out is None else None
    folder = Path(out if out is not None else str(temporary))
    settings = CompareSettings(
        out=folder, scenarios=tuple(scenarios), arms=tuple(arms), algorithms=tuple(algorithms),
        seeds=seeds, first_seed=first_seed, epochs=epochs, services=services, workers=workers,
    )  # fmt: skip
    if _of_session(settings.arms, settings.scenarios):
        settings = replace(settings, workers=1)

    def announce(sentence: str) -> None:
        if progress:
            print(sentence, file=sys.stderr)

    with terminal.stages() if progress else terminal.silent() as stage:
        rows = comparing.compare(settings, stage, announce, "evenhand.compare")
    result = Comparison(settings.out, tables.shown(rows))
    if temporary is not None:
        weakref.finalize(result, shutil.rmtree, temporary, ignore_errors=True)
    return result


def _of_session(arms: Sequence[str], scenarios: Sequence[str]) -> bool:
    """Whether something was registered by the running script, session or an imported module."""
    from evenhand.experiments.comparison.settings import learns, method_of

    kinds = [registry.entry(method_of(arm)[0]).kind for arm in arms if learns(arm)]
    names = [one for name in scenarios for one in name.split("+")]
    return any(
        not plugins.reaches_workers(kind.__module__, registry.GROUP) for kind in kinds
    ) or any(map(worlds.of_session, names))
