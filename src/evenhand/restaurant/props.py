"""What the restaurant is drawn with: colours, materials, shapes, and the furniture made of them.

Everything is a primitive of MuJoCo that touches nothing and weighs nothing, so that looks never
change what happens. Lengths are in metres, colours are red, green, blue, opacity in [0, 1].
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

Rgb = tuple[float, float, float]

LOOKS = 1
"""Geom group of what every camera shows."""
ENCLOSURE = 4
"""Geom group of what stands between the room camera and the room; the other cameras show it."""

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
        ("lamp", 0.0, 0.0, 0.9),
    ):
        spec.add_material(name=name, specular=specular, shininess=shininess, emission=emission)


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
        self, name: str, start: Sequence[float], end: Sequence[float], radius: float, rgb: Rgb,
        **more,
    ) -> None:
        """A rod with round ends from one point to another."""
        ends = [*self._raised(start), *self._raised(end)]
        self._add(name, _ROD, None, [radius, 0.0, 0.0], rgb, fromto=ends, **more)

    def shade(self, pos: Sequence[float], radius: float) -> None:
        """The soft dark spot under a thing that stands on the floor."""
        for k, (share, dark) in enumerate(((1.0, 0.10), (0.8, 0.12), (0.6, 0.14))):
            at = (pos[0], pos[1], 0.004 + 0.003 * k)
            self.disc(f"shade{k}", at, share * radius, 0.001, (0.16, 0.09, 0.05), alpha=dark)

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


def chair(brush: Brush, at: Sequence[float], facing: float, wood: Rgb = WOOD) -> None:
    """A chair around a point; facing is 1 along x, -1 against it."""
    x, y = at
    for k, (dx, dy) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        foot = (x + 0.165 * dx, y + 0.165 * dy, 0.02)
        top = (x + 0.155 * dx, y + 0.155 * dy, SEAT_HEIGHT - 0.04)
        brush.rod(f"leg{k}", foot, top, 0.016, wood)
    brush.box("seat", (x, y, SEAT_HEIGHT - 0.035), (0.185, 0.185, 0.015), wood)
    brush.box("cushion", (x, y, SEAT_HEIGHT - 0.01), (0.17, 0.17, 0.016), CUSHION)
    back = x - 0.18 * facing
    for k, dy in enumerate((-0.155, 0.155)):
        low, high = (back, y + dy, SEAT_HEIGHT - 0.05), (back - 0.05 * facing, y + dy, 0.86)
        brush.rod(f"post{k}", low, high, 0.016, wood)
    for k, height in enumerate((0.64, 0.80)):
        lean = back - 0.05 * facing * (height - SEAT_HEIGHT) / 0.4
        brush.box(f"slat{k}", (lean, y, height), (0.011, 0.15, 0.045), wood)


def table(brush: Brush, at: Sequence[float], radius: float) -> None:
    """A round table on one leg, laid with a flower and a candle."""
    x, y = at
    top = TABLE_HEIGHT
    brush.shade((x, y), radius + 0.22)
    brush.disc("foot", (x, y, 0.02), 0.22, 0.015, RUBBER, surface="satin")
    brush.disc("leg", (x, y, top / 2), 0.035, top / 2 - 0.03, RUBBER, surface="satin")
    brush.disc("rim", (x, y, top - 0.022), radius, 0.014, DARK_WOOD, surface="satin")
    brush.disc("top", (x, y, top - 0.004), radius - 0.008, 0.008, WOOD, surface="satin")
    brush.disc("runner", (x, y, top + 0.005), 0.15, 0.002, CREAM)
    brush.ball("vase", (x - 0.05, y, top + 0.05), (0.032, 0.032, 0.05), CREAM, surface="gloss")
    for k, (dx, dy, up) in enumerate(((-0.02, 0.03, 0.17), (-0.09, 0.02, 0.15), (-0.05, -0.04, 0.16))):
        flower = (x + dx, y + dy, top + up)
        brush.rod(f"stem{k}", (x - 0.05, y, top + 0.08), flower, 0.006, LEAF)
        brush.ball(f"flower{k}", flower, (0.026, 0.026, 0.022), (0.93, 0.53, 0.45))
    brush.disc("candle", (x + 0.07, y, top + 0.03), 0.026, 0.026, CREAM)
    flame = (x + 0.07, y, top + 0.078)
    brush.ball("flame", flame, (0.010, 0.010, 0.020), GLOW, surface="lamp")


def plant(brush: Brush, at: Sequence[float], tall: float) -> None:
    """A plant in a pot."""
    x, y = at
    brush.disc("pot", (x, y, 0.17), 0.16, 0.17, CUSHION)
    brush.disc("brim", (x, y, 0.34), 0.18, 0.025, hue(CUSHION, 1.12))
    brush.disc("soil", (x, y, 0.36), 0.15, 0.01, DARK_WOOD)
    for k in range(7):
        turn = 2.4 * k
        out = 0.06 + 0.022 * k
        tip = (x + out * np.cos(turn), y + out * np.sin(turn), 0.42 + tall * (1.0 - 0.10 * k))
        brush.rod(f"twig{k}", (x, y, 0.36), tip, 0.010, hue(LEAF, 0.7))
        size = 0.12 + 0.012 * (k % 3)
        brush.ball(f"leaf{k}", tip, (size, size, 0.8 * size), hue(LEAF, 0.85 + 0.06 * (k % 4)))
