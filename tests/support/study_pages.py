"""The participants' pages in a real Chromium: servers that start and stop, clips, and helpers."""

import contextlib
import subprocess
import threading
from dataclasses import replace
from pathlib import Path

import pytest
import uvicorn
from playwright.sync_api import expect, sync_playwright

from evenhand.study.design.protocol import ClipSet, Protocol
from evenhand.study.server import participants, rows
from evenhand.study.server.open_store import open_store
from evenhand.study.server.web import app, serve
from evenhand.study.server.web.desk import STATIC, Settings
from support.chromium import CHROMIUM, QUIET
from support.postgres import free_port
from support.studies import ADMIN, STUDY

PATIENCE = 20_000
"""Milliseconds: a machine may be busy, and nothing is judged by the clock."""
PHONE = {"viewport": {"width": 375, "height": 667}, "has_touch": True, "is_mobile": True}
DESKTOP = {"viewport": {"width": 1280, "height": 800}}
expect.set_options(timeout=PATIENCE)


class Running:
    """A study that is served from a thread, and can be stopped and started again."""

    def __init__(self, study: Protocol, db: str, **settings) -> None:
        self.study, self.db, self.settings = study, db, settings
        self.port = free_port()
        self.address = f"http://127.0.0.1:{self.port}"

    def start(self) -> "Running":
        self.store = open_store(self.db, self.study)
        made = app.build(
            self.study, self.store, Settings(participants.hashed(ADMIN), **self.settings)
        )
        config = uvicorn.Config(
            made, access_log=False, log_config=None, ws="none", lifespan="off",
            timeout_graceful_shutdown=1,
        )  # fmt: skip
        self._server = uvicorn.Server(config)
        listening = serve.listen("127.0.0.1", self.port)
        self._thread = threading.Thread(target=self._server.run, args=([listening],), daemon=True)
        self._listening = listening
        self._thread.start()
        return self

    def stop(self) -> None:
        self._server.should_exit = True
        self._thread.join()
        self._listening.close()
        self.store.dispose()

    def rows(self, **more) -> list[dict]:
        """What is stored, by question of a page; each is stored once."""
        found = list(rows.read(self.store, previews=True, **more))
        names = [(row["participant"], row["page"], row["question"]) for row in found]
        assert len(names) == len(set(names))
        return found

    def values(self) -> dict[tuple[str, str], str | None]:
        """Page and question -> value, of a study that one participant takes."""
        found = self.rows()
        assert len({row["participant"] for row in found}) <= 1
        return {(row["page"], row["question"]): row["value"] for row in found}


@pytest.fixture(scope="session")
def clips(tmp_path_factory) -> Path:
    """A folder with the clips of the small study, a second each."""
    import imageio_ffmpeg

    folder = tmp_path_factory.mktemp("clips")
    for name in STUDY.clip_names:
        subprocess.run(
            [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-f", "lavfi", "-i",
             "testsrc=duration=1:size=160x120:rate=10", "-pix_fmt", "yuv420p", folder / name],
            check=True, stdin=subprocess.DEVNULL,
        )  # fmt: skip
    return folder


@pytest.fixture(scope="session")
def short(clips) -> Protocol:
    """A study of one clip, for what is not about clips."""
    return replace(STUDY, clips=clips, sets=(ClipSet("s2", ("s2a.mp4",)),), pairs=(), checks=(),
                   questions=tuple(q for q in STUDY.questions if q.about != "pair"))  # fmt: skip


@pytest.fixture
def running(require, tmp_path):
    """``running(study)`` serves it, from a new database."""
    require((STATIC / "study.js").exists(), "the built pages: python frontend/build.py")
    started = []

    def start(study, **settings):
        made = Running(study, str(tmp_path / f"{len(started)}.db"), **settings).start()
        started.append(made)
        return made

    yield start
    for one in started:
        with contextlib.suppress(AttributeError):
            one.stop()


@pytest.fixture(scope="module")
def chromium(require):
    require(CHROMIUM.exists(), "Chromium: the Debian package chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=[*QUIET, "--disable-gpu"], timeout=PATIENCE
        )
        yield browser
        browser.close()


@pytest.fixture
def opened(chromium):
    """``opened(address, ...)`` opens a page in a browser of its own.

    In the end nobody may have broken the content policy or written to the console, but for requests
    that were meant to fail.
    """
    contexts, heard = [], []

    def open_page(address, *, context=None, **options):
        if context is None:
            context = chromium.new_context(**{**DESKTOP, **options})
            context.set_default_timeout(PATIENCE)
            contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: heard.append(message.text))
        page.on("pageerror", lambda error: heard.append(str(error)))
        page.goto(address)
        return page

    yield open_page
    for context in contexts:
        context.close()
    wrong = [one for one in heard if not one.startswith("Failed to load resource")]
    assert wrong == [], wrong


def title(page) -> str:
    return page.inner_text("main h1")


def reaches(page, heading: str) -> None:
    """Wait until a page with this heading is shown."""
    expect(page.locator("main h1")).to_have_text(heading)


def saved(page) -> None:
    """Wait until nothing waits to be saved."""
    # the words stay as they are while a page is saved quickly
    expect(page.locator("#saved")).to_have_attribute("data-saved", "saved")
    expect(page.locator("#saved")).to_contain_text("Everything so far is saved")


def agree(page) -> None:
    page.click("text=I agree: begin")


def go_on(page) -> None:
    page.click("text=Save and go on")


def watch(page) -> None:
    """Play every clip of the page to its end, one after another."""
    for k in range(page.locator("video").count()):
        figure = page.locator("figure").nth(k)
        figure.locator("button").click()
        expect(figure).to_have_attribute("data-seen", "yes")


def answer(page, kind: str) -> None:
    """Answer the page that is shown as ``support.studies.ANSWERS`` does."""
    if kind == "about":
        page.check("label:has-text('18-39') input")
    elif kind == "set":
        watch(page)
        page.check("#q-fair-1")
        page.check("label:has-text('Too close') input")
        page.check("label:has-text('Age') input")
        page.check("label:has-text('Race') input")
    elif kind == "check":
        page.check("label:has-text('blue') input")
    elif kind == "pair":
        watch(page)
        page.check("label:has-text('Second') input")
    else:
        page.fill("textarea", "Nothing.")
    go_on(page)


KINDS = {"About you": "about", "Robot 1 of 1": "set", "Robot 1 of 2": "set",
         "Robot 2 of 2": "set", "A short question": "check", "Compare two robots": "pair",
         "Last questions": "end"}  # fmt: skip


def answer_all(page, until: str = "Thank you") -> list[str]:
    """Answer page after page until one has this heading; returns the headings before it."""
    expect(page.locator("text=I agree: begin")).to_have_count(0)
    expect(page.locator("text=Beginning\u2026")).to_have_count(0)
    seen = []
    while (heading := title(page)) != until:
        if heading != "Saving your last answers":
            seen.append(heading)
            answer(page, KINDS[heading])
        expect(page.locator("main h1")).not_to_have_text(heading)
    return seen
