"""What the environments draw: nothing before the first picture is asked for."""

from __future__ import annotations

from typing import Any

import numpy as np

from evenhand.core.errors import unknown
from evenhand.restaurant import floor_plan
from evenhand.restaurant.drawing import dressing
from evenhand.restaurant.env_base import RestaurantSettings, Source

MODES = ["rgb_array"]
RENDERING: dict[str, Any] = {"render_modes": MODES, "render_fps": 10}
"""As Gymnasium declares it."""


def rendering(settings: RestaurantSettings) -> dict[str, Any]:
    """The same of an environment with these settings."""
    return {**RENDERING, "render_fps": round(1 / (floor_plan.TIMESTEP * settings.world.interval))}


class Pictures:
    """Pictures of services by one camera."""

    def __init__(self, mode: str | None, camera: str) -> None:
        """Check that pictures can be drawn, if there are to be any.

        Nothing is opened yet: threads of OpenGL would not follow into a forked process.

        Args:
            mode: None or "rgb_array".
            camera: which camera is shown, see ``dressing.CAMERAS``.

        Raises:
            InputError: for an unknown mode or camera, or where OpenGL cannot be found.
        """
        if mode is not None and mode not in MODES:
            raise unknown("render mode", mode, MODES, "render_mode")
        if camera not in dressing.CAMERAS:
            raise unknown("camera", camera, dressing.CAMERAS)
        self.camera = camera
        self._screen: Any = None
        if mode is not None:
            from evenhand.restaurant.drawing import renderer

            renderer.find_opengl()

    def of(self, source: Source, lane: int) -> np.ndarray:
        """A lane as it is now, uint8 [height, width, 3].

        Raises:
            InputError: in another thread than that of the first picture, in a process that was
                forked since, or where OpenGL does not start.
        """
        if self._screen is None:
            from evenhand.restaurant.drawing.renderer import Screen

            self._screen = Screen(self.camera)
        return self._screen.picture(source.lanes.physics, lane, *source.current(lane))

    def close(self) -> None:
        """Free the renderer.

        Raises:
            InputError: in another thread than that of the first picture.
        """
        if self._screen is not None:
            self._screen.close()
            self._screen = None

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_screen": None}
