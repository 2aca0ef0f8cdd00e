"""Stored answers as rows, one an answered question: what export writes and analysis reads."""

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import select

from evenhand.study.server import check_reply
from evenhand.study.server.schema import answers, external, pages, participants
from evenhand.study.server.store import Store

EXTERNAL = {"PROLIFIC_PID": "prolific_pid", "STUDY_ID": "study_id", "SESSION_ID": "session_id"}
"""Column of the export -> column of the table."""


def read(
    store: Store,
    *,
    previews: bool = False,
    external_ids: bool = False,
    exact_times: bool = False,
) -> Iterator[dict[str, Any]]:
    """Rows with the columns that ``evenhand study export`` documents, by participant and page.

    Whoever has withdrawn has none. Participants come in the order of their random names, so that
    rows do not tell who came first.

    Args:
        store: where from.
        previews: also those of previews.
        external_ids: with ``EXTERNAL``, which identify people.
        exact_times: ``received`` to the millisecond instead of the minute.

    Raises:
        StorageError: when the database cannot be read.
    """
    asked = (
        select(
            participants,
            pages.c.position,
            pages.c.shown_ms,
            pages.c.clip_views,
            pages.c.received,
            *(column for column in answers.c if column.name != "participant"),
            *(external.c[name] for name in EXTERNAL.values() if external_ids),
        )
        .join(pages, pages.c.participant == participants.c.participant)
        .join(
            answers,
            (answers.c.participant == pages.c.participant) & (answers.c.page == pages.c.page),
        )
        .order_by(participants.c.participant, pages.c.position, answers.c.place)
    )
    if external_ids:
        asked = asked.outerjoin(external, external.c.participant == participants.c.participant)
    if not previews:
        asked = asked.where(participants.c.preview.is_(False))
    with store.read() as connection:
        # rows are fetched as they are read; ten thousand participants need not fit into memory
        for row in connection.execution_options(yield_per=1000).execute(asked).mappings():
            views = json.loads(row["clip_views"])
            yield {
                "participant": row["participant"],
                "simulated": row["simulated"],
                "preview": row["preview"],
                "consent_version": row["consent_version"],
                "order": row["order_number"],
                "position": row["position"],
                "page": row["page"],
                "kind": row["kind"],
                "item": row["item"],
                "question": row["question"],
                "role": row["role"],
                "type": row["type"],
                "value": row["value"],
                "number": row["number"],
                "right": row["right"],
                "seconds": check_reply.seconds(row["shown_ms"]),
                # how often every clip of the page was seen to its end
                "views": min(views.values()) if views else None,
                "received": moment(row["received"], exact_times),
                "status": row["status"],
                **{told: row[name] for told, name in EXTERNAL.items() if external_ids},
            }


def moment(milliseconds: int, exact: bool = False) -> str:
    """A time of UTC as ISO 8601, to the minute unless asked for exactly."""
    when = datetime.fromtimestamp(milliseconds / 1000, UTC)
    return when.strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z" if exact else f"{when:%Y-%m-%dT%H:%MZ}"
