"""MuJoCo Studio's web viewer on a shift.

The browser draws; this process sends it the model once a service and the state sixty times a
second, and needs neither display nor graphics card. Studio's own stepping is replaced by the
shift's: what is dragged, pushed or set in the viewer moves the picture, never the physics.
"""

from __future__ import annotations

import contextlib
import errno
import io
import logging
import socket
import threading
import time
from collections.abc import Callable

import mujoco
import numpy as np
from mujoco.studio import (
    app,
    endpoints,
    launch_thread,
    messages,
    plugin,
    sim,  # type: ignore[attr-defined]  # exists only once Studio is loaded
    sim_history,
    step_control,
    viewer_protocol,
    web_viewer,
)
from mujoco.studio.web import web_server

from evenhand.core.errors import InputError
from evenhand.restaurant import floor_plan
from evenhand.restaurant.live import words
from evenhand.restaurant.live.browser_models import Wardrobe
from evenhand.restaurant.live.panel import FasterSnapshot, LookedAtEvent, MomentSnapshot, Panel
from evenhand.restaurant.live.shift import Shift

HOST = "127.0.0.1"
_REST = 1.0
"""Seconds for which the end of a service stays in sight."""
_BEHIND = 0.1
"""Seconds of lateness that are caught up with; after more, time goes on from where it is."""
_KEPT_MODELS = 96 * 2**20
"""Bytes of models that the server keeps; a slow browser asks late, for some of long ago."""
_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


class Stage(step_control.StepControl):
    """Steps a shift in real time, and shows its state; runs beside the viewer.

    Attributes:
        shift: what is shown.
        model: what the browser draws next.
    """

    def __init__(
        self,
        shift: Shift,
        told: Callable[[str], None],
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Prepare.

        Args:
            shift: what is shown.
            told: is told of every service that has ended, in one line.
            clock: seconds that pass.
            sleep: lets some of them pass.
        """
        super().__init__()
        self.shift = shift
        self._told, self._clock, self._sleep = told, clock, sleep
        self._wardrobe = Wardrobe()
        self.model = self._wardrobe.model(shift.now)
        self._faster = 1
        self._due = self._clock()
        self._rested = 0.0
        self._awaited = True

    def raise_curtain(self) -> None:
        """Show the present service from a model of its own, and announce that of the next."""
        self.handle.set_model(self.model)
        self.model = self._wardrobe.model(self.shift.coming)
        self.handle.send_to_viewer(messages.PreloadModelEvent(self.model))
        self._show()
        self._tell()  # a robot may respond at once

    def _show(self) -> None:
        handle, data = self.handle, self.shift.data
        assert handle.model is not None
        assert handle.data is not None
        state = np.empty(mujoco.mj_stateSize(handle.model, _STATE))
        mujoco.mj_getState(handle.model, data, state, _STATE)
        mujoco.mj_setState(handle.model, handle.data, state, _STATE)
        handle.send_to_viewer(MomentSnapshot(self.shift.moment, self._faster))

    def _advance(self, at_once: bool) -> None:
        """One physics step; after the end of a service one step of rest, or the next at once."""
        shift = self.shift
        if shift.outcome is None:
            shift.step()
            self._show()
            self._tell()
            return
        self._rested += floor_plan.TIMESTEP
        if at_once or self._rested >= _REST:
            shift.proceed()
            self.raise_curtain()

    def _tell(self) -> None:
        if self.shift.outcome is not None:
            self._told(words.line(self.shift.outcome, self.shift.cast.world.scheme))
            self._rested = 0.0

    @messages.handler(priority=messages.Priority.INTERNAL)
    def _on_step(self, event: messages.StepEvent) -> None:
        del event
        control, now = self.step_control, self._clock()
        if self._awaited or control.get_pause_state() != sim.PauseState.UNPAUSED:
            if control.consume_single_step_request():
                self._advance(at_once=True)
            self._due = now + floor_plan.TIMESTEP
        else:
            pace = floor_plan.TIMESTEP / (self._faster * control.get_speed() / 100.0)
            self._due = min(max(self._due, now - max(_BEHIND, pace)), now + pace)
            while self._due <= now:
                self._due += pace
                self._advance(at_once=False)
        # the viewer's thread needs its turn, and there is no hurry before the next step is due
        self._sleep(min(max(self._due - now, 0.001), floor_plan.TIMESTEP))

    @messages.handler
    def on_looked_at(self, event: LookedAtEvent) -> None:
        """Begin: whoever opens the page first sees the first service from its beginning."""
        del event
        self._awaited = False

    @messages.handler
    def on_faster(self, snapshot: FasterSnapshot) -> None:
        """Go faster than real time."""
        self._faster = snapshot.faster
        self.handle.send_to_viewer(MomentSnapshot(self.shift.moment, self._faster))

    @messages.handler
    def on_load_model(self, event: messages.LoadModelEvent) -> bool:
        """Keep the restaurant, whatever is dropped on the page."""
        del event
        return True

    @messages.handler
    def on_reset(self, event: messages.ResetEvent) -> bool:
        """Show the present service from its beginning."""
        del event
        self.shift.restart()
        self._show()
        return True


class LoopbackViewer(web_viewer.WebViewer):
    """Studio's web viewer, heard by this machine alone, and silent in the terminal."""

    @property
    def _host(self) -> str:
        return HOST

    @_host.setter
    def _host(self, value: str) -> None:
        """Studio asks for every interface, and has no setting for it."""

    def _start_server(self) -> None:
        self._http_sock = listening(self._http_sock, self.config.http_port)
        self._http_port = self._http_sock.getsockname()[1]
        super()._start_server()
        assert self._web_server is not None
        self._web_server.model_cache_bytes = _KEPT_MODELS

    @messages.handler(priority=messages.Priority.INTERNAL)
    def _on_post_model(self, event: messages.PostModelEvent) -> None:
        del event
        self._update_model()

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://{HOST}:{self._http_port}/"


def listening(bound: socket.socket, wanted: int) -> socket.socket:
    """A socket that listens, so that its port is taken: the one given, or one on the next port.

    Studio binds a port and listens later; until then Linux lets another program bind it, too, and
    whoever listens first has it.

    Raises:
        InputError: when the port that was asked for is taken; 0 asks for none.
    """
    while True:
        try:
            bound.listen()
            return bound
        except OSError as error:
            bound.close()
            if error.errno != errno.EADDRINUSE:
                raise
            if wanted:
                said = f"port {wanted} is in use: give another one, or leave --port out"
                raise InputError("unavailable port", said) from error
        bound = web_server.bind_public_socket(HOST, 0)


def show(
    shift: Shift, title: str, port: int, told: Callable[[str], None], *, browser: bool
) -> None:
    """Show a shift until the viewer is closed.

    Args:
        shift: what is shown.
        title: of the panel.
        port: to listen on, 0 for the first free one from 8080.
        told: is told the address first, and of every service that has ended, a line each.
        browser: open one, if this machine has a display.
    """
    logging.getLogger("WebServer").setLevel(logging.WARNING)
    # Studio's server lets errors escape of pages that go away just while it stops
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)
    config = viewer_protocol.ViewerConfig(
        title="Evenhand", gfx="web", http_port=port, open_browser=browser
    )
    stage = Stage(shift, told)
    looks = app.Config(show_options=False, show_inspector=False, show_toolbar=True)
    parts: list[plugin.Plugin] = [
        app.App(looks),
        stage,
        sim_history.SimHistory(),
        Panel(title, shift.cast.world.scheme),
    ]
    viewers, sims = plugin.split_plugins(parts)
    open_now = threading.Event()
    address: list[str] = []

    def look(endpoint: endpoints.ViewerEndpoint) -> None:
        try:
            # Studio prints a banner of its own
            with contextlib.redirect_stdout(io.StringIO()):
                viewer = LoopbackViewer(config, endpoint, model=stage.model, plugins=viewers)
            address.append(viewer.address)
        finally:
            open_now.set()
        viewer_protocol.run_viewer_loop(viewer)

    with launch_thread.launch_thread(look, sim_plugins=sims) as handle:
        open_now.wait()
        for url in address:
            told(f"open {url} in a browser; Ctrl-C ends")
        stage.raise_curtain()
        while handle.is_running():
            handle.sync()
