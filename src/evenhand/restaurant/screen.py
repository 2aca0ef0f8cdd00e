"""Pictures of the restaurant, drawn by MuJoCo's classic renderer through OpenGL.

MuJoCo chooses how it reaches OpenGL when it is first imported, by the environment variable
MUJOCO_GL. Where that is not set and Linux has no display, the only way that works is EGL; then
the first screen sets MUJOCO_GL=egl and lets MuJoCo choose again. What draws nothing never
touches OpenGL, so that simulating and learning need none of its libraries.
"""

from __future__ import annotations

import copy
import importlib
import os
import sys

import mujoco
import numpy as np

from evenhand.errors import InputError, unknown
from evenhand.restaurant import dressing, scene
from evenhand.restaurant.figures import Figures
from evenhand.restaurant.layout import Places
from evenhand.restaurant.props import INDOORS
from evenhand.restaurant.world import World

_HIDDEN = 5
"""Geom group that no camera shows."""


class Screen:
    """Takes pictures with one camera. Each screen has a model and a renderer of its own.

    Attributes:
        camera: one of ``dressing.CAMERAS``.
        width: of a picture, pixels.
        height: of a picture, pixels.
    """

    def __init__(
        self, camera: str = "room", width: int = 640, height: int = 480, smooth: bool = True
    ) -> None:
        """Set up the camera and its renderer.

        Args:
            camera: one of ``dressing.CAMERAS``.
            width: pixels.
            height: pixels.
            smooth: draw edges without steps; without it drawing is about twice as fast.

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
                raise InputError(f"{name} of the picture is {value}: give 1 to {most} pixels")
        self.camera, self.width, self.height = camera, width, height
        self._model = copy.copy(scene.model(dressed=True))
        # the renderer allots its buffer by these numbers: no more than is needed
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = width, height
        # facets of round things: as few as the eye forgives at this size
        facets = round((12 if camera == "room" else 16) * min(max(height / 480, 1.0), 2.0) / 2)
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
        renderer = _renderer(self._model, width, height)
        # five to seven times faster without
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._renderer: mujoco.Renderer | None = renderer

    def picture(self, world: World, lane: int, setups: Places, row: int) -> np.ndarray:
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
        if self._renderer is None:
            raise RuntimeError("the screen is closed: make a new one")
        self._figures.show(setups, row)
        data = self._data
        data.qpos[:] = robot
        data.mocap_pos[:, :2] = setups.position[row]
        data.mocap_pos[:, 2] = scene.FOOTPRINT_HEIGHT
        data.mocap_quat[:] = 0.0
        data.mocap_quat[:, 0] = np.cos(setups.facing[row] / 2)
        data.mocap_quat[:, 3] = np.sin(setups.facing[row] / 2)
        guests = setups.position[row]
        dressing.aim(self._model, self.camera, data.qpos[:2], guests, setups.start[row])
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_camlight(self._model, data)
        self._model.geom_group[:] = np.where(self._in_view(), self._groups, _HIDDEN)
        self._renderer.update_scene(data, self.camera, self._options)
        return self._renderer.render()

    def _in_view(self) -> np.ndarray:
        """Which geoms may be seen; drawing costs by the geom, in view or not. Bool [geoms]."""
        model, data = self._model, self._data
        index = model.camera(self.camera).id
        right, up, back = (
            (data.geom_xpos - data.cam_xpos[index]) @ data.cam_xmat[index].reshape(3, 3)
        ).T
        reach = np.where(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE, np.inf, model.geom_rbound)
        tall = np.tan(np.deg2rad(model.cam_fovy[index]) / 2)
        wide = tall * self.width / self.height
        seen = -back > -reach
        for across, share in ((right, wide), (up, tall)):
            seen &= np.abs(across) < -back * share + reach * np.hypot(1.0, share)
        return seen

    def close(self) -> None:
        """Free the renderer; a second call does nothing."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def _renderer(model: mujoco.MjModel, width: int, height: int) -> mujoco.Renderer:
    chosen = os.environ.get("MUJOCO_GL")
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    try:
        if sys.platform.startswith("linux") and not chosen and not display:
            os.environ["MUJOCO_GL"] = "egl"
            importlib.reload(mujoco.rendering.classic.gl_context)
        return mujoco.Renderer(model, height, width)
    except (ImportError, AttributeError, RuntimeError, OSError, mujoco.FatalError) as error:
        if not chosen:
            # whoever imports MuJoCo next must not stumble over a choice that does not work
            os.environ.pop("MUJOCO_GL", None)
        raise InputError(
            "this machine cannot draw pictures, for OpenGL does not start: install the Debian "
            "packages libegl1 libegl-mesa0 libgl1-mesa-dri, and leave MUJOCO_GL unset or set it "
            "to egl"
        ) from error
