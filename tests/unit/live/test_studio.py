"""The loop that shows a shift, with a fake viewer at the other end and a clock of its own."""

import socket
from contextlib import closing
from typing import Any

import mujoco
import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.restaurant.live import shift, words
from evenhand.restaurant.live.browser_models import Wardrobe
from evenhand.restaurant.live.shift import Shift

studio = pytest.importorskip("evenhand.restaurant.live.studio")
panel = pytest.importorskip("evenhand.restaurant.live.panel")
from mujoco.studio import launch_thread, messages, viewer_handle  # noqa: E402

STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


class Theatre:
    """A stage, a handle and the far end of its wires."""

    def __init__(self, robot: str = "even", seed: int = 0) -> None:
        self.now = 100.0
        self.told: list[str] = []
        self.shift = Shift(shift.scripted(robot, 1.0, "even"), seed)
        self.stage = studio.Stage(
            self.shift, self.told.append, clock=lambda: self.now, sleep=lambda seconds: None
        )
        self.viewer, sim_end = launch_thread.make_thread_endpoints()
        self.handle = viewer_handle.ViewerHandle(sim_end, sim_plugins=[self.stage])
        self.stage.raise_curtain()
        self.steps = 0

    def wait(self, seconds: float, *sent: Any) -> int:
        """Let time pass, a sync every 5 ms; returns how many physics steps were taken."""
        for message in sent:
            self.viewer.send_to_sim(message)
        before, number = self.shift.moment.steps, self.shift.moment.number
        for _ in range(round(seconds / 0.005)):
            self.now += 0.005
            self.handle.sync()
        assert self.shift.moment.number == number, "wait for less"
        return self.shift.moment.steps - before

    def play(self) -> None:
        """To the end of the service."""
        while self.shift.outcome is None:
            self.now += 0.02
            self.handle.sync()

    @property
    def events(self) -> list[Any]:
        return self.viewer.get_sim_events()


@pytest.fixture
def theatre():
    return Theatre()


@pytest.fixture
def playing(theatre):
    theatre.wait(0.005, panel.LookedAtEvent())
    theatre.wait(0.02)
    return theatre


def pause(*, speed: float = 100.0, paused: bool = False) -> Any:
    state = studio.sim.PauseState
    return messages.StepControlSnapshot(
        pause_state=state.NORMAL_PAUSED if paused else state.UNPAUSED, speed=speed
    )


def test_it_begins_when_somebody_looks(theatre):
    assert theatre.wait(1.0) == 0
    assert theatre.wait(1.0, panel.LookedAtEvent()) == pytest.approx(50, abs=1)


def test_real_time_slower_and_faster(playing):
    assert playing.wait(0.4) == pytest.approx(20, abs=1)
    assert playing.wait(0.4, pause(speed=25.0)) == pytest.approx(5, abs=1)
    assert playing.wait(0.2, pause(), panel.FasterSnapshot(4)) == pytest.approx(40, abs=2)


def test_pause_and_single_steps(playing):
    assert playing.wait(1.0, pause(paused=True)) == 0
    for _ in range(3):
        assert playing.wait(1.0, messages.SingleStepEvent()) == 1
    assert playing.wait(0.2, pause()) == pytest.approx(10, abs=1)


def test_lost_time_is_not_made_up_for(playing):
    before = playing.shift.moment.steps
    playing.now += 60.0
    playing.handle.sync()
    assert 1 <= playing.shift.moment.steps - before <= 6


def test_the_viewer_gets_the_state_and_the_moment_of_the_shift(playing):
    playing.viewer.get_sim_snapshots()
    playing.wait(0.1)
    got = {type(one): one for one in playing.viewer.get_sim_snapshots()}
    model, data = playing.handle.model, playing.shift.data
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    np.testing.assert_array_equal(got[messages.StateSnapshot].state, state)
    assert got[panel.MomentSnapshot].moment.steps == playing.shift.moment.steps > 0


def test_after_a_service_and_a_rest_comes_the_next_with_the_model_that_was_announced(playing):
    first, announced = [one.model for one in playing.events if hasattr(one, "model")]
    playing.play()
    assert playing.told == [words.line(playing.shift.outcome)]
    assert playing.wait(0.9) == 0
    assert playing.shift.moment.number == 1
    for _ in range(40):
        playing.now += 0.005
        playing.handle.sync()
    assert playing.shift.moment.number == 2
    now = playing.events
    assert [type(one) for one in now if hasattr(one, "model")] == [
        messages.ModelEvent,
        messages.PreloadModelEvent,
    ]
    assert next(one.model for one in now if isinstance(one, messages.ModelEvent)) is announced
    assert first is not announced
    assert not np.array_equal(first.geom_rgba, announced.geom_rgba), "other guests, other looks"


def test_paused_at_the_end_a_single_step_goes_to_the_next_service(playing):
    playing.play()
    playing.viewer.send_to_sim(pause(paused=True))
    playing.handle.sync()
    assert playing.shift.moment.number == 1
    playing.viewer.send_to_sim(messages.SingleStepEvent())
    playing.handle.sync()
    assert (playing.shift.moment.number, playing.shift.moment.steps) == (2, 0)


def test_what_is_done_in_the_viewer_changes_no_fact():
    quiet, disturbed = Theatre(seed=5), Theatre(seed=5)
    for one in (quiet, disturbed):
        one.wait(0.02, panel.LookedAtEvent())
    model = disturbed.handle.model
    options = mujoco.MjOption()
    options.gravity[:] = (5.0, 5.0, 0.0)
    options.timestep = 0.001
    size = mujoco.mj_stateSize(model, STATE)
    wild = np.random.default_rng(0).normal(size=size)
    force = int(mujoco.mjtState.mjSTATE_XFRC_APPLIED)
    pushed = np.full(mujoco.mj_stateSize(model, force), 1e4)
    while disturbed.shift.outcome is None:
        disturbed.wait(
            0.02,
            messages.StateEvent(state=wild, state_sig=STATE),
            messages.PerturbSnapshot(state=pushed, state_sig=force),
            messages.MjOptionSnapshot(opt=options),
            messages.LoadModelEvent(path="other.xml"),
        )
    quiet.play()
    assert disturbed.told == quiet.told
    assert disturbed.handle.model is model


def test_reset_shows_the_service_from_its_beginning(playing):
    playing.wait(0.4)
    playing.viewer.send_to_sim(pause(paused=True))
    playing.viewer.send_to_sim(messages.ResetEvent())
    playing.handle.sync()
    assert (playing.shift.moment.number, playing.shift.moment.steps) == (1, 0)
    start = playing.shift.now.drawn.setups.start[playing.shift.now.row]
    np.testing.assert_array_equal(playing.handle.data.qpos[:2], start)


def test_a_robot_that_responds_at_once_is_told_of_too():
    eager = Theatre("ableist", seed=2)
    eager.wait(0.005, panel.LookedAtEvent())
    for _ in range(6):
        eager.play()
        while eager.shift.outcome is not None:
            if "after 0 steps" in eager.told[-1]:
                break
            eager.now += 0.02
            eager.handle.sync()
        else:
            continue
        break
    else:
        pytest.fail("nobody was answered at once: choose another seed")
    assert len(eager.told) == eager.shift.moment.number


# --- the model that the browser draws ---


def test_the_model_shows_the_guests_where_they_are_and_rings_around_who_asks():
    seen = Shift(shift.scripted("even", 1.0, "even"), 0)
    model = Wardrobe().model(seen.now)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    before = data.xpos[1:].copy()  # as the browser shows it until the first state arrives
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, seen.data, state, STATE)
    mujoco.mj_setState(model, data, state, STATE)
    mujoco.mj_forward(model, data)
    robot = model.body("robot").id - 1
    np.testing.assert_allclose(np.delete(before - data.xpos[1:], robot, axis=0), 0.0, atol=1e-12)
    person = seen.now.drawn.setups.position[seen.now.row, 0]
    np.testing.assert_allclose(data.body("guest0").xpos[:2], person)
    for radius in (0.5, 1.0, 1.5):
        ring = model.geom(f"ring_{radius}").id
        mesh = model.geom_dataid[ring]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        turn = data.geom_xmat[ring].reshape(3, 3)
        points = model.mesh_vert[first : first + count] @ turn.T + data.geom_xpos[ring]
        away = np.hypot(*(points[:, :2] - person).T)
        assert away.min() == pytest.approx(radius - 0.012, abs=2e-3)
        assert away.max() == pytest.approx(radius + 0.012, abs=2e-3)
        assert abs(points[:, 2]).max() < 0.03, "flat on the floor"


def test_the_robots_camera_moves_with_the_robot_and_looks_at_the_person():
    seen = Shift(shift.scripted("even", 1.0, "even"), 0)
    model = Wardrobe().model(seen.now)
    data = mujoco.MjData(model)
    data.qpos[:] = (1.0, -0.5, 0.7)
    data.mocap_pos[0] = (3.0, 1.0, 0.3)
    mujoco.mj_forward(model, data)
    camera = model.camera("robot").id
    eye = data.cam_xpos[camera]
    assert np.hypot(*(eye[:2] - data.qpos[:2])) == pytest.approx(np.hypot(1.5, 0.5))
    ahead = -data.cam_xmat[camera].reshape(3, 3)[:, 2]
    towards = np.array([3.0, 1.0, 0.3]) - eye
    np.testing.assert_allclose(ahead, towards / np.linalg.norm(towards), atol=1e-9)


def test_faces_are_seen_and_what_hides_the_room_is_not():
    model = Wardrobe().model(Shift(shift.scripted("even", 1.0, "even"), 0).now)
    assert model.geom("look_guest0_eye_left").group[0] == 0
    assert model.geom("look_south_ceiling").group[0] == 4
    assert all(model.geom_group[model.geom_rgba[:, 3] == 0.0] == 5)


class TestAPortThatTwoHaveBound:
    """Linux lets them, as long as neither listens."""

    @pytest.fixture
    def rival(self, monkeypatch):
        """Another program binds the first port that the viewer binds, and listens at once."""
        bind, rivals = studio.web_server.bind_public_socket, []

        def bind_too(host: str, port: int = 0) -> socket.socket:
            ours = bind(host, port)
            if not rivals:
                rivals.append(socket.socket())
                rivals[0].setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                rivals[0].bind(ours.getsockname())
                rivals[0].listen()
            return ours

        monkeypatch.setattr(studio.web_server, "bind_public_socket", bind_too)
        yield rivals
        rivals[0].close()

    def test_whoever_comes_later_takes_another(self, rival, monkeypatch):
        monkeypatch.setattr(studio.web_server.WebServer, "start", lambda server: None)
        with closing(shown()) as viewer:
            port = int(viewer.address.removeprefix("http://127.0.0.1:").removesuffix("/"))
            assert port != rival[0].getsockname()[1]
            socket.create_connection(("127.0.0.1", port)).close()

    def test_one_that_was_asked_for_is_said_to_be_in_use(self, rival):
        bound = studio.web_server.bind_public_socket(studio.HOST)
        port = rival[0].getsockname()[1]
        with pytest.raises(InputError, match=f"port {port} is in use: give another one"):
            studio.listening(bound, port)


def shown() -> Any:
    """A viewer of one service."""
    config = studio.viewer_protocol.ViewerConfig(gfx="web", open_browser=False)
    endpoint, _ = launch_thread.make_thread_endpoints()
    model = Wardrobe().model(Shift(shift.scripted("even", 1.0, "even"), 0).now)
    return studio.LoopbackViewer(config, endpoint, model=model, plugins=[])
