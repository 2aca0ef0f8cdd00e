"""Are answers such as their study's questions can have? Else counts and ratings would be wrong."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from evenhand.core.errors import InputError, nearest
from evenhand.study.analysis.answer_columns import ABOUT_ITEMS, BETWEEN, pc
from evenhand.study.analysis.answers import Answers
from evenhand.study.design.protocol import Protocol, Question

MOST_POINTS = 11
"""Of a scale, see :class:`evenhand.study.design.protocol.Question`."""
_SHOWN = 5


def check(answers: Answers, study: Protocol) -> None:
    """Check the answers to a study's questions; answers to other questions are not looked at.

    Raises:
        InputError: for the first rating that is no point of its scale, or says one thing as text
            and another as a number, and for the first choice that is none of the options; with
            participant, page and value.
    """
    for question in study.questions:
        asked = _asked(answers, question.id)
        if question.type == "scale":
            _check_scale(asked, question)
        elif question.type != "text":
            values = [one.value for one in question.options]
            _check_options(asked, question.id, values, question.type == "choices")
    for one in (*study.demographics, *study.checks):
        _check_options(_asked(answers, one.id), one.id, one.options, several=False)


def check_codebook(path: Path, study: Protocol) -> None:
    """Check that answers were given to this very study, where a codebook lies beside them.

    Raises:
        InputError: when its questions, sets or consent were changed since.
    """
    beside = path.with_suffix(".codebook.json")
    if not beside.is_file():
        return
    try:
        noted = json.loads(beside.read_text(encoding="utf-8"))["study"]
        there = noted and (noted["name"], noted["fingerprint"])
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(
            "format codebook",
            f"{beside} is no codebook of `evenhand study export`: move it away, or export again",
        ) from None
    if there and there != (study.name, study.fingerprint()):
        raise InputError(
            "changed file",
            f"{path} holds answers to another study, or to {study.name!r} before its questions, "
            f"sets or consent were changed (says {beside.name}): give the file that was served",
        )


def strangers(answers: Answers, study: Protocol) -> dict[str, int]:
    """Sets, pairs and checks that answers are about and the study lacks: number of answers by id.

    They are no mistake, for a study may drop a set; but who analyses it has to know.
    """
    about = answers.table.filter(pc.is_in(answers.table["kind"], pa.array(ABOUT_ITEMS)))
    known = {one.id for one in (*study.sets, *study.pairs, *study.checks)}
    counts = about["item"].value_counts().to_pylist()
    return {one["values"]: one["counts"] for one in counts if one["values"] not in known}


def told(strange: dict[str, int]) -> str:
    """The same as a sentence; empty when there is none."""
    if not strange:
        return ""
    names = ", ".join(sorted(strange)[:_SHOWN]) + (", ..." if len(strange) > _SHOWN else "")
    return (
        f"{sum(strange.values()):,} answers are left out of ratings: they are about {names}, which "
        "the protocol does not have"
    )


def _asked(answers: Answers, question: str) -> pa.Table:
    return answers.table.filter(pc.equal(answers.table["question"], question))


def _check_scale(asked: pa.Table, question: Question) -> None:
    number = np.asarray(pc.fill_null(asked["number"], np.nan), dtype=np.float64)
    there = ~np.isnan(number)
    wrong = there & ~np.isin(number, np.arange(1, question.points + 1))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            f"range {question.id}",
            f"{_place(asked, row)}: {number[row]:g} is no point of the scale of 1 to "
            f"{question.points} of question {question.id!r}: "
            "is this the protocol of these answers?",
        )
    said = asked["value"].to_pylist()
    for row, (text, point) in enumerate(zip(said, number, strict=True)):
        if text is not None and not _same(text, point):
            shown = "is empty" if np.isnan(point) else f"says {point:g}"
            raise InputError(
                f"conflict {question.id}",
                f"{_place(asked, row)}: the value of question {question.id!r} says {text[:40]!r} "
                f"and its number {shown}: correct one of them",
            )


def _same(text: str, number: float) -> bool:
    try:
        return float(text) == number
    except ValueError:
        return False


def _check_options(asked: pa.Table, question: str, options: Iterable[str], several: bool) -> None:
    known = list(options)
    for value in pc.unique(asked["value"]).to_pylist():
        parts = [] if value is None else value.split(BETWEEN) if several else [value]
        for part in parts:
            if known and part not in known:
                row = pc.index(asked["value"], value).as_py()
                guess = nearest(part, known)
                meant = f" (is it {guess!r}?)" if guess else ""
                raise InputError(
                    f"unknown {question}",
                    f"{_place(asked, row)}: {part[:40]!r} is no option of question "
                    f"{question!r}{meant}: is this the protocol of these answers?",
                )


def _place(asked: Any, row: int) -> str:
    who, page = (asked[name][row].as_py() for name in ("participant", "page"))
    return f"participant {who}, page {page!r}"
