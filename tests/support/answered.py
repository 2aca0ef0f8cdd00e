"""A small study of uneven and even robots, and answers to it, for what is made of answers."""

from pathlib import Path
from typing import Any

from evenhand.study.design.protocol import (
    PAIR_OPTIONS,
    Check,
    ClipSet,
    Demographic,
    Option,
    Pair,
    Protocol,
    Question,
)

EVEN = (0.05, 0.05, 0.05, 0.05)
SCORES = {
    "no-answer": {"race": (0.6, 0.3, 0.2, 0.3)},
    "from-afar": {"disability": (0.2, 0.7, 0.3, 0.2)},
    "late": {"age": (0.2, 0.3, 0.7, 0.3)},
    "too-close": {"disability": (0.2, 0.4, 0.2, 0.6)},
    "even-one": {"race": EVEN, "gender": EVEN, "age": EVEN, "disability": EVEN},
    "even-two": {"race": EVEN, "gender": EVEN, "age": EVEN, "disability": EVEN},
}
ROLES = {"fair": "fair", "issue": "issue", "towards": "identity", "say": "free", "even": "pair"}
TYPES = {"fair": "scale", "say": "text", "even": "pair"}


def options(*values: str) -> tuple[Option, ...]:
    return tuple(Option(value, value.capitalize()) for value in values)


def protocol(**changes: Any) -> Protocol:
    """Four uneven sets and two even ones; fair, issue, identity, free text, a pair, a check."""
    issues = options("willingness", "quality", "priority", "risk", "none")
    identities = options("race", "gender", "age", "disability", "none")
    duel = tuple(Option(*one) for one in PAIR_OPTIONS)
    return Protocol(
        **{
            "name": "small",
            "title": "A small study",
            "consent_version": "1",
            "consent": "You agree.",
            "sets": tuple(
                ClipSet(
                    name,
                    (f"{name}.mp4",),
                    kind="control" if name.startswith("even") else "scenario",
                    scores=scores,
                )
                for name, scores in SCORES.items()
            ),
            "questions": (
                Question("fair", "How fair?", "scale", "fair", points=5),
                Question("issue", "What is worst?", "choice", "issue", options=issues),
                Question("towards", "Towards whom?", "choice", "identity", options=identities),
                Question("even", "Which one?", "pair", "pair", about="pair", options=duel),
                Question("say", "Anything else?", "text", "free", about="end", required=False),
            ),
            "demographics": (Demographic("age-group", "How old?", ("18-39", "40 or more")),),
            "pairs": (Pair("duel", "no-answer", "even-one"),),
            "checks": (Check("look", "Choose blue.", ("red", "blue"), "blue", 2),),
            "clips": Path("clips"),
        }
        | changes
    )


def row(participant: str, page: str, question: str, **values: Any) -> dict[str, Any]:
    """A row of answers; what is not said is as in a finished study of people."""
    kind, _, item = page.partition(":")
    return {
        "participant": participant,
        "simulated": False,
        "preview": False,
        "consent_version": "1",
        "order": 0,
        "position": 1,
        "page": page,
        "kind": kind,
        "item": item or None,
        "question": question,
        "role": ROLES.get(question, kind),
        "type": TYPES.get(question, "choice"),
        "number": None,
        "right": None,
        "seconds": 20.0,
        "views": 1,
        "received": "2026-11-22T10:00Z",
        "status": "finished",
    } | values


def judged(
    participant: str,
    item: str,
    rating: int | None,
    issue: str | None = None,
    towards: str | None = None,
    **values: Any,
) -> list[dict[str, Any]]:
    """The three rows of a judged set."""
    said = None if rating is None else str(rating)
    number = None if rating is None else float(rating)
    page = f"set:{item}"
    return [
        row(participant, page, "fair", value=said, number=number, **values),
        row(participant, page, "issue", value=issue, **values),
        row(participant, page, "towards", value=towards, **values),
    ]
