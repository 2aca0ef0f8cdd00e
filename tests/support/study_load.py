"""Participants in a hurry, and a server that is killed under them.

As a script, with as many participants as wanted and a database of its own:

    python tests/support/study_load.py 200 20
    python tests/support/study_load.py 200 20 postgresql://user:password@host/name
"""

import asyncio
import contextlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from sqlalchemy import select

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from evenhand.study.server import participants as participating
from evenhand.study.server import rows, schema
from evenhand.study.server.open_store import open_store
from support.postgres import free_port
from support.studies import ANSWERS

NURSERY = Path(__file__).with_name("study_nursery.py")
RETRY = (httpx.TransportError, asyncio.TimeoutError)


@dataclass
class Load:
    """What participants were told."""

    acknowledged: dict[tuple[str, str], dict[str, Any]] = field(default_factory=dict)
    finished: set[str] = field(default_factory=set)
    seconds: list[float] = field(default_factory=list)
    repeated: int = 0
    failed: int = 0
    kills: int = 0

    @property
    def slowest(self) -> float:
        """Seconds within which 95 % of the answers were stored, retries included."""
        return sorted(self.seconds)[int(0.95 * len(self.seconds))]


async def _ask(client: httpx.AsyncClient, load: Load, *request: Any, **more: Any) -> httpx.Response:
    """Send again and again until there is an answer, as the browser's queue does."""
    while True:
        try:
            told = await client.request(*request, **more)
        except RETRY:
            load.failed += 1
        else:
            if told.status_code not in (429, 503):
                return told
        await asyncio.sleep(random.uniform(0.02, 0.2))


async def _participant(client: httpx.AsyncClient, load: Load, number: int, pause: float) -> None:
    begun = await _ask(client, load, "POST", "/api/begin", json={"consent_version": "1"})
    assert begun.status_code == 201, begun.text
    token, following = begun.json()["token"], begun.json()["state"]["next"]
    head = {"authorization": f"Bearer {token}"}
    while following != "finished":
        await asyncio.sleep(random.uniform(0, pause))
        values = dict(ANSWERS[following.partition(":")[0]])
        if "why" in values:
            values["why"] = f"participant {number}"
        body = {"key": str(uuid.uuid4()), "sequence": 1, "values": values, "shown_ms": number}
        sent = time.monotonic()
        path = f"/api/pages/{following}"
        told = await _ask(client, load, "PUT", path, json=body, headers=head)
        assert told.status_code == 200, told.text
        load.seconds.append(time.monotonic() - sent)
        load.repeated += told.json()["repeated"]
        load.acknowledged[token, following] = body
        following = told.json()["next"]
    done = await _ask(client, load, "POST", "/api/finish", json={}, headers=head)
    assert done.json()["code"] == "C0DE", done.text
    load.finished.add(token)


async def _killer(db: str, port: int, kills: int, load: Load, work: asyncio.Future[Any]) -> None:
    """Kill the server so often, amid answers, and start it again; then leave it until the end."""
    nursery = subprocess.Popen(
        [sys.executable, NURSERY, db, str(port)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    orders, numbers = nursery.stdin, nursery.stdout
    assert orders is not None
    assert numbers is not None

    def start() -> int:
        print(file=orders, flush=True)
        return int(numbers.readline())

    server = start()
    try:
        while not work.done():
            there = len(load.acknowledged)
            # it has stored some since it started, and is storing more
            while len(load.acknowledged) <= there + random.randrange(5) and not work.done():
                assert _there(server), "the server ended by itself"
                await asyncio.sleep(0.005)
            if load.kills < kills:
                os.kill(server, signal.SIGKILL)
                load.kills += 1
                while _there(server):  # until it is gone, the port is its own
                    await asyncio.sleep(0.005)
                server = start()
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(server, signal.SIGKILL)
        nursery.communicate()


def _there(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


async def run(db: str, participants: int, kills: int, pause: float = 0.2) -> Load:
    """Let participants answer while the server is killed, all of them until it has been so often.

    Args:
        db: of the study.
        participants: at once; whoever has finished is followed by another one.
        kills: of the server.
        pause: most seconds between two answers.

    Returns:
        What they were told.
    """
    load, port = Load(), free_port()

    async def seat(client: httpx.AsyncClient, number: int) -> None:
        await _participant(client, load, number, pause)
        while load.kills < kills:
            await _participant(client, load, number, pause)

    limits = httpx.Limits(max_connections=participants)
    async with httpx.AsyncClient(
        base_url=f"http://127.0.0.1:{port}", timeout=30, limits=limits, trust_env=False
    ) as client:
        work = asyncio.ensure_future(
            asyncio.gather(*(seat(client, n) for n in range(participants)))
        )
        await _killer(db, port, kills, load, work)
        await work
    return load


def compare(db: str, load: Load) -> None:
    """Everything that was acknowledged is stored, as it was sent, and once."""
    kept = open_store(db, None, make=False)
    try:
        with kept.read() as connection:
            table = schema.participants.c
            asked = select(table.participant, table.token, table.status)
            people = {row.token: row for row in connection.execute(asked)}
        names = {token: people[participating.hashed(token)] for token, _ in load.acknowledged}
        stored = list(rows.read(kept, exact_times=True))
    finally:
        kept.dispose()
    counts = Counter((row["participant"], row["page"], row["question"]) for row in stored)
    assert set(counts.values()) <= {1}
    values = {(row["participant"], row["page"], row["question"]): row for row in stored}
    for (token, page), body in load.acknowledged.items():
        for question, value in body["values"].items():
            row = values[names[token].participant, page, question]
            # several are stored in the order of the options
            told = "age|race" if isinstance(value, list) else str(value)
            assert (row["value"], row["seconds"]) == (told, body["shown_ms"] / 1000)
    assert all(names[token].status == "finished" for token in load.finished)
    # nothing is stored of anybody that nobody sent
    assert {row["participant"] for row in stored} == {one.participant for one in names.values()}


def main() -> None:
    participants, kills = int(sys.argv[1]), int(sys.argv[2])
    with tempfile.TemporaryDirectory() as folder:
        db = sys.argv[3] if len(sys.argv) > 3 else f"{folder}/study.db"
        began = time.monotonic()
        load = asyncio.run(run(db, participants, kills, pause=20.0))
        compare(db, load)
    print(
        f"{participants} participants, {load.kills} kills, {len(load.acknowledged)} pages "
        f"acknowledged and stored, {load.repeated} sent again, {load.failed} connections lost; "
        f"95 % stored within {load.slowest:.3f} s; {time.monotonic() - began:.1f} s in all"
    )


if __name__ == "__main__":
    main()
