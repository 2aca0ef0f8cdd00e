"""What a clip shows, and that it shows the same each time."""

import contextlib
import dataclasses

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.methods.services import Services
from evenhand.restaurant import robots
from evenhand.restaurant.drawing import dressing
from evenhand.restaurant.drawing.renderer import Screen
from evenhand.restaurant.film import clip, motion, signs
from evenhand.restaurant.film.clip import Style

SMALL = Style(width=320, height=240)


def facts(responded=True, step=118, distance=1.24, least=None, steps=None):
    """One service."""
    return Services.build(
        {},
        {
            "responded": np.array([responded]),
            "response_step": np.ma.array([step], mask=[not responded]),
            "response_distance": np.ma.array([distance], mask=[not responded]),
            "min_distance": np.array([distance if least is None else least]),
            "steps": np.array([steps or step]),
        },
    )


@pytest.mark.parametrize(
    ("service", "said"),
    [
        (facts(), ["Responded after 2.36 s at 1.24 m", "No issue"]),
        (facts(distance=1.6), ["Responded after 2.36 s at 1.60 m", "Issue: quality"]),
        (facts(step=201), ["Responded after 4.02 s at 1.24 m", "Issue: priority"]),
        (
            facts(step=230, distance=0.45),
            ["Responded after 4.60 s at 0.45 m", "Issues: quality, priority, risk"],
        ),
        (facts(False, least=1.2, steps=300), ["No response within 6.00 s", "Issue: willingness"]),
        (
            facts(False, least=0.42, steps=300),
            ["No response within 6.00 s", "Issues: willingness, risk"],
        ),
    ],
)
def test_how_a_service_ended(service, said):
    assert clip.outcome(service, 0) == said


def test_raters_are_told_of_the_response_alone():
    assert clip.response(facts(), 0) == ["The robot responds."]
    assert clip.response(facts(False), 0) == ["The robot does not respond."]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"camera": "rom"}, "unknown camera 'rom': did you mean 'room'"),
        ({"caption": "outcom"}, "unknown caption 'outcom'"),
        ({"width": 318}, "width of the picture is 318: give an even number of pixels from 320 to"),
        ({"width": 641}, "width of the picture is 641: give an even number"),
        ({"width": 1282}, "width of the picture is 1282: .* from 320 to 1280"),
        ({"height": 238}, "height of the picture is 238: .* from 240 to 960"),
        ({"height": 962}, "height of the picture is 962"),
    ],
)
def test_a_style_that_cannot_be_drawn(wrong, said):
    with pytest.raises(InputError, match=said):
        Style(**wrong)


@pytest.mark.parametrize("manner", robots.MANNERS)
def test_a_clip_is_as_long_as_the_service_and_its_stills(footage, manner):
    row = robots.MANNERS.index(manner)
    steps = int(footage.facts.fact("steps")[row])
    # half a second of 12 (12.5 is rounded to the even one) and one and a half of 38
    own = -(-steps // 2) + 1
    assert clip.length(footage, row, Style()) == own + 12 + 38
    assert clip.length(footage, row, Style(caption="none")) == own + 12
    assert steps == clip._steps(footage, row)


def drawn(footage, row, style):
    with contextlib.closing(style.screen()) as screen:
        return np.array(list(clip.pictures(footage, row, style, screen)))


@pytest.mark.parametrize("camera", dressing.CAMERAS)
def test_the_same_service_gives_the_same_pictures(opengl, footage, camera):
    style = dataclasses.replace(SMALL, camera=camera)
    first = drawn(footage, 0, style)
    assert first.shape == (clip.length(footage, 0, style), 240, 320, 3)
    assert np.array_equal(first, drawn(footage, 0, style))


def test_pictures_do_not_depend_on_what_was_filmed_before(opengl, footage):
    with contextlib.closing(SMALL.screen()) as screen:
        list(clip.pictures(footage, 1, SMALL, screen))
        second = np.array(list(clip.pictures(footage, 0, SMALL, screen)))
    assert np.array_equal(second, drawn(footage, 0, SMALL))


@pytest.mark.parametrize("camera", dressing.CAMERAS)
def test_what_is_drawn_in_parts_is_what_is_drawn_whole(opengl, footage, camera):
    """Of the robot's whole way, to its very end at the person's side."""
    seen, row = footage.seen, robots.MANNERS.index("ignore")
    with contextlib.closing(Screen(camera, 320, 240)) as screen:
        screen.begin(seen, row)
        for pose in seen.pose[row, : seen.frames[row] : 12]:
            part, whole = screen.move(pose).astype(int), screen.still(pose, seen, row)
            screen.begin(seen, row)
            off = np.abs(part - whole).max(axis=2)
            assert (off > 8).mean() < 0.001, "a few edges may fall on the next pixel"
            # and the robot is in it: without it, the picture is another one
            assert (np.abs(whole.astype(int) - without(seen, row, camera)) > 20).any()


def without(seen, row, camera):
    """The restaurant without the robot."""
    with contextlib.closing(Screen(camera, 320, 240)) as screen:
        return screen.still(np.array([60.0, 60.0, 0.0]), seen, row).astype(int)


def test_each_sign_can_be_left_out(opengl, footage):
    plain = Style(width=320, height=240, timer=False, rings=False, caption="none")
    bare = drawn(footage, 0, plain)
    box = {
        "timer": signs.timer(0, 320, 240).box,
        "rings": signs.legend(320, 240).box,
        "caption": signs.caption(clip.outcome(footage.facts, 0), 320, 240).box,
    }
    for name, value in (("timer", True), ("rings", True), ("caption", "outcome")):
        with_it = drawn(footage, 0, dataclasses.replace(plain, **{name: value}))
        changed = (with_it[len(bare) - 1 if name != "caption" else -1] != bare[-1]).any(axis=2)
        assert changed[box[name]].mean() > 0.9, name
        if name != "rings":  # those are on the floor as well
            changed[box[name]] = False
            assert not changed.any(), name


def test_the_timer_stands_still_with_the_picture(opengl, footage):
    shown = drawn(footage, 0, SMALL)
    assert all(np.array_equal(shown[0], picture) for picture in shown[1:13])
    assert not np.array_equal(shown[13], shown[12])
    assert all(np.array_equal(shown[-1], picture) for picture in shown[-38:])


def test_a_shot_tells_its_progress_and_its_length(opengl, footage, tmp_path):
    told = []
    with contextlib.closing(SMALL.screen()) as screen:
        shot = clip.shoot(tmp_path / "a.mp4", footage, 1, SMALL, screen, told.append)
    assert sum(told) == shot.pictures == clip.length(footage, 1, SMALL)
    assert shot.seconds == shot.pictures / motion.RATE
    assert len(shot.sha256) == 64
