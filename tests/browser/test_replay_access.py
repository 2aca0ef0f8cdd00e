"""The replay page in a real Chromium: keys, phones, no WebGL, and what axe finds."""

import pytest

from support import replay_page as shown
from support.chromium import AXE
from support.replay_page import NO_GL, NUMBER, row_of_six_seconds, until, value

# fixtures
address, browser, chromium = shown.address, shown.browser, shown.chromium
opened, page, served = shown.opened, shown.page, shown.served
pytestmark = pytest.mark.slow


# --- keys ------------------------------------------------------------------------------------


def test_every_key(opened, browser, served):
    row = row_of_six_seconds(served)
    page = opened(browser, at=f"#service-{served[0].number[row]}", still=True)
    press = page.keyboard.press
    for key, there in (
        ("ArrowRight", 1), ("Shift+ArrowRight", 11), ("ArrowLeft", 10), ("End", 60), ("Home", 0),
    ):  # fmt: skip
        press(key)
        assert value(page) == there
    press("+")
    assert page.input_value("#speed") == "2"
    press("-")
    assert page.input_value("#speed") == "1"
    press("3")
    assert page.get_attribute("[data-camera=guest]", "aria-pressed") == "true"
    press("r")
    assert not page.is_checked("#rings")
    press("Space")
    assert page.get_attribute("#play", "aria-label") == "Pause"
    press("Space")
    assert page.get_attribute("#play", "aria-label") == "Play"
    title = page.inner_text("#player-title")
    press("?")
    assert page.is_visible("#help")
    page.uncheck("#keys-on")
    press("Escape")
    assert not page.is_visible("#help")
    press("p")
    assert page.inner_text("#player-title") == title


def test_tab_reaches_everything_shows_where_it_is_and_leaves_again(page):
    reached = []
    for _ in range(60):
        page.keyboard.press("Tab")
        at, outline = page.evaluate(
            "() => [document.activeElement.id || document.activeElement.textContent,"
            " getComputedStyle(document.activeElement).outlineStyle]"
        )
        if at in reached or page.evaluate("document.activeElement === document.body"):
            break
        assert outline != "none", at
        reached.append(at)
    assert {"play", "after", "scrub", "Room", "Free", "speed", "rings", "help-open"} <= {*reached}
    assert sum(text.startswith("Service") and "skin" in text for text in reached) == NUMBER


def test_space_on_the_list_chooses_and_then_plays(page):
    entry = page.locator("#services button").nth(3)
    entry.focus()
    page.keyboard.press("Space")
    assert entry.get_attribute("aria-current") == "true"
    assert page.get_attribute("#play", "aria-label") == "Play"
    page.keyboard.press("Space")
    until(page, lambda: value(page) > 0)


# --- for everybody ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options",
    [
        {"width": 1280, "height": 800},
        {"width": 1280, "height": 800, "color_scheme": "dark"},
        {"width": 375, "height": 812, "has_touch": True},
    ],
    ids=["wide", "dark", "phone"],
)
def test_axe_finds_nothing(opened, browser, require, options):
    require(AXE.exists(), "axe-core: npm ci in frontend/")
    page = opened(browser, **options)
    page.add_script_tag(path=AXE)
    run = "() => axe.run({runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa']})"
    for keys in ((), ("4", "End"), ("?",)):
        for key in keys:
            page.keyboard.press(key)
        found = page.evaluate(run)
        assert found["passes"]
        assert [(v["id"], v["nodes"][0]["html"]) for v in found["violations"]] == []


def test_a_phone_is_wide_enough_and_keeps_the_picture_in_sight(opened, browser):
    page = opened(browser, width=375, height=812, has_touch=True)
    assert page.evaluate("document.documentElement.scrollWidth") == 375
    page.locator("#plots .plot").nth(2).scroll_into_view_if_needed()
    box = page.locator("#view").bounding_box()
    assert -1 <= box["y"] < 400
    for button in page.locator("#player button:visible").all():
        size = button.bounding_box()
        assert min(size["width"], size["height"]) >= 24
    page.tap("#play")
    until(page, lambda: value(page) > 0)


def test_who_prefers_less_motion_gets_none_unasked(opened, browser):
    for preference, label in (("reduce", "Play"), ("no-preference", "Pause")):
        page = opened(browser, still=True, reduced_motion=preference)
        assert page.get_attribute("#play", "aria-label") == "Play"
        page.click("#play")
        page.keyboard.press("n")
        assert page.get_attribute("#play", "aria-label") == label


def test_without_webgl_it_says_so_and_everything_else_works(opened, chromium):
    page = opened(chromium(*NO_GL))
    assert "WebGL is switched off or missing" in page.inner_text("#no-webgl")
    assert not page.is_visible("#view")
    page.keyboard.press("End")
    assert page.inner_text("#outcome").startswith("Outcome: ")
    assert value(page) > 0
    page.get_by_label("Issue", exact=True).select_option("any")
    assert " match" in page.inner_text("#matches")
    for k in range(3):
        assert page.locator("#plots svg[role=img]").nth(k).is_visible()
