"""What a participant may ask for at any time: everything that is stored, and its deletion."""

from __future__ import annotations

import json
from typing import Any

from sqlalchemy import delete, select, update

from evenhand.study.server.participants import find
from evenhand.study.server.schema import answers, external, pages, participants
from evenhand.study.server.store import Store


def everything(store: Store, token: str) -> dict[str, Any]:
    """All that is stored about a participant, for the participant.

    Raises:
        RefusalError: "unknown-token" or "withdrawn".
    """
    with store.read() as connection:
        who = dict(find(connection, token))
        del who["token"]
        name = who["participant"]
        found: dict[str, Any] = {"participant": who}
        for kind, table in (("external", external), ("pages", pages), ("answers", answers)):
            asked = select(table).where(table.c.participant == name).order_by(*table.primary_key)
            rows = [dict(row) for row in connection.execute(asked).mappings()]
            for row in rows:
                del row["participant"]
                row.pop("digest", None)
                if "clip_views" in row:
                    row["clip_views"] = json.loads(row["clip_views"])
            found[kind] = rows
    return found


def withdraw(store: Store, token: str) -> None:
    """Delete everything but a row that says that somebody withdrew. Can be said again.

    The row keeps the order and the hash of the token, and no times. Ids of a platform are deleted
    too, so the same person could begin again.

    Raises:
        RefusalError: "unknown-token".
        StorageError: nothing was deleted.
    """
    with store.write() as connection:
        who = find(connection, token, lock=True, withdrawn=True)
        for table in (answers, pages, external):
            connection.execute(delete(table).where(table.c.participant == who["participant"]))
        mine = participants.c.participant == who["participant"]
        gone = {"status": "withdrawn", "began": 0, "seen": 0, "finished": None}
        connection.execute(update(participants).where(mine).values(**gone))
    store.forget()
