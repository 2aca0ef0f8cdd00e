"""The replay page in a real Chromium: it draws, plays, seeks, and filters."""

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.methods.paper import issues
from evenhand.restaurant.drawing.renderer import Screen
from support import replay_page as shown
from support.replay_page import NUMBER, apart, clear, picture, row_of_six_seconds, until, value

# fixtures
address, browser, chromium = shown.address, shown.browser, shown.chromium
opened, page, served = shown.opened, shown.page, shown.served
pytestmark = pytest.mark.slow


# --- the picture -----------------------------------------------------------------------------


def test_it_draws_the_same_restaurant_as_mujoco(opened, browser, served, require):
    page = opened(browser)
    clear(page)
    page.uncheck("#rings")
    page.keyboard.press("End")
    seen = served[0]
    for camera in ("room", "robot", "guest"):
        page.click(f"[data-camera={camera}]")
        ours = picture(page)
        assert len(np.unique(ours.reshape(-1, 3), axis=0)) > 500
        high, wide = ours.shape[:2]
        try:
            screen = Screen(camera, wide, high)
        except InputError as error:
            require("OpenGL" not in str(error), "OpenGL: libegl1 libegl-mesa0 libgl1-mesa-dri")
            raise
        theirs = screen.still(seen.pose[0, seen.frames[0] - 1], seen, 0).astype(float)
        screen.close()
        # rounded corners of the frame and edges of shapes differ, faces do not
        difference = np.abs(ours - theirs).max(axis=-1)[15:-15, 15:-15]
        assert np.median(difference) < 6, camera
        assert (difference > 40).mean() < 0.08, camera


def test_it_shows_another_picture_for_every_camera_ring_and_service(page):
    clear(page)
    pictures = [picture(page)]
    for name in ("robot", "guest", "free"):
        page.click(f"[data-camera={name}]")
        if name == "free":
            page.keyboard.press("Tab")
            page.focus("#view")
            page.keyboard.press("ArrowRight")
            page.keyboard.press("ArrowUp")
        pictures.append(picture(page))
    for k, one in enumerate(pictures):
        assert all(apart(one, two) > 0.1 for two in pictures[:k])
    page.click("[data-camera=guest]")
    page.uncheck("#rings")
    assert apart(picture(page), pictures[2]) > 0.005
    page.keyboard.press("n")
    assert apart(picture(page), pictures[2]) > 0.1


# --- time ------------------------------------------------------------------------------------


def test_nothing_moves_until_it_is_played_and_then_it_does(page, served):
    page.keyboard.press("2")
    before = picture(page)
    assert value(page) == 0
    page.click("#play")
    until(page, lambda: value(page) > 3)
    assert page.get_attribute("#play", "aria-label") == "Pause"
    assert apart(picture(page), before) > 0.05
    until(page, lambda: page.get_attribute("#play", "aria-label") == "Play")
    assert value(page) == served[0].frames[0] - 1
    outcome = page.inner_text("#outcome").removeprefix("Outcome: ")
    assert page.text_content("#live") == outcome
    assert outcome.startswith(("Response at", "No response"))


@pytest.mark.parametrize(("speed", "steps"), [("0.25", 12.5), ("1", 50), ("4", 200)])
def test_a_second_of_the_clock_is_as_much_of_the_service_as_the_speed_says(
    opened, browser, served, speed, steps
):
    number = served[0].number[row_of_six_seconds(served)]
    page = opened(browser, at=f"#service-{number}", still=True)
    page.select_option("#speed", speed)
    page.click("#play")
    page.clock.run_for(1000)
    shown = int(page.inner_text("#facts").split("step ")[1].split(")")[0])
    assert shown == pytest.approx(steps, abs=float(speed) * 2.5)  # frames are 0.016 s apart


def test_scrubbing_pressing_a_curve_and_text_agree(opened, browser, served):
    row = row_of_six_seconds(served)
    seen = served[0]
    page = opened(browser, at=f"#service-{seen.number[row]}", still=True)
    page.fill("#scrub", "30")
    assert f"3.0 s (step 150)\nDistance\n{seen.distance[row, 30]:.2f} m" in page.inner_text(
        "#facts"
    )
    drawing = page.locator("#plots svg[role=img]").first
    box = drawing.bounding_box()
    # the axis of six seconds runs from 78 to 392 of 400
    across = (78 + 314 * 4.5 / 6) / 400
    drawing.click(position={"x": across * box["width"], "y": box["height"] / 2})
    assert value(page) == 45
    said = page.get_attribute("#scrub", "aria-valuetext")
    assert said.startswith(f"4.5 s, {seen.distance[row, 45]:.2f} m, ")
    for word in page.locator(".plot .now").all_inner_texts():
        assert word


def test_the_issues_of_the_facts_are_those_of_the_page_at_the_end(page, served):
    x = issues.indicators(served[1])
    for row in range(NUMBER):
        page.keyboard.press("End")
        told = dict(zip(*[iter(page.inner_text("#facts").split("\n"))] * 2, strict=True))
        for k, issue in enumerate(issues.PAPER_ISSUES):
            word = {1.0: "yes, from", 0.0: "no"}.get(x[row, k], "does not apply")
            assert told[issue.name.capitalize()].startswith(word), (row, issue.name)
        page.keyboard.press("n")


# --- which services --------------------------------------------------------------------------


def test_filters_by_identity_and_issue(page, served):
    rows = served[1]
    codes, ages = rows.identity("age")
    met = issues.indicators(rows) == 1.0
    numbers = rows.fact("service").astype(int)

    def listed():
        return [
            int(text.removeprefix("Service "))
            for text in page.locator("#services li:visible b").all_inner_texts()
        ]

    assert listed() == numbers.tolist()
    for option, wanted in (
        ("any", met.any(axis=1)),
        ("none", ~met.any(axis=1)),
        *((issue.name, met[:, k]) for k, issue in enumerate(issues.PAPER_ISSUES)),
    ):
        page.get_by_label("Issue", exact=True).select_option(option)
        assert listed() == numbers[wanted].tolist()
        assert page.inner_text("#matches") == f"{wanted.sum()} of {NUMBER} match"
    page.get_by_label("Issue", exact=True).select_option("")
    age = ages[codes[5]]
    page.get_by_label("Age", exact=True).select_option(age)
    wanted = numbers[codes == codes[5]]
    assert listed() == wanted.tolist()
    page.focus("#play")
    for _ in range(NUMBER):
        page.keyboard.press("p")
    for number in wanted:
        if f"Service {number} " not in page.inner_text("#player-title"):
            page.keyboard.press("n")
        assert f"Service {number} " in page.inner_text("#player-title")
    assert age in page.inner_text("#who")
    page.click("#reset")
    assert listed() == numbers.tolist()


def test_choosing_from_the_list_and_by_address(opened, browser, served):
    numbers = served[0].number
    page = opened(browser, at=f"#service-{numbers[4]}")
    assert page.inner_text("#player-title") == f"Service {numbers[4]} of epoch 0"
    page.click(f"#services button:has-text('Service {numbers[6]}')")
    assert page.inner_text("#player-title") == f"Service {numbers[6]} of epoch 0"
    current = page.locator("#services [aria-current=true]")
    assert current.count() == 1
    assert f"Service {numbers[6]}" in current.inner_text()
    assert f"Service {numbers[6]}:" in page.text_content("#live")
