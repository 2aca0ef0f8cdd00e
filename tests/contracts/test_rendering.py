"""What pictures of the restaurant promise: who can be seen, and that looks change nothing."""

import copy
import dataclasses
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from evenhand.core.errors import InputError
from evenhand.restaurant import floor_plan, people, registration
from evenhand.restaurant.drawing import dressing
from evenhand.restaurant.drawing.renderer import Screen
from evenhand.restaurant.env import RestaurantEnv
from evenhand.restaurant.simulation import layout
from evenhand.restaurant.vector import RestaurantVectorEnv
from support.refusals import refused

SMALL = (160, 120)


@pytest.fixture
def screen(opengl, request):
    made = Screen(getattr(request, "param", "room"), *SMALL)
    yield made
    made.close()


@pytest.fixture(scope="module")
def setups():
    return layout.draw(people.population("uniform"), 60, np.random.default_rng(5))


def on_picture(model, camera, points):
    """Where points [n, 3] fall, in half widths and half heights of a 4:3 picture, [n, 2]."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    index = model.camera(camera).id
    x, y, z = ((points - data.cam_xpos[index]) @ data.cam_xmat[index].reshape(3, 3)).T
    assert (z < 0).all(), "behind the camera"
    half = np.tan(np.deg2rad(model.cam_fovy[index] / 2))
    return np.stack([x / -z / (half * 4 / 3), y / -z / half], axis=1)


# --- pictures --------------------------------------------------------------------------------


@pytest.mark.parametrize("screen", dressing.CAMERAS, indirect=True)
def test_a_picture_is_an_array_of_bytes_with_something_on_it(screen, setups):
    picture = screen.still(np.array([*setups.start[0], 0.0]), setups, 0)
    assert (picture.shape, picture.dtype) == ((120, 160, 3), np.uint8)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 500


@pytest.mark.parametrize("camera", dressing.CAMERAS)
def test_the_same_seed_gives_the_same_pixels(opengl, camera):
    films = []
    for _ in range(2):
        env = RestaurantEnv(render_mode="rgb_array", camera=camera)
        env.reset(seed=3)
        films.append([env.render()])
        for _ in range(3):
            env.step(0)
            films[-1].append(env.render())
        env.close()
    assert np.array_equal(films[0], films[1])


def test_another_service_gives_another_picture(screen, setups):
    first, second = (screen.still(np.zeros(3), setups, row) for row in (0, 1))
    assert not np.array_equal(first, second)
    assert np.array_equal(screen.still(np.zeros(3), setups, 0), first)


def test_skin_types_differ_in_the_picture(screen, setups):
    pictures = []
    for skin in (0, 5):
        codes = setups.people.copy()
        codes[..., 4] = skin
        pictures.append(screen.still(np.zeros(3), dataclasses.replace(setups, people=codes), 0))
    assert not np.array_equal(pictures[0], pictures[1])


def test_when_the_robot_drives_only_its_part_of_the_room_changes(opengl):
    env = RestaurantEnv(render_mode="rgb_array")
    env.reset(seed=0)
    before = env.render()
    for _ in range(10):
        env.step(0)
    after = env.render()
    env.close()
    assert before is not None
    assert after is not None
    changed = (before != after).any(axis=2)
    assert 0.0005 < changed.mean() < 0.05


def test_many_screens_at_once_do_not_disturb_each_other(opengl, setups):
    robot = np.array([*setups.start[0], 1.0])
    alone = {}
    for camera in dressing.CAMERAS:
        one = Screen(camera, *SMALL)
        alone[camera] = one.still(robot, setups, 0)
        one.close()
    screens = [Screen(camera, *SMALL) for camera in (*dressing.CAMERAS, "room")]
    for screen in [*screens, *reversed(screens)]:
        assert np.array_equal(screen.still(robot, setups, 0), alone[screen.camera])
    for screen in screens:
        screen.close()


def test_a_closed_screen_can_be_closed_again_and_says_that_it_is_closed(screen, setups):
    screen.close()
    screen.close()
    with pytest.raises(RuntimeError, match="closed"):
        screen.still(np.zeros(3), setups, 0)


def in_another_thread(do):
    """What something gives or raises in a thread of its own."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(do)


@pytest.mark.parametrize("make", [RestaurantEnv, RestaurantVectorEnv])
def test_a_thread_draws_what_it_opened_and_another_is_told_so(opengl, make):
    env = make(render_mode="rgb_array")
    env.reset(seed=0)
    picture = np.array(env.render())
    for use in (env.render, env.close):
        error = in_another_thread(use).exception()
        assert isinstance(error, InputError)
        assert "the renderer belongs to thread 'MainThread'" in str(error)
    np.testing.assert_array_equal(env.render(), picture)

    def elsewhere():
        other = make(render_mode="rgb_array")
        other.reset(seed=0)
        drawn = np.array(other.render())
        other.close()
        return drawn

    np.testing.assert_array_equal(in_another_thread(elsewhere).result(), picture)
    np.testing.assert_array_equal(env.render(), picture)
    env.close()


def test_the_largest_picture_can_be_drawn(opengl, setups):
    screen = Screen("guest", *dressing.LARGEST, smooth=False)
    assert screen.still(np.zeros(3), setups, 0).shape == (960, 1280, 3)
    screen.close()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (("rom",), "unknown camera 'rom': did you mean 'room'"),
        (("ceiling", 640, 480), "choose one of room, robot, guest"),
        (("room", 1281, 480), "width of the picture is 1281: give 1 to 1280"),
        (("room", 640, 0), "height of the picture is 0: give 1 to 960"),
    ],
)
def test_what_cannot_be_drawn_is_said(wrong, said):
    with pytest.raises(InputError, match=said):
        Screen(*wrong)


def test_the_environment_names_an_unknown_camera():
    with refused("unknown camera", "'gest'", "'guest'"):
        RestaurantEnv(render_mode="rgb_array", camera="gest")


def test_gymnasium_checks_the_environment_with_rendering(opengl):
    registration.register()
    env = gym.make("evenhand/Restaurant-v0", render_mode="rgb_array")
    check_env(env.unwrapped)
    env.close()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="EGL belongs to Linux")
def test_without_egl_the_missing_packages_are_named_and_nothing_else_breaks():
    program = """
import os, sys
sys.modules["mujoco.egl"] = None
from evenhand.core.errors import InputError
from evenhand.restaurant.env import RestaurantEnv
try:
    RestaurantEnv(render_mode="rgb_array")
except InputError as error:
    print(error)
RestaurantEnv().reset(seed=0)
print(os.environ.get("MUJOCO_GL"))
"""
    hidden = ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY", "PYOPENGL_PLATFORM")
    asked = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env={name: value for name, value in os.environ.items() if name not in hidden},
    )
    said, setting = asked.stdout.splitlines()
    assert "libegl1 libegl-mesa0 libgl1-mesa-dri" in said
    assert setting == "None"


# --- cameras ---------------------------------------------------------------------------------


def test_the_room_camera_shows_the_whole_room(setups):
    model = copy.copy(dressing.model())
    dressing.aim(model, "room", setups.start[0], setups.position[0], setups.start[0])
    x, y = floor_plan.ROOM
    floor = [(sx * x, sy * y, 0.0) for sx in (-1, 1) for sy in (-1, 1)]
    heads = [(sx * x, sy * y, 1.9) for sx in (-1, 1) for sy in (-1, 1)]
    at = on_picture(model, "room", np.array(floor + heads))
    assert (np.abs(at) < 1.0).all()
    assert np.ptp(at[:, 0]) > 1.8, "the room fills the width"


@pytest.mark.parametrize("camera", ["robot", "guest"])
def test_the_other_cameras_stay_in_the_room_and_show_robot_and_person(setups, camera):
    model = copy.copy(dressing.model())
    for row in range(len(setups)):
        person, start = setups.position[row, 0], setups.start[row]
        for share in (0.0, 0.5):
            robot = start + share * (person - start)
            dressing.aim(model, camera, robot, setups.position[row], start)
            eye = model.cam_pos[model.camera(camera).id]
            assert (np.abs(eye[:2]) < floor_plan.ROOM).all()
            both = np.array([[*robot, 1.1], [*person, 1.0]])
            assert (np.abs(on_picture(model, camera, both)) < 1.0).all()
