"""What a participant does: begin, answer page by page, finish."""

import hashlib
import json
import secrets
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from sqlalchemy import Connection, RowMapping, and_, delete, func, insert, or_, select, update

from evenhand.study.design import orders
from evenhand.study.design.protocol import Protocol
from evenhand.study.server import check_reply
from evenhand.study.server.check_reply import Value
from evenhand.study.server.refusal import RefusalError
from evenhand.study.server.schema import answers, external, pages, participants
from evenhand.study.server.store import Store, read_note

UNDER_WAY = 3600 * 1000
"""Milliseconds after which somebody who has not finished counts as gone."""
_LETTERS = "abcdefghijkmnpqrstuvwxyz"


@dataclass(frozen=True)
class State:
    """How far a participant is.

    Attributes:
        pages: ``orders.pages`` of the participant.
        answered: page id -> number of questions stored; the consent counts as answered.
        next: id of the first page that is not.
        finished: whether the participant has finished.
    """

    pages: list[dict[str, Any]]
    answered: dict[str, int]
    next: str
    finished: bool


@dataclass(frozen=True)
class Sent:
    """One page as a browser sends it.

    Attributes:
        key: a UUID of the browser's, the same when it sends the same again.
        sequence: the browser's own count.
        values: question id -> answer.
        shown_ms: how long the page was open.
        clip_views: clip -> how often it was seen to its end.
        at: the browser's clock; kept as data, decides nothing.
    """

    key: str
    sequence: int
    values: Mapping[str, Value]
    shown_ms: int
    clip_views: Mapping[str, int] = field(default_factory=dict)
    at: str = ""


def hashed(token: str) -> str:
    """What is stored of a token: its SHA-256. It has 256 random bits, so no salt is needed."""
    return hashlib.sha256(token.encode()).hexdigest()


def begin(
    store: Store,
    study: Protocol,
    consent_version: str,
    ids: Mapping[str, str] | None = None,
    *,
    token: str | None = None,
    simulated: bool = False,
    preview: bool = False,
) -> tuple[str, State]:
    """A new participant, with the order that is least filled.

    A browser can make the token itself and send it along. Then it can send the same again when it
    heard no answer: who has begun with it is found, and nobody begins twice.

    Filled by those who have finished or were seen within the last hour; real participants,
    simulated ones and previews are counted apart. Ids of a platform are not stored of previews.

    Args:
        store: where to.
        study: the study.
        consent_version: the one that was agreed to.
        ids: PROLIFIC_PID, STUDY_ID, SESSION_ID, as far as given.
        token: of the browser's making, 256 random bits; one is made here when None.
        simulated: marked so for ever.
        preview: likewise.

    Returns:
        The token, which is told this once and stored nowhere, and the state.

    Raises:
        RefusalError: "closed", "other-consent", "withdrawn" for a token of the browser's, or
            "already-begun" for the same PROLIFIC_PID and STUDY_ID.
        StorageError: nothing was stored.
    """
    if consent_version != study.consent_version:
        raise RefusalError(
            "other-consent", "The consent text has changed: reload the page and read it."
        )
    given, now = token, store.now()
    token = given or secrets.token_urlsafe(32)
    with store.write() as connection:
        store.one_at_a_time(connection)
        if given and (known := _known(connection, given)):
            if known["status"] == "withdrawn":
                raise _gone()
            return given, _state_of(connection, store, study, known)
        if read_note(connection, "closed") == "yes":
            raise _closed()
        order = _least_filled(connection, study, now, simulated, preview)
        name = _unused_name(connection)
        connection.execute(
            insert(participants).values(
                participant=name,
                token=hashed(token),
                simulated=simulated,
                preview=preview,
                consent_version=consent_version,
                order_number=order,
                status="begun",
                began=now,
                seen=now,
            )
        )
        if ids and not preview:
            remember(connection, name, ids)
    return token, _state(store.pages(study, order), {}, False)


def state(store: Store, study: Protocol, token: str) -> State:
    """How far a participant is.

    Raises:
        RefusalError: "unknown-token" or "withdrawn".
    """
    with store.read() as connection:
        return _state_of(connection, store, study, find(connection, token))


def save(store: Store, study: Protocol, token: str, page_id: str, sent: Sent) -> tuple[str, bool]:
    """Store one page. The same page with the same answers can be sent again and again.

    Returns:
        The next page, and whether these answers had been stored before.

    Raises:
        RefusalError: "unknown-token", "withdrawn", "unknown-page", "invalid", "already-answered",
            "key-reused", "closed" or "out-of-order"; nothing was stored.
        StorageError: likewise.
    """
    with store.write() as connection:
        who = find(connection, token, lock=True)
        name, all_pages = who["participant"], store.pages(study, who["order_number"])
        places = {page["id"]: place for place, page in enumerate(all_pages)}
        if page_id not in places:
            raise RefusalError("unknown-page", "There is no such page in this study.")
        done = _answered(connection, name)
        following = _next(all_pages, done)
        page = all_pages[places[page_id]]
        if page["kind"] == "consent":
            raise RefusalError("already-answered", "You agreed when you began.", following)
        if page["kind"] == "finished":
            raise RefusalError("out-of-order", "The last page has no questions.", following)
        found = check_reply.check(study, page, sent.values)
        views = _every_view(page, sent.clip_views)
        print_ = check_reply.digest(found)
        if page_id in done and done[page_id][1] == print_:
            return following, True
        if who["status"] == "finished" or read_note(connection, "closed") == "yes":
            raise _closed()
        if page_id in done:
            raise RefusalError(
                "already-answered", "This page was answered before; that answer counts.", following
            )
        if sent.key in {key for key, _ in done.values()}:
            raise RefusalError("key-reused", "Another page was sent with the same key.", following)
        if page_id != following:
            raise RefusalError("out-of-order", "Another page comes first.", following)
        now = store.now()
        connection.execute(
            insert(pages).values(
                participant=name,
                page=page_id,
                key=sent.key,
                digest=print_,
                position=places[page_id],
                sequence=sent.sequence,
                shown_ms=sent.shown_ms,
                clip_views=json.dumps(views),
                browser_clock=sent.at,
                received=now,
            )
        )
        connection.execute(
            insert(answers),
            [
                {"participant": name, "page": page_id, "place": place, **asdict(reply)}
                for place, reply in enumerate(found)
            ],
        )
        mine = participants.c.participant == name
        connection.execute(update(participants).where(mine).values(seen=now))
        return _next(all_pages, {**done, page_id: ("", "")}), False


def finish(store: Store, study: Protocol, token: str) -> None:
    """Everything is answered. Can be said again.

    Raises:
        RefusalError: "unknown-token", "withdrawn", or "not-finished" with the next page.
        StorageError: nothing was changed.
    """
    with store.write() as connection:
        who = find(connection, token, lock=True)
        if who["status"] == "finished":
            return
        done = _answered(connection, who["participant"])
        following = _next(store.pages(study, who["order_number"]), done)
        if following != "finished":
            raise RefusalError("not-finished", "There are pages left to answer.", following)
        now = store.now()
        mine = participants.c.participant == who["participant"]
        connection.execute(
            update(participants).where(mine).values(status="finished", finished=now, seen=now)
        )


def _closed() -> RefusalError:
    return RefusalError("closed", "This study is closed and takes no more answers. Thank you.")


def find(
    connection: Connection, token: str, *, lock: bool = False, withdrawn: bool = False
) -> RowMapping:
    """The row of a participant.

    Raises:
        RefusalError: "unknown-token" or "withdrawn".
    """
    row = _known(connection, token, lock=lock)
    if row is None:
        raise RefusalError("unknown-token", "This link is not known here: begin the study anew.")
    if row["status"] == "withdrawn" and not withdrawn:
        raise _gone()
    return row


def _known(connection: Connection, token: str, *, lock: bool = False) -> RowMapping | None:
    asked = select(participants).where(participants.c.token == hashed(token))
    return connection.execute(asked.with_for_update() if lock else asked).mappings().first()


def _gone() -> RefusalError:
    return RefusalError("withdrawn", "You have withdrawn; your answers are deleted.")


def _answered(connection: Connection, name: str) -> dict[str, tuple[str, str]]:
    """Page -> key and digest, of all that is stored."""
    asked = select(pages.c.page, pages.c.key, pages.c.digest).where(pages.c.participant == name)
    return {page: (key, print_) for page, key, print_ in connection.execute(asked)}


def _next(all_pages: list[dict[str, Any]], done: Mapping[str, Any]) -> str:
    return next(page["id"] for page in all_pages[1:] if page["id"] not in done)


def _state_of(connection: Connection, store: Store, study: Protocol, who: RowMapping) -> State:
    done = _answered(connection, who["participant"])
    asked = (
        select(answers.c.page, func.count())
        .where(answers.c.participant == who["participant"])
        .group_by(answers.c.page)
    )
    counts: dict[str, int] = {row[0]: row[1] for row in connection.execute(asked)}
    told = {page: counts.get(page, 0) for page in done}
    return _state(store.pages(study, who["order_number"]), told, who["status"] == "finished")


def _state(all_pages: list[dict[str, Any]], told: dict[str, int], finished: bool) -> State:
    return State(all_pages, {"consent": 0, **told}, _next(all_pages, told), finished)


def _least_filled(
    connection: Connection, study: Protocol, now: int, simulated: bool, preview: bool
) -> int:
    table = participants.c
    asked = (
        select(table.order_number, func.count())
        .where(
            table.simulated.is_(simulated),
            table.preview.is_(preview),
            or_(
                table.status == "finished",
                and_(table.status == "begun", table.seen > now - UNDER_WAY),
            ),
        )
        .group_by(table.order_number)
    )
    filled: dict[int, int] = {row[0]: row[1] for row in connection.execute(asked)}
    # with no end of orders, one that nobody has is among the first len + 1
    return min(range(orders.count(study) or len(filled) + 1), key=lambda k: (filled.get(k, 0), k))


def _unused_name(connection: Connection) -> str:
    while True:
        name = "".join(secrets.choice(_LETTERS) for _ in range(8))
        taken = select(participants.c.participant).where(participants.c.participant == name)
        if connection.scalar(taken) is None:
            return name


def _every_view(page: Mapping[str, Any], views: Mapping[str, int]) -> dict[str, int]:
    """How often each clip of a page was seen to its end; 0 for one that was not spoken of."""
    shown = [*page.get("clips", ()), *(c for side in ("first", "second") if side in page
                                       for c in page[side]["clips"])]  # fmt: skip
    for clip in views:
        if clip not in shown:
            raise RefusalError(
                "invalid", f"clip_views names {clip[:100]!r}, which is not on this page"
            )
    return {clip: views.get(clip, 0) for clip in shown}


def remember(connection: Connection, participant: str, ids: Mapping[str, str]) -> None:
    """Store the ids of a participant who begins.

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
