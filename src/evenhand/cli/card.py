"""``evenhand card``."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from evenhand.cli import inputs
from evenhand.cli.inputs import OPTIONAL, Plugin
from evenhand.cli.train import Train
from evenhand.core import files
from evenhand.core.errors import InputError, whole
from evenhand.experiments.settings import SEEDS, SERVICES, TEST_SEED
from evenhand.methods import registry

if TYPE_CHECKING:
    from evenhand.report.model_cards.robot import Robot, Trial
    from evenhand.report.model_cards.sections import Said
    from evenhand.training.settings import TrainSettings


@dataclass(frozen=True)
class Card:
    """Write the model card of a trained robot or of a detector, as Hugging Face shows them.

    A robot serves new people for its card, and every group is shown with its number and its
    interval. What was not measured is called so. The card is a Markdown file; nothing is sent.

    For instance: evenhand card out/run --out README.md
    """

    file: Annotated[Positional[Path], arg(metavar="RUN|FILE")]
    """Folder of a run, whose last checkpoint serves; or the file of a detector, *.json."""

    out: Annotated[Path, arg(metavar="FILE")]
    """The card to write, *.md; one that is there is replaced."""

    name: Annotated[str | None, arg(metavar="TEXT", help_behavior_hint="(of the file)")] = None
    """What the model is called."""

    licence: Annotated[str | None, arg(metavar="ID", help_behavior_hint="(not stated)")] = None
    """Its licence, as Hugging Face spells it, such as apache-2.0."""

    plugin: Plugin = ()

    notes: Annotated[str, arg(metavar="TEXT", help_behavior_hint=OPTIONAL)] = ""
    """Anything that readers should know; shown as plain text."""

    services: int = 3000
    """New people whom a robot serves for its card; 0 leaves the evaluation out."""

    seed: int = TEST_SEED
    """Of these people, places and chances; take one that training has not used."""

    answers: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint=OPTIONAL)] = None
    """Answers that a detector was fitted to (CSV); with them its accuracy is measured."""

    def run(self, command: str) -> int:
        """Read, measure, write, print the path."""
        self._check()
        if self.file.is_dir():
            inputs.load_physics("train")
        from evenhand.report.model_cards.sections import Said

        name = self.name if self.name is not None else self.file.resolve().stem
        said = Said(name, self.licence, self.notes)
        page = self._robot(said) if self.file.is_dir() else self._judge(said)
        files.write_text(self.out, page)
        print(self.out)
        return 0

    def _check(self) -> None:
        if self.out.suffix != ".md":
            raise InputError("unknown file", f"{self.out} does not end in .md: give such a file")
        if self.out.is_dir():
            raise InputError("conflict out", f"{self.out} is a folder: give the name of a file")
        if not self.file.exists():
            raise InputError(
                "missing file",
                f"{self.file} does not exist: give the folder of a run or a detector",
            )
        if self.services:
            whole("services", self.services, 30, SERVICES[1])
        whole("seed", self.seed, *SEEDS)
        if self.file.is_dir() and self.answers is not None:
            raise InputError("conflict answers", "--answers belongs to a detector: leave it out")
        files.make_folder(self.out.parent)

    def _judge(self, said: Said) -> str:
        from evenhand.experiments import model_card_numbers
        from evenhand.methods import detector_file
        from evenhand.methods.vocabulary import SIMULATED
        from evenhand.report.model_cards import detector

        found = detector_file.load(self.file)
        if self.answers is None:
            return detector.render(said, found, None)
        answers = detector_file.read_answers(
            self.answers, issues=found.issues, missing=found.source == SIMULATED
        )
        return detector.render(said, found, model_card_numbers.evaluation_of(found, answers))

    def _robot(self, said: Said) -> str:
        from evenhand.experiments import model_card_numbers
        from evenhand.report.model_cards import robot
        from evenhand.training import evaluate

        settings, state = inputs.load_policy(self.file)
        about = self._about(settings, int(state.step))
        population = settings.world.people.name
        trial: Trial | None = None
        if self.services:
            table = evaluate.serve_policy(state, settings, self.services, self.seed)
            trial = model_card_numbers.trial_of(table, self.seed, population)
        return robot.render(said, about, trial)

    def _about(self, settings: TrainSettings, epochs: int) -> Robot:
        from evenhand.methods import detector_file
        from evenhand.report.model_cards.robot import Robot
        from evenhand.training import epoch_log

        judge = detector_file.load(self.file / "detector.json")
        shipped = judge == detector_file.load(detector_file.SHIPPED)
        noted = files.read_record(self.file / "settings.json", "settings", "versions")
        lines = epoch_log.read(self.file)
        if len(lines) < epochs:
            raise InputError(
                "changed epochs",
                f"{self.file / 'epochs.jsonl'} has {len(lines)} lines, but {epochs} epochs have "
                "run: restore it, or train again",
            )
        return Robot(
            settings=noted["settings"],
            versions=noted["versions"],
            epochs=epochs,
            population=settings.world.people.name,
            judge=f"{judge.rows} judgements by {judge.source}",
            command=repeating(settings, shipped),
            last=lines[epochs - 1],
        )


def repeating(settings: TrainSettings, shipped: bool) -> str | None:
    """The command that trains with these settings.

    Returns:
        None when options cannot say all of the settings.
    """
    method = settings.method
    name, strength = registry.name_of(method), registry.strength_of(method)
    spelled = registry.spelled(name, strength)
    usual = registry.create(spelled)
    changed = {
        one.name: getattr(method, one.name)
        for one in fields(method)
        if getattr(method, one.name) != getattr(usual, one.name)
    }
    wanted: dict[str, Any] = {
        "preset": settings.preset,
        "algorithm": settings.update.algorithm,
        "guidance": name if registry.create(name) == usual else spelled,
        "set": tuple(f"{field}={_text(value)}" for field, value in changed.items()),
        "tau": ",".join(f"{weight:g}" for weight in settings.tau),
    }
    wanted |= {
        name: getattr(settings, name)
        for name in ("scenario", "seed", "epochs", "people", "population")
    }
    plain = {one.name: one.default for one in fields(Train)}
    for left_out in ({"tau"}, set()):
        given = {
            name: value
            for name, value in wanted.items()
            if name not in left_out and value != plain[name]
        }
        try:
            if Train(out=Path("RUN"), **given).settings() != settings:
                continue
        except InputError:
            continue
        words = ["evenhand", "train", "--out", "RUN"]
        words += [] if shipped else ["--detector", "RUN/detector.json"]
        for name, value in given.items():
            words.append(f"--{name.replace('_', '-')}")
            words += map(str, value) if isinstance(value, tuple) else [str(value)]
        return shlex.join(words)
    return None


def _text(value: Any) -> str:
    """A setting of a method as ``--set`` takes it."""
    if isinstance(value, tuple):
        return ",".join(map(str, value))
    return str(value).lower() if isinstance(value, bool) else str(value)
