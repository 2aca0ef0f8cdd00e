"""``evenhand film``."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from evenhand.cli import inputs
from evenhand.cli.inputs import OPTIONAL, Plugin, Robot, Strength
from evenhand.core.errors import InputError, whole
from evenhand.experiments.settings import SEEDS, TEST_SEED

if TYPE_CHECKING:
    from evenhand.experiments.footage import Footage
    from evenhand.restaurant.film.clip import Style

_STUDY = "study"
_MOST = 1000
"""Services that one command films."""


@dataclass(frozen=True)
class Film:
    """Make clips of services: MP4 that every browser plays, 25 pictures a second.

    Of a run: evenhand film out/run --services 3,17. Of a scripted robot: evenhand film --robot
    ageist --services 0,4 films what evenhand evaluate serves with the same seed.

    The clips of the questionnaire: evenhand film study. It shows the paper's four scenarios, one
    for each issue, with even controls, and says in clips.json what is in which clip. Raters must
    not be primed: these clips have neither timer nor rings, the end says only whether the robot
    responded, and names of files tell nothing.
    """

    run_folder: Annotated[
        Positional[str | None], arg(metavar="RUN", help_behavior_hint=OPTIONAL)
    ] = None
    """Folder of a run that kept its states; or the word study (give ./study for such a folder)."""

    services: Annotated[str | None, arg(metavar="A,B,...", help_behavior_hint=OPTIONAL)] = None
    """Numbers of the services to film, as in the column service; joined by commas."""

    robot: Robot = None
    """Instead of a run, a scripted robot: even, racist, sexist, ageist or ableist."""

    strength: Strength = None
    """Of the scripted robot's bias, 0 to 1."""

    seed: Annotated[
        int | None, arg(metavar="INT", help_behavior_hint=f"(default: {TEST_SEED}; study: 0)")
    ] = None
    """Of people, places and chances of a scripted robot, or of the study."""

    population: Annotated[
        str | None, arg(metavar="uniform|us|fairface", help_behavior_hint="(default: uniform)")
    ] = None
    """Where people of a scripted robot are drawn from."""

    plugin: Plugin = ()

    out: Annotated[Path, arg(metavar="FOLDER")] = Path("out/film")
    """Where clips are written."""

    camera: Annotated[
        Literal["room", "robot", "guest"] | None,
        arg(metavar="room|robot|guest", help_behavior_hint="(default: room; study: guest)"),
    ] = None
    """The whole room, over the robot's shoulder, or beside the guest who asks."""

    size: Annotated[str, arg(metavar="WIDTHxHEIGHT")] = "640x480"
    """Of the picture, pixels; from 320x240 to 1280x960, both even."""

    no_timer: bool = False
    """Leave out the timer in seconds and physics steps."""

    no_rings: bool = False
    """Leave out the rings at 1.5, 1.0 and 0.5 m around the person who asks."""

    no_caption: bool = False
    """Leave out how the service ended: response, time, distance and issues."""

    plain: bool = False
    """Leave out all three, for raters; with study also the words that say whether the robot
    responded."""

    def run(self, command: str) -> int:
        """Draw, encode, print the paths."""
        study = self.run_folder == _STUDY
        self._check(study)
        services = _numbers(self.services) if self.services is not None else []
        width, height = _size(self.size)
        inputs.load_physics("film")
        from evenhand.core import files, terminal
        from evenhand.experiments.paper import questionnaire_clips as questionnaire
        from evenhand.restaurant.film import clip, encoder

        style = replace(
            self._style(questionnaire.STYLE if study else clip.Style()), width=width, height=height
        )
        # what is missing is said before long work, and nothing is written then
        encoder.ffmpeg()
        with terminal.stages() as stage:

            def begin(name: str, units: int) -> Callable[[int], None]:
                tell = stage(name, units)
                return lambda done: tell(done, {})

            if study:
                for path in questionnaire.film(self.out, self.seed or 0, style, stage=begin):
                    print(path)
                return 0
            footage = self._footage(services)
            rows = range(len(footage))
            with contextlib.closing(style.screen()) as screen:
                folder = files.make_folder(self.out)
                tell = begin("film", sum(clip.length(footage, row, style) for row in rows))
                for row, number in enumerate(services):
                    path = folder / f"service-{number}-{style.camera}.mp4"
                    clip.shoot(path, footage, row, style, screen, tell)
                    print(path, flush=True)
        return 0

    def _check(self, study: bool) -> None:
        given = (self.run_folder is not None) + (self.robot is not None)
        if given != 1:
            raise InputError(
                "conflict folder",
                "name the folder of a run, or a scripted robot with --robot, or the word study: "
                "one of the three",
            )
        if study and self.services is not None:
            raise InputError(
                "conflict services",
                "--services does not go with study, which chooses its own: leave out",
            )
        if not study and self.services is None:
            raise InputError(
                "missing services", "--services is missing: name the services to film, as 3,17"
            )
        for option, value in (("strength", self.strength), ("population", self.population)):
            if self.robot is None and value is not None:
                raise InputError(
                    f"conflict {option}",
                    f"--{option} belongs to a scripted robot: leave it out, or name --robot",
                )
        if self.seed is not None:
            if self.robot is None and not study:
                raise InputError(
                    "conflict seed", "--seed belongs to a scripted robot and to study: leave it out"
                )
            whole("seed", self.seed, *SEEDS)

    def _style(self, base: Style) -> Style:
        silent = self.plain or self.no_caption
        return replace(
            base,
            camera=self.camera or base.camera,
            timer=base.timer and not (self.no_timer or self.plain),
            rings=base.rings and not (self.no_rings or self.plain),
            caption="none" if silent else base.caption,
        )

    def _footage(self, services: list[int]) -> Footage:
        from evenhand.experiments import footage as sources

        if self.robot is None:
            return sources.from_run(str(self.run_folder), services)
        if max(services) >= sources.SERVED:
            raise InputError(
                "range services",
                f"service {max(services)} does not exist: a scripted robot serves "
                f"{sources.SERVED} people, give numbers from 0 to {sources.SERVED - 1}",
            )
        whole_footage = sources.from_robot(
            self.robot,
            1.0 if self.strength is None else self.strength,
            self.population or "uniform",
            TEST_SEED if self.seed is None else self.seed,
        )
        return whole_footage.take(services)


def _numbers(text: str) -> list[int]:
    parts = [part.strip() for part in text.split(",")]
    for part in parts:
        if not re.fullmatch(r"[0-9]{1,9}", part, re.ASCII):
            raise InputError(
                "format services",
                f"services is {text!r}: give whole numbers of at least 0 joined by commas, as 3,17",
            )
    numbers = [int(part) for part in parts]
    for number in numbers:
        if numbers.count(number) > 1:
            raise InputError(
                "duplicate services", f"service {number} is named twice: name each service once"
            )
    if len(numbers) > _MOST:
        raise InputError(
            "range services", f"{len(numbers)} services are named: film {_MOST} at most at a time"
        )
    return numbers


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"([0-9]{1,5})x([0-9]{1,5})", text, re.ASCII)
    if found is None:
        raise InputError(
            "format size", f"size is {text!r}: give width and height in pixels, as 640x480"
        )
    return int(found[1]), int(found[2])
