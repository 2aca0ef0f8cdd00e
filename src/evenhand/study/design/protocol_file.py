"""A study read from its TOML file, with every mistake and its line."""

import math
import os
import re
from collections.abc import Iterator
from dataclasses import replace
from importlib.resources import files as resources
from pathlib import Path
from typing import Any

from evenhand.core.errors import InputError
from evenhand.core.toml_file import ID, Mistake, Place, Table, content_of, located, text_of
from evenhand.methods.vocabulary import ISSUES
from evenhand.study.design import protocol
from evenhand.study.design.protocol import (
    LONGEST,
    Check,
    ClipSet,
    Demographic,
    Option,
    Pair,
    Protocol,
    Question,
)

FORMAT = 1
PAPER = Path(str(resources("evenhand.study.design") / "data" / "paper.toml"))
"""The paper's study, as far as the paper tells it."""
CLIP = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}\.(mp4|webm)")
_HTTPS = re.compile(r"https://[^\s\"'<>\\]+")
_OPEN = re.compile(r"\[\[[^\[\]]+\]\]")
_GIVEN = {
    "scale": ("points", "low", "high", "lowest_is_unfair"),
    "choice": ("options",),
    "choices": ("options",),
    "pair": ("options",),
    "text": ("longest",),
}


def read(path: str | os.PathLike[str], clips: Path | None = None) -> Protocol:
    """Read a study whose clips are all there.

    Args:
        path: of the file.
        clips: folder of the clips, instead of the one that the file names.

    Raises:
        InputError: when the file cannot be read or has mistakes; the first is told.
    """
    found, wrong = examine(path, clips)
    if found is None:
        more = f" ({len(wrong)} mistakes: see `evenhand study check {path}`)"
        raise InputError("format file", f"{path}, {wrong[0]}" + (more if len(wrong) > 1 else ""))
    return found


def examine(
    path: str | os.PathLike[str], clips: Path | None = None, *, look: bool = True
) -> tuple[Protocol | None, list[Mistake]]:
    """Read a study and collect all its mistakes; there is no study when there is any.

    Args:
        path: of the file.
        clips: folder of the clips, instead of the one that the file names.
        look: whether a clip that is not there, or is no film, is a mistake.
    """
    text = text_of(path)
    content = content_of(text)
    if isinstance(content, Mistake):
        return None, [content]
    wrong: list[tuple[Place, str]] = []
    study = _study(Table(content, (), wrong), Path(path).parent)
    study = study if clips is None else replace(study, clips=clips)
    wrong += _fitting(study, [place for place, _ in wrong])
    if look:
        wrong += [*_missing(study), *_no_films(study)]
    if not wrong:
        return study, []
    return None, located(text, wrong, _named)


def _missing(study: Protocol) -> Iterator[tuple[Place, str]]:
    """Sets whose clips are not in the study's folder, or cannot be read there."""
    for number, one in enumerate(study.sets):
        lost = [name for name in one.clips if not os.access(study.clips / name, os.R_OK)]
        # a name that is none was complained about
        if lost and all(CLIP.fullmatch(name) for name in lost):
            are = "is" if len(lost) == 1 else "are"
            if study.clips.is_relative_to(PAPER.parent):  # no place to put anything
                where = "there, for the paper's study comes without clips: name their folder with"
                told = f"{where} --clips FOLDER, after `evenhand film study --out FOLDER`"
            else:
                told = f"in the folder {study.clips}: put clips there, for instance with "
                told += f"`evenhand film study --out {study.clips}`, or name their folder with "
                told += "--clips FOLDER"
            yield ("sets", number, "clips"), f"{', '.join(lost)} {are} not {told}"


def _no_films(study: Protocol) -> Iterator[tuple[Place, str]]:
    """Clips that are there but are none, by their first bytes (ISO/IEC 14496-12, RFC 8794)."""
    for number, one in enumerate(study.sets):
        for name in filter(CLIP.fullmatch, one.clips):
            try:
                with (study.clips / name).open("rb") as file:
                    head = file.read(12)
            except OSError:
                continue  # was complained about
            if name.endswith(".mp4"):
                kind, right = "MP4", head[4:8] == b"ftyp"
            else:
                kind, right = "WebM", head[:4] == b"\x1a\x45\xdf\xa3"
            if not right:
                told = f"{name} is no {kind} film, and browsers could not show it: export it anew"
                yield ("sets", number, "clips"), told


def unfinished(study: Protocol) -> list[str]:
    """What the lead still has to write: everything in [[double brackets]]."""
    shown = (study.title, study.consent, study.contact, study.thanks)
    return [found for text in shown for found in _OPEN.findall(text)]


def _named(place: Place) -> str:
    """A place as words: sets 3, clips."""
    told = ""
    for word in place:
        told += f" {word + 1}" if isinstance(word, int) else f"{'.' if told else ''}{word}"
    return told


def _fitting(study: Protocol, wrong: list[Place]) -> Iterator[tuple[Place, str]]:
    """What does not fit together, but for what may only follow from mistakes found before."""
    for place, sentence in protocol.mistakes(study):
        if len(place) == 1:
            doubtful = any(one[:1] in ((), place) for one in wrong)
        else:
            names_sets = place[0] == "pairs" and place[-1] in ("first", "second")
            doubtful = any(
                one[:2] in (place[:2], place[:1]) or (names_sets and one[:1] == ("sets",))
                for one in wrong
            )
        if not doubtful:
            yield place, sentence


def _study(file: Table, folder: Path) -> Protocol:
    file.whole("format", FORMAT, FORMAT)
    study, consent = file.table("study"), file.table("consent")
    values: dict[str, Any] = {
        "name": study.text("name", 40, pattern=ID, shape="a-z, 0-9 and hyphens"),
        "title": study.text("title", LONGEST["label"]),
        "language": study.text(
            "language", 35, "en", re.compile(r"[A-Za-z]{2,3}(-[A-Za-z0-9]{2,8})*"), "as en or pt-BR"
        ),
        "minutes": study.whole("minutes", 1, 600, 15),
        "seed": study.whole("seed", 0, 2**32 - 1, 0),
        "contact": study.text("contact", LONGEST["ask"], ""),
        "thanks": study.text("thanks", LONGEST["long"], "Thank you."),
        "completion_code": study.text(
            "completion_code", 100, "", re.compile(r"[A-Za-z0-9_-]*"), "letters, digits, - and _"
        ),
        "redirect": study.text(
            "redirect", 1000, "", _HTTPS, "an address that begins with https://"
        ),
        "shared_computer": study.flag("shared_computer", False),
        "order": study.one_of("order", protocol.ORDERS, "latin"),
        "length": study.whole("length", 0, 1000, 0),
        "clips": folder / study.text("clips", 1000, "clips"),
        "consent_version": consent.text("version", LONGEST["id"]),
        "consent": consent.text("text", LONGEST["long"]),
        "demographics": tuple(_demographic(one) for one in file.tables("demographics")),
        "sets": tuple(_set(one) for one in file.tables("sets", needed=True)),
        "questions": tuple(_asked(one) for one in file.tables("questions", needed=True)),
        "pairs": tuple(_pair(one) for one in file.tables("pairs")),
        "checks": tuple(_check(one) for one in file.tables("checks")),
    }
    for one in (study, consent, file):
        one.done()
    return Protocol(**values)


def _demographic(one: Table) -> Demographic:
    found = Demographic(
        id=one.id(),
        ask=one.text("ask", LONGEST["ask"]),
        options=one.texts("options", 1, 60, LONGEST["label"]),
    )
    one.done()
    return found


def _set(one: Table) -> ClipSet:
    scores = one.table("scores", needed=False)
    found = ClipSet(
        id=one.id(),
        clips=one.texts("clips", 1, 20, 110, CLIP, "names of .mp4 or .webm files, without folders"),
        captions=one.texts("captions", 0, 20, LONGEST["ask"], default=()),
        kind=one.one_of("kind", protocol.KINDS, "scenario"),
        scores={
            name: _scores(scores, name) for name in protocol.IDENTITIES if name in scores.content
        },
        note=one.text("note", LONGEST["ask"], ""),
    )
    scores.done(protocol.IDENTITIES)
    one.done()
    return found


def _scores(one: Table, name: str) -> tuple[float, float, float, float]:
    value = one.get(name)
    numbers = value if isinstance(value, list) else []
    good = [
        float(number)
        for number in numbers
        if isinstance(number, int | float) and not isinstance(number, bool)
        if math.isfinite(number) and -1 <= number <= 1
    ]
    if len(good) != len(ISSUES) or len(numbers) != len(ISSUES):
        one.note(name, f"give four scores from -1 to 1: {', '.join(ISSUES)}")
        return (0.0, 0.0, 0.0, 0.0)
    return (good[0], good[1], good[2], good[3])


def _asked(one: Table) -> Question:
    kind = one.one_of("type", protocol.TYPES)
    role = one.one_of("role", tuple(protocol.ROLES), "other")
    # a key that another type would have is unknown here
    given = _GIVEN.get(kind, ())
    values: dict[str, Any] = {}
    if "points" in given:
        values["points"] = one.whole("points", 2, 11, 7)
        values["low"] = one.text("low", LONGEST["label"])
        values["high"] = one.text("high", LONGEST["label"])
        values["lowest_is_unfair"] = one.flag("lowest_is_unfair", True)
    if "options" in given:
        options = tuple(_option(table) for table in one.tables("options"))
        if kind == "pair" and not options:
            options = tuple(Option(*pair) for pair in protocol.PAIR_OPTIONS)
        values["options"] = options
    if "longest" in given:
        values["longest"] = one.whole("longest", 1, LONGEST["answer"], LONGEST["answer"])
    found = Question(
        id=one.id(),
        ask=one.text("ask", LONGEST["ask"]),
        type=kind,
        role=role,
        about=one.one_of("about", protocol.ABOUT, "set"),
        required=one.flag("required", True),
        **values,
    )
    one.done(hidden=() if kind else tuple(key for keys in _GIVEN.values() for key in keys))
    return found


def _option(one: Table) -> Option:
    # "|" joins several values in what is exported
    value = one.text("value", LONGEST["id"], pattern=re.compile(r"[^|\s]+"), shape="no blank, no |")
    found = Option(value=value, label=one.text("label", LONGEST["label"]))
    one.done()
    return found


def _pair(one: Table) -> Pair:
    found = Pair(id=one.id(), first=one.text("first", 40), second=one.text("second", 40))
    one.done()
    return found


def _check(one: Table) -> Check:
    found = Check(
        id=one.id(),
        ask=one.text("ask", LONGEST["ask"]),
        options=one.texts("options", 2, 20, LONGEST["label"]),
        right=one.text("right", LONGEST["label"]),
        after=one.whole("after", 1, 1000),
    )
    one.done()
    return found
