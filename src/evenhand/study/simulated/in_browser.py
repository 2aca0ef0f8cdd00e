"""Simulated participants who take a running study through its real pages, in a real browser.

jsPsych's simulation mode drives the pages: they watch the clips, fill in the forms and send what a
simulated participant (`study.simulated.participants`) answers, and say in every beginning that it
is simulated. Clips are played sixteen times as fast; how long a page was open is simulated, too.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from evenhand.core import extras
from evenhand.core.errors import InputError
from evenhand.study.design.protocol import Protocol
from evenhand.study.simulated.over_http import Server, meet
from evenhand.study.simulated.participants import Crowd, Habits, recruit, visit

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

AT_ONCE = 4
"""Participants whose pages are open at the same time."""
PATIENCE = 60.0
"""Seconds without a new page after which a participant is stuck."""
_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_FLAGS = (
    "--autoplay-policy=no-user-gesture-required",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)
_PHONE = {"width": 390, "height": 844}
_DESK = {"width": 1280, "height": 800}


@dataclass
class _Walk:
    """One participant under way."""

    who: int
    page: Page
    stays: bool = True
    told: str = ""
    finished: bool = False


def take(
    server: Server,
    study: Protocol,
    n: int,
    seed: int,
    habits: Habits | None = None,
    tell: Callable[[int], None] = lambda done: None,
) -> int:
    """Let simulated participants take a running study through its pages.

    Every other one has a screen as small as a phone's.

    Args:
        server: where it runs; it has to let simulated participants in.
        study: the same study; its scores and right answers are not told by the server.
        n: participants.
        seed: of everything random but the order in which they arrive.
        habits: how they take it; the default settings when None.
        tell: is told how many have left.

    Returns:
        How many finished.

    Raises:
        InputError: when playwright or Chromium is not installed, the server has another study or
            refuses, or a page does not go on.
    """
    meet(server, study)
    recruiting, *own = np.random.default_rng(seed).spawn(n + 1)
    crowd = recruit(n, recruiting, habits)
    finished = 0
    with browser() as chromium:
        for first in range(0, n, AT_ONCE):
            together = range(first, min(first + AT_ONCE, n))
            walks = [_begin(chromium, server, study, crowd, who, own[who]) for who in together]
            for walk in walks:
                _end(walk, server)
                finished += walk.finished
                tell(1)
    return finished


@contextmanager
def browser() -> Iterator[Browser]:
    """A Chromium without a window: the machine's own, else playwright's."""
    extras.require("pages", "a simulated participant in the real pages")
    from playwright.sync_api import Error, sync_playwright

    own = next((found for name in _NAMES if (found := shutil.which(name))), None)
    # Chromium refuses to be root in a sandbox
    flags = [*_FLAGS, *(["--no-sandbox"] if os.geteuid() == 0 else [])]
    with sync_playwright() as driver:
        try:
            started = driver.chromium.launch(executable_path=own, args=flags)
        except Error as error:
            first = str(error).strip().splitlines()[0]
            raise InputError(
                "unavailable chromium",
                f"the real pages need Chromium, and none can be started ({first}): install the "
                "package chromium of your system, or run `playwright install chromium`",
            ) from error
        try:
            yield started
        finally:
            started.close()


def _begin(
    chromium: Browser,
    server: Server,
    study: Protocol,
    crowd: Crowd,
    who: int,
    rng: np.random.Generator,
) -> _Walk:
    context = chromium.new_context(viewport=_PHONE if who % 2 else _DESK)  # type: ignore
    walk = _Walk(who, context.new_page())

    def answers(pages: list[dict[str, Any]]) -> dict[str, Any]:
        made = visit(study, pages, crowd, who, rng)
        walk.stays = made.finished
        return {
            payload["page"]: {"values": payload["values"], "shown_ms": payload["shown_ms"]}
            for payload in made.payloads
        }

    walk.page.expose_function("evenhandSimulated", answers)
    walk.page.goto(server.url + "/", wait_until="commit")
    return walk


def _end(walk: _Walk, server: Server) -> None:
    """Wait until the participant has finished or left.

    Raises:
        InputError: when the page says that it cannot go on, or stands still.
    """
    from playwright.sync_api import Error

    over = "html[data-simulated=finished], html[data-simulated=left], html[data-stopped]"
    heading, told = "main h1", ""
    try:
        while True:
            try:
                walk.page.wait_for_selector(over, state="attached", timeout=PATIENCE * 1000)
                break
            except Error:
                before, told = told, walk.page.text_content(heading, timeout=1000) or ""
                if told == before:
                    raise
        marks = walk.page.evaluate("() => ({...document.documentElement.dataset})")
    except Error as error:
        raise InputError(
            "unavailable url",
            f"simulated participant {walk.who + 1} is stuck at {server.url} on the page "
            f"{told or 'that should have opened'!r}: {str(error).splitlines()[0]}",
        ) from error
    if "stopped" in marks:
        raise InputError("unavailable url", f"{server.url} refused: {marks['stopped']}")
    walk.finished = marks["simulated"] == "finished"
    walk.page.context.close()
