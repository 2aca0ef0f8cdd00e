"""The participants' pages where things go wrong that nobody planned: slow devices, odd memories."""

import json
from dataclasses import replace

import pytest
from playwright.sync_api import expect

from support import study_pages as shown
from support.study_pages import agree, answer_all, go_on, reaches, saved, watch

# fixtures
chromium, clips, opened, running, short = (
    shown.chromium, shown.clips, shown.opened, shown.running, shown.short,
)  # fmt: skip
pytestmark = pytest.mark.slow


def test_a_clip_counts_on_a_device_whose_page_stands_still_while_it_plays(running, opened, short):
    server = running(replace(short, demographics=()))
    page = opened(server.address)
    agree(page)
    reaches(page, "Robot 1 of 1")
    page.wait_for_function("() => document.querySelector('video').readyState === 4")
    # the clip lasts one second; the page hears of its beginning when it is over
    page.evaluate(
        """() => {
            document.querySelector("figure button").click();
            const began = performance.now();
            while (performance.now() - began < 2000);
        }"""
    )
    expect(page.locator("figure")).to_have_attribute("data-seen", "yes")


def test_the_second_half_of_a_double_click_does_nothing_on_the_next_page(running, opened, short):
    server = running(short)
    page = opened(server.address)
    agree(page)
    reaches(page, "About you")
    page.evaluate(
        """() => {
            window.came = [];
            window.did = [];
            const heading = () => document.querySelector("main h1").textContent;
            window.addEventListener("click", () => came.push(heading()), true);
            document.body.addEventListener("click", () => did.push(heading()));
        }"""
    )
    page.dblclick("text=Save and go on")
    assert page.evaluate("() => came") == ["About you", "Robot 1 of 1"]
    assert len(page.evaluate("() => did")) == 1
    # a click that is meant for it does what it says
    watch(page)
    assert len(page.evaluate("() => did")) > 1


def test_half_a_character_is_left_out_and_does_not_keep_anybody_from_going_on(
    running, opened, short
):
    server = running(replace(short, demographics=()))
    page = opened(server.address)
    agree(page)
    answer_all(page, until="Last questions")
    page.evaluate(
        """() => {
            const area = document.querySelector("textarea");
            area.value = "so\\ud83d \\ude00so \\ud83d\\ude00";
            area.dispatchEvent(new Event("input"));
        }"""
    )
    assert "43 characters left" in page.inner_text("main")
    go_on(page)
    reaches(page, "Thank you")
    assert server.values()["end", "why"] == "so so \U0001f600"


# what a browser remembers, as others may have left it: notes -> notes
MEDDLED = {
    "queue of nothing": lambda notes: {**notes, "queue": [None]},
    "no drafts": lambda notes: {**notes, "drafts": None},
    "drafts of nothing": lambda notes: {**notes, "drafts": {"set:s2": {}}},
    "no ids": lambda notes: {key: one for key, one in notes.items() if key != "external"},
    "no count": lambda notes: {**notes, "sequence": None},
}


@pytest.mark.parametrize("meddle", MEDDLED.values(), ids=MEDDLED)
def test_a_memory_that_was_meddled_with_keeps_the_place(running, opened, short, meddle):
    server = running(short)
    page = opened(server.address)
    agree(page)
    reaches(page, "About you")
    go_on(page)
    reaches(page, "Robot 1 of 1")
    saved(page)
    remember(page, meddle)
    reaches(page, "Robot 1 of 1")
    assert answer_all(page) == ["Robot 1 of 1", "Last questions"]
    assert len(server.rows()) == 5


@pytest.mark.parametrize(
    "token", ["\U0001f600" * 43, "x\n", 7, None], ids=["emoji", "short", "number", "nothing"]
)
def test_a_token_that_is_none_begins_anew(running, opened, short, token):
    server = running(short)
    page = opened(server.address)
    agree(page)
    reaches(page, "About you")
    remember(page, lambda notes: {**notes, "token": token})
    reaches(page, short.title)
    agree(page)
    reaches(page, "About you")


def remember(page, meddle) -> None:
    """Change the notes of a page, and load it again."""
    find = "() => Object.entries(localStorage).find(([key]) => key.includes('/notes/'))"
    key, text = page.evaluate(find)
    # written when the page is gone, which writes its own
    notes = json.dumps(json.dumps(meddle(json.loads(text))))
    page.add_init_script(f"localStorage.setItem({json.dumps(key)}, {notes})")
    page.reload()


def test_a_storage_with_hardly_any_space_is_none(running, opened, short):
    server = running(short)
    page = opened("about:blank")
    page.add_init_script(
        """const set = Storage.prototype.setItem;
        Storage.prototype.setItem = function (key, value) {
            if (key.length + value.length > 20) throw new DOMException("full");
            set.call(this, key, value);
        };"""
    )
    page.goto(server.address)
    expect(page.locator("#forgetful")).to_be_visible()
    agree(page)
    reaches(page, "About you")


def test_captions_stand_where_the_end_of_a_service_does_not(running, opened, short):
    told = replace(short.sets[0], captions=("Who asks: a child.",))
    server = running(replace(short, demographics=(), sets=(told,)))
    page = opened(server.address)
    agree(page)
    reaches(page, "Robot 1 of 1")
    page.check("#captions")
    page.wait_for_function("() => document.querySelector('video').textTracks[0].cues?.length")
    cue = page.evaluate(
        """() => {
            const cue = document.querySelector("video").textTracks[0].cues[0];
            return [cue.text, cue.line];
        }"""
    )
    assert cue == ["Who asks: a child.", 0]
