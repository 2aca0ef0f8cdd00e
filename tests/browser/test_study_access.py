"""The participants' pages and the dashboard for everybody: axe, keys, small screens, zoom."""

from dataclasses import replace

import pytest
from playwright.sync_api import expect

from support import study_pages as shown
from support.chromium import AXE
from support.studies import ADMIN, STUDY
from support.study_pages import (
    DESKTOP,
    KINDS,
    PHONE,
    agree,
    answer,
    go_on,
    reaches,
    saved,
    title,
    watch,
)

# fixtures
chromium, clips, opened, running, short = (
    shown.chromium, shown.clips, shown.opened, shown.running, shown.short,
)  # fmt: skip
pytestmark = pytest.mark.slow

SMALL = {"viewport": {"width": 320, "height": 256}, "has_touch": True}
"""320 pixels wide, or 1280 at 400 %, which is the same to a page."""
OUTLINE = """() => getComputedStyle(
    document.activeElement.closest(".option") ?? document.activeElement).outlineStyle"""


def check(page) -> None:
    """Axe, with every rule that it has."""
    if not page.evaluate("() => 'axe' in window"):
        # through the debugger: the content policy lets no script in that is not the server's
        page.evaluate(AXE.read_text())
    found = page.evaluate("() => axe.run()")
    assert len(found["passes"]) > 10
    wrong = [(v["id"], [node["html"] for node in v["nodes"]]) for v in found["violations"]]
    assert wrong == [], page.url


@pytest.fixture
def axe(require):
    require(AXE.exists(), "axe-core: npm ci in frontend/")
    return check


@pytest.mark.parametrize(
    ("size", "scheme"), [(DESKTOP, "light"), (PHONE, "dark")], ids=["desktop-light", "phone-dark"]
)
def test_axe_finds_nothing_on_any_page(running, opened, clips, axe, size, scheme):
    server = running(replace(STUDY, clips=clips, contact="lead@example.org"))
    page = opened(server.address, color_scheme=scheme, **size)
    reaches(page, STUDY.title)
    axe(page)
    agree(page)
    reaches(page, "About you")
    kinds = set()
    while (heading := title(page)) != "Thank you":
        kind = KINDS[heading]
        axe(page)
        if kind in ("set", "check") and kind not in kinds:
            if kind == "set":
                watch(page)
                axe(page)
                page.check("#captions")
                page.uncheck("#captions")
            go_on(page)
            expect(page.locator(".summary")).to_be_focused()
            axe(page)
        kinds.add(kind)
        if kind == "end":
            page.click("text=Withdraw and delete my answers")
            axe(page)
            page.click("text=Keep my answers")
            page.context.set_offline(True)
            page.fill("textarea", "x" * 60)
            go_on(page)
            axe(page)
            page.fill("textarea", "Nothing.")
            go_on(page)
            reaches(page, "Saving your last answers")
            expect(page.locator("#saved")).to_contain_text("Waiting for the connection")
            axe(page)
            page.context.set_offline(False)
        else:
            answer(page, kind)
        expect(page.locator("main h1")).not_to_have_text(heading)
        if title(page) == "Saving your last answers":
            reaches(page, "Thank you")
    assert kinds == {"about", "set", "check", "pair", "end"}
    axe(page)
    other = opened(server.address, context=page.context)
    reaches(other, "Thank you")
    reaches(page, "The study is open in another window")
    axe(page)
    other.click("text=Withdraw and delete my answers")
    other.click("#withdraw-yes")
    reaches(other, "Your answers are deleted")
    axe(other)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_on_the_lead_s_pages(running, opened, short, axe, scheme):
    server = running(short, preview=True)
    page = opened(server.address, color_scheme=scheme)
    expect(page.locator("#preview")).to_be_visible()
    agree(page)
    reaches(page, "About you")
    axe(page)
    page.goto(server.address + "/lead")
    axe(page)
    page.fill("#token", "not the token of the lead")
    page.keyboard.press("Enter")
    expect(page.locator(".wrong")).to_be_visible()
    axe(page)
    page.fill("#token", ADMIN)
    page.keyboard.press("Enter")
    expect(page.locator("#preview table").first).to_be_visible()
    axe(page)


def test_axe_finds_nothing_where_no_script_runs_or_no_server_answers(running, opened, short, axe):
    server = running(short)
    page = opened(server.address, java_script_enabled=False)
    assert "needs JavaScript" in page.inner_text("main")
    page = opened(server.address)
    page.route("**/api/study", lambda route: route.abort())
    page.reload()
    reaches(page, "The study cannot be reached just now")
    axe(page)
    page.unroute("**/api/study")
    page.click("text=Try again")
    reaches(page, short.title)


def test_a_whole_study_by_keyboard_alone(running, opened, clips):
    server = running(replace(STUDY, clips=clips))
    page = opened(server.address)
    reaches(page, STUDY.title)

    def tab_to(selector: str) -> None:
        for _ in range(40):
            page.keyboard.press("Tab")
            if page.evaluate("selector => document.activeElement.matches(selector)", selector):
                outline = page.evaluate(OUTLINE)
                assert outline != "none"
                return
        pytest.fail(f"the tab key does not come to {selector}")

    tab_to("button.main")
    page.keyboard.press("Enter")
    reaches(page, "About you")
    while (heading := title(page)) != "Thank you":
        assert page.evaluate("() => document.activeElement.tagName") == "H1"
        for k in range(page.locator("video").count()):
            tab_to(".clip-play")
            page.keyboard.press("Space")
            expect(page.locator("figure").nth(k)).to_have_attribute("data-seen", "yes")
        asked = page.locator("form input, form textarea")
        names = list(dict.fromkeys(one.get_attribute("name") or "" for one in asked.all()))
        for name in names:
            tab_to(f"[name='{name}']" if name else "textarea")
            if name:
                page.keyboard.press("Space")
                if name != "q-whom":
                    page.keyboard.press("ArrowDown")
            else:
                page.keyboard.type("By keys.")
        tab_to("button[type=submit]")
        page.keyboard.press("Enter")
        expect(page.locator("main h1")).not_to_have_text(heading)
        if title(page) == "Saving your last answers":
            reaches(page, "Thank you")
    assert server.values()["set:s1", "fair"] == "2"
    assert server.values()["set:s1", "whom"] == "age"
    assert server.values()["end", "why"] == "By keys."


def test_small_screens_and_zoom_lose_nothing(running, opened, clips):
    server = running(replace(STUDY, clips=clips))
    page = opened(server.address, **SMALL)
    reaches(page, STUDY.title)
    seen = set()

    def fits() -> None:
        assert page.evaluate("() => document.documentElement.scrollWidth") == 320
        for one in page.locator("button:visible, .option:visible, a:visible").all():
            box = one.bounding_box()
            assert box is not None
            assert min(box["width"], box["height"]) >= 44, one.inner_text()

    fits()
    agree(page)
    reaches(page, "About you")
    while (heading := title(page)) != "Thank you":
        kind = KINDS[heading]
        if kind == "set" and kind not in seen:
            watch(page)
            go_on(page)
            expect(page.locator(".summary")).to_be_focused()
            fits()
        seen.add(kind)
        fits()
        answer(page, kind)
        expect(page.locator("main h1")).not_to_have_text(heading)
        if kind == "end":
            reaches(page, "Thank you")
    fits()
    saved(page)


def test_who_prefers_less_motion_gets_none(running, opened, short):
    page = opened(running(short).address, reduced_motion="reduce")
    reaches(page, short.title)
    moving = """() => [...document.querySelectorAll("*")].map((e) => getComputedStyle(e))
        .filter((s) => s.transitionDuration !== "0s" || s.animationName !== "none").length"""
    assert page.evaluate(moving) == 0
