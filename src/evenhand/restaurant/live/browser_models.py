"""What the browser draws: the dressed restaurant with the guests of one service.

Guests are dressed by changing the model, and the browser has a model whole: one for each service.
"""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from evenhand.restaurant import floor_plan
from evenhand.restaurant.drawing import dressing, guests, props
from evenhand.restaurant.live.shift import Service
from evenhand.restaurant.simulation import scene

_RINGS = ((1.5, (0.25, 0.60, 0.35)), (1.0, (0.85, 0.60, 0.15)), (0.5, (0.80, 0.20, 0.15)))


class Wardrobe:
    """Makes the model that the browser draws: the dressed one, with the guests of one service."""

    def __init__(self) -> None:
        spec = dressing.build()
        spec.visual.global_.azimuth, spec.visual.global_.elevation = 90.0, -44.0
        # far enough to the left that the panel does not cover the room
        spec.stat.extent, spec.stat.center = 14.5, [5.5, -0.5, 0.0]
        self._follow(spec)
        self._rings(spec)
        self._model = spec.compile()
        for geom in range(self._model.ngeom):
            # Studio hides this group, for it hides the room from above; faces belong to it, too
            name = self._model.geom(geom).name
            if self._model.geom_group[geom] == props.INDOORS and name.startswith("look_guest"):
                self._model.geom_group[geom] = 0
        self._groups = self._model.geom_group.copy()
        # facets of round things: coarser, for browsers without a graphics card
        quality = self._model.vis.quality
        quality.numslices, quality.numstacks, quality.numquads = 16, 8, 1
        names = [scene.guest_name(i) for i in range(floor_plan.N_GUESTS)]
        self._guests = np.array([self._model.body(name).id for name in names])
        self._figures = guests.Figures(self._model, scene.PERSON)

    @staticmethod
    def _follow(spec: mujoco.MjSpec) -> None:
        """A camera over the robot's shoulder that moves with it, in place of the one that is aimed.

        The browser has the model once a service, so nothing can be aimed while the robot drives.
        """
        spec.delete(spec.camera("robot"))
        spec.body("robot").add_camera(
            name="robot",
            pos=[-1.5, 0.5, 1.5],
            mode=mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY,
            targetbody=scene.guest_name(scene.PERSON),
            fovy=55.0,
        )

    @staticmethod
    def _rings(spec: mujoco.MjSpec) -> None:
        """Rings on the floor around who asks, at 1.5, 1.0 and 0.5 m."""
        person = spec.body(scene.guest_name(scene.PERSON))
        for radius, colour in _RINGS:
            mesh = spec.add_mesh(name=f"ring_{radius}")
            mesh.make_supertorus(32, 0.012 / radius, 1.0, 1.0)
            mesh.scale = [radius, radius, 0.3 * radius]
            person.add_geom(
                name=f"ring_{radius}",
                type=mujoco.mjtGeom.mjGEOM_MESH,
                meshname=f"ring_{radius}",
                pos=[0.0, 0.0, 0.012 - scene.FOOTPRINT_HEIGHT],
                rgba=[*colour, 1.0],
                contype=0,
                conaffinity=0,
                group=1,
            )

    def model(self, service: Service) -> mujoco.MjModel:
        """A model of its own for a service."""
        setups, row = service.drawn.setups, service.row
        self._figures.show(setups, row)
        made = copy.copy(self._model)
        # what is not to be seen costs nothing in a group that is not drawn
        made.geom_group[:] = np.where(made.geom_rgba[:, 3] == 0.0, 5, self._groups)
        # where the guests are until the first state arrives
        made.body_pos[self._guests, :2] = setups.position[row]
        half = setups.facing[row] / 2
        made.body_quat[self._guests] = np.stack(
            [np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1
        )
        for camera in ("room", "guest"):
            dressing.aim(made, camera, setups.start[row], setups.position[row], setups.start[row])
        return made
