"""Signs can be read: contrast, place, no overlap, at every size of the picture."""

import itertools

import numpy as np
import pytest

from evenhand.restaurant.film import rings, signs

SIZES = [(320, 240), (640, 480), (1280, 960), (320, 960), (1280, 240)]
WORST = ("No response within 6.00 s", "Issues: willingness, quality, priority, risk")


def luminance(rgb):
    """Relative luminance of WCAG 2."""
    share = np.asarray(rgb) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one, other):
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def worst_ground():
    """What the ground of a sign looks like over a black picture."""
    sign = signs.timer(0, 640, 480)
    picture = np.zeros((480, 640, 3), np.uint8)
    signs.lay(picture, [sign])
    rows, columns = sign.box
    return picture[rows.start + 1, columns.start + 1]


def test_text_stands_out_at_least_seven_to_one_whatever_is_behind_it():
    assert contrast(signs.INK, worst_ground()) > 7


@pytest.mark.parametrize("ring", rings.RINGS, ids=lambda r: str(r.radius))
def test_samples_of_the_lines_stand_out_at_least_three_to_one(ring):
    assert contrast(ring.colour, worst_ground()) > 3


def test_the_lines_can_be_told_apart_without_colour():
    assert len({(ring.dashes == 1, ring.drawn) for ring in rings.RINGS}) == 3
    sign = signs.legend(640, 480)
    third = sign.ink.shape[0] // 3
    samples = sign.ink[:, : sign.ink.shape[1] // 2]
    kinds = []
    for number in range(3):
        rows = samples[number * third : (number + 1) * third]
        line = rows[np.argmin(rows.sum(axis=(1, 2)))].sum(axis=1)
        dark = line < line.max() * 0.8
        kinds.append(int((np.diff(dark.astype(int)) == 1).sum()))
    assert kinds == [1, 3, 6], "pieces of line of 1.5, 1.0 and 0.5 m"


@pytest.mark.parametrize("size", SIZES)
def test_signs_lie_in_the_picture_and_never_over_each_other(size):
    width, height = size
    made = [signs.timer(300, *size), signs.legend(*size), signs.caption(WORST, *size)]
    for sign in made:
        rows, columns = sign.box
        assert 0 <= rows.start < rows.stop <= height
        assert 0 <= columns.start < columns.stop <= width
    for one, other in itertools.combinations(made, 2):
        (a, b), (c, d) = one.box, other.box
        assert a.stop <= c.start or c.stop <= a.start or b.stop <= d.start or d.stop <= b.start


def test_the_timer_does_not_change_its_size():
    boxes = {str(signs.timer(step, 640, 480).box) for step in (0, 7, 99, 100, 299, 300)}
    assert len(boxes) == 1


def test_the_timer_tells_seconds_and_steps():
    # different moments look different; the same one looks the same
    assert not np.array_equal(signs.timer(118, 640, 480).ink, signs.timer(119, 640, 480).ink)
    assert np.array_equal(signs.timer(118, 640, 480).ink, signs.timer(118, 640, 480).ink)


def test_text_is_at_least_eleven_pixels_high_on_a_phone_360_pixels_wide():
    sign = signs.timer(0, 640, 480)
    dark = (sign.ink.sum(axis=2) < 300).any(axis=1)
    high = np.flatnonzero(dark)
    assert (high[-1] - high[0] + 1) * 360 / 640 > 8, "a digit; text of 11 px has digits of 8"


def test_what_is_under_a_sign_shows_through_a_little_and_the_rest_stays():
    sign = signs.caption(["x"], 640, 480)
    picture = np.full((480, 640, 3), 100, np.uint8)
    signs.lay(picture, [sign])
    rows, columns = sign.box
    # 0.9 of the ground (rounded to 230/255) over 0.1 of 100
    corner = 230 / 255 * np.array(signs.PAPER) + 25 / 255 * 100
    np.testing.assert_allclose(picture[rows.start, columns.start], corner, atol=1)
    picture[sign.box] = 100
    assert (picture == 100).all()
