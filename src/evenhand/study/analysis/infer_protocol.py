"""What answers alone tell of their study, where its protocol is not at hand."""

from typing import Any

import numpy as np

from evenhand.study.analysis.answer_columns import BETWEEN, pc
from evenhand.study.analysis.answers import Answers
from evenhand.study.analysis.check_answers import MOST_POINTS
from evenhand.study.analysis.judgements import NOTHING, numbers
from evenhand.study.design.protocol import (
    ABOUT,
    ROLE_VALUES,
    Check,
    ClipSet,
    Demographic,
    Option,
    Pair,
    Protocol,
    Question,
)


def study_of(answers: Answers) -> Protocol:
    """A study with the sets, questions and values that occur in answers.

    Which sets are controls, how many points a scale has beyond the largest answer, and the words of
    questions are not in the answers: no set is a control here, and a scale ends where the answers
    do.
    """
    keys = ["kind", "item", "question", "role", "type"]
    seen = answers.table.group_by(keys, use_threads=False).aggregate([]).to_pylist()
    of = {about: [row for row in seen if row["kind"] == about] for about in (*ABOUT, "about")}
    questions: dict[str, Question] = {}
    for about in ABOUT:
        for row in of[about]:
            if row["question"] not in questions:
                questions[row["question"]] = _question(answers, row)
    checks = dict.fromkeys(row["question"] for row in seen if row["kind"] == "check")
    return Protocol(
        name="unnamed",
        title="A study without its protocol",
        consent_version="",
        consent="",
        sets=tuple(ClipSet(name, ()) for name in dict.fromkeys(row["item"] for row in of["set"])),
        questions=tuple(questions.values()),
        demographics=tuple(
            Demographic(name, name, tuple(_values(answers, name)))
            for name in dict.fromkeys(row["question"] for row in of["about"])
        ),
        pairs=tuple(Pair(name, "", "") for name in dict.fromkeys(r["item"] for r in of["pair"])),
        checks=tuple(Check(name, name, (), "", 0) for name in checks),
    )


def _question(answers: Answers, row: dict[str, Any]) -> Question:
    name, role, kind = row["question"], row["role"] or "other", row["type"] or "text"
    points = 2
    options: tuple[Option, ...] = ()
    if kind == "scale":
        asked = answers.table.filter(pc.equal(answers.table["question"], name))
        largest = np.nan_to_num(numbers(asked["number"])).max(initial=0)
        points = int(np.clip(largest, points, MOST_POINTS))
    elif kind != "text":
        usual = ROLE_VALUES.get(role, ())
        values = _values(answers, name, kind == "choices")
        known = [value for value in usual if value in values]
        rest = [value for value in values if value not in usual and value != NOTHING]
        options = tuple(Option(v, v) for v in [*known, *rest] + [NOTHING] * (NOTHING in values))
        options = tuple(dict.fromkeys(options))
    return Question(name, name, kind, role, row["kind"], points=points, options=options)


def _values(answers: Answers, question: str, several: bool = False) -> list[str]:
    asked = answers.table.filter(pc.equal(answers.table["question"], question))
    found = [value for value in pc.unique(asked["value"]).to_pylist() if value is not None]
    if several:
        found = [one for value in found for one in value.split(BETWEEN)]
    return sorted(set(found))
