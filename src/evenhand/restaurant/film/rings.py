"""Rings on the floor at 1.5, 1.0 and 0.5 m around the person who asks: the paper's limits.

They are drawn in the scene itself, so that perspective, furniture and people are right; each has
a line of its own, so that they can be told apart without colour.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import mujoco
import numpy as np

from evenhand.restaurant.drawing import dressing
from evenhand.restaurant.simulation import scene


@dataclass(frozen=True)
class Ring:
    """One ring.

    Attributes:
        radius: metres.
        dashes: pieces that the line consists of; 1 is an unbroken line.
        drawn: share of a piece that is drawn.
        colour: red, green, blue as they are seen, 0 to 255.
    """

    radius: float
    dashes: int
    drawn: float
    colour: tuple[int, int, int]


RINGS = (
    Ring(1.5, 1, 1.0, (20, 95, 215)),
    Ring(1.0, 20, 0.62, (175, 25, 165)),
    Ring(0.5, 22, 0.34, (205, 22, 22)),
)
"""Farthest and nearest proper distance of a response, and where risk begins."""
THICK = {"room": 0.055, "robot": 0.03, "guest": 0.03}
"""Width of the lines for each camera, metres."""
_HEIGHT = 0.014
"""Above the floor: over the soft spots that lie there."""
_CORNERS = 120
"""Of a whole ring."""
_SHINE = 1.6
"""How much brighter the restaurant's light and the lines' own make them."""


@functools.cache
def model(thick: float) -> mujoco.MjModel:
    """The dressed restaurant with rings around the person; callers that change it copy it first.

    Args:
        thick: width of the lines, metres.
    """
    spec = dressing.build()
    body = spec.body(scene.guest_name(scene.PERSON))
    for number, ring in enumerate(RINGS):
        corners, faces = _shape(ring, thick)
        name = f"ring{number}"
        mesh = spec.add_mesh(name=name, uservert=corners.ravel(), userface=faces.ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            pos=[0.0, 0.0, _HEIGHT - body.pos[2]],
            rgba=[*(channel / 255 / _SHINE for channel in ring.colour), 1.0],
            material="lamp",
            contype=0,
            conaffinity=0,
            mass=0.0,
            group=1,
        )
    return spec.compile()


def _shape(ring: Ring, thick: float) -> tuple[np.ndarray, np.ndarray]:
    """A flat band: corners [C, 3] in metres, and triangles [T, 3] that can be seen from above."""
    pieces = max(2, round(_CORNERS / ring.dashes * ring.drawn))
    begin = np.arange(ring.dashes) * 2 * np.pi / ring.dashes
    span = ring.drawn * 2 * np.pi / ring.dashes
    angle = begin[:, None] + np.linspace(0.0, span, pieces + 1)
    inner, outer = ring.radius - thick / 2, ring.radius + thick / 2
    way = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
    corners = np.stack([inner * way, outer * way], axis=2).reshape(-1, 3)
    # corners 2 i and 2 i + 1 lie side by side; no band leads from one dash to the next
    i = 2 * np.arange(ring.dashes * (pieces + 1)).reshape(ring.dashes, -1)[:, :-1].reshape(-1)
    faces = np.stack([i, i + 1, i + 3, i, i + 3, i + 2], axis=1).reshape(-1, 3)
    return corners, faces
