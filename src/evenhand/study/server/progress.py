"""What a lead wants to know of a running study."""

import math
from collections.abc import Sequence
from statistics import median
from typing import Any

import numpy as np
from sqlalchemy import ColumnElement, Connection, func, select

from evenhand.study.analysis import agreement
from evenhand.study.design.protocol import Protocol, Question
from evenhand.study.server.participants import UNDER_WAY
from evenhand.study.server.rows import moment
from evenhand.study.server.schema import answers, participants
from evenhand.study.server.store import Store, read_note

STATES = ("began", "finished", "under_way", "dropped_out", "withdrawn")


def read(store: Store, study: Protocol) -> dict[str, Any]:
    """Numbers of the study, real participants, simulated ones and previews apart.

    Who has not finished and was not seen within the last hour has dropped out, until seen again.

    Returns:
        ``study``, ``title``, ``at``, ``closed``, ``sets`` and, under ``real``, ``simulated`` and
        ``preview``: ``counts`` of ``STATES``, the same for each of ``orders``, ``minutes``
        (median from beginning to end, of n who finished), ``checks`` (answered, failed) and
        ``agreement`` (Krippendorff's alpha over the sets; ordinal for scales, nominal for
        choices; None where it is not defined).

    Raises:
        StorageError: when the database cannot be read.
    """
    with store.read() as connection:
        now = store.now()
        return {
            "study": study.name,
            "title": study.title,
            "at": moment(now),
            "closed": read_note(connection, "closed") == "yes",
            "sets": study.judged,
            "real": _of(connection, study, now, simulated=False, preview=False),
            "simulated": _of(connection, study, now, simulated=True, preview=False),
            "preview": _of(connection, study, now, preview=True),
        }


def _of(connection: Connection, study: Protocol, now: int, **marks: bool) -> dict[str, Any]:
    table = participants.c
    meant = [table[name].is_(mark) for name, mark in marks.items()]
    asked = select(table.order_number, table.status, table.seen, table.began, table.finished)
    orders: dict[int, dict[str, int]] = {}
    counts = dict.fromkeys(STATES, 0)
    minutes = []
    for order, status, seen, began, finished in connection.execute(asked.where(*meant)):
        if status == "begun":
            status = "under_way" if seen > now - UNDER_WAY else "dropped_out"
        if status == "finished" and finished >= began:
            minutes.append((finished - began) / 60_000)
        for one in (counts, orders.setdefault(order, dict.fromkeys(STATES, 0))):
            one["began"] += 1
            one[status] += 1
    asked = (
        select(answers.c.question, answers.c.right, func.count())
        .join(participants, table.participant == answers.c.participant)
        .where(answers.c.kind == "check", *meant)
        .group_by(answers.c.question, answers.c.right)
    )
    found = {(name, right): n for name, right, n in connection.execute(asked)}
    return {
        "counts": counts,
        "orders": [{"order": order} | orders[order] for order in sorted(orders)],
        "minutes": {"median": round(median(minutes), 1) if minutes else None, "n": len(minutes)},
        "checks": [
            {
                "check": one.id,
                "answered": found.get((one.id, True), 0) + found.get((one.id, False), 0),
                "failed": found.get((one.id, False), 0),
            }
            for one in study.checks
        ],
        "agreement": [
            {"question": one.id} | _agreement(connection, one, meant)
            for one in study.asked("set")
            if one.type in ("scale", "choice")
        ],
    }


def _agreement(
    connection: Connection, question: Question, meant: Sequence[ColumnElement[bool]]
) -> dict[str, Any]:
    asked = (
        select(answers.c.item, answers.c.value, func.count())
        .join(participants, participants.c.participant == answers.c.participant)
        .where(answers.c.question == question.id, answers.c.value.is_not(None), *meant)
        .group_by(answers.c.item, answers.c.value)
    )
    found = connection.execute(asked).all()
    values = [one.value for one in question.options]
    if question.type == "scale":
        values = [str(point) for point in range(1, question.points + 1)]
    # previews may have been answered before the study was changed
    found = [one for one in found if one.value in values]
    sets = sorted({item for item, _, _ in found})
    counts = np.zeros((len(sets), len(values)))
    for item, value, n in found:
        counts[sets.index(item), values.index(value)] = n
    level = "ordinal" if question.type == "scale" else "nominal"
    alpha = float(agreement.alpha(counts, level)) if sets else math.nan
    return {"alpha": None if math.isnan(alpha) else round(alpha, 3), "answers": int(counts.sum())}
