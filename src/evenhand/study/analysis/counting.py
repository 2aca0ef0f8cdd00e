"""Counts of answers: what was named and chosen, how far participants came, what they wrote."""

from collections import Counter
from collections.abc import Iterable

import numpy as np

from evenhand.report.table import Table, table
from evenhand.statistics.detector_accuracy import wilson
from evenhand.study.analysis.answer_columns import BETWEEN, STATUSES, pc
from evenhand.study.analysis.answers import Answers
from evenhand.study.analysis.judgements import numbers
from evenhand.study.design.protocol import Protocol, Question

CHOSEN = ("question", "set", "answer", "count", "n", "share", "low", "high")
PREFERRED = "of those who preferred one: first"


def share(count: int, n: int) -> tuple[float, float, float]:
    """A share with its Wilson limits; NaN throughout when n is 0."""
    found = wilson(count, n)
    return found.value, found.low, found.high


def named(answers: Answers, study: Protocol) -> Table:
    """How often each identity and each issue was named about each set, as the paper's Fig. 5."""
    rows = []
    for role in ("identity", "issue"):
        for question in study.asked("set"):
            if question.role == role:
                rows += chosen(answers, role, question, [one.id for one in study.sets])
    return table(CHOSEN, rows)


def others(answers: Answers, study: Protocol) -> Table:
    """Answers about oneself, and to all questions that have no table of their own."""
    rows = []
    for one in study.demographics:
        asked = Question(one.id, one.ask, "choice", options=())
        rows += chosen(answers, one.id, asked, [""], one.options)
    for question in study.questions:
        role = question.role
        own = role == "pair" or (question.about == "set" and role in ("fair", "identity", "issue"))
        if own or question.type == "text":
            continue
        items = {
            "set": [one.id for one in study.sets],
            "pair": [one.id for one in study.pairs],
            "end": [""],
        }[question.about]
        points = [str(point) for point in range(1, question.points + 1)]
        values = points if question.type == "scale" else [one.value for one in question.options]
        rows += chosen(answers, question.id, question, items, values)
    return table(CHOSEN, rows)


def pairs(answers: Answers, study: Protocol) -> Table:
    """Which robot of each pair was preferred: shares, and the share of the first of the decided."""
    rows: list[tuple[object, ...]] = []
    for question in study.asked("pair"):
        if question.role != "pair":
            continue
        for one in study.pairs:
            found = chosen(answers, question.id, question, [one.id])
            rows += found
            counts = {str(row[2]): int(str(row[3])) for row in found}
            first, second = counts.get("first", 0), counts.get("second", 0)
            decided = first + second
            rows.append((question.id, one.id, PREFERRED, first, decided, *share(first, decided)))
    return table(CHOSEN, rows)


def chosen(
    answers: Answers,
    name: str,
    question: Question,
    items: Iterable[str],
    values: Iterable[str] | None = None,
) -> list[tuple[object, ...]]:
    """How often each value was chosen, of those who answered; an item that nobody did has none.

    Args:
        answers: of a study.
        name: what the question is called in the table.
        question: which one.
        items: sets or pairs, or "" for a question that is about neither.
        values: in their order; those of the question's options by default.
    """
    asked = answers.table.filter(pc.equal(answers.table["question"], question.id))
    counts: dict[str, Counter[str]] = {}
    n = Counter[str]()
    for row in (
        asked.group_by(["item", "value"], use_threads=False)
        .aggregate([([], "count_all")])
        .to_pylist()
    ):
        if row["value"] is None:
            continue
        item, many = row["item"] or "", row["count_all"]
        n[item] += many
        for value in row["value"].split(BETWEEN) if question.type == "choices" else [row["value"]]:
            counts.setdefault(item, Counter())[value] += many
    listed = [one.value for one in question.options] if values is None else list(values)
    return [
        (name, item, value, counts[item][value], n[item], *share(counts[item][value], n[item]))
        for item in items
        if n[item]
        for value in listed
    ]


def progress(answers: Answers, study: Protocol | None) -> Table:
    """How many participants answered so many pages or more.

    Whoever left before the first answer is in no row. Without a study the most pages that anybody
    answered are taken for all.
    """
    pages = answers.table.group_by(["participant", "page"]).aggregate([])
    done = np.array(pages.group_by("participant").aggregate([([], "count_all")])["count_all"])
    whole = int(done.max(initial=0))
    if study is not None:
        about, end = bool(study.demographics), bool(study.asked("end"))
        whole = about + study.judged + len(study.checks) + len(study.pairs) + end
    people = len(done)
    at_least = [int((done >= k).sum()) for k in range(1, whole + 1)]
    rows = [(k, count, *share(count, people)) for k, count in enumerate(at_least, 1)]
    return table(("pages", "participants", "share", "low", "high"), rows)


def statuses(answers: Answers) -> dict[str, int]:
    """Participants of each status."""
    seen = answers.table.group_by(["participant", "status"]).aggregate([])["status"].to_pylist()
    return {status: seen.count(status) for status in STATUSES}


def minutes(answers: Answers) -> float:
    """Median time that those who finished spent on all pages; NaN without any, or without times."""
    done = answers.table.filter(pc.equal(answers.table["status"], "finished"))
    pages = done.group_by(["participant", "page"]).aggregate([("seconds", "max")])
    whole = pages.group_by("participant").aggregate([("seconds_max", "sum")])
    spent = numbers(whole["seconds_max_sum"])
    spent = spent[~np.isnan(spent)]
    return float(np.median(spent)) / 60 if len(spent) else float("nan")


def texts(answers: Answers) -> list[tuple[str, str, str, str]]:
    """Every free answer: participant, question, set or pair, text; in the order of the table."""
    asked = answers.table.filter(pc.equal(answers.table["type"], "text"))
    asked = asked.filter(pc.is_valid(asked["value"]))
    return [
        (row["participant"], row["question"], row["item"] or "", row["value"])
        for row in asked.select(["participant", "question", "item", "value"]).to_pylist()
    ]
