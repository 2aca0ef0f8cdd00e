"""Simulated participants through the API of a server that listens on this machine."""

import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
import uvicorn

from evenhand.study.analysis.answers import Answers
from evenhand.study.server import rows
from evenhand.study.server.store import Store
from evenhand.study.server.web.limits import Limits, Rate
from evenhand.study.server.web.serve import address, listen
from evenhand.study.simulated import over_http, participants
from evenhand.study.simulated.over_http import Server, take
from support.answered import protocol
from support.refusals import refused
from support.studies import served


class Running:
    """A server in a thread of this process."""

    def __init__(self, where: Path, **settings) -> None:
        app, self.store = served(where, protocol(), clock=time.time, **settings)
        socket = listen("127.0.0.1", 0)
        self.url = address(socket)
        config = uvicorn.Config(app, log_config=None, access_log=False, ws="none", lifespan="off")
        self.server = uvicorn.Server(config)
        self.thread = threading.Thread(target=self.server.run, kwargs={"sockets": [socket]})

    def __enter__(self) -> "Running":
        self.thread.start()
        return self

    def __exit__(self, *_) -> None:
        self.server.should_exit = True
        self.thread.join(30)
        self.store.dispose()


@pytest.fixture(scope="module")
def running(tmp_path_factory) -> Iterator[Running]:
    with Running(tmp_path_factory.mktemp("served") / "s.db", simulated=True) as found:
        yield found


def stored(store: Store) -> Answers:
    return Answers.of_rows(rows.read(store))


def told(answers: Answers) -> Counter:
    wanted = ("order", "position", "page", "question", "role", "type", "value", "number", "right",
              "seconds", "views", "status", "simulated")  # fmt: skip
    return Counter(tuple(row[name] for name in wanted) for row in answers.rows())


def test_what_goes_through_the_server_is_what_is_written_directly(running):
    finished = take(Server(running.url), protocol(), 8, 5)
    found = stored(running.store)
    assert told(found) == told(participants.answers(protocol(), 8, 5))
    assert 0 < finished <= 8
    assert all(row["simulated"] for row in found.rows())


def test_a_server_that_asks_to_wait_gets_its_time(tmp_path, monkeypatch):
    waited: list[float] = []
    monkeypatch.setattr(over_http.time, "sleep", waited.append)
    monkeypatch.setattr(over_http, "TRIES", 3)
    limits = Limits(begin=Rate(1, 0.001))
    with (
        Running(tmp_path / "s.db", simulated=True, limits=limits) as found,
        refused("unavailable url"),
    ):
        take(Server(found.url), protocol(), 2, 0)
    assert len(waited) == 2
    assert all(0 < wait <= 5 for wait in waited)


def test_a_server_for_people_takes_no_simulated_participants(tmp_path):
    with Running(tmp_path / "s.db") as found:
        with refused("unavailable url", "--allow-simulated"):
            take(Server(found.url), protocol(), 1, 0)
        assert len(stored(found.store)) == 0


def test_another_study_is_refused_before_anybody_begins(running):
    before = len(stored(running.store))
    with refused("conflict url", "'small'", "'other'"):
        take(Server(running.url), protocol(name="other"), 1, 0)
    assert len(stored(running.store)) == before


def test_no_server_and_no_address_are_told():
    with refused("unavailable url", "127.0", "9"):
        Server("http://127.0.0.1:9").ask("GET", "/study")
    for url in ("", "localhost", "file:///etc/passwd", "http://"):
        with refused("format url"):
            Server(url)
