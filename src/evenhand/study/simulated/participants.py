"""Simulated participants: who answers the pages of any study, as a browser would send them.

A simulated participant is an assumption, not evidence. It judges sets as a simulated respondent
(`study.simulated.respondents`) does windows: by the scores that the study states for the robot
behind the clips. A set without scores shows it nothing, so it is judged as an even one. Some leave
before the end, some do not care: they answer quickly and at random, or always alike.
"""

import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenhand.core import errors
from evenhand.core.errors import InputError
from evenhand.methods.vocabulary import IDENTITIES, ISSUES
from evenhand.study.analysis.answers import Answers
from evenhand.study.design import orders
from evenhand.study.design.protocol import Protocol, Question
from evenhand.study.server import check_reply
from evenhand.study.simulated import respondents
from evenhand.study.simulated.respondents import RespondentModel, Respondents

LETTERS = "abcdefghijkmnpqrstuvwxyz"
MOST = 100_000
"""Participants at once."""
_STEP = 0.15  # evidence beyond the threshold that moves a rating by one point


@dataclass(frozen=True)
class Habits:
    """How simulated participants take a study. All of it is assumed.

    Attributes:
        model: how they judge; its number of respondents is not used.
        careless: share who do not care.
        alike: share of the careless who always give the same answer; the others answer at random.
        leaves: share who leave before the end, on any page alike.
        silent: share of questions that may be left out and are.
        seconds: median time for a question, beyond the clips.
        pace: spread (log scale) of people's own medians, and of one person's times.
        clip: seconds that a clip lasts.
    """

    model: RespondentModel = field(default_factory=RespondentModel)
    careless: float = 0.05
    alike: float = 0.5
    leaves: float = 0.08
    silent: float = 0.6
    seconds: float = 6.0
    pace: float = 0.35
    clip: float = 10.0

    def __post_init__(self) -> None:
        for name in ("careless", "alike", "leaves", "silent"):
            if not 0 <= getattr(self, name) <= 1:
                raise InputError(
                    f"range {name}", f"{name} is {getattr(self, name)}: give a share from 0 to 1"
                )
        for name in ("seconds", "clip"):
            if not 0 < getattr(self, name) < 3600:
                raise InputError(
                    f"range {name}", f"{name} is {getattr(self, name)}: give seconds below 3600"
                )


@dataclass(frozen=True, eq=False)
class Crowd:
    """Simulated participants, one entry each.

    Attributes:
        judges: how they judge.
        careless: bool [n], who does not care.
        alike: bool [n], who of them always answers alike.
        leaves: bool [n], who leaves before the end.
        seconds: float64 [n], median time of each for a question.
        habits: the settings they were drawn from.
    """

    judges: Respondents
    careless: NDArray[np.bool_]
    alike: NDArray[np.bool_]
    leaves: NDArray[np.bool_]
    seconds: NDArray[np.float64]
    habits: Habits

    @property
    def n(self) -> int:
        """Number of participants."""
        return len(self.careless)


@dataclass(frozen=True)
class Visit:
    """What one participant sends.

    Attributes:
        payloads: in order, each with ``page`` and the fields of ``PUT /api/pages``: key, sequence,
            values, shown_ms, clip_views, at.
        finished: whether the participant came to the end.
    """

    payloads: tuple[dict[str, Any], ...]
    finished: bool


def recruit(n: int, rng: np.random.Generator, habits: Habits | None = None) -> Crowd:
    """Draw simulated participants.

    Args:
        n: how many, 1 to ``MOST``.
        rng: source of randomness.
        habits: how they take a study; the default settings when None.
    """
    errors.whole("respondents", n, 1, MOST)
    habits = habits or Habits()
    model = RespondentModel(**vars(habits.model) | {"n": n})
    careless = rng.random(n) < habits.careless
    return Crowd(
        judges=respondents.recruit(rng, model),
        careless=careless,
        alike=careless & (rng.random(n) < habits.alike),
        leaves=rng.random(n) < habits.leaves,
        seconds=habits.seconds * np.exp(habits.pace * rng.standard_normal(n)),
        habits=habits,
    )


def visit(
    study: Protocol,
    pages: Sequence[Mapping[str, Any]],
    crowd: Crowd,
    who: int,
    rng: np.random.Generator,
) -> Visit:
    """Let one participant answer pages."""
    to_answer = [page for page in pages if page.get("questions")]
    end = len(to_answer)
    if crowd.leaves[who] and end:
        end = int(rng.integers(end))
    feelings = _feelings(study, crowd, who, rng)
    payloads = []
    for sequence, page in enumerate(to_answer[:end]):
        values = {
            question["id"]: _answer(study, page, question, feelings, crowd, who, rng)
            for question in page["questions"]
        }
        clips = [*page.get("clips", ()), *(c for side in ("first", "second") if side in page
                                           for c in page[side]["clips"])]  # fmt: skip
        hurry = 0.15 if crowd.careless[who] else 1.0
        pace = np.exp(crowd.habits.pace * rng.standard_normal(len(values)))
        thought = float(hurry * crowd.seconds[who] * pace.sum())
        payloads.append(
            {
                "page": page["id"],
                "key": str(uuid.UUID(bytes=rng.bytes(16), version=4)),
                "sequence": sequence,
                "values": values,
                "shown_ms": round(1000 * (thought + crowd.habits.clip * len(clips))),
                "clip_views": dict.fromkeys(clips, 1),
                "at": "",
            }
        )
    return Visit(tuple(payloads), end == len(to_answer))


def answers(study: Protocol, n: int, seed: int, habits: Habits | None = None) -> Answers:
    """Answers of simulated participants, as the server would have stored them.

    Orders are dealt in turn, so that each is filled alike.

    Args:
        study: what they take.
        n: how many.
        seed: of everything random.
        habits: how they take it; the default settings when None.

    Raises:
        InputError: as :func:`recruit`, or when a page cannot be answered.
    """
    recruiting, *own = np.random.default_rng(seed).spawn(n + 1)
    crowd = recruit(n, recruiting, habits)
    names: dict[str, None] = {}
    while len(names) < n:
        names.setdefault("".join(LETTERS[i] for i in recruiting.integers(len(LETTERS), size=8)))
    ways = orders.count(study) or n
    known = {k: orders.pages(study, k) for k in range(min(ways, n))}
    rows: list[dict[str, Any]] = []
    for who, name in enumerate(names):
        pages = known[who % ways]
        places = {page["id"]: (place, page) for place, page in enumerate(pages)}
        made = visit(study, pages, crowd, who, own[who])
        head = {
            "participant": name,
            "simulated": True,
            "preview": False,
            "consent_version": study.consent_version,
            "order": who % ways,
            "status": "finished" if made.finished else "begun",
        }
        for payload in made.payloads:
            place, page = places[payload["page"]]
            views = payload["clip_views"]
            told = head | {
                "position": place,
                "page": page["id"],
                "seconds": check_reply.seconds(payload["shown_ms"]),
                "views": min(views.values()) if views else None,
            }
            rows += [
                told | vars(reply) for reply in check_reply.check(study, page, payload["values"])
            ]
    return Answers.of_rows(rows)


@dataclass(frozen=True, eq=False)
class _Feelings:
    """What a participant makes of every set of a study: by the set's id."""

    excess: dict[str, float]
    issue: dict[str, str]
    identity: dict[str, str]


def _feelings(study: Protocol, crowd: Crowd, who: int, rng: np.random.Generator) -> _Feelings:
    ids = [one.id for one in study.sets]
    scores = np.full((len(ids), len(IDENTITIES), len(ISSUES)), np.nan)
    for i, one in enumerate(study.sets):
        for identity, vector in one.scores.items():
            scores[i, IDENTITIES.index(identity)] = vector
    totals = np.nansum(scores, axis=-1)
    # a set is about the identity that it is most uneven for; without any score, about anybody
    anybody = rng.integers(len(IDENTITIES), size=len(ids))
    shown = np.where(np.isnan(scores).all(axis=(1, 2)), anybody, totals.argmax(axis=1))
    asked = np.full(len(ids), who)
    said = respondents.judge(crowd.judges, asked, scores, shown, rng)
    seen = np.nan_to_num(scores[np.arange(len(ids)), shown]) @ crowd.judges.weights[who]
    beyond = np.abs(seen - crowd.judges.thresholds[who])
    excess = np.where(said.biased, beyond, -beyond)
    return _Feelings(
        excess=dict(zip(ids, excess.tolist(), strict=True)),
        issue={i: ISSUES[k] if k >= 0 else "none" for i, k in zip(ids, said.issue, strict=True)},
        identity={
            i: IDENTITIES[k] if k >= 0 else "none" for i, k in zip(ids, said.identity, strict=True)
        },
    )


def _answer(
    study: Protocol,
    page: Mapping[str, Any],
    question: Mapping[str, Any],
    feelings: _Feelings,
    crowd: Crowd,
    who: int,
    rng: np.random.Generator,
) -> str | int | list[str] | None:
    kind = question["type"]
    known = {one.id: one for one in study.questions}.get(question["id"])
    if kind == "text":
        silent = not question["required"] and rng.random() < crowd.habits.silent
        return None if silent else "a simulated remark"[: question["longest"]]
    if crowd.alike[who]:
        if kind == "scale":
            return 1
        picked: str | int = question["options"][0]["value"]
    elif crowd.careless[who]:
        picked = _at_random(question, rng)
    elif page["kind"] == "check":
        lapsed = rng.random() < crowd.judges.lapses[who]
        right = {one.id: one.right for one in study.checks}[question["id"]]
        picked = _at_random(question, rng) if lapsed else right
    elif known is None or known.role not in ("fair", "issue", "identity", "pair"):
        picked = _at_random(question, rng)
    else:
        picked = _felt(study, page, known, question, feelings, rng)
    return [str(picked)] if kind == "choices" else picked


def _felt(
    study: Protocol,
    page: Mapping[str, Any],
    known: Question,
    question: Mapping[str, Any],
    feelings: _Feelings,
    rng: np.random.Generator,
) -> str | int:
    """An answer by what was seen; at random where the question is about nothing that was."""
    item = page.get("item")
    if known.role == "pair" and page["kind"] == "pair":
        pair = next(one for one in study.pairs if one.id == item)
        more = feelings.excess[pair.first] - feelings.excess[pair.second]
        felt = "second" if more > _STEP else "first" if more < -_STEP else "same"
    elif page["kind"] != "set" or item not in feelings.excess:
        return _at_random(question, rng)
    elif known.role == "fair":
        return _rating(feelings.excess[item], known)
    else:
        felt = (feelings.issue if known.role == "issue" else feelings.identity)[item]
    values = [option["value"] for option in question["options"]]
    return felt if felt in values else _at_random(question, rng)


def _rating(excess: float, question: Question) -> int:
    """A point of a scale: unfair and fair side of its middle, further out the clearer it is."""
    half = question.points // 2
    steps = min(half, 1 + int(abs(excess) / _STEP))
    low = half + 1 - steps
    return low if (excess > 0) == question.lowest_is_unfair else question.points + 1 - low


def _at_random(question: Mapping[str, Any], rng: np.random.Generator) -> str | int:
    if question["type"] == "scale":
        return int(rng.integers(question["points"])) + 1
    options = question["options"]
    return options[int(rng.integers(len(options)))]["value"]
