"""Simulated participants in the real pages: jsPsych's simulation mode in a real Chromium."""

import shutil
import sys
from dataclasses import replace

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.study.design import orders, protocol_file
from evenhand.study.design.protocol import ClipSet
from evenhand.study.simulated import in_browser, over_http, participants
from support import study_pages as shown
from support.studies import STUDY

# fixtures
clips, running, short = shown.clips, shown.running, shown.short
pytestmark = pytest.mark.slow

CAREFUL = participants.Habits(careless=0.0, leaves=0.0, silent=0.0)
NOTHING = (0.0, 0.0, 0.0, 0.0)
UNEVEN = {"race": (0.0, 0.0, 0.0, 0.9), "age": NOTHING}
TOML = """
format = 1
[study]
name = "small"
title = "A small study"
clips = "."
[consent]
version = "1"
text = "You watch a robot."
[[sets]]
id = "one"
clips = ["s2a.mp4"]
[[questions]]
id = "fair"
ask = "How even?"
type = "scale"
role = "fair"
low = "uneven"
high = "even"
"""


@pytest.fixture
def browser(require):
    """A Chromium that walking finds."""
    found = any(shutil.which(name) for name in ("chromium", "google-chrome"))
    require(found, "Chromium: the Debian package chromium")


def test_they_answer_in_the_pages_what_they_would_send(running, clips, browser):
    uneven = ClipSet("s1", ("s1a.mp4", "s1b.mp4"), scores=UNEVEN)
    even = ClipSet("s2", ("s2a.mp4",), scores=dict.fromkeys(UNEVEN, NOTHING))
    study = replace(STUDY, clips=clips, sets=(uneven, even))
    through = []
    for room in (in_browser, over_http):
        server = running(study, simulated=True)
        told = []
        where = over_http.Server(server.address)
        assert room.take(where, study, 1, 5, CAREFUL, told.append) == 1
        assert told == [1]
        rows = server.rows()
        assert {(row["simulated"], row["status"]) for row in rows} == {(True, "finished")}
        kept = ("page", "question", "value", "right", "views", "seconds")
        through.append([tuple(row[name] for name in kept) for row in rows])
    assert through[0] == through[1]
    fair = {page: int(value) for page, question, value, *_ in through[0] if question == "fair"}
    assert fair["set:s1"] < fair["set:s2"]


def test_who_leaves_has_sent_what_came_before(running, short, browser):
    server = running(short, simulated=True)
    leaves = replace(CAREFUL, leaves=1.0)
    assert in_browser.take(over_http.Server(server.address), short, 3, 2, leaves) == 0
    recruiting, *own = np.random.default_rng(2).spawn(4)
    crowd = participants.recruit(3, recruiting, leaves)
    visits = [
        participants.visit(short, orders.pages(short, 0), crowd, who, own[who]) for who in range(3)
    ]
    wanted = sorted(payload["page"] for visit in visits for payload in visit.payloads)
    assert wanted  # somebody answers a page before she leaves
    rows = server.rows()
    assert sorted(page for _, page in {(row["participant"], row["page"]) for row in rows}) == wanted
    assert {row["status"] for row in rows} == {"begun"}


def test_a_server_that_lets_none_in_says_so(running, short, browser):
    server = running(short)
    with pytest.raises(InputError, match="takes no simulated participants: start it with --allow"):
        in_browser.take(over_http.Server(server.address), short, 1, 0)
    other = replace(short, name="other")
    with pytest.raises(InputError, match="runs study 'tiny', not 'other'"):
        in_browser.take(over_http.Server(server.address), other, 1, 0)


def test_what_is_not_installed_is_named(monkeypatch, tmp_path):
    wrong = tmp_path / "chromium"
    wrong.write_text("#!/bin/sh\nexit 1\n")
    wrong.chmod(0o755)
    monkeypatch.setattr(in_browser.shutil, "which", lambda name: str(wrong))
    told = "need Chromium, and none can be started"
    with pytest.raises(InputError, match=told), in_browser.browser():
        pass
    monkeypatch.setitem(sys.modules, "playwright", None)
    with pytest.raises(InputError, match=r"pip install '\.\[pages\]'"), in_browser.browser():
        pass


def test_the_command(cli, running, clips, browser, tmp_path):
    assert cli("study", "simulate", "--pages", "--out", "a.csv").complaint == (
        "--pages needs a server: name it with --url"
    )
    file = tmp_path / "small.toml"
    file.write_text(TOML)
    server = running(protocol_file.read(file, clips), simulated=True)
    ended = cli("study", "simulate", "--pages", "--url", server.address, "--protocol", file,
                "--respondents", 2, "--seed", 1)  # fmt: skip
    assert ended.code == 0, ended.err
    assert ended.out == f"2 of 2 simulated participants finished at {server.address}\n"
    assert len(server.rows()) == 2
