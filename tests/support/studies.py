"""A small study, a browser that needs no network, and answers to send."""

import asyncio
import uuid
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from fastapi import FastAPI

from evenhand.study.design.protocol import (
    Check,
    ClipSet,
    Demographic,
    Option,
    Pair,
    Protocol,
    Question,
)
from evenhand.study.server import participants, store
from evenhand.study.server.open_store import open_store
from evenhand.study.server.web.app import build
from evenhand.study.server.web.desk import Settings

FILM = b"\x00\x00\x00\x14ftypisom\x00\x00\x00\x00isom"
"""How an MP4 file begins: enough for what never plays it."""
WEBM = b"\x1a\x45\xdf\xa3"

ADMIN = "a-token-of-the-lead-0001"
LEAD = {"authorization": f"Bearer {ADMIN}"}

STUDY = Protocol(
    name="tiny",
    title="A tiny study",
    consent_version="1",
    consent="You watch robots and say what you think.",
    completion_code="C0DE",
    redirect="https://recruit.example/done?cc={code}",
    sets=(
        ClipSet("s1", ("s1a.mp4", "s1b.mp4"), ("A child asks.", "An adult asks.")),
        ClipSet("s2", ("s2a.mp4",), kind="control"),
    ),
    questions=(
        Question("fair", "How even?", "scale", "fair", low="uneven", high="even", points=5),
        Question(
            "issue",
            "Which is worst?",
            "choice",
            "issue",
            options=(Option("risk", "Too close"), Option("none", "None")),
        ),
        Question(
            "whom",
            "Towards whom?",
            "choices",
            "identity",
            required=False,
            options=(Option("age", "Age"), Option("race", "Race"), Option("none", "Nobody")),
        ),
        Question("which", "Which was more even?", "pair", "pair", about="pair",
                 options=(Option("first", "First"), Option("second", "Second"),
                          Option("same", "Same"))),
        Question("why", "Anything else?", "text", "free", about="end", required=False, longest=50),
    ),
    demographics=(Demographic("years", "How old are you?", ("18-39", "40 or more")),),
    pairs=(Pair("p1", "s1", "s2"),),
    checks=(Check("look", "Choose blue.", ("red", "blue"), "blue", after=1),),
)  # fmt: skip
"""Every kind of page and question once."""

ANSWERS: dict[str, dict[str, Any]] = {
    "about": {"years": "18-39"},
    "set": {"fair": 2, "issue": "risk", "whom": ["race", "age"]},
    "check": {"look": "blue"},
    "pair": {"which": "second"},
    "end": {"why": "Nothing."},
}


@dataclass
class Clock:
    """A clock that goes when it is told to."""

    now: float = 1_700_000_000.0

    def __call__(self) -> float:
        return self.now


@dataclass
class Browser:
    """Asks an application in this process, and keeps its token."""

    app: FastAPI
    headers: dict[str, str] = field(default_factory=dict)

    def __call__(self, method: str, path: str, **more: Any) -> httpx.Response:
        async def ask() -> httpx.Response:
            transport = httpx.ASGITransport(self.app)
            async with httpx.AsyncClient(transport=transport, base_url="http://study") as client:
                headers = {**self.headers, **more.pop("headers", {})}
                return await client.request(method, path, headers=headers, **more)

        return asyncio.run(ask())

    def begin(self, headers: dict[str, str] | None = None, **more: Any) -> httpx.Response:
        sent = {"consent_version": "1", **more}
        told = self("POST", "/api/begin", json=sent, headers=headers or {})
        if told.status_code == 201:
            self.headers["authorization"] = f"Bearer {told.json()['token']}"
        return told

    def put(self, page: str, values: dict[str, Any], **more: Any) -> httpx.Response:
        return self("PUT", f"/api/pages/{page}", json=sent(values, **more))

    def next(self) -> str:
        return self("GET", "/api/state").json()["next"]

    def answer_all(self) -> None:
        while (page := self.next()) != "finished":
            told = self.put(page, ANSWERS[page.partition(":")[0]])
            assert told.status_code == 200, told.text


def sent(values: dict[str, Any], **more: Any) -> dict[str, Any]:
    """The body of a page."""
    body = {"key": str(uuid.uuid4()), "sequence": 1, "values": values, "shown_ms": 4000}
    return {**body, "clip_views": {}, "at": "2026-01-01T00:00:00Z", **more}


def served(
    where: str | Path = "sqlite://", study: Protocol = STUDY, clock: Any = None, **settings: Any
) -> tuple[FastAPI, store.Store]:
    """The application of a study on a database."""
    kept = open_store(str(where), study, clock=clock or Clock(), wait=0.2)
    return build(study, kept, Settings(participants.hashed(ADMIN), **settings)), kept


def pragma(kept: store.Store, words: str) -> Any:
    """Set or ask for something of an SQLite connection that is used again afterwards."""
    with kept.engine.connect() as bare:
        raw: Any = bare.connection.driver_connection
        row = raw.execute(f"PRAGMA {words}").fetchone()
    return row[0] if row else None
