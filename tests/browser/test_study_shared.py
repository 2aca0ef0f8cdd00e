"""One computer for many: people take part one after another in the same browser."""

from dataclasses import replace

import pytest
from playwright.sync_api import expect

from support import study_pages as shown
from support.study_pages import PHONE, agree, answer_all, go_on, reaches, saved

# fixtures
chromium, clips, opened, running, short = (
    shown.chromium, shown.clips, shown.opened, shown.running, shown.short,
)  # fmt: skip
pytestmark = pytest.mark.slow

NEXT = "The next person begins"
ELSE = "Somebody else takes part now"
MEMORY = "() => Object.keys(localStorage).filter((key) => key.includes('notes'))"


@pytest.fixture
def shared(running, short):
    return running(replace(short, redirect="", shared_computer=True))


def statuses(server) -> list[str]:
    """Of the participants who answered anything."""
    return sorted({row["participant"]: row["status"] for row in server.rows()}.values())


def test_one_finishes_and_the_next_begins(shared, opened, short):
    page = opened(shared.address)
    reaches(page, short.title)
    assert "If you do not agree, leave this page as it is." in page.inner_text("main")
    assert not page.is_visible("#next")
    agree(page)
    answer_all(page)
    assert "close this page" not in page.inner_text("main")
    assert not page.is_visible("#next")
    assert page.is_visible("text=Withdraw and delete my answers")
    page.get_by_role("button", name=NEXT).click()
    reaches(page, short.title)
    assert page.evaluate(MEMORY) == []
    assert not page.is_visible("#rights")
    agree(page)
    answer_all(page)
    assert statuses(shared) == ["finished", "finished"]


@pytest.mark.parametrize("size", [{}, PHONE], ids=["desktop", "phone"])
def test_one_leaves_half_way_and_the_next_begins(shared, opened, short, size):
    page = opened(shared.address, **size)
    agree(page)
    reaches(page, "About you")
    go_on(page)
    reaches(page, "Robot 1 of 1")
    saved(page)
    page.click(f"text={ELSE}")
    expect(page.locator("#leaving-not")).to_be_focused()
    page.keyboard.press("Escape")
    expect(page.locator("#leaving")).to_be_hidden()
    page.click(f"text={ELSE}")
    page.click("text=No, go on")
    page.reload()
    reaches(page, "Robot 1 of 1")
    page.click(f"text={ELSE}")
    page.click("text=Yes, begin anew")
    reaches(page, short.title)
    assert page.evaluate(MEMORY) == []
    agree(page)
    answer_all(page)
    assert statuses(shared) == ["begun", "finished"]


def test_nobody_is_forgotten_before_everything_is_saved(shared, opened, short):
    page = opened(shared.address)
    agree(page)
    reaches(page, "About you")
    page.check("text=18-39")
    page.context.set_offline(True)
    go_on(page)
    reaches(page, "Robot 1 of 1")
    page.click(f"text={ELSE}")
    page.click("text=Yes, begin anew")
    assert "Not everything is saved yet" in page.inner_text("#leaving-problem")
    page.click("text=No, go on")
    page.context.set_offline(False)
    saved(page)
    page.click(f"text={ELSE}")
    assert page.inner_text("#leaving-problem") == ""
    page.click("text=Yes, begin anew")
    reaches(page, short.title)
    assert shared.values() == {("about", "years"): "18-39"}


def test_one_withdraws_and_the_next_begins(shared, opened, short):
    page = opened(shared.address)
    agree(page)
    reaches(page, "About you")
    page.click("text=Withdraw and delete my answers")
    page.click("#withdraw-yes")
    reaches(page, "Your answers are deleted")
    assert "close this page" not in page.inner_text("main")
    assert not page.is_visible("#next")
    page.get_by_role("button", name=NEXT).click()
    reaches(page, short.title)
    agree(page)
    answer_all(page)
    assert statuses(shared) == ["finished"]


def test_elsewhere_nobody_is_asked_for(running, opened, short):
    page = opened(running(replace(short, redirect="")).address)
    agree(page)
    reaches(page, "About you")
    assert not page.is_visible("#next")
    answer_all(page)
    assert page.get_by_role("button", name=NEXT).count() == 0
    assert "You can close this page." in page.inner_text("main")
