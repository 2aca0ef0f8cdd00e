"""The participants' pages when things go wrong: reloads, stops, lost connections, two windows."""

from dataclasses import replace

import pytest
from playwright.sync_api import expect

from evenhand.study.server.web.limits import Limits, Rate
from support import study_pages as shown
from support.studies import STUDY
from support.study_pages import (
    agree,
    answer,
    answer_all,
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

TOKEN = "() => JSON.parse(localStorage.getItem('evenhand/tiny/notes/')).token"
PUT = """async ([token, page, values]) => (await fetch("/api/pages/" + page, {
    method: "PUT",
    headers: { authorization: "Bearer " + token, "content-type": "application/json" },
    body: JSON.stringify({ key: crypto.randomUUID(), sequence: 0, values, shown_ms: 1 }),
})).status"""


def at_the_robot(page) -> None:
    agree(page)
    reaches(page, "About you")
    go_on(page)
    reaches(page, "Robot 1 of 1")


# --- the browser ---


def test_a_reload_goes_on_with_what_was_typed_and_seen(running, opened, short):
    server = running(short)
    page = opened(server.address)
    at_the_robot(page)
    watch(page)
    page.check("#q-fair-2")
    page.check("label:has-text('Race') input")
    page.wait_for_timeout(300)
    page.reload()
    reaches(page, "Robot 1 of 1")
    expect(page.locator("main form")).to_be_visible()
    assert page.is_checked("#q-fair-2")
    assert page.is_checked("label:has-text('Race') input")
    page.check("#q-issue-1")
    go_on(page)
    reaches(page, "Last questions")
    page.fill("textarea", "half a sen")
    # as after a crash: nothing had the time to be tidied up
    page.context.new_page().goto("about:blank")
    page.close()
    page = opened(server.address, context=page.context)
    reaches(page, "Last questions")
    assert page.input_value("textarea") == "half a sen"
    go_on(page)
    reaches(page, "Thank you")
    values = server.values()
    assert (values["set:s2", "fair"], values["set:s2", "whom"]) == ("3", "race")
    rows = [row for row in server.rows() if row["page"] == "set:s2"]
    assert {row["views"] for row in rows} == {1}
    assert all(row["seconds"] > 1 for row in rows)  # the time before the reload counts


def test_a_browser_that_keeps_nothing_is_told_so(running, opened, short, chromium):
    context = chromium.new_context()
    context.add_init_script(
        "Object.defineProperty(window, 'localStorage', {get() { throw new DOMException(); }})"
    )
    server = running(short)
    page = opened(server.address, context=context)
    expect(page.locator("#forgetful")).to_be_visible()
    agree(page)
    answer_all(page)
    assert len(server.rows()) == 5
    context.close()


def test_a_full_storage_loses_nothing_that_is_sent(running, opened, short):
    server = running(short)
    page = opened(server.address)
    agree(page)
    reaches(page, "About you")
    page.evaluate("() => { Storage.prototype.setItem = () => { throw new DOMException(); } }")
    assert answer_all(page) == ["About you", "Robot 1 of 1", "Last questions"]
    assert len(server.rows()) == 5


def test_clocks_that_jump_cost_nothing(running, opened, short):
    server = running(short)
    page = opened("about:blank")
    page.add_init_script("Date.now = () => -8e15; Date.prototype.getTime = () => NaN;")
    page.goto(server.address)
    agree(page)
    answer_all(page)
    assert all(0 < row["seconds"] < 60 for row in server.rows())


# --- the server and the connection ---


def test_the_server_stops_in_the_middle_and_comes_back(running, opened, clips):
    study = replace(STUDY, clips=clips, order="fixed")
    server = running(study)
    page = opened(server.address)
    agree(page)
    answer(page, "about")
    reaches(page, "Robot 1 of 2")
    watch(page)
    server.stop()
    page.check("#q-fair-1")
    page.check("#q-issue-0")
    go_on(page)
    # on it goes, with the answers in the browser
    reaches(page, "A short question")
    expect(page.locator("#saved")).to_contain_text("Waiting for the connection: 1 page waits")
    answer(page, "check")
    reaches(page, "Robot 2 of 2")
    expect(page.locator("#saved")).to_contain_text("2 pages wait")
    server.start()
    page.click("text=Try now")
    saved(page)
    assert list(server.values()) == [
        ("about", "years"), ("set:s1", "fair"), ("set:s1", "issue"), ("set:s1", "whom"),
        ("check:look", "look"),
    ]  # fmt: skip
    page.reload()
    reaches(page, "Robot 2 of 2")
    answer_all(page)
    assert len(server.rows()) == 10


def test_a_lost_connection_and_a_lost_acknowledgement_store_nothing_twice(running, opened, short):
    server = running(short)
    page = opened(server.address)
    lost = []

    def swallow(route):
        """The server stores it, and the browser never hears of it."""
        if not lost:
            route.fetch()
        lost.append(route.request.url)
        route.abort() if len(lost) < 3 else route.continue_()

    for part in ("begin", "pages/**", "finish"):
        page.route(f"**/api/{part}", swallow)
        if part == "begin":
            agree(page)
            reaches(page, "About you")
        elif part == "pages/**":
            go_on(page)
        else:
            answer(page, "set")
            reaches(page, "Last questions")
            go_on(page)
        for _ in range(400):
            if len(lost) >= 3:
                break
            page.wait_for_timeout(50)
        assert len(lost) >= 3, part
        saved(page)
        lost.clear()
        page.unroute(f"**/api/{part}")
    reaches(page, "Thank you")
    assert len(server.rows()) == 5
    with server.store.read() as connection:
        count = connection.exec_driver_sql("SELECT count(*) FROM study_participants").scalar()
    assert count == 1


def test_offline_answers_survive_a_crash(running, opened, short):
    server = running(short)
    page = opened(server.address)
    at_the_robot(page)
    watch(page)
    page.context.set_offline(True)
    page.check("#q-fair-1")
    page.check("#q-issue-0")
    go_on(page)
    reaches(page, "Last questions")
    page.close()
    page.context.set_offline(False)
    page = opened(server.address, context=page.context)
    reaches(page, "Last questions")
    saved(page)
    assert server.values()["set:s2", "fair"] == "2"


def test_a_busy_server_is_waited_for(running, opened, short):
    limits = replace(Limits(), token=Rate(3, 1.0))
    server = running(short, limits=limits)
    page = opened(server.address)
    agree(page)
    busy = []
    page.on("response", lambda told: busy.append(told.status) if told.status == 429 else None)
    assert answer_all(page) == ["About you", "Robot 1 of 1", "Last questions"]
    page.click("text=Download my answers")
    page.click("text=Download my answers")
    page.click("text=Download my answers")
    page.click("text=Download my answers")
    expect(page.locator("#rights-told")).to_contain_text("try again soon")
    assert 429 in busy


# --- two windows, and a server that says no ---


def test_two_windows_follow_each_other(running, opened, short):
    server = running(short)
    first = opened(server.address)
    agree(first)
    reaches(first, "About you")
    second = opened(server.address, context=first.context)
    reaches(second, "About you")
    reaches(first, "The study is open in another window")
    second.check("#q-years-1")
    go_on(second)
    reaches(second, "Robot 1 of 1")
    saved(second)
    first.click("main button")
    reaches(first, "Robot 1 of 1")
    reaches(second, "The study is open in another window")
    assert server.values() == {("about", "years"): "40 or more"}


def test_an_answer_that_was_given_elsewhere_counts(running, opened, short):
    server = running(short)
    page = opened(server.address)
    agree(page)
    reaches(page, "About you")
    token = page.evaluate(TOKEN)
    assert page.evaluate(PUT, [token, "about", {"years": "40 or more"}]) == 200
    page.check("#q-years-0")
    go_on(page)
    expect(page.locator(".notice", has_text="had been answered before")).to_be_visible()
    assert title(page) == "Robot 1 of 1"
    # the page is two behind: it is sent on to where the study is
    fair = {"fair": 1, "issue": "none"}
    assert page.evaluate(PUT, [token, "set:s2", fair]) == 200
    answer(page, "set")
    reaches(page, "Last questions")
    saved(page)
    assert server.values()["set:s2", "fair"] == "1"


def test_a_page_that_does_not_fit_comes_back_with_everything_in_it(running, opened, short):
    server = running(short)
    page = opened(server.address)
    at_the_robot(page)

    def spoil(route):
        body = route.request.post_data_json
        body["values"]["fair"] = 9
        route.continue_(post_data=body)

    page.route("**/api/pages/set*", spoil)
    answer(page, "set")
    expect(page.locator(".summary")).to_contain_text("question 'fair' needs a whole number")
    expect(page.locator(".summary")).to_be_focused()
    assert title(page) == "Robot 1 of 1"
    assert page.is_checked("#q-fair-1")
    expect(page.locator("main form")).to_be_visible()
    page.unroute("**/api/pages/set*")
    go_on(page)
    saved(page)
    assert server.values()["set:s2", "fair"] == "2"


@pytest.mark.parametrize(
    ("status", "code", "heading"),
    [(413, "too-large", None), (404, "unknown-page", "The study cannot go on just now"),
     (409, "closed", "The study is closed"), (410, "withdrawn", "Your answers are deleted"),
     (401, "unknown-token", "Your place is not known any more")],
)  # fmt: skip
def test_every_refusal_in_plain_words(running, opened, short, status, code, heading):
    server = running(short)
    page = opened(server.address)
    agree(page)
    reaches(page, "About you")
    page.check("#q-years-0")
    told = {"error": "A sentence of the server.", "code": code}
    page.route("**/api/pages/*", lambda route: route.fulfill(status=status, json=told))
    go_on(page)
    if heading is None:
        expect(page.locator(".summary")).to_contain_text("A sentence of the server.")
        assert page.is_checked("#q-years-0")
        return
    reaches(page, heading)
    page.unroute("**/api/pages/*")
    if code == "withdrawn":
        return
    page.locator("main button").click()
    if code == "unknown-token":
        reaches(page, short.title)
        return
    # nothing was lost: what was not saved is sent now
    reaches(page, "Robot 1 of 1")
    saved(page)
    assert server.values() == {("about", "years"): "18-39"}


def test_a_study_that_is_closed_and_opened_again(running, opened, short):
    server = running(short)
    page = opened(server.address)
    agree(page)
    reaches(page, "About you")
    server.store.close_study(True)
    go_on(page)
    reaches(page, "The study is closed")
    assert page.is_visible("text=Download my answers")
    late = opened(server.address)
    agree(late)
    reaches(late, "The study is closed")
    server.store.close_study(False)
    page.click("text=Try again")
    reaches(page, "Robot 1 of 1")
    saved(page)
