"""The robot between recorded poses, against hand numbers and against the physics itself."""

import numpy as np
import pytest

from evenhand.restaurant import floor_plan, people
from evenhand.restaurant.film import motion
from evenhand.restaurant.simulation import layout, physics


def test_twenty_five_pictures_a_second_each_of_a_moment_of_the_physics():
    assert motion.RATE == 25
    assert pytest.approx(1.0) == floor_plan.TIMESTEP * motion.FRAME_STEPS * motion.RATE


@pytest.mark.parametrize(
    ("steps", "shown"),
    [(0, [0]), (5, [0, 2, 4, 5]), (10, [0, 2, 4, 6, 8, 10]), (1, [0, 1])],
)
def test_the_last_moment_is_always_shown(steps, shown):
    assert motion.moments(steps).tolist() == shown


def test_a_start_at_rest_with_constant_acceleration_is_exact():
    # x = a t^2 / 2 with a = 2.5 m/s^2; y stands still; yaw turns likewise
    steps = np.arange(21)
    seconds = steps * floor_plan.TIMESTEP
    truth = np.stack([1.25 * seconds**2, 0 * seconds + 3, 0.5 * seconds**2], axis=1)
    found = motion.poses(truth[::5], 5, steps)
    np.testing.assert_allclose(found, truth, atol=1e-12)


def test_the_recorded_poses_themselves_are_met():
    pose = np.random.default_rng(0).normal(size=(9, 3))
    np.testing.assert_allclose(motion.poses(pose, 5, np.arange(9) * 5), pose, atol=1e-12)


@pytest.mark.parametrize("poses", [1, 2])
def test_services_that_end_at_once_have_pictures_too(poses):
    pose = np.arange(poses * 3.0).reshape(poses, 3)
    found = motion.poses(pose, 5, motion.moments(5 * (poses - 1)))
    np.testing.assert_allclose(found[0], pose[0])
    np.testing.assert_allclose(found[-1], pose[-1], atol=1e-12)


def test_between_the_poses_it_is_where_the_physics_had_it():
    """240 services of 300 physics steps, each looked at in every step."""
    n = 240
    setups = layout.draw(people.population("uniform"), n, np.random.default_rng(8))
    truth = np.zeros((floor_plan.MAX_STEPS + 1, n, 3))
    rooms = physics.Physics(n)
    rooms.place(np.arange(n), rooms.prepare(setups), np.arange(n))
    truth[0] = rooms.state
    for step in range(floor_plan.MAX_STEPS):
        rooms.walk(None, 1)
        truth[step + 1] = rooms.state
    assert (np.hypot(*(truth[-1] - truth[0])[:, :2].T) > 0.5).all(), "they drive"
    steps = np.arange(floor_plan.MAX_STEPS + 1)
    errors = np.stack([motion.poses(truth[::5, i], 5, steps) - truth[:, i] for i in range(n)])
    metres = np.hypot(errors[..., 0], errors[..., 1])
    assert metres.max() < 0.005, metres.max()
    assert np.sqrt((metres**2).mean()) < 0.001
    assert np.abs(errors[..., 2]).max() < 0.05, "yaw, radians"
