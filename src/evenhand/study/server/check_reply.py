"""What a participant answered on a page, checked against the study and made into rows."""

import hashlib
import json
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from evenhand.study.design.protocol import PREFER_NOT, Protocol
from evenhand.study.server.refusal import RefusalError

Value = str | int | list[str] | None
SHOWN_MOST = 7 * 24 * 3600 * 1000
"""A page is not open for longer, in milliseconds; beyond, the browser's clock has jumped."""


@dataclass(frozen=True)
class Reply:
    """One answered question.

    Attributes:
        question: its id.
        kind: about, set, check, pair or end.
        item: id of the set, pair or check; None elsewhere.
        role: of the question; "about" and "check" for those.
        type: of the question.
        value: as text; values joined by "|" for several; None when left out or not said.
        number: of a scale.
        right: of a check.
    """

    question: str
    kind: str
    item: str | None
    role: str
    type: str
    value: str | None
    number: float | None = None
    right: bool | None = None


def check(
    study: Protocol, page: Mapping[str, Any], values: Mapping[str, Value]
) -> tuple[Reply, ...]:
    """Answers of one page, one row a question, in the order of the page.

    Args:
        study: the study.
        page: one of ``orders.pages``.
        values: question id -> answer; what may be left out may be missing or None.

    Raises:
        RefusalError: "invalid", naming the question.
    """
    asked = {question["id"]: question for question in page["questions"]}
    for name in values:
        if name not in asked:
            raise RefusalError("invalid", f"there is no question {name[:40]!r} on this page")
    roles = {question.id: question.role for question in study.questions}
    right = {one.id: one.right for one in study.checks}
    kind, found = page["kind"], []
    for name, question in asked.items():
        value = _value(question, values.get(name))
        if value is None and question["required"]:
            raise RefusalError("invalid", f"question {name!r} needs an answer")
        found.append(
            Reply(
                question=name,
                kind=kind,
                item=page.get("item"),
                role=roles.get(name, kind),
                type=question["type"],
                value=value,
                number=float(value) if question["type"] == "scale" and value else None,
                right=value == right[name] if kind == "check" else None,
            )
        )
    return tuple(found)


def digest(replies: tuple[Reply, ...]) -> str:
    """The same for the same answers, whatever request brought them."""
    told = json.dumps([(one.question, one.value) for one in replies])
    return hashlib.sha256(told.encode()).hexdigest()


def seconds(shown_ms: int) -> float | None:
    """How long a page was open; None when no clock can have measured that."""
    return shown_ms / 1000 if 0 <= shown_ms <= SHOWN_MOST else None


def _value(question: Mapping[str, Any], given: Value) -> str | None:
    """An answer as text.

    Raises:
        RefusalError: when it is of the wrong type, too long, or no option.
    """
    name, kind = question["id"], question["type"]
    if given is None:
        return None
    if kind == "scale":
        points = question["points"]
        if not isinstance(given, int) or isinstance(given, bool) or not 1 <= given <= points:
            raise RefusalError(
                "invalid", f"question {name!r} needs a whole number from 1 to {points}"
            )
        return str(given)
    if kind == "text":
        if not isinstance(given, str):
            raise RefusalError("invalid", f"question {name!r} needs text")
        text = _clean(given)
        if len(text) > question["longest"]:
            raise RefusalError(
                "invalid",
                f"the answer to question {name!r} has {len(text)} characters: write at most "
                f"{question['longest']}",
            )
        return text or None
    options = [option["value"] for option in question["options"]]
    chosen = given if kind == "choices" else [given]
    if (
        not isinstance(chosen, list)
        or any(one not in options for one in chosen)
        or len(set(chosen)) < len(chosen)
    ):
        some = "some" if kind == "choices" else "one"
        raise RefusalError("invalid", f"question {name!r} needs {some} of its options")
    if chosen == [PREFER_NOT]:
        return None
    # in the order of the options, so that the same choice is the same answer
    return "|".join(one for one in options if one in chosen) or None


def _clean(text: str) -> str:
    """Without the control characters that no database takes and nobody types, and blank ends."""
    kept = (c for c in text if c in "\n\t" or unicodedata.category(c) not in ("Cc", "Cs"))
    return "".join(kept).strip()
