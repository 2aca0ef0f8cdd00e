"""What the restaurant is drawn with: colours, materials, shapes, and the furniture made of them.

Everything is a primitive of MuJoCo that touches nothing and weighs nothing, so that looks never
change what happens. Lengths are in metres, colours are red, green, blue, opacity in [0, 1].
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

Rgb = tuple[float, float, float]
Point = Sequence[float] | np.ndarray

LOOKS = 1
"""Geom group of what every camera shows."""
INDOORS = 4
"""Geom group of what only cameras in the room show: what hides the room from above, or is small."""

WOOD: Rgb = (0.62, 0.42, 0.26)
DARK_WOOD: Rgb = (0.38, 0.25, 0.17)
CREAM: Rgb = (0.97, 0.93, 0.85)
SAGE: Rgb = (0.55, 0.65, 0.55)
CUSHION: Rgb = (0.78, 0.40, 0.29)
BRASS: Rgb = (0.80, 0.62, 0.30)
LEAF: Rgb = (0.33, 0.52, 0.30)
STEEL: Rgb = (0.66, 0.69, 0.72)
RUBBER: Rgb = (0.16, 0.16, 0.18)
GLOW: Rgb = (1.00, 0.86, 0.58)

TABLE_HEIGHT = 0.74
SEAT_HEIGHT = 0.46

_BOX, _BALL, _DISC, _ROD = (
    mujoco.mjtGeom.mjGEOM_BOX,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
)


def hue(rgb: Rgb, factor: float) -> Rgb:
    """The colour made lighter or darker."""
    r, g, b = (min(1.0, factor * c) for c in rgb)
    return r, g, b


def add_materials(spec: mujoco.MjSpec) -> None:
    """Surfaces: how they shine; the colour is a matter of each shape."""
    for name, specular, shininess, emission in (
        ("matt", 0.08, 0.1, 0.0),
        ("satin", 0.25, 0.4, 0.0),
        ("gloss", 0.6, 0.75, 0.0),
        ("wall", 0.0, 0.0, 0.12),
        ("pane", 0.3, 0.8, 0.45),
        ("lamp", 0.0, 0.0, 0.9),
    ):
        spec.add_material(name=name, specular=specular, shininess=shininess, emission=emission)
    spot = spec.add_texture(
        name="spot", type=mujoco.mjtTexture.mjTEXTURE_2D, width=64, height=64, nchannel=4
    )
    spot.data = _spot(64).tobytes()
    for name, emission in (("shade", 0.0), ("shine", 0.9)):
        soft = spec.add_material(name=name, specular=0.0, shininess=0.0, emission=emission)
        soft.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "spot"


def _spot(size: int) -> np.ndarray:
    """A white spot that fades out towards its rim, uint8 [size, size, 4]."""
    across = np.linspace(-1.0, 1.0, size)
    distance = np.hypot(across[:, None], across[None])
    picture = np.ones((size, size, 4))
    picture[..., 3] = (1.0 - distance.clip(0.0, 1.0) ** 2) ** 1.5
    return (255.0 * picture).astype(np.uint8)


class Brush:
    """Adds shapes to one body, under names that begin alike.

    Attributes:
        body: what the shapes belong to.
        prefix: first part of every name.
        floor: height of the floor in the frame of the body; heights are given above it.
        group: geom group of the shapes.
    """

    def __init__(
        self, body: mujoco.MjsBody, prefix: str, floor: float = 0.0, group: int = LOOKS
    ) -> None:
        self.body = body
        self.prefix = prefix
        self.floor = floor
        self.group = group

    def box(self, name: str, pos: Sequence[float], half: Sequence[float], rgb: Rgb, **more) -> None:
        """A box with its half sizes."""
        self._add(name, _BOX, pos, half, rgb, **more)

    def ball(
        self, name: str, pos: Sequence[float], radii: Sequence[float], rgb: Rgb, **more
    ) -> None:
        """An ellipsoid with its three radii."""
        self._add(name, _BALL, pos, radii, rgb, **more)

    def disc(
        self, name: str, pos: Sequence[float], radius: float, half: float, rgb: Rgb, **more
    ) -> None:
        """An upright cylinder with its radius and half its height."""
        self._add(name, _DISC, pos, [radius, half, 0.0], rgb, **more)

    def rod(
        self,
        name: str,
        start: Sequence[float],
        end: Sequence[float],
        radius: float,
        rgb: Rgb,
        **more,
    ) -> None:
        """A rod with round ends from one point to another."""
        ends = [*self._raised(start), *self._raised(end)]
        self._add(name, _ROD, None, [radius, 0.0, 0.0], rgb, fromto=ends, **more)

    def spot(
        self,
        name: str,
        pos: Sequence[float],
        radius: float,
        rgb: Rgb = (0.13, 0.07, 0.04),
        alpha: float = 0.5,
        surface: str = "shade",
        **more,
    ) -> None:
        """A soft round spot that lies flat: the shade under a thing, or the shine of a lamp."""
        flat = (radius, radius, 2e-5)
        self._add(name, _BOX, pos, flat, rgb, surface=surface, alpha=alpha, **more)

    def _raised(self, pos: Sequence[float]) -> list[float]:
        return [pos[0], pos[1], pos[2] + self.floor]

    def _add(
        self,
        name: str,
        kind: int,
        pos: Sequence[float] | None,
        size: Sequence[float],
        rgb: Rgb,
        surface: str = "matt",
        alpha: float = 1.0,
        **more,
    ) -> None:
        if pos is not None:
            more["pos"] = self._raised(pos)
        self.body.add_geom(
            name=f"{self.prefix}_{name}",
            type=kind,
            size=list(size),
            rgba=[*rgb, alpha],
            material=surface,
            group=self.group,
            contype=0,
            conaffinity=0,
            mass=0.0,
            **more,
        )


def chair(brush: Brush, at: Point, facing: float) -> None:
    """A chair around a point; facing is 1 along x, -1 against it."""
    x, y = at
    under = (SEAT_HEIGHT - 0.04) / 2
    for k, (dx, dy) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        leg = (x + 0.16 * dx, y + 0.16 * dy, under)
        brush.box(f"leg{k}", leg, (0.016, 0.016, under), WOOD)
    brush.box("seat", (x, y, SEAT_HEIGHT - 0.022), (0.185, 0.185, 0.022), CUSHION)
    back = x - 0.19 * facing
    for k, dy in enumerate((-0.155, 0.155)):
        brush.box(f"post{k}", (back, y + dy, 0.65), (0.014, 0.018, 0.21), WOOD)
    for k, height in enumerate((0.66, 0.80)):
        brush.box(f"slat{k}", (back, y, height), (0.009, 0.145, 0.042), WOOD)


def table(brush: Brush, at: Point, radius: float) -> None:
    """A round table on one leg, laid with a flower and a candle."""
    x, y = at
    top = TABLE_HEIGHT
    brush.spot("shade", (x, y, 0.004), radius + 0.30)
    brush.disc("foot", (x, y, 0.02), 0.22, 0.015, RUBBER, surface="satin")
    brush.disc("leg", (x, y, top / 2), 0.035, top / 2 - 0.03, RUBBER, surface="satin")
    brush.disc("top", (x, y, top - 0.02), radius, 0.02, WOOD, surface="satin")
    brush.disc("runner", (x, y, top + 0.001), 0.15, 0.002, CREAM)
    brush.ball("vase", (x - 0.05, y, top + 0.045), (0.032, 0.032, 0.05), CREAM, surface="gloss")
    brush.ball("flowers", (x - 0.05, y, top + 0.13), (0.045, 0.045, 0.04), (0.93, 0.53, 0.45))
    brush.disc("candle", (x + 0.07, y, top + 0.03), 0.026, 0.026, CREAM)
    small = Brush(brush.body, f"{brush.prefix}_small", group=INDOORS)
    for k, (dx, dy, up) in enumerate(
        ((-0.02, 0.04, 0.17), (-0.09, 0.02, 0.15), (-0.04, -0.05, 0.16))
    ):
        bloom = (x + dx, y + dy, top + up)
        small.ball(f"bloom{k}", bloom, (0.028, 0.028, 0.024), (0.95, 0.62, 0.52))
    small.ball("leaves", (x - 0.05, y, top + 0.10), (0.035, 0.05, 0.025), LEAF)
    flame = (x + 0.07, y, top + 0.078)
    small.ball("flame", flame, (0.010, 0.010, 0.020), GLOW, surface="lamp")


def plant(brush: Brush, at: Point, tall: float) -> None:
    """A plant in a pot."""
    x, y = at
    brush.disc("pot", (x, y, 0.17), 0.16, 0.17, CUSHION)
    brush.disc("brim", (x, y, 0.34), 0.18, 0.025, hue(CUSHION, 1.12))
    for k in range(6):
        turn, out = 2.4 * k, 0.05 + 0.022 * k
        tip = (x + out * np.cos(turn), y + out * np.sin(turn), 0.42 + tall * (1.0 - 0.12 * k))
        size = 0.13 + 0.012 * (k % 3)
        brush.ball(f"leaf{k}", tip, (size, size, 0.8 * size), hue(LEAF, 0.85 + 0.06 * (k % 4)))
