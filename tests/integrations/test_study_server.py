"""The study on real servers: killed under load, asked nonsense, on SQLite and on PostgreSQL."""

import asyncio
import contextlib
import json
import os
import re
import signal
import socket
import sqlite3
from pathlib import Path
from urllib.request import Request, urlopen

import pytest
import schemathesis
from hypothesis import HealthCheck, settings
from schemathesis.checks import CHECKS

from evenhand.study.design import protocol_file
from evenhand.study.server import backup, participants, progress, rows, store
from evenhand.study.server.open_store import open_store
from evenhand.study.server.refusal import RefusalError
from support import study_load
from support.postgres import programs, server
from support.studies import ANSWERS, FILM, STUDY, Browser, served

pytestmark = [
    pytest.mark.slow,
    # a killed server's connections are left to the garbage collector
    pytest.mark.filterwarnings("ignore:unclosed <socket:ResourceWarning"),
]
KILLS = 20


QUIET = (HealthCheck.too_slow, HealthCheck.filter_too_much)


@pytest.fixture(scope="module")
def postgres(require):
    found = programs()
    require(found is not None, "a PostgreSQL server (postgres, initdb)")
    assert found is not None
    with server(found) as url:
        yield url


def stored(kept: store.Store) -> list[tuple]:
    return [(row["page"], row["question"], row["value"]) for row in rows.read(kept)]


# --- killed ---


def killed_under_load(db: str) -> None:
    load = asyncio.run(study_load.run(db, participants=8, kills=KILLS))
    assert load.kills == KILLS
    assert len(load.finished) >= 8
    assert load.failed > 0
    study_load.compare(db, load)


def test_no_answer_is_lost_or_stored_twice_when_sqlite_is_killed(tmp_path):
    killed_under_load(str(tmp_path / "study.db"))
    with sqlite3.connect(tmp_path / "study.db") as one:
        assert one.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    one.close()


def test_no_answer_is_lost_or_stored_twice_when_postgres_is_used(postgres):
    killed_under_load(postgres)


# --- PostgreSQL does what SQLite does ---


@pytest.fixture
def emptied(postgres):
    """The same server, without a study."""
    import psycopg

    with psycopg.connect(postgres, autocommit=True) as one:
        one.execute("DROP SCHEMA public CASCADE")
        one.execute("CREATE SCHEMA public")
    return postgres


def test_a_whole_study_on_postgres(emptied, tmp_path):
    app, kept = served(emptied)
    browser = Browser(app)
    ids = {"PROLIFIC_PID": "p1", "STUDY_ID": "s1"}
    assert browser.begin(external=ids).status_code == 201
    assert Browser(app).begin(external=ids).json()["code"] == "already-begun"
    browser.answer_all()
    assert browser("POST", "/api/finish", json={}).json()["code"] == "C0DE"
    second = Browser(app)
    second.begin()
    second.put(second.next(), ANSWERS["about"])
    before = stored(kept)
    assert len(before) == 11  # 1 about oneself, 2 x 3, 1 check, 1 pair, 1 at the end; 1 more
    assert progress.read(kept, STUDY)["real"]["counts"] == {
        "began": 2, "finished": 1, "under_way": 1, "dropped_out": 0, "withdrawn": 0,
    }  # fmt: skip
    # the backup is an SQLite file that holds the same and can go on
    copy = backup.write(kept, tmp_path / "copy.db")
    browser("DELETE", "/api/mine")
    assert len(stored(kept)) == 1
    app, again = served(copy)
    assert sorted(stored(again)) == sorted(before)
    on_copy = Browser(app, dict(second.headers))
    on_copy.answer_all()
    assert on_copy("POST", "/api/finish", json={}).status_code == 200
    for one in (kept, again):
        one.dispose()


def test_two_tabs_on_postgres_store_one_answer(emptied):
    from concurrent.futures import ThreadPoolExecutor

    kept = open_store(emptied, STUDY)
    token, _ = participants.begin(kept, STUDY, "1")

    def send(answer: str) -> str:
        one = participants.Sent(f"key-{answer}", 1, {"years": answer}, 5)
        try:
            participants.save(kept, STUDY, token, "about", one)
        except RefusalError as error:
            return error.code
        return "saved"

    with ThreadPoolExecutor(4) as pool:
        told = list(pool.map(send, ["18-39", "40 or more"] * 6))
    assert sorted(set(told)) == ["already-answered", "saved"]
    assert told.count("saved") == 6  # one was stored, five repeat it
    assert len(stored(kept)) == 1
    kept.dispose()


def test_orders_are_filled_evenly_by_a_crowd_on_postgres(emptied):
    from concurrent.futures import ThreadPoolExecutor

    kept = open_store(emptied, STUDY)
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda _: participants.begin(kept, STUDY, "1"), range(30)))
    found = progress.read(kept, STUDY)["real"]["orders"]
    assert [(one["order"], one["began"]) for one in found] == [(0, 15), (1, 15)]
    kept.dispose()


def test_a_password_is_never_shown(emptied, cli):
    wrong = emptied.replace("s3cr%40t", "wr0ng%40pw")
    complaint = cli("study", "backup", "--db", wrong, "--out", "x.db").complaint
    assert "wr0ng" not in complaint
    assert "cannot store or read" in complaint


# --- asked nonsense ---

APP, KEPT = served()
# a body that is too large is refused before anybody looks at what is in it
REFUSED = [
    "400",
    "401",
    "403",
    "404",
    "405",
    "406",
    "409",
    "413",
    "415",
    "422",
    "428",
    "429",
    "5xx",
]
CONFIG = schemathesis.Config.from_dict(
    {"checks": {"negative_data_rejection": {"expected-statuses": REFUSED}}}
)
SCHEMA = schemathesis.openapi.from_dict(APP.openapi(), config=CONFIG)
SCHEMA.app = APP
# needs a server that remembers across requests, or other people's tokens
STATEFUL = ("use_after_free", "ensure_resource_availability", "object_level_authorization")
CHECKED = [CHECKS.get_one(name) for name in CHECKS.get_all_names() if name not in STATEFUL]


@SCHEMA.parametrize()
@settings(
    max_examples=25,
    suppress_health_check=QUIET,
)
def test_schemathesis_finds_nothing(case):
    case.call_and_validate(checks=CHECKED)


# what fits the schema may still be no answer to the page's questions
ANSWERED = [one for one in CHECKED if one.__name__ not in ("positive_data_acceptance",
                                                           "ignored_auth")]  # fmt: skip


@SCHEMA.parametrize()
@settings(max_examples=25, suppress_health_check=QUIET)
def test_schemathesis_finds_nothing_as_a_participant(case):
    one = Browser(APP)
    one.begin()
    case.call_and_validate(checks=ANSWERED, headers=one.headers)


# --- the command, on a port ---


def ask(url: str, token: str | None = None, sent: object = None, **headers: str):
    body = None if sent is None else json.dumps(sent).encode()
    if token:
        headers["authorization"] = f"Bearer {token}"
    request = Request(url, body, {"content-type": "application/json", **headers})
    with urlopen(request) as answer:
        return answer.status, dict(answer.headers), answer.read()


@pytest.fixture
def file(tmp_path) -> Path:
    text = protocol_file.PAPER.read_text()
    path = tmp_path / "study.toml"
    path.write_text(re.sub(r"\[\[[^\[\]\n]*[A-Z ][^\[\]]*\]\]|\[\[institution\]\]", "x", text))
    study, _ = protocol_file.examine(path, look=False)
    assert study is not None
    study.clips.mkdir()
    for name in study.clip_names:
        (study.clips / name).write_bytes(FILM[:10] + bytes(range(10, 256)))
    return path


@contextlib.contextmanager
def serving(apart, *words: str, cwd: Path):
    """A command that serves: its process, the address, and the admin token that it printed."""
    process = apart.start(*words, cwd=cwd)
    at = ""
    try:
        for line in process.stdout:
            at = line.split(": ")[1].strip() if "participants:" in line else at
            if "shown this once" in line:
                yield process, at, line.split(": ")[1].strip()
                break
        else:
            raise AssertionError(process.communicate())
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()


def test_a_study_is_served_on_a_port_and_goes_on_after_a_stop(apart, tmp_path, file):
    words = ("study", "serve", file.name, "--db", "s.db", "--port", "0")
    token = None
    for turn in range(2):
        with serving(apart, *words, cwd=tmp_path) as (process, at, admin):
            if turn == 0:
                _, _, body = ask(f"{at}api/begin", sent={"consent_version": "template-1"})
                token = json.loads(body)["token"]
            state = json.loads(ask(f"{at}api/state", token)[2])
            assert state["next"] == "about"
            status, headers, body = ask(f"{at}clips/clip-01.mp4", range="bytes=10-19")
            assert (status, body) == (206, bytes(range(10, 20)))
            assert headers["content-range"] == "bytes 10-19/256"
            counts = json.loads(ask(f"{at}lead/numbers", admin)[2])["real"]["counts"]
            assert counts["began"] == 1
            ended = apart.interrupt(process)
        assert ended.code == 130
        # the log has routes, and no addresses, browsers, tokens or ids
        assert "GET /api/state 200" in ended.err
        assert not re.search(r"127\.0\.0\.1|Python-urllib|clip-01", ended.err)
        assert token is not None
        assert token not in ended.err
        assert admin not in ended.err


def test_a_preview_keeps_nothing(apart, tmp_path, file):
    words = ("study", "preview", file.name, "--port", "0")
    with serving(apart, *words, cwd=tmp_path) as (process, at, admin):
        ask(f"{at}api/begin", sent={"consent_version": "template-1"})
        told = json.loads(ask(f"{at}lead/numbers", admin)[2])
        assert told["preview"]["counts"]["began"] == 1
        assert told["real"]["counts"]["began"] == 0
        apart.interrupt(process)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["clips", "study.toml"]


def test_a_port_that_is_taken(cli, tmp_path, file):
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        one.listen()
        port = one.getsockname()[1]
        said = cli("study", "serve", file, "--port", port)
    assert said.code == 2
    assert f"127.0.0.1, port {port} cannot be listened to" in said.err
