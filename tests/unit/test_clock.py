"""MuJoCo's clock stands still while Evenhand simulates, and goes on afterwards."""

import threading

import mujoco
import pytest
from mujoco.batch import Batch

from evenhand.methods import detector_file
from evenhand.restaurant.simulation import driving, scene
from evenhand.restaurant.simulation.clock import untimed
from evenhand.restaurant.simulation.physics import Physics
from evenhand.training import train
from evenhand.training.settings import settings_of

STEP = mujoco.mjtTimer.mjTIMER_STEP


def ticks() -> bool:
    """Whether MuJoCo measures the time of a step."""
    model = scene.model()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=50)
    assert data.timer[STEP].number == 50
    return data.timer[STEP].duration > 0.0


def test_without_a_clock_and_with_it_again():
    assert ticks()
    with untimed():
        assert not ticks()
        with untimed():
            assert not ticks()
        assert not ticks()
    assert ticks()


def test_it_comes_back_after_an_error():
    with pytest.raises(KeyError), untimed():
        raise KeyError
    assert ticks()


def test_it_comes_back_when_the_last_thread_is_done():
    first_in, second_in, first_out = (threading.Event() for _ in range(3))

    def first():
        with untimed():
            first_in.set()
            second_in.wait(10)
        first_out.set()

    thread = threading.Thread(target=first)
    thread.start()
    first_in.wait(10)
    with untimed():
        second_in.set()
        first_out.wait(10)
        assert not ticks()
    thread.join()
    assert ticks()


def test_somebodys_own_clock_is_asked():
    asked = []
    mujoco.set_mjcb_time(lambda: float(len(asked.append(1) or asked)))
    try:
        with untimed():
            assert ticks()
        assert asked
    finally:
        mujoco.set_mjcb_time(None)
    assert ticks()


def test_the_usual_clock_that_is_set_meanwhile_stays():
    with untimed():
        mujoco.set_mjcb_time(None)
        with untimed():
            assert not ticks()
    assert ticks()


def test_a_clock_that_is_set_meanwhile_stays():
    asked = []
    try:
        with untimed():
            mujoco.set_mjcb_time(lambda: float(len(asked.append(1) or asked)))
        assert ticks()
        assert asked
    finally:
        mujoco.set_mjcb_time(None)


@pytest.fixture
def while_running(monkeypatch):
    """Whether there is a clock whenever a method or function of this name is called."""
    heard: list[bool] = []

    def listen(owner: object, name: str) -> list[bool]:
        original = getattr(owner, name)

        def called(*args, **named):
            heard.append(ticks())
            return original(*args, **named)

        monkeypatch.setattr(owner, name, called)
        return heard

    return listen


def test_environments_step_without_a_clock(while_running):
    heard = while_running(Batch, "rollout")
    Physics(2).walk(None, 10)
    assert heard == [False, False]
    assert ticks()


def test_training_serves_without_a_clock(while_running):
    settings = settings_of("service", "ppo", "service", epochs=1)
    heard = while_running(driving, "serve")
    list(train.train(settings, detector_file.load(detector_file.SHIPPED), threads=2))
    assert heard
    assert not any(heard)
    assert ticks()
