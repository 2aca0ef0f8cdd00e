"""A study as data: who is asked what, about which clips, in which order."""

import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from evenhand.core.toml_file import Place
from evenhand.methods.vocabulary import IDENTITIES, ISSUES

PREFER_NOT = "Prefer not to say"
"""Always among the answers about oneself; stored as no answer."""

TYPES = ("scale", "choice", "choices", "text", "pair")
ABOUT = ("set", "pair", "end")
ORDERS = ("latin", "random", "fixed")
KINDS = ("scenario", "control")
ROLES = {
    "fair": ("scale",),
    "issue": ("choice", "choices"),
    "identity": ("choice", "choices"),
    "free": ("text",),
    "pair": ("pair",),
    "other": TYPES,
}
"""What a question is for, and the types that it can have then."""
ROLE_ABOUT = {"fair": "set", "issue": "set", "identity": "set", "pair": "pair"}
"""What a question of a role has to be about, where it is not free."""
ROLE_VALUES = {"issue": (*ISSUES, "none"), "identity": (*IDENTITIES, "none")}
"""Values of the options of a role; what analysis reads."""
PAIR_OPTIONS = (
    ("first", "The first robot"),
    ("second", "The second robot"),
    ("same", "Both alike"),
)

LONGEST = {"id": 40, "label": 200, "ask": 1000, "long": 20_000, "answer": 2000}
"""Most characters of names, of labels, of questions, of consent and thanks, of a free answer."""

_BRACES = re.compile(r"\{[^{}]*\}")
_UNSEEN = (
    "thanks", "contact", "completion_code", "redirect", "shared_computer", "minutes", "clips",
    "title",
)  # fmt: skip


@dataclass(frozen=True)
class Option:
    """An answer that can be chosen: what is stored, and what is shown."""

    value: str
    label: str


@dataclass(frozen=True)
class Question:
    """What is asked.

    Attributes:
        id: unique in the study.
        ask: the words.
        type: one of ``TYPES``.
        role: one of ``ROLES``: what analysis makes of the answers.
        about: one of ``ABOUT``: asked after each set, after each pair, or once at the end.
        required: whether it has to be answered.
        points: of a scale, 2 to 11; answers are 1 to ``points``.
        low: label of the first point.
        high: label of the last.
        lowest_is_unfair: whether 1 is the unfair end.
        options: of choice, choices and pair.
        longest: most characters of a text.
    """

    id: str
    ask: str
    type: str
    role: str = "other"
    about: str = "set"
    required: bool = True
    points: int = 7
    low: str = ""
    high: str = ""
    lowest_is_unfair: bool = True
    options: tuple[Option, ...] = ()
    longest: int = LONGEST["answer"]


@dataclass(frozen=True)
class ClipSet:
    """Clips that are seen one after another and judged together.

    Attributes:
        id: unique; participants' browsers see it, so it should tell nothing.
        clips: names of files.
        captions: a sentence shown with each clip, for instance who is served; empty when none is.
        kind: one of ``KINDS``: a robot that may be uneven, or an even one.
        scores: identity -> the issue scores (Eq. 2) of the robot behind the clips, in the order of
            ``ISSUES``; what a detector is fitted to.
        note: for the lead, never shown.
    """

    id: str
    clips: tuple[str, ...]
    captions: tuple[str, ...] = ()
    kind: str = "scenario"
    scores: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)
    note: str = ""


@dataclass(frozen=True)
class Pair:
    """Two sets, by id, that are compared with each other."""

    id: str
    first: str
    second: str


@dataclass(frozen=True)
class Check:
    """An attention check: one right answer, asked after the ``after``-th set."""

    id: str
    ask: str
    options: tuple[str, ...]
    right: str
    after: int


@dataclass(frozen=True)
class Demographic:
    """A question about oneself, always optional; ``PREFER_NOT`` is added to the options."""

    id: str
    ask: str
    options: tuple[str, ...]


@dataclass(frozen=True)
class Protocol:
    """A whole study. ``mistakes`` says whether it makes sense.

    Attributes:
        name: short name, a-z, 0-9 and hyphens.
        title: shown.
        consent_version: stored with every participant.
        consent: what participants agree to.
        sets: what is judged.
        questions: what is asked.
        language: of the texts, as HTML wants it.
        minutes: how long it takes, as participants are told.
        seed: of orders.
        contact: whom to ask.
        thanks: the last words.
        completion_code: shown at the end, or put into ``redirect``.
        redirect: address to return to; {code} becomes the completion code.
        shared_computer: people take part one after another in one browser, which forgets each of
            them when the next one begins.
        order: one of ``ORDERS``.
        length: sets that each participant judges; 0 is all.
        clips: folder of the clips.
        demographics: questions about oneself.
        pairs: sets to compare.
        checks: attention checks.
    """

    name: str
    title: str
    consent_version: str
    consent: str
    sets: tuple[ClipSet, ...]
    questions: tuple[Question, ...]
    language: str = "en"
    minutes: int = 15
    seed: int = 0
    contact: str = ""
    thanks: str = "Thank you."
    completion_code: str = ""
    redirect: str = ""
    shared_computer: bool = False
    order: str = "latin"
    length: int = 0
    clips: Path = Path("clips")
    demographics: tuple[Demographic, ...] = ()
    pairs: tuple[Pair, ...] = ()
    checks: tuple[Check, ...] = ()

    @property
    def judged(self) -> int:
        """How many sets each participant judges."""
        return self.length or len(self.sets)

    @property
    def clip_names(self) -> tuple[str, ...]:
        """Every clip once, in the order of the sets."""
        return tuple(dict.fromkeys(clip for one in self.sets for clip in one.clips))

    def asked(self, about: str) -> tuple[Question, ...]:
        """The questions about a set, about a pair, or at the end."""
        return tuple(one for one in self.questions if one.about == about)

    def fingerprint(self) -> str:
        """SHA-256 of what decides what answers mean; a changed one needs a new database.

        Thanks, contact, codes, scores and notes can be changed while a study runs.
        """
        told: dict[str, Any] = {k: v for k, v in asdict(self).items() if k not in _UNSEEN}
        for one in told["sets"]:
            del one["scores"], one["note"]
        return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def mistakes(protocol: Protocol) -> Iterator[tuple[Place, str]]:
    """What does not fit together, each with its place and one sentence; nothing if all is well."""
    yield from _ids(protocol)
    yield from _sets(protocol)
    for number, question in enumerate(protocol.questions):
        for key, sentence in _question(question):
            yield ("questions", number, key), sentence
    if not protocol.asked("set"):
        yield ("questions",), 'nothing is asked about the sets: add a question with about = "set"'
    sets = [one.id for one in protocol.sets]
    for number, pair in enumerate(protocol.pairs):
        for key in ("first", "second"):
            if getattr(pair, key) not in sets:
                yield (
                    ("pairs", number, key),
                    f"{getattr(pair, key)!r} is no set: name one of {', '.join(sets)}",
                )
        if pair.first == pair.second:
            yield ("pairs", number, "second"), "a set is compared with itself: name two sets"
    if protocol.pairs and not protocol.asked("pair"):
        yield ("pairs",), 'nothing is asked about the pairs: add a question with about = "pair"'
    if protocol.asked("pair") and not protocol.pairs:
        number = protocol.questions.index(protocol.asked("pair")[0])
        yield ("questions", number, "about"), "there is no pair to ask about: add [[pairs]]"
    for number, check in enumerate(protocol.checks):
        if check.right not in check.options:
            yield (
                ("checks", number, "right"),
                f"{check.right!r} is none of its options: name one of {', '.join(check.options)}",
            )
        if check.after > protocol.judged:
            yield (
                ("checks", number, "after"),
                f"it would come after set {check.after}, but {protocol.judged} are judged",
            )
    for kind in ("demographics", "checks"):
        for number, one in enumerate(getattr(protocol, kind)):
            if len(set(one.options)) < len(one.options):
                yield (kind, number, "options"), "an option stands twice"
            if PREFER_NOT in one.options:
                why = "always added" if kind == "demographics" else "stored as no answer"
                yield (kind, number, "options"), f"{PREFER_NOT!r} is {why}: leave it out"
    if "{code}" in protocol.redirect and not protocol.completion_code:
        yield ("study", "redirect"), "it holds {code}, but there is no completion_code: add one"
    odd = [one for one in _BRACES.findall(protocol.redirect) if one != "{code}"]
    if odd:
        yield ("study", "redirect"), f"it holds {odd[0]}, which nothing is put for: write {{code}}"
    if protocol.redirect and protocol.shared_computer:
        yield (
            ("study", "shared_computer"),
            "nobody else could begin where everybody is sent on to redirect: leave one of them out",
        )


def _ids(protocol: Protocol) -> Iterator[tuple[Place, str]]:
    seen: dict[str, str] = {}
    for kind in ("demographics", "sets", "questions", "pairs", "checks"):
        for number, one in enumerate(getattr(protocol, kind)):
            if one.id in seen:
                yield (
                    (kind, number, "id"),
                    f"id {one.id!r} is taken in {seen[one.id]}: ids are unique in the whole file",
                )
            seen.setdefault(one.id, kind)


def _sets(protocol: Protocol) -> Iterator[tuple[Place, str]]:
    if protocol.length > len(protocol.sets):
        yield (
            ("study", "length"),
            f"{protocol.length} sets are to be judged, but there are {len(protocol.sets)}",
        )
    for number, one in enumerate(protocol.sets):
        if one.captions and len(one.captions) != len(one.clips):
            yield (
                ("sets", number, "captions"),
                f"{len(one.captions)} captions stand beside {len(one.clips)} clips: give one each",
            )


def _question(question: Question) -> Iterator[tuple[str, str]]:
    if question.role in ROLES and question.type in TYPES:
        fitting = ROLES[question.role]
        if question.type not in fitting:
            yield "type", f"role {question.role!r} needs type {' or '.join(fitting)}"
    wanted = "pair" if question.type == "pair" else ROLE_ABOUT.get(question.role)
    if wanted and question.about != wanted:
        yield (
            "about",
            f'type {question.type!r} with role {question.role!r} needs about = "{wanted}"',
        )
    values = [one.value for one in question.options]
    if question.type in ("choice", "choices") and len(values) < 2:
        yield "options", "give at least two options, as { value = ..., label = ... }"
    if question.type in ("scale", "text") and values:
        yield "options", f"type {question.type!r} has no options: leave them out"
    if len(set(values)) < len(values):
        yield "options", "a value stands twice"
    if PREFER_NOT in values and question.required:
        yield "options", f"{PREFER_NOT!r} is stored as no answer: leave it out, or required = false"
    for value in values:
        allowed = ROLE_VALUES.get(question.role)
        if question.type == "pair":
            allowed = tuple(value for value, _ in PAIR_OPTIONS)
        if allowed and value not in allowed:
            yield "options", f"value {value!r} is none of {', '.join(allowed)}"
