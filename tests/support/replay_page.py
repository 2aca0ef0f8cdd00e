"""The replay page of ten services, opened in a real Chromium: fixtures and helpers."""

import io

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import sync_playwright

from evenhand.restaurant.replay import page as replay_page
from evenhand.restaurant.replay import write
from support import replayed
from support.chromium import CHROMIUM, QUIET

SOFTWARE_GL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
NO_GL = ["--disable-gpu", "--disable-webgl", "--disable-3d-apis"]
NUMBER = 10
PATIENCE = 180_000
"""Milliseconds: a machine may be busy, and nothing is judged by the clock."""


@pytest.fixture(scope="module")
def served():
    """Ten services, one or more of which run for the whole six seconds."""
    seen, rows = replayed.served(60)
    assert (rows.fact("steps")[:NUMBER] == 300).any()
    return seen[:NUMBER], rows.take(np.arange(NUMBER))


@pytest.fixture(scope="module")
def address(served, require, tmp_path_factory):
    """Where the page lies."""
    require(replay_page.SCRIPT.exists(), "the built replay page: python frontend/build.py")
    path = write(
        served[0], served[1], tmp_path_factory.mktemp("page") / "replay.html", title="Ten services"
    )
    return path.as_uri()


@pytest.fixture(scope="module")
def chromium(require):
    """``chromium(*flags)`` starts a browser."""
    require(CHROMIUM.exists(), "Chromium: the Debian package chromium")
    with sync_playwright() as playwright:
        started = []

        def start(*flags):
            browser = playwright.chromium.launch(
                executable_path=CHROMIUM, args=[*QUIET, *flags], timeout=PATIENCE
            )
            started.append(browser)
            return browser

        yield start
        for browser in started:
            browser.close()


@pytest.fixture(scope="module")
def browser(chromium):
    return chromium(*SOFTWARE_GL)


@pytest.fixture
def opened(address):
    """``opened(browser, ...)`` opens the page; what it said and asked for is checked in the end."""
    contexts, heard, asked = [], [], []

    def open_page(browser, *, at="", still=False, width=400, height=640, **options):
        context = browser.new_context(viewport={"width": width, "height": height}, **options)
        contexts.append(context)
        context.set_default_timeout(PATIENCE)
        page = context.new_page()
        page.on("console", lambda message: heard.append(message.text))
        page.on("pageerror", lambda error: heard.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        if still:
            page.clock.install(time=0)
        page.goto(address + at)
        if still:
            page.clock.pause_at(10_000)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert heard == []
    assert [url for url in asked if not url.startswith((address, "data:"))] == []


@pytest.fixture
def page(opened, browser):
    return opened(browser)


def value(page, selector="#scrub"):
    return int(page.input_value(selector))


def until(page, reached):
    """Wait, with the patience that everything here has."""
    for _ in range(PATIENCE // 50):
        if reached():
            return
        page.wait_for_timeout(50)
    pytest.fail("it never came to that")


def picture(page):
    """What is on the canvas after the next frames, as bytes [height, width, 3]."""
    page.evaluate("() => new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")
    shot = page.locator("#view").screenshot()
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"), float)


def apart(one, two):
    """Share of the pixels that differ."""
    return (np.abs(one - two).max(axis=-1) > 12).mean()


def clear(page):
    """Take away what lies over the picture."""
    page.add_style_tag(content=".badge { visibility: hidden }")


def row_of_six_seconds(served):
    return int(np.flatnonzero(served[1].fact("steps") == 300)[0])
