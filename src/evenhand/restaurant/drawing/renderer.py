"""Pictures of the restaurant, drawn by MuJoCo's classic renderer through OpenGL.

MuJoCo chooses how it reaches OpenGL when it is first imported, by the environment variable
MUJOCO_GL. Where that is not set and Linux has no display, the only way that works is EGL; then
the first screen sets MUJOCO_GL=egl and lets MuJoCo choose again. What draws nothing never
touches OpenGL, so that simulating and learning need none of its libraries.
"""

from __future__ import annotations

import copy
import functools
import importlib
import os
import sys
import threading
from collections.abc import Callable
from typing import TypeVar

import mujoco
import numpy as np
from mujoco.rendering.classic import gl_context

from evenhand.core import forks
from evenhand.core.errors import InputError, unknown
from evenhand.restaurant.drawing import dressing
from evenhand.restaurant.drawing.guests import Figures
from evenhand.restaurant.drawing.props import INDOORS
from evenhand.restaurant.simulation import scene
from evenhand.restaurant.simulation.layout import Places
from evenhand.restaurant.simulation.physics import Physics

_HIDDEN = 5
"""Geom group that no camera shows."""
_SMALLEST = 1.5
"""Radius of the smallest geoms that are drawn, pixels."""
_ROBOT_BOX = np.array([(x, y, z) for x in (-0.45, 0.45) for y in (-0.45, 0.45) for z in (0.0, 1.3)])
"""Corners of a box around the robot, whichever way it turns; metres from its place on the floor."""
T = TypeVar("T")
Part = tuple[int, int, int, int]
"""Of a picture: first column, first row from below, number of columns, number of rows; pixels."""


class Screen:
    """Takes pictures with one camera. Each screen has a model and a renderer of its own.

    Attributes:
        camera: one of ``dressing.CAMERAS``.
        width: of a picture, pixels.
        height: of a picture, pixels.
    """

    def __init__(
        self,
        camera: str = "room",
        width: int = 640,
        height: int = 480,
        smooth: bool = True,
        model: mujoco.MjModel | None = None,
    ) -> None:
        """Set up the camera and its renderer.

        Args:
            camera: one of ``dressing.CAMERAS``.
            width: pixels.
            height: pixels.
            smooth: draw edges without steps; without it drawing is about twice as fast.
            model: a dressed restaurant in which more is to be seen; the usual one by default.

        Raises:
            InputError: for an unknown camera, a size that cannot be drawn, or a machine that
                lacks OpenGL.
        """
        if camera not in dressing.CAMERAS:
            raise unknown("camera", camera, dressing.CAMERAS)
        for name, value, most in zip(
            ("width", "height"), (width, height), dressing.LARGEST, strict=True
        ):
            if not 1 <= value <= most:
                raise InputError(
                    f"range {name}", f"{name} of the picture is {value}: give 1 to {most} pixels"
                )
        self.camera, self.width, self.height = camera, width, height
        self._model = copy.copy(model or dressing.model())
        # the renderer allots its buffer by these numbers: no more than is needed
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = width, height
        # facets of round things: as few as the eye forgives at this size
        facets = round(6 * min(max(height / 480, 1.0), 2.0))
        quality = self._model.vis.quality
        quality.numslices, quality.numstacks, quality.numquads = 2 * facets, facets, 1
        quality.offsamples = 4 if smooth else 0
        quality.shadowsize = 0  # no shadows, no 64 MB for them
        self._data = mujoco.MjData(self._model)
        self._figures = Figures(self._model, scene.PERSON)
        self._options = mujoco.MjvOption()
        self._options.geomgroup[INDOORS] = camera != "room"
        self._options.sitegroup[:] = 0
        self._groups = self._model.geom_group.copy()
        self._robots = self._model.geom_bodyid == self._model.body("robot").id
        self._still: np.ndarray | None = None
        renderer = _renderer(self._model, width, height)
        self._thread = threading.current_thread()
        # five to seven times faster without
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._renderer: mujoco.Renderer | None = renderer

    def picture(self, world: Physics, lane: int, setups: Places, row: int) -> np.ndarray:
        """A service as it stands now.

        Args:
            world: the simulations.
            lane: which of them.
            setups: the set-ups that simulations were placed by.
            row: which of them belongs to the lane.

        Returns:
            Red, green, blue, uint8 [height, width, 3].

        Raises:
            RuntimeError: after ``close``.
        """
        return self.still(world.state[lane], setups, row)

    def still(self, robot: np.ndarray, setups: Places, row: int) -> np.ndarray:
        """A service with the robot at a pose that was recorded; guests keep their places.

        Args:
            robot: x, y (m) and yaw (rad) of the robot, shape (3,).
            setups: services.
            row: which of them.

        Returns:
            Red, green, blue, uint8 [height, width, 3].

        Raises:
            RuntimeError: after ``close``.
        """
        self._place(robot, setups, row)
        return self._draw(self._in_view())

    def begin(self, setups: Places, row: int) -> None:
        """Begin to show one service in pictures that follow each other, see ``move``.

        Raises:
            RuntimeError: after ``close``.
        """
        self._service = setups, row
        self._place(np.array([*setups.start[row], 0.0]), setups, row)
        self._still = None
        if self.camera != "robot":
            self._still = self._draw(self._in_view() & ~self._robots)

    def move(self, robot: np.ndarray) -> np.ndarray:
        """The service that was begun with the robot at a pose; as ``still``, but faster.

        Two cameras do not move: what lies before them is drawn once, and then only the part of
        the picture where the robot is.

        Args:
            robot: x, y (m) and yaw (rad) of the robot, shape (3,).

        Returns:
            Red, green, blue, uint8 [height, width, 3], the caller's own.

        Raises:
            RuntimeError: after ``close``.
        """
        self._data.qpos[:] = robot
        mujoco.mj_kinematics(self._model, self._data)
        if self._still is None:
            self._aim(*self._service)
            return self._draw(self._in_view())
        left, low, wide, tall = self._around(robot)
        picture = self._still.copy()
        if wide > 0 and tall > 0:
            top = self.height - low - tall
            seen = self._in_view((left, low, wide, tall))
            picture[top : top + tall, left : left + wide] = self._draw(
                seen, (left, low, wide, tall)
            )
        return picture

    def _place(self, robot: np.ndarray, setups: Places, row: int) -> None:
        """Put everything where it belongs, and point the camera."""
        self._figures.show(setups, row)
        data = self._data
        data.qpos[:] = robot
        data.mocap_pos[:, :2] = setups.position[row]
        data.mocap_pos[:, 2] = scene.FOOTPRINT_HEIGHT
        data.mocap_quat[:] = 0.0
        data.mocap_quat[:, 0] = np.cos(setups.facing[row] / 2)
        data.mocap_quat[:, 3] = np.sin(setups.facing[row] / 2)
        mujoco.mj_kinematics(self._model, data)
        self._aim(setups, row)

    def _aim(self, setups: Places, row: int) -> None:
        """Point the camera at what was placed."""
        data, guests = self._data, setups.position[row]
        dressing.aim(self._model, self.camera, data.qpos[:2], guests, setups.start[row])
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_camlight(self._model, data)

    def _draw(self, seen: np.ndarray, part: Part | None = None) -> np.ndarray:
        """The picture, or a part of it, uint8 [rows, columns, 3]."""
        renderer = self._renderer
        if renderer is None:
            raise RuntimeError("the screen is closed: make a new one")
        self._check()
        self._model.geom_group[:] = np.where(seen, self._groups, _HIDDEN)
        renderer.update_scene(self._data, self.camera, self._options)
        if part is None:
            return renderer.render()
        left, low, wide, tall = part
        for eye in renderer.scene.camera:
            pixel = (eye.frustum_top - eye.frustum_bottom) / self.height
            eye.frustum_bottom += low * pixel
            eye.frustum_top = eye.frustum_bottom + tall * pixel
            eye.frustum_center = (left + wide / 2 - self.width / 2) * pixel
            eye.frustum_width = wide * pixel / 2
        picture = np.empty((tall, wide, 3), np.uint8)
        # the renderer itself draws whole pictures only
        if renderer._gl_context:
            renderer._gl_context.make_current()
        window = mujoco.MjrRect(0, 0, wide, tall)
        mujoco.mjr_render(window, renderer.scene, renderer._mjr_context)
        mujoco.mjr_readPixels(picture, None, window, renderer._mjr_context)
        return picture[::-1]

    def _eye(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Place of the camera, its axes (right, up, back) as columns, half a picture at 1 m."""
        index = self._model.camera(self.camera).id
        axes = self._data.cam_xmat[index].reshape(3, 3)
        half = float(np.tan(np.deg2rad(self._model.cam_fovy[index]) / 2))
        return self._data.cam_xpos[index], axes, half

    def _around(self, robot: np.ndarray) -> Part:
        """The part of the picture that the robot can be in."""
        eye, axes, half = self._eye()
        corners = np.array([*robot[:2], 0.0]) + _ROBOT_BOX
        right, up, back = ((corners - eye) @ axes).T
        if (back > -0.2).any():
            return 0, 0, self.width, self.height
        scale = self.height / 2 / half
        x, y = self.width / 2 + scale * right / -back, self.height / 2 + scale * up / -back
        (left, wide), (low, tall) = (
            (first, last - first)
            for first, last in (
                (max(int(along.min()) - 2, 0), min(int(along.max()) + 3, size))
                for along, size in ((x, self.width), (y, self.height))
            )
        )
        return left, low, wide, tall

    def _in_view(self, part: Part | None = None) -> np.ndarray:
        """Which geoms may be seen; drawing costs by the geom, in view or not. Bool [geoms]."""
        model, data = self._model, self._data
        eye, axes, half = self._eye()
        right, up, back = ((data.geom_xpos - eye) @ axes).T
        reach = np.where(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE, np.inf, model.geom_rbound)
        left, low, wide, tall = part or (0, 0, self.width, self.height)
        pixel = 2 * half / self.height
        # what is too small to be made out costs as much as the rest
        seen = (-back > -reach) & (reach > _SMALLEST * pixel * np.abs(back))
        for across, first, count, size in (
            (right, left, wide, self.width),
            (up, low, tall, self.height),
        ):
            # slopes of the two sides of what is seen
            least, most = (first - size / 2) * pixel, (first + count - size / 2) * pixel
            seen &= across + back * most < reach * np.hypot(1.0, most)
            seen &= across + back * least > -reach * np.hypot(1.0, least)
        return seen

    def close(self) -> None:
        """Free the renderer; a second call does nothing.

        Raises:
            InputError: in another thread than the one that made it, and in a forked process.
        """
        if self._renderer is not None:
            self._check()
            self._renderer.close()
            self._renderer = None

    def _check(self) -> None:
        """OpenGL belongs to the process and the thread that opened it."""
        _opengl().check()
        if threading.current_thread() is not self._thread:
            raise InputError(
                "unsupported thread",
                f"the renderer belongs to thread {self._thread.name!r}, which made it with its "
                f"first picture, and {threading.current_thread().name!r} cannot use it: draw and "
                "close there, or make an environment for each thread",
            )


@functools.cache
def _opengl() -> forks.Home:
    return forks.Home("OpenGL was opened")


def find_opengl() -> None:
    """Choose how OpenGL is reached, and find it, but do not open it.

    Raises:
        InputError: when it is not there.
    """

    def find() -> None:
        if gl_context.GLContext is getattr(gl_context, "_MissingGLContext", None):
            raise ImportError("nothing was found for the value of MUJOCO_GL")

    _through_opengl(find)


def _renderer(model: mujoco.MjModel, width: int, height: int) -> mujoco.Renderer:
    _opengl().check()
    made = _through_opengl(lambda: mujoco.Renderer(model, height, width))
    forks.hold(made)
    return made


def _through_opengl(do: Callable[[], T]) -> T:
    chosen = os.environ.get("MUJOCO_GL")
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    try:
        if sys.platform.startswith("linux") and not chosen and not display:
            os.environ["MUJOCO_GL"] = "egl"
            importlib.reload(gl_context)
        return do()
    except (ImportError, AttributeError, RuntimeError, OSError, mujoco.FatalError) as error:
        if not chosen:
            # whoever imports MuJoCo next must not stumble over a choice that does not work
            os.environ.pop("MUJOCO_GL", None)
        raise InputError(
            "unavailable opengl",
            "this machine cannot draw pictures, for OpenGL does not start: install the Debian "
            "packages libegl1 libegl-mesa0 libgl1-mesa-dri, and leave MUJOCO_GL unset or set it "
            "to egl",
        ) from error
