"""The participants' pages in a real Chromium: a whole study, clips, questions, rights."""

import json
import re
from dataclasses import replace

import pytest
from playwright.sync_api import expect

from evenhand.study.design.protocol import ClipSet, Demographic, Option
from evenhand.study.server import progress
from support import study_pages as shown
from support.studies import STUDY
from support.study_pages import (
    DESKTOP,
    PHONE,
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

IDS = "PROLIFIC_PID=5f0&STUDY_ID=77a&SESSION_ID=s1"


# --- a whole study ---


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_a_whole_study(running, opened, clips, size):
    server = running(replace(STUDY, clips=clips, redirect=""))
    page = opened(server.address, **size)
    reaches(page, "A tiny study")
    assert "You watch robots and say what you think." in page.inner_text("main")
    assert "Page 1 of 7" in page.inner_text("header")
    assert not page.is_visible("#rights")
    agree(page)
    reaches(page, "About you")
    assert "Page 2 of 7" in page.inner_text("header")
    seen = answer_all(page)
    assert seen[0] == "About you"
    assert seen[-2:] == ["Compare two robots", "Last questions"]
    assert sorted(seen[1:4]) == ["A short question", "Robot 1 of 2", "Robot 2 of 2"]
    assert page.inner_text("#code") == "C0DE"
    assert page.locator("#back").count() == 0
    values = server.values()
    assert values == {
        ("about", "years"): "18-39",
        **{(f"set:{name}", question): value for name in ("s1", "s2")
           for question, value in (("fair", "2"), ("issue", "risk"), ("whom", "age|race"))},
        ("check:look", "look"): "blue",
        ("pair:p1", "which"): "second",
        ("end", "why"): "Nothing.",
    }  # fmt: skip
    rows = server.rows()
    assert {row["status"] for row in rows} == {"finished"}
    assert {row["views"] for row in rows if row["kind"] in ("set", "pair")} == {1}
    # two clips of a second each have been seen to their end
    assert all(row["seconds"] > 1.5 for row in rows if row["page"] == "set:s1")
    page.reload()
    reaches(page, "Thank you")


def test_html_in_the_texts_of_a_study_is_text(running, opened, clips):
    bad = "<img src=x onerror='document.title=1'><b>bold</b> & \"so\""
    study = replace(
        STUDY, clips=clips, title=bad, consent=bad, thanks=bad, contact=bad, redirect="",
        completion_code="<i>", sets=(ClipSet("s2", ("s2a.mp4",), (bad,)),), pairs=(), checks=(),
        demographics=(Demographic("years", bad, (bad, "other")),),
        questions=tuple(
            replace(q, ask=bad, low=bad, options=tuple(Option(o.value, bad) for o in q.options))
            for q in STUDY.questions if q.about != "pair"
        ),
    )  # fmt: skip
    page = opened(running(study).address)
    headings = []
    expect(page.locator("main h1")).to_have_text(bad)
    assert bad in page.inner_text("main .prose")
    agree(page)
    for heading in ("About you", "Robot 1 of 1", "Last questions"):
        reaches(page, heading)
        headings.append(page.title())
        if heading == "Robot 1 of 1":
            watch(page)
            page.check("#captions")
            assert bad in page.inner_text("figcaption")
            cue = "() => document.querySelector('video').textTracks[0].cues[0].getCueAsHTML()"
            assert page.evaluate(f"{cue}.textContent") == bad
            go_on(page)
            assert bad in page.inner_text(".summary")
            page.check("#q-fair-0")
            page.check("#q-issue-0")
        assert bad in page.inner_text("form")
        go_on(page)
    reaches(page, "Thank you")
    assert bad in page.inner_text("main")
    assert page.inner_text("#code") == "<i>"
    assert page.locator("main img, main b, footer img").count() == 0
    assert all(one.endswith(bad) for one in headings)


def test_the_first_page_is_small(running, opened, short):
    """Everything before the first clip; half of what a slow connection should have to carry."""
    server = running(short)
    page = opened("about:blank")
    told = []
    page.on("response", lambda one: told.append(one))
    page.goto(server.address)
    reaches(page, short.title)
    page.wait_for_load_state("networkidle")
    sizes = [len(one.body()) for one in told if one.ok]
    assert len(sizes) == 4  # page, style, script, study
    assert sum(sizes) < 150_000


# --- clips ---


def test_a_clip_cannot_be_skipped_and_can_be_seen_again(running, opened, clips):
    server = running(replace(STUDY, clips=clips, demographics=(), order="fixed"))
    for way in (
        "video.currentTime = video.duration - 0.05",
        "video.playbackRate = 16",
        "video.currentTime = video.duration; video.play()",
    ):
        page = opened(server.address)
        agree(page)
        reaches(page, "Robot 1 of 2")
        page.wait_for_function("() => document.querySelector('video').readyState >= 2")
        went_on = page.evaluate(
            f"""async () => {{
                const video = document.querySelector("video");
                const began = performance.now();
                video.closest("figure").querySelector("button").click();
                await new Promise((done) => setTimeout(done, 100));
                {way};
                await new Promise((done) => video.addEventListener("ended", done));
                const seen = video.closest("figure").dataset.seen;
                return [seen, performance.now() - began, video.playbackRate];
            }}"""
        )
        # either it did not count, or it was played for as long as it lasts in the end
        seen, lasted, rate = went_on
        assert seen == "no" or lasted > 800, way
        assert rate == 1
        page.context.close()
    page = opened(server.address)
    agree(page)
    reaches(page, "Robot 1 of 2")
    first, second = page.locator("figure").all()
    form = page.locator("main form")
    assert second.locator("button").is_disabled()
    assert form.is_hidden()
    # keys that skip or speed up in players: none does anything here
    first.locator("button").focus()
    page.keyboard.press("Enter")
    for key in ("ArrowRight", "End", ">", "l", "PageDown"):
        page.keyboard.press(key)
    assert form.is_hidden()
    expect(first).to_have_attribute("data-seen", "yes")
    assert form.is_hidden()
    second.locator("button").click()
    expect(form).to_be_visible()
    expect(first.locator("button")).to_have_text("Watch again")
    first.locator("button").click()
    expect(first.locator("button")).to_have_text("Pause")
    page.wait_for_function("() => document.querySelector('video').ended")
    page.check("#q-fair-0")
    page.check("#q-issue-0")
    go_on(page)
    reaches(page, "A short question")
    saved(page)
    kept = server.store
    with kept.read() as connection:
        views = connection.exec_driver_sql("SELECT clip_views FROM study_pages").scalar()
    assert json.loads(views) == {"s1a.mp4": 2, "s1b.mp4": 1}


def test_a_clip_that_does_not_load_says_so_and_is_tried_again(running, opened, short):
    server = running(replace(short, demographics=()))
    page = opened("about:blank")
    page.route("**/clips/*", lambda route: route.abort())
    page.goto(server.address)
    agree(page)
    reaches(page, "Robot 1 of 1")
    expect(page.locator(".clip-state")).to_contain_text("cannot be loaded just now")
    page.unroute("**/clips/*")
    page.click("text=Try again")
    expect(page.locator("main form")).to_be_visible()


# --- questions ---


def test_required_questions_are_explained_and_nothing_is_sent(running, opened, short):
    server = running(replace(short, demographics=()))
    page = opened(server.address)
    agree(page)
    reaches(page, "Robot 1 of 1")
    watch(page)
    go_on(page)
    summary = page.locator(".summary")
    expect(summary).to_be_focused()
    assert summary.locator("a").all_inner_texts() == [
        "Choose an answer: How even?", "Choose an answer: Which is worst?",
    ]  # fmt: skip
    summary.locator("a").nth(1).click()
    expect(page.locator("#q-issue-0")).to_be_focused()
    fieldset = page.locator("#q-issue")
    described = fieldset.get_attribute("aria-describedby")
    assert page.inner_text(f"#{described}") == "Error: Choose an answer."
    page.check("#q-issue-0")
    assert fieldset.get_attribute("aria-describedby") is None
    assert server.rows() == []
    page.check("#q-fair-4")
    go_on(page)
    reaches(page, "Last questions")
    expect(page.locator("main h1")).to_be_focused()
    page.fill("textarea", "\U0001f600" * 45)
    assert "5 characters left, of 50." in page.inner_text("main")
    page.fill("textarea", "x" * 51)
    go_on(page)
    assert "Write 1 characters less" in page.inner_text(".summary")
    page.fill("textarea", "\U0001f600" * 50)
    go_on(page)
    reaches(page, "Thank you")
    assert server.values()["end", "why"] == "\U0001f600" * 50
    assert server.values()["set:s2", "fair"] == "5"


# --- the recruiting platform ---


def test_the_platform_s_ids_are_sent_and_leave_the_address(running, opened, short, chromium):
    server = running(short)
    page = opened(f"{server.address}/?{IDS}&other=1")
    reaches(page, short.title)
    assert page.url == f"{server.address}/?other=1"
    page.reload()
    agree(page)
    reaches(page, "About you")
    with server.store.read() as connection:
        ids = connection.exec_driver_sql(
            "SELECT prolific_pid, study_id, session_id FROM study_external"
        ).all()
    assert [tuple(row) for row in ids] == [("5f0", "77a", "s1")]
    # somebody else in the same browser begins anew, and the first one can come back
    other = opened(f"{server.address}/?PROLIFIC_PID=6e1&STUDY_ID=77a", context=page.context)
    reaches(other, short.title)
    back = opened(f"{server.address}/?{IDS}", context=page.context)
    reaches(back, "About you")
    # the same person in another browser is told what to do
    elsewhere = opened(f"{server.address}/?{IDS}")
    agree(elsewhere)
    reaches(elsewhere, "You have begun this study before")


def test_nobody_is_sent_back_before_everything_is_saved(running, opened, short):
    server = running(short)
    page = opened("about:blank")
    went = []
    page.route("https://recruit.example/**", lambda route: (
        went.append(route.request.url), route.fulfill(body="welcome back")))  # fmt: skip
    page.clock.install()
    page.goto(f"{server.address}/?{IDS}")
    agree(page)
    reaches(page, "About you")
    page.context.set_offline(True)
    go_on(page)
    page.context.set_offline(False)  # clips need the network
    reaches(page, "Robot 1 of 1")
    answer(page, "set")
    reaches(page, "Last questions")
    page.context.set_offline(True)
    go_on(page)
    reaches(page, "Saving your last answers")
    page.clock.fast_forward(60_000)
    assert page.locator("#back").count() == 0
    assert went == []
    page.context.set_offline(False)
    page.clock.fast_forward(60_000)
    reaches(page, "Thank you")
    assert {row["status"] for row in server.rows()} == {"finished"}
    assert page.get_attribute("#back", "href") == "https://recruit.example/done?cc=C0DE"
    # nobody is taken away while deciding whether to withdraw
    page.click("text=Withdraw and delete my answers")
    page.clock.fast_forward(31_000)
    page.click("text=Keep my answers")
    page.clock.fast_forward(31_000)
    page.wait_for_url("https://recruit.example/done?cc=C0DE")
    assert went == ["https://recruit.example/done?cc=C0DE"]


# --- rights ---


def test_downloading_and_withdrawing(running, opened, short):
    server = running(short)
    page = opened(server.address)
    agree(page)
    reaches(page, "About you")
    page.check("#q-years-0")
    go_on(page)
    reaches(page, "Robot 1 of 1")
    saved(page)
    with page.expect_download() as download:
        page.click("text=Download my answers")
    assert download.value.suggested_filename == "tiny-my-answers.json"
    mine = json.loads(download.value.path().read_text())
    assert [(one["question"], one["value"]) for one in mine["answers"]] == [("years", "18-39")]
    assert mine["not_saved_yet"]["pages"] == []
    page.click("text=Withdraw and delete my answers")
    expect(page.locator("#withdraw-not")).to_be_focused()
    page.keyboard.press("Escape")
    assert len(server.rows()) == 1
    page.click("text=Withdraw and delete my answers")
    page.context.set_offline(True)
    page.click("#withdraw-yes")
    expect(page.locator("#withdrawing-problem")).to_contain_text("not deleted yet")
    page.context.set_offline(False)
    page.click("#withdraw-yes")
    reaches(page, "Your answers are deleted")
    assert not page.is_visible("#rights")
    assert server.rows() == []
    assert progress.read(server.store, short)["real"]["counts"]["withdrawn"] == 1
    left = page.evaluate("() => Object.entries(localStorage).map((e) => e.join()).join()")
    assert not re.search("18-39|token", left), left
    page.reload()
    reaches(page, short.title)


def test_a_preview_says_so_and_can_start_over(running, opened, short):
    server = running(short, preview=True)
    page = opened(server.address)
    expect(page.locator("#preview")).to_contain_text("Nothing is stored")
    agree(page)
    reaches(page, "About you")
    answer_all(page)
    assert "Participants are sent on from here to: https://recruit" in page.inner_text("main")
    page.click("text=Start over")
    reaches(page, short.title)
    assert {row["preview"] for row in server.rows()} == {True}
    assert title(page) == short.title
