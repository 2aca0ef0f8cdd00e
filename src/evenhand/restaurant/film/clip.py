"""A service as a clip: the pictures, one after another, and the file."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from evenhand.core.errors import InputError, unknown
from evenhand.methods.paper.issues import PAPER_ISSUES, Issue, indicators
from evenhand.methods.scheme import named
from evenhand.methods.services import Services
from evenhand.restaurant import floor_plan
from evenhand.restaurant.drawing import dressing
from evenhand.restaurant.drawing.renderer import Screen
from evenhand.restaurant.film import encoder, motion, rings, signs
from evenhand.restaurant.simulation.recording import Recording

SMALLEST = (320, 240)
"""Width and height below which nobody can read what is written into the picture, pixels."""
CAPTIONS = ("outcome", "response", "none")


@dataclass(frozen=True)
class Footage:
    """N services; row i of both is the same one.

    Attributes:
        seen: who stood where, and where the robot was.
        facts: what happened.
        issues: what can go wrong, as their world says.
    """

    seen: Recording
    facts: Services
    issues: tuple[Issue, ...] = PAPER_ISSUES

    def __len__(self) -> int:
        return len(self.seen)

    def take(self, rows: Sequence[int]) -> Footage:
        """Some of the services, in this order."""
        return Footage(self.seen[rows], self.facts.take(np.array(rows, np.int64)), self.issues)


@dataclass(frozen=True)
class Style:
    """How clips look.

    Attributes:
        camera: one of ``dressing.CAMERAS``.
        width: of the picture, pixels; even.
        height: likewise.
        timer: show seconds and physics steps.
        rings: show rings at 1.5, 1.0 and 0.5 m around the person.
        caption: what is said at the end. ``outcome``: response, time, distance and issues;
            ``response``: only whether the robot responded, which nothing else shows; ``none``.
        before: seconds that the picture stands still before the service.
        after: likewise after it, if there is a caption.
    """

    camera: str = "room"
    width: int = 640
    height: int = 480
    timer: bool = True
    rings: bool = True
    caption: str = "outcome"
    before: float = 0.5
    after: float = 1.5

    def __post_init__(self) -> None:
        if self.camera not in dressing.CAMERAS:
            raise unknown("camera", self.camera, dressing.CAMERAS)
        if self.caption not in CAPTIONS:
            raise unknown("caption", self.caption, CAPTIONS)
        for name, size, least, most in zip(
            ("width", "height"),
            (self.width, self.height),
            SMALLEST,
            dressing.LARGEST,
            strict=True,
        ):
            if not least <= size <= most or size % 2:
                raise InputError(
                    f"range {name}",
                    f"{name} of the picture is {size}: give an even number of pixels from {least} "
                    f"to {most}",
                )

    def screen(self) -> Screen:
        """A camera of this style.

        Raises:
            InputError: on a machine that lacks OpenGL.
        """
        model = rings.model(rings.THICK[self.camera]) if self.rings else None
        # a camera that drives along has to draw everything anew each time: smooth edges would take
        # twice as long, and nobody sees them in what moves
        return Screen(self.camera, self.width, self.height, self.camera != "robot", model)

    @property
    def stills(self) -> tuple[int, int]:
        """Pictures that stand still before and after a service, besides its own."""
        after = self.after if self.caption != "none" else 0.0
        return round(self.before * motion.RATE), round(after * motion.RATE)


@dataclass(frozen=True)
class Shot:
    """A clip that was written.

    Attributes:
        pictures: how many it has.
        sha256: of the bytes of its pictures, before they were encoded.
    """

    pictures: int
    sha256: str

    @property
    def seconds(self) -> float:
        """How long it is."""
        return self.pictures / motion.RATE


def length(footage: Footage, row: int, style: Style) -> int:
    """How many pictures a clip will have."""
    return len(motion.moments(_steps(footage, row))) + sum(style.stills)


def pictures(footage: Footage, row: int, style: Style, screen: Screen) -> Iterator[np.ndarray]:
    """The pictures of a service.

    Args:
        footage: services.
        row: which of them.
        style: how they look.
        screen: of that style.

    Yields:
        Red, green, blue, uint8 [height, width, 3], 25 a second.
    """
    seen, size = footage.seen, (style.width, style.height)
    moments = motion.moments(_steps(footage, row))
    poses = motion.poses(seen.pose[row, : seen.frames[row]], seen.interval, moments)
    always = [signs.legend(*size)] if style.rings else []
    screen.begin(seen, row)
    before, after = style.stills
    picture = np.empty(0)
    for number, (step, pose) in enumerate(zip(moments.tolist(), poses, strict=True)):
        picture = screen.move(pose)
        timer = [signs.timer(step, *size)] if style.timer else []
        signs.lay(picture, [*always, *timer])
        for _ in range(1 + (before if number == 0 else 0)):
            yield picture
    if style.caption != "none":
        plain = style.caption == "response"
        said = (
            response(footage.facts, row) if plain else outcome(footage.facts, row, footage.issues)
        )
        picture = picture.copy()
        signs.lay(picture, [signs.caption(said, *size)])
        for _ in range(after):
            yield picture


def shoot(
    path: str | os.PathLike[str],
    footage: Footage,
    row: int,
    style: Style,
    screen: Screen,
    tell: Callable[[int], None] = lambda _: None,
) -> Shot:
    """Write the clip of a service.

    Args:
        path: of the file.
        footage: services.
        row: which of them.
        style: how it looks.
        screen: of that style.
        tell: told of every picture, that there is one more.

    Raises:
        InputError: as ``encoder.write``.
    """

    def told() -> Iterator[np.ndarray]:
        for picture in pictures(footage, row, style, screen):
            yield picture
            tell(1)

    return Shot(*encoder.write(path, told()))


def issues_of(facts: Services, row: int, issues: tuple[Issue, ...] = PAPER_ISSUES) -> list[str]:
    """Names of the issues that a service has, see ``scheme.named``."""
    return named(issues, indicators(facts.take(np.array([row])), issues)[0])


def response(facts: Services, row: int) -> list[str]:
    """Whether the robot responded, in words that judge nothing."""
    responded = facts.fact("responded")[row] == 1.0
    return ["The robot responds." if responded else "The robot does not respond."]


def outcome(facts: Services, row: int, issues: tuple[Issue, ...] = PAPER_ISSUES) -> list[str]:
    """How a service ended, and its issues, in two lines."""
    if facts.fact("responded")[row] == 1.0:
        seconds = facts.fact("response_step")[row] * floor_plan.TIMESTEP
        metres = facts.fact("response_distance")[row]
        first = f"Responded after {seconds:.2f} s at {metres:.2f} m"
    else:
        first = f"No response within {facts.fact('steps')[row] * floor_plan.TIMESTEP:.2f} s"
    names = issues_of(facts, row, issues)
    many = "Issues" if len(names) > 1 else "Issue"
    return [first, f"{many}: {', '.join(names)}" if names else "No issue"]


def _steps(footage: Footage, row: int) -> int:
    """Physics steps that a service took."""
    return int(footage.seen.frames[row] - 1) * footage.seen.interval
