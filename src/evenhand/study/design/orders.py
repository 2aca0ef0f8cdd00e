"""Which pages a participant sees, and in which order: a function of the study and a number."""

from typing import Any

import numpy as np

from evenhand.study.design.protocol import PREFER_NOT, Protocol, Question


def count(study: Protocol) -> int | None:
    """How many orders there are; None when there is no end of them (``random``)."""
    if study.order == "fixed":
        return 1
    if study.order == "random":
        return None
    n = len(study.sets)
    return n if n % 2 == 0 or n == 1 else 2 * n


def sets(study: Protocol, number: int) -> list[int]:
    """Positions of the sets that a participant judges, in order.

    ``latin`` is a Williams design (E. J. Williams, 1949, Aust. J. Sci. Res. A 2, 149-168): rows
    0, 1, n-1, 2, n-2, ... shifted by the order number. Over n consecutive numbers from a multiple
    of n, every set is at every position equally often; where n is even, every set also follows
    every other one equally often. Where n is odd, no n orders can do that: the next n orders are
    the first n backwards, and all 2n together do. A ``length`` below n cuts the orders, which keeps
    the balance of positions. ``random`` is a permutation of its own for each number.

    Args:
        study: the study; its seed decides which set is which row.
        number: of the order, 0 first.
    """
    n = len(study.sets)
    if study.order == "fixed":
        row = np.arange(n)
    elif study.order == "random":
        row = np.random.default_rng([study.seed, number]).permutation(n)
    else:
        number %= count(study) or 1
        zigzag = np.array([-(-i // 2) * (1 if i % 2 else -1) for i in range(n)])
        row = np.random.default_rng(study.seed).permutation(n)[(zigzag + number) % n]
        row = row[::-1] if number >= n else row
    return [int(one) for one in row[: study.judged]]


def pages(study: Protocol, number: int) -> list[dict[str, Any]]:
    """The pages of one participant, each with what a browser needs to show it.

    Right answers, scores, notes, and what is an even control are not told.

    Returns:
        Pages ``consent``, ``about``, ``set:<id>``, ``check:<id>``, ``pair:<id>``, ``end`` and
        ``finished``, as far as there are any.
    """
    found: list[dict[str, Any]] = [
        {
            "id": "consent",
            "kind": "consent",
            "version": study.consent_version,
            "text": study.consent,
        }
    ]
    if study.demographics:
        asked = [_chosen(d.id, d.ask, (*d.options, PREFER_NOT), False) for d in study.demographics]
        found.append({"id": "about", "kind": "about", "questions": asked})
    for position, index in enumerate(sets(study, number), 1):
        one = study.sets[index]
        found.append(
            {
                "id": f"set:{one.id}",
                "kind": "set",
                "item": one.id,
                "clips": list(one.clips),
                "captions": list(one.captions),
                "questions": [_asked(question) for question in study.asked("set")],
            }
        )
        for check in study.checks:
            if check.after == position:
                asked = [_chosen(check.id, check.ask, check.options, True)]
                found.append(
                    {
                        "id": f"check:{check.id}",
                        "kind": "check",
                        "item": check.id,
                        "questions": asked,
                    }
                )
    shown = {one.id: one for one in study.sets}
    for pair in study.pairs:
        page: dict[str, Any] = {"id": f"pair:{pair.id}", "kind": "pair", "item": pair.id}
        for side, one in (("first", shown[pair.first]), ("second", shown[pair.second])):
            page[side] = {"clips": list(one.clips), "captions": list(one.captions)}
        found.append(page | {"questions": [_asked(question) for question in study.asked("pair")]})
    if study.asked("end"):
        asked = [_asked(question) for question in study.asked("end")]
        found.append({"id": "end", "kind": "end", "questions": asked})
    found.append({"id": "finished", "kind": "finished", "thanks": study.thanks})
    return found


def length(study: Protocol) -> int:
    """How many pages a participant fills in, as the pages count them: without the thanks."""
    return len(pages(study, 0)) - 1


def _chosen(name: str, ask: str, options: tuple[str, ...], required: bool) -> dict[str, Any]:
    return {
        "id": name,
        "ask": ask,
        "type": "choice",
        "required": required,
        "options": [{"value": option, "label": option} for option in options],
    }


def _asked(question: Question) -> dict[str, Any]:
    told: dict[str, Any] = {
        "id": question.id,
        "ask": question.ask,
        "type": question.type,
        "required": question.required,
    }
    if question.type == "scale":
        told |= {"points": question.points, "low": question.low, "high": question.high}
    elif question.type == "text":
        told["longest"] = question.longest
    else:
        told["options"] = [{"value": one.value, "label": one.label} for one in question.options]
    return told
