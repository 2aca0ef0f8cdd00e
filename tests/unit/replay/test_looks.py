"""That the page draws what MuJoCo draws: the same shapes, in the same places and colours."""

import base64
import copy
import io

import mujoco
import numpy as np
import pytest
from PIL import Image

from evenhand.restaurant import floor_plan
from evenhand.restaurant.drawing import dressing
from evenhand.restaurant.drawing.guests import SKIN, Figures
from evenhand.restaurant.replay import looks
from evenhand.restaurant.simulation import scene
from support import replayed


@pytest.fixture(scope="module")
def still():
    return looks.still()


@pytest.fixture(scope="module")
def seen():
    return replayed.served(12)[0]


@pytest.fixture(scope="module")
def figured(seen):
    return looks.figures(seen)


def columns(parts, name, wide):
    return np.array(parts[name]).reshape(-1, wide)


def placed(seen, row):
    """The dressed model with the guests of a service in their places, and where everything is."""
    model = copy.copy(dressing.model())
    Figures(model, scene.PERSON).show(seen, row)
    data = mujoco.MjData(model)
    data.qpos[:] = seen.pose[row, 0]
    data.mocap_pos[:, :2] = seen.position[row]
    data.mocap_pos[:, 2] = scene.FOOTPRINT_HEIGHT
    data.mocap_quat[:] = 0.0
    data.mocap_quat[:, 0] = np.cos(seen.facing[row] / 2)
    data.mocap_quat[:, 3] = np.sin(seen.facing[row] / 2)
    mujoco.mj_kinematics(model, data)
    return model, data


def visible(model, body):
    """Geoms of a body that people see, by their name."""
    return [
        g
        for g in range(model.ngeom)
        if model.body(model.geom_bodyid[g]).name == body
        and model.geom(g).name.startswith("look_")
        and model.geom_rgba[g, 3] > 0
    ]


def turned(places, heading):
    x, y, z = places.T
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)


def test_the_room_is_every_shape_of_the_dressed_model(still, seen):
    model, data = placed(seen, 0)
    room = visible(model, "world")
    assert len(still["room"]["kind"]) == len(room) > 300
    found = columns(still["room"], "place", 3)
    assert np.allclose(found, data.geom_xpos[room], atol=1e-4)
    assert np.allclose(columns(still["room"], "size", 3), model.geom_size[room], atol=1e-4)


def test_the_robot_moved_by_a_pose_is_where_physics_has_it(still, seen):
    model, data = placed(seen, 0)
    x, y, yaw = seen.pose[0, 0]
    found = turned(columns(still["robot"], "place", 3), yaw) + np.array([x, y, 0.0])
    assert np.allclose(found, data.geom_xpos[visible(model, "robot")], atol=2e-4)


@pytest.mark.parametrize("row", [0, 5, 11])
def test_every_guest_is_drawn_where_physics_has_it_and_as_coloured(seen, figured, row):
    model, data = placed(seen, row)
    for guest in range(floor_plan.N_GUESTS):
        parts = figured.shapes[figured.shape[row, guest]]
        geoms = visible(model, scene.guest_name(guest))
        found = turned(columns(parts, "place", 3), seen.facing[row, guest])
        found[:, :2] += seen.position[row, guest]
        assert np.allclose(found, data.geom_xpos[geoms], atol=2e-4)
        assert np.allclose(columns(parts, "size", 3), model.geom_size[geoms], atol=1e-4)
        colours = [figured.colours[k] for k in figured.coats[figured.coat[row, guest]]]
        rgba = np.array([list(bytes.fromhex(colour)) for colour in colours]) / 255
        assert np.allclose(rgba, model.geom_rgba[geoms], atol=0.5 / 255 + 1e-6)


def test_skin_tones_are_those_of_the_people(seen, figured):
    for guest in range(floor_plan.N_GUESTS):
        tone = np.rint(255 * np.array(SKIN[seen.people[3, guest, 4]])).astype(np.uint8)
        coat = figured.coats[figured.coat[3, guest]]
        assert bytes(tone).hex() + "ff" in [figured.colours[k] for k in coat]


def test_figures_that_look_alike_are_kept_once(figured):
    assert len({repr(shape) for shape in figured.shapes}) == len(figured.shapes)
    assert len({tuple(coat) for coat in figured.coats}) == len(figured.coats)
    # age, seat, wheelchair, and one raised arm: no more than 5 x 2 x 2 x 2 shapes
    assert len(figured.shapes) <= 40


def test_who_asks_is_drawn_with_an_arm_up_and_on_light(still, figured):
    pictured = [k for k, s in enumerate(still["surfaces"]) if s["name"] in ("shade", "shine")]
    for row in range(12):
        asking, other = (figured.shapes[figured.shape[row, guest]] for guest in (0, 1))
        assert columns(asking, "place", 3)[:, 2].max() > columns(asking, "place", 3)[0, 2]
        assert asking != other
        spots, fewer = (sum(k in pictured for k in figure["surface"]) for figure in (asking, other))
        assert spots == fewer + 1  # shade, and the warm light


def test_pictures_are_the_textures_of_the_model(still):
    model = dressing.model()
    surface = next(s for s in still["surfaces"] if s["name"] == "boards")
    kind, data = surface["picture"].split(",")
    assert kind == "data:image/png;base64"
    picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))))
    begin = model.tex("boards").adr[0]
    assert picture.shape == (512, 512, 3)
    assert np.array_equal(picture.ravel(), model.tex_data[begin : begin + picture.size])


def test_the_floor_takes_its_colour_from_its_material(still):
    floor = still["room"]["kind"].index(looks.KINDS.index("plane"))
    assert still["room"]["colour"][floor] == "ffffffff"


def test_the_light_is_that_of_the_model(still):
    assert still["lights"]["ambient"] == [0.46, 0.44, 0.41]
    assert [lamp[1] for lamp in still["lights"]["lamps"]] == [[0.5, 0.46, 0.39], [0.14, 0.15, 0.18]]
    assert still["fovy"] == {"room": 24.0, "robot": 55.0, "guest": 56.0}
