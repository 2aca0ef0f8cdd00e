"""The codebook of answers: every column and every question, with counts and what is missing."""

from collections import Counter
from collections.abc import Iterator
from typing import Any

from evenhand.study.analysis.answer_columns import BETWEEN, SCHEMA, STATUSES, pc
from evenhand.study.analysis.answers import Answers
from evenhand.study.design.protocol import PREFER_NOT, Protocol, Question

MEANINGS = {
    "participant": "random letters of one participant, without meaning",
    "simulated": "whether a program answered; never evidence of how people judge",
    "preview": "whether the lead only looked through the study",
    "consent_version": "of the consent that was given",
    "order": "number of the order in which sets were seen",
    "position": "place of the page among the participant's pages; the consent is 0",
    "page": "which page",
    "kind": "of the page: about oneself, a set, an attention check, a pair, the end",
    "item": "the set, pair or check that the page is about",
    "question": "which question",
    "role": "what the question is for: fair, issue, identity, free, pair, other, about, check",
    "type": "of the question: scale, choice, choices, text, pair",
    "value": f"the answer as given, several joined by {BETWEEN!r}; missing where nothing was said",
    "number": "the answer on a scale; missing otherwise",
    "right": "whether an attention check was answered right; missing otherwise",
    "seconds": "how long the page was shown, seconds",
    "views": "how often every clip of the page was seen to its end",
    "received": "when the answer came in, UTC",
    "status": "how far the participant came",
}
"""What each column holds."""
SHOWN = 60
"""Values of an unknown question that are counted; free text is never listed."""


def codebook(answers: Answers, protocol: Protocol | None = None) -> dict[str, Any]:
    """Describe answers as plain values that JSON knows.

    Args:
        answers: of a study.
        protocol: of the same study, for the words of questions and options; without it only
            what was answered is described.

    Returns:
        ``study``, ``participants`` (counts, people apart from simulated ones), ``columns`` and
        ``questions``: of each its words, options with counts, and how many left it out.
    """
    from evenhand import __version__

    return {
        "format": "evenhand-codebook",
        "evenhand": __version__,
        "study": None
        if protocol is None
        else {
            "name": protocol.name,
            "title": protocol.title,
            "fingerprint": protocol.fingerprint(),
        },
        "simulated": answers.simulated,
        "rows": len(answers),
        "participants": people(answers),
        "columns": [
            {
                "name": field.name,
                "type": str(field.type),
                "meaning": MEANINGS[field.name],
                "missing": answers.table[field.name].null_count,
            }
            for field in SCHEMA
        ],
        "questions": list(_questions(answers, protocol)),
    }


def people(answers: Answers) -> dict[str, dict[str, int]]:
    """Participants of each status, people apart from simulated ones and previews."""
    seen = answers.table.group_by(["participant", "simulated", "preview", "status"]).aggregate([])
    found = {
        # who has withdrawn has no answer in an export to be counted by
        kind: {str(status): 0 for status in STATUSES if status != "withdrawn"}
        for kind in ("people", "simulated", "preview")
    }
    for row in seen.to_pylist():
        kind = "simulated" if row["simulated"] else "preview" if row["preview"] else "people"
        found[kind][row["status"]] = found[kind].get(row["status"], 0) + 1
    return found


def _questions(answers: Answers, protocol: Protocol | None) -> Iterator[dict[str, Any]]:
    """Questions as the protocol has them, then those that only the answers know."""
    table = answers.table
    asked = pc.unique(table["question"]).to_pylist()
    known = [] if protocol is None else list(_known(protocol))
    names = {one["id"] for one in known}
    for one in [*known, *({"id": name} for name in asked if name not in names)]:
        part = answers.where(pc.equal(table["question"], one["id"])).table
        first = part.slice(0, 1).to_pylist()
        values = part["value"]
        one = {
            "id": one["id"],
            "role": first[0]["role"] if first else None,
            "type": first[0]["type"] if first else None,
        } | one
        one |= {"answered": part.num_rows - values.null_count, "missing": values.null_count}
        if one["type"] != "text":
            counts = Counter[str]()
            for row in values.value_counts().to_pylist():
                if row["values"] is not None:
                    several = one["type"] == "choices"
                    for value in row["values"].split(BETWEEN) if several else [row["values"]]:
                        counts[value] += row["counts"]
            labels = one.pop("labels", {})
            listed = [*labels, *sorted(value for value in counts if value not in labels)]
            one["options"] = [
                {"value": value, "label": labels.get(value), "count": counts[value]}
                for value in listed[: max(SHOWN, len(labels))]
            ]
        yield one


def _known(protocol: Protocol) -> Iterator[dict[str, Any]]:
    for one in protocol.demographics:
        labels = {value: value for value in one.options}
        yield {"id": one.id, "ask": one.ask, "about": "oneself", "role": None, "type": "choice",
               "note": f"{PREFER_NOT!r} is stored as missing", "labels": labels}  # fmt: skip
    for question in protocol.questions:
        yield {
            "id": question.id,
            "ask": question.ask,
            "about": question.about,
            "role": question.role,
            "type": question.type,
            "required": question.required,
            **_answers_of(question),
        }
    for check in protocol.checks:
        yield {"id": check.id, "ask": check.ask, "about": "attention", "role": None,
               "type": "choice", "right": check.right,
               "labels": {value: value for value in check.options}}  # fmt: skip


def _answers_of(question: Question) -> dict[str, Any]:
    if question.type == "text":
        return {"longest": question.longest}
    if question.type == "scale":
        ends = {1: question.low, question.points: question.high}
        labels = {str(point): ends.get(point, "") for point in range(1, question.points + 1)}
        return {"points": question.points, "lowest_is_unfair": question.lowest_is_unfair,
                "labels": labels}  # fmt: skip
    return {"labels": {one.value: one.label for one in question.options}}
