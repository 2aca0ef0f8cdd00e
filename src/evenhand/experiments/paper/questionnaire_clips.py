"""The clips of the questionnaire: four scenarios, one for each issue, and even controls.

The robots of the questionnaire have one manner for those they treat worse and serve everybody else
properly. A scenario is a few triples. In each, the biased robot serves somebody worse; it serves
somebody well who differs in the identities that it goes by, and in as little else as can be found;
and the even robot serves the first person, at the same place. So what differs within a triple is
what the robot makes of people. Race and gender are not drawn, for there is no body that belongs to
them: a questionnaire has to say who is served, in words, from the manifest.
"""

from __future__ import annotations

import contextlib
import copy
import functools
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evenhand.core import files
from evenhand.core.errors import InputError
from evenhand.experiments import footage
from evenhand.experiments.footage import Footage
from evenhand.methods.paper import issues
from evenhand.restaurant import floor_plan, people, robots
from evenhand.restaurant.drawing import dressing
from evenhand.restaurant.film import clip, motion
from evenhand.restaurant.film.clip import Style
from evenhand.restaurant.worlds import World

STYLE = Style(camera="guest", timer=False, rings=False, caption="response", before=1.0, after=2.0)
"""Nothing that tells raters what to think: no timer, no rings, no issues. A response alone cannot
be seen, so the end says whether there was one."""
MANIFEST = "clips.json"
TRIPLES = 2
"""In each scenario."""
SERVICES = 1500
"""Of each robot, to choose from."""
_FAR = 2.0
"""Metres at which a response is from afar beyond doubt."""
_SIDE = 0.14
"""Least angle between robot and person as the camera sees them, radians: neither hides the
other."""
_NEAR = 1.5
"""Least metres between camera and robot: else it fills the picture."""
_WIDE = 0.55
"""Greatest angle from the middle of the picture at which the robot is seen whole, radians."""


@dataclass(frozen=True)
class Scene:
    """One scenario of the questionnaire.

    Attributes:
        number: as in ``study.respondents.SCENARIOS``.
        issue: what is to be seen.
        robot: who serves.
        manner: how those are served who are treated worse, one of ``robots.MANNERS``.
        worse: identity -> categories of those.
        also: issues that may come with it.
    """

    number: int
    issue: str
    robot: str
    manner: str
    worse: Mapping[str, tuple[str, ...]]
    also: tuple[str, ...]


# A robot that only walks and responds is at the person's side when it has not responded, or not in
# time; and who comes nearer than 0.5 m is nearer than 1.0 m.
SCENES = (
    Scene(1, "willingness", "racist", "ignore", {"race": ("Black",)}, ("risk",)),
    Scene(2, "quality", "ableist", "far", {"disability": ("Yes",)}, ()),
    Scene(3, "priority", "ageist", "late", {"age": ("Child", "Elder")}, ("quality",)),
    Scene(
        4,
        "risk",
        "ableist and racist",
        "close",
        {"race": ("Black",), "disability": ("Yes",)},
        ("quality",),
    ),
)
"""The paper's four."""

_SKIN = [identity.name for identity in people.IDENTITIES].index("skin")
_MIDDLE = people.IDENTITIES[_SKIN].groups.index("IV")

ROLES = ("worse", "other", "even")
"""Who is treated worse, who is not, and the first person again, served by the even robot."""


@dataclass(frozen=True)
class Choice:
    """A clip to make.

    Attributes:
        scene: it belongs to.
        triple: number within the scenario, 0 first.
        role: one of ``ROLES``.
        service: number of the service.
    """

    scene: Scene
    triple: int
    role: str
    service: int

    @property
    def robot(self) -> str:
        """Who serves."""
        return "even" if self.role == "even" else self.scene.robot


def serve(seed: int, scenes: Sequence[Scene] = SCENES) -> dict[str, Footage]:
    """The services that clips are chosen from: robot -> the same people at the same places."""
    served = {}
    for one in (None, *scenes):
        name = "even" if one is None else one.robot
        robot = robots.Mannered(functools.partial(_manners, one))
        served[name] = footage.recorded(World(name="even"), robot, SERVICES, seed, name)
    return served


def _manners(one: Scene | None, codes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Proper, but for those whom the robot of a scenario treats worse."""
    del rng
    worse = np.zeros(len(codes), bool) if one is None else _sides(one, codes)[0]
    return np.where(worse, robots.MANNERS.index("proper" if one is None else one.manner), 0)


def choose(served: Mapping[str, Footage], scenes: Sequence[Scene] = SCENES) -> list[Choice]:
    """Search the clips, scenario by scenario; the same services give the same clips."""
    found: list[Choice] = []
    visible = _Sight()
    for one in scenes:
        pairs = _pairs(one, served[one.robot], served["even"], visible)
        if len(pairs) < TRIPLES:
            raise InputError(
                "empty seed",
                f"scenario {one.number} needs {TRIPLES} services that show {one.issue}, and "
                f"{len(pairs)} do: give another --seed",
            )
        for number, (worse, other) in enumerate(pairs):
            services = zip(ROLES, (worse, other, worse), strict=True)
            found += [Choice(one, number, *rest) for rest in services]
    return found


def _pairs(one: Scene, biased: Footage, even: Footage, visible: _Sight) -> list[tuple[int, int]]:
    """Services of who is treated worse and of who is not, ``TRIPLES`` of them at most."""
    codes = biased.seen.people[:, 0]
    has = issues.indicators(biased.facts) == 1.0
    names = [issue.name for issue in issues.PAPER_ISSUES]
    expected = [names.index(name) for name in (one.issue, *one.also)]
    start = biased.facts.fact("start_distance")
    member, stranger = _sides(one, codes)
    shown = member & has[:, expected[0]] & ~np.delete(has, expected, axis=1).any(axis=1)
    if one.manner == "far":
        shown &= start >= _FAR
    if "race" in one.worse:
        # races are told in words, and no skin should seem to contradict them
        shown &= codes[:, _SKIN] == _MIDDLE
    worse = [
        row
        for row in np.flatnonzero(shown & _perfect(even)).tolist()
        if visible(biased, row) and visible(even, row)
    ]
    others = [
        row for row in np.flatnonzero(stranger & _perfect(biased)).tolist() if visible(biased, row)
    ]
    if not others:
        return []
    alike = [i for i, identity in enumerate(people.IDENTITIES) if identity.name not in one.worse]
    ranked = []
    for row in worse:
        differs = (codes[others][:, alike] != codes[row, alike]).sum(axis=1)
        farther = np.abs(start[others] - start[row])
        best = min(zip(differs.tolist(), farther.tolist(), others, strict=True))
        ranked.append((has[row].sum(), *best[:2], row, best[2]))
    chosen: list[tuple[int, int]] = []
    for *_, row, other in sorted(ranked):
        # two triples are of two kinds of people
        fresh = all((codes[row] != codes[before]).any() for before, _ in chosen)
        if len(chosen) < TRIPLES and fresh and all(other != taken for _, taken in chosen):
            chosen.append((row, other))
    return chosen


def _perfect(footage: Footage) -> np.ndarray:
    x = issues.indicators(footage.facts)
    return (x == 0.0).all(axis=1)


def _sides(one: Scene, codes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Who is treated worse, and who differs from them in all that the robot goes by; bool [N]."""
    member, stranger = np.ones((2, len(codes)), bool)
    for column, identity in enumerate(people.IDENTITIES):
        if identity.name in one.worse:
            meant = [identity.groups.index(name) for name in one.worse[identity.name]]
            belongs = np.isin(codes[:, column], meant)
            member, stranger = member & belongs, stranger & ~belongs
    return member, stranger


class _Sight:
    """Tells whether robot and person stand beside each other in the picture, first and last."""

    def __init__(self) -> None:
        self._model = copy.copy(dressing.model())
        self._eyes: dict[int, np.ndarray] = {}

    def __call__(self, footage: Footage, row: int) -> bool:
        seen, model = footage.seen, self._model
        places, start = seen.position[row], seen.start[row]
        if row not in self._eyes:  # people and places are the same for every robot
            dressing.aim(model, STYLE.camera, start, places, start)
            self._eyes[row] = model.cam_pos[model.camera(STYLE.camera).id][:2].copy()
        eye = self._eyes[row]
        person = _direction(eye, places[0])
        middle = person + _turn(_direction(eye, start) - person) / 2
        last = seen.pose[row, seen.frames[row] - 1, :2]
        return all(
            abs(_turn(_direction(eye, robot) - person)) >= _SIDE
            and abs(_turn(_direction(eye, robot) - middle)) <= _WIDE
            and np.hypot(*(robot - eye)) >= _NEAR
            for robot in (start, last)
        )


def _direction(eye: np.ndarray, point: np.ndarray) -> float:
    x, y = point - eye
    return float(np.arctan2(y, x))


def _turn(angle: float) -> float:
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def film(
    folder: str | os.PathLike[str],
    seed: int,
    style: Style = STYLE,
    scenes: Sequence[Scene] = SCENES,
    stage: Callable[[str, int], Callable[[int], None]] = lambda _, __: lambda _: None,
) -> list[Path]:
    """Make the clips and their manifest.

    Returns:
        Paths of the clips, and last that of the manifest.
    """
    served = serve(seed, scenes)
    choices = choose(served, scenes)
    # names tell nothing, and neither does their order
    order = np.random.default_rng(seed).permutation(len(choices))
    lengths = [clip.length(served[c.robot], c.service, style) for c in choices]
    tell = stage("study", sum(lengths))
    entries, paths = [], []
    with contextlib.closing(style.screen()) as screen:
        root = files.make_folder(folder)
        for number, choice in enumerate(choices[i] for i in order):
            path = root / f"clip-{number + 1:02d}.mp4"
            footage = served[choice.robot]
            shot = clip.shoot(path, footage, choice.service, style, screen, tell)
            entries.append({"file": path.name} | _entry(choice, seed, footage, shot))
            paths.append(path)
    about = {
        "camera": style.camera,
        "size": [style.width, style.height],
        "pictures_per_second": motion.RATE,
        "seed": seed,
    }
    files.write_json(root / MANIFEST, about | {"clips": entries})
    return [*paths, root / MANIFEST]


def _entry(choice: Choice, seed: int, footage: Footage, shot: clip.Shot) -> dict[str, Any]:
    row, facts = choice.service, footage.facts
    responded = bool(facts.fact("responded")[row])
    person = people.labels(footage.seen.people[row, :1])
    outcome = {
        "responded": responded,
        "response_seconds": facts.fact("response_step")[row] * floor_plan.TIMESTEP
        if responded
        else None,
        "response_distance": facts.fact("response_distance")[row] if responded else None,
        "min_distance": facts.fact("min_distance")[row],
        "issues": clip.issues_of(facts, row),
    }
    return {
        "scenario": choice.scene.number,
        "issue": choice.scene.issue,
        "triple": choice.triple + 1,
        "role": choice.role,
        "robot": choice.robot,
        "manner": choice.scene.manner if choice.role == "worse" else "proper",
        "seed": seed,
        "service": choice.service,
        "person": {name: labels[0] for name, labels in person.items()},
        "outcome": outcome,
        "seconds": shot.seconds,
        "pictures_sha256": shot.sha256,
    }
