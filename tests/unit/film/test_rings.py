"""Rings lie where they should: in the scene, and in the picture."""

import numpy as np
import pytest

from evenhand.restaurant.drawing import dressing
from evenhand.restaurant.drawing.renderer import Screen
from evenhand.restaurant.film import rings


def test_the_rings_are_the_limits_of_the_paper():
    assert [ring.radius for ring in rings.RINGS] == [1.5, 1.0, 0.5]


@pytest.mark.parametrize("ring", rings.RINGS, ids=lambda r: str(r.radius))
def test_a_ring_is_a_flat_band_that_is_seen_from_above(ring):
    corners, faces = rings._shape(ring, 0.04)
    radius = np.hypot(corners[:, 0], corners[:, 1])
    assert set(np.round(radius, 9)) == {ring.radius - 0.02, ring.radius + 0.02}
    assert (corners[:, 2] == 0).all()
    a, b, c = corners[faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    assert (normal[:, 2] > 0).all()
    # area of the drawn share of the band between the two circles, a little less for its corners
    area = normal[:, 2].sum() / 2
    whole = np.pi * ((ring.radius + 0.02) ** 2 - (ring.radius - 0.02) ** 2)
    assert area == pytest.approx(ring.drawn * whole, rel=0.01)


def test_rings_change_nothing_that_happens():
    plain, ringed = dressing.model(), rings.model(0.03)
    assert ringed.nq == plain.nq
    assert ringed.nu == plain.nu
    assert ringed.ngeom == plain.ngeom + 3
    for number in range(3):
        geom = ringed.geom(f"ring{number}")
        assert (geom.contype[0], geom.conaffinity[0]) == (0, 0)
    np.testing.assert_array_equal(
        ringed.body_mass[ringed.body("robot").id], plain.body_mass[plain.body("robot").id]
    )


@pytest.mark.parametrize("camera", ["room", "guest"])
def test_what_a_ring_adds_to_the_picture_lies_at_its_distance(opengl, footage, camera):
    seen, thick = footage.seen, rings.THICK[camera]
    robot = np.array([*seen.start[0], 0.0])
    pictures = []
    for model in (None, rings.model(thick)):
        screen = Screen(camera, 640, 480, model=model)
        pictures.append(screen.still(robot, seen, 0).astype(int))
        eye, axes, half = screen._eye()
        screen.close()
    rows, columns = np.nonzero(np.abs(pictures[0] - pictures[1]).max(axis=2) > 60)
    assert len(rows) > 200, "rings are seen"
    # the ray of each pixel, down to the floor
    scale = half / 240
    ray = np.stack([(columns + 0.5 - 320) * scale, (240 - rows - 0.5) * scale, -1 + 0 * rows], 1)
    way = ray @ axes.T
    floor = eye[:2] + way[:, :2] * (-eye[2] / way[:, 2])[:, None]
    distance = np.hypot(*(floor - seen.position[0, 0]).T)
    off = np.abs(distance[:, None] - [1.5, 1.0, 0.5]).min(axis=1)
    pixel = 0.05 if camera == "room" else 0.03
    assert (off < thick / 2 + pixel).mean() > 0.98
