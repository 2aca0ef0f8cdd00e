"""Who comes from a recruiting platform: its ids, apart from everything else."""

from __future__ import annotations

from collections.abc import Mapping

from sqlalchemy import Connection, insert, select

from evenhand.study.server.refusal import RefusalError
from evenhand.study.server.schema import external


def remember(connection: Connection, participant: str, ids: Mapping[str, str]) -> None:
    """Store the ids of a participant who begins.

    Args:
        connection: of a transaction in which nobody else begins.
        participant: who begins.
        ids: PROLIFIC_PID, STUDY_ID, SESSION_ID, as far as given.

    Raises:
        RefusalError: "already-begun" for the same PROLIFIC_PID in the same STUDY_ID.
    """
    person, study = ids.get("PROLIFIC_PID"), ids.get("STUDY_ID")
    # the table's own constraint lets rows without STUDY_ID pass: NULL differs from NULL
    same = external.c.study_id.is_not_distinct_from(study)
    asked = select(external.c.participant).where(external.c.prolific_pid == person, same)
    if person and connection.scalar(asked) is not None:
        raise RefusalError(
            "already-begun",
            "You have begun this study before: open it in the same browser to go on, or write to "
            "the contact of the study.",
        )
    connection.execute(
        insert(external).values(
            participant=participant,
            prolific_pid=person,
            study_id=study,
            session_id=ids.get("SESSION_ID"),
        )
    )
