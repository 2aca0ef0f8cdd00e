"""The room: floor, walls, kitchen, tables and chairs, seen from outside through an open south side.

Nothing here can be touched; what stands on the floor of the room has a footprint in ``scene``,
everything else hangs on a wall, stands behind one, or stands outside. Lengths are in metres.
"""

from __future__ import annotations

import mujoco
import numpy as np

from evenhand.restaurant import floor_plan
from evenhand.restaurant.drawing import props
from evenhand.restaurant.drawing.props import CREAM, DARK_WOOD, GLOW, INDOORS, SAGE, Brush, Rgb, hue

_WALL = 2.6
"""Height of the north wall, and of every wall that a camera in the room sees."""
_PARAPET = 0.95
"""Height up to which the room camera sees the walls in the east and in the west."""
_THICK = 0.08
"""Half the thickness of a wall."""
_RAIL = 1.0
"""Height of the rail between panel and wall."""
_PASS = (1.5, 1.0, 1.85)
"""Half width, lower and upper edge of the opening to the kitchen in the north wall."""
_PANE: Rgb = (0.66, 0.82, 0.90)
_UPRIGHT = [0.7071068, 0.7071068, 0.0, 0.0]
"""Turns what lies flat upright, against the north wall."""


def furnish(spec: mujoco.MjSpec) -> None:
    """Add everything that stands still; the materials of ``props`` must be there."""
    world = spec.worldbody
    _floor(spec)
    _north(world)
    _sides(world)
    _south(world)
    _kitchen(world)
    for t, centre in enumerate(floor_plan.TABLES):
        props.table(Brush(world, f"look_table{t}"), centre, floor_plan.TABLE_RADIUS)
        _pendant(Brush(world, f"look_pendant{t}", group=INDOORS), centre)
    for c, centre in enumerate(floor_plan.CHAIRS):
        brush = Brush(world, f"look_chair{c}")
        brush.spot("shade", (*centre, 0.006), 0.34)
        props.chair(brush, centre, facing=1.0 if c % 2 == 0 else -1.0)
    for k, x in enumerate((-6.4, -3.2, 0.0, 3.2, 6.4)):
        props.plant(Brush(world, f"look_plant{k}"), (x, -floor_plan.ROOM[1] - 0.55), 0.30)


def _floor(spec: mujoco.MjSpec) -> None:
    """Boards on a slab."""
    texture = spec.add_texture(
        name="boards", type=mujoco.mjtTexture.mjTEXTURE_2D, width=512, height=512, nchannel=3
    )
    texture.data = _boards(512, np.random.default_rng(7)).tobytes()
    material = spec.add_material(
        name="boards", specular=0.15, shininess=0.3, texuniform=True, texrepeat=[0.45, 0.45]
    )
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "boards"
    x, y = floor_plan.ROOM
    world = spec.worldbody
    world.add_geom(
        name="look_floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[x, y, 0.5],
        material="boards",
        group=props.LOOKS,
        contype=0,
        conaffinity=0,
    )
    wide, deep = x + 2 * _THICK, y + 2 * _THICK
    slab = Brush(world, "look_slab")
    # costs a fraction of a sky, which no camera would see
    slab.box("ground", (0, 0, -0.25), (45.0, 45.0, 0.02), (0.80, 0.765, 0.715))
    slab.box("base", (0, 0, -0.11), (wide, deep, 0.1), hue(DARK_WOOD, 0.9))
    rgb, half = (0.35, 0.25, 0.18), (1.3 * wide, 1.45 * deep, 2e-5)
    slab.box("shade", (0, 0, -0.22), half, rgb, surface="shade", alpha=0.7)


def _boards(size: int, rng: np.random.Generator) -> np.ndarray:
    """A picture of floor boards that repeats without a seam, uint8 [size, size, 3]."""
    wide = size // 16
    picture = np.empty((size, size, 3))
    for k in range(16):
        grain = np.cumsum(rng.normal(0.0, 0.004, (wide, 1)), axis=0) + rng.normal(0.0, 0.008)
        tone = np.repeat(rng.normal(0.0, 0.028, 2), size // 2)[None]
        board = 1.0 + np.roll(tone, rng.integers(size), axis=1) + grain
        joint = np.flatnonzero(np.diff(board[0], append=board[0, 0]))
        board[:, joint] *= 0.80
        board[-1] *= 0.82
        picture[k * wide : (k + 1) * wide] = board[..., None] * np.array([0.80, 0.62, 0.44])
    return (255.0 * picture.clip(0.0, 1.0)).astype(np.uint8)


def _north(world: mujoco.MjsBody) -> None:
    """The wall that all cameras see, with windows, lamps, and the opening to the kitchen."""
    x, y = floor_plan.ROOM
    half, low, high = _PASS
    brush = Brush(world, "look_north")
    at, side, up = y + _THICK, (x - half) / 2 + _THICK, (_WALL - _RAIL) / 2
    for name, sign in (("west", -1), ("east", 1)):
        middle = sign * (half + side)
        panel = (side, _THICK, _RAIL / 2)
        brush.box(f"panel_{name}", (middle, at, _RAIL / 2), panel, SAGE, surface="wall")
        wall = (side, _THICK, up)
        brush.box(f"wall_{name}", (middle, at, _RAIL + up), wall, CREAM, surface="wall")
    brush.box("panel", (0, at, low / 2), (half, _THICK, low / 2), SAGE, surface="wall")
    over = (half, _THICK, (_WALL - high) / 2)
    brush.box("wall", (0, at, (high + _WALL) / 2), over, CREAM, surface="wall")
    brush.box("rail", (0, y - 0.01, _RAIL), (x, 0.015, 0.025), DARK_WOOD)
    brush.box("skirting", (0, y - 0.005, 0.05), (x, 0.01, 0.05), DARK_WOOD)
    cornice = (x + 2 * _THICK, _THICK + 0.03, 0.03)
    brush.box("cornice", (0, at, _WALL + 0.03), cornice, DARK_WOOD)
    for k, centre in enumerate((-5.2, -3.0, 3.0, 5.2)):
        _window(Brush(world, f"look_window{k}"), (centre, y), 0.60)
    for k, centre in enumerate((-4.1, -1.9, 1.9, 4.1)):
        lamp = Brush(world, f"look_sconce{k}")
        lamp.box("plate", (centre, y - 0.01, 1.85), (0.04, 0.012, 0.09), props.BRASS)
        lamp.spot("glow", (centre, y - 0.004, 1.92), 0.55, GLOW, 0.45, "shine", quat=_UPRIGHT)
        lamp.ball("globe", (centre, y - 0.06, 1.92), (0.06, 0.05, 0.08), GLOW, surface="lamp")


def _sides(world: mujoco.MjsBody) -> None:
    """The walls in the east and in the west: low from above, whole and with prints from inside."""
    x, y = floor_plan.ROOM
    long, up = y + 2 * _THICK, (_WALL - _PARAPET) / 2
    for name, sign in (("west", -1), ("east", 1)):
        at = sign * (x + _THICK)
        low = Brush(world, f"look_{name}")
        low.box("panel", (at, 0, _PARAPET / 2), (_THICK, long, _PARAPET / 2), SAGE)
        low.box("rail", (at, 0, _PARAPET + 0.02), (_THICK + 0.02, long, 0.02), DARK_WOOD)
        high = Brush(world, f"look_upper_{name}", group=INDOORS)
        high.box("wall", (at, 0, _PARAPET + up), (_THICK, long, up), CREAM, surface="wall")
        inner = sign * x
        for k, along in enumerate((-2.0, 0.0, 2.0)):
            high.box(f"frame{k}", (inner, along, 1.75), (0.02, 0.48, 0.33), DARK_WOOD)
            high.box(f"print{k}", (inner, along, 1.75), (0.025, 0.43, 0.28), (0.93, 0.90, 0.82))
            high.ball(f"sun{k}", (inner, along + 0.1, 1.80), (0.03, 0.13, 0.13), props.CUSHION)
            high.ball(f"hill{k}", (inner, along - 0.1, 1.60), (0.03, 0.24, 0.11), SAGE)


def _south(world: mujoco.MjsBody) -> None:
    """A kerb from above; wall, windows and ceiling from inside."""
    x, y = floor_plan.ROOM
    at, thick, up = -y - _THICK, 0.9 * _THICK, (_WALL - _RAIL) / 2
    Brush(world, "look_south").box("kerb", (0, at, 0.06), (x, _THICK, 0.06), DARK_WOOD)
    brush = Brush(world, "look_south", group=INDOORS)
    brush.box("panel", (0, at, _RAIL / 2), (x, thick, _RAIL / 2), SAGE, surface="wall")
    brush.box("wall", (0, at, _RAIL + up), (x, thick, up), CREAM, surface="wall")
    brush.box("rail", (0, -y, _RAIL), (x, 0.015, 0.025), DARK_WOOD)
    ceiling = (x + _THICK, y + _THICK, 0.02)
    brush.box("ceiling", (0, 0, _WALL + 0.01), ceiling, CREAM, surface="pane")
    for k, centre in enumerate((-4.8, -1.6, 1.6, 4.8)):
        _window(Brush(world, f"look_window_south{k}", group=INDOORS), (centre, -y), 0.75)


def _window(brush: Brush, at: tuple[float, float], half: float) -> None:
    x, y = at
    brush.box("frame", (x, y, 1.75), (half, 0.02, 0.50), DARK_WOOD)
    brush.box("pane", (x, y, 1.75), (half - 0.05, 0.025, 0.45), _PANE, surface="pane")
    brush.box("post", (x, y, 1.75), (0.02, 0.03, 0.45), DARK_WOOD)
    brush.box("bar", (x, y, 1.85), (half - 0.05, 0.03, 0.02), DARK_WOOD)
    brush.box("sill", (x, y, 1.24), (half + 0.04, 0.04, 0.02), DARK_WOOD)


def _kitchen(world: mujoco.MjsBody) -> None:
    """Behind the north wall, where nobody can stand: a counter and shelves with crockery."""
    half, low, high = _PASS
    y = floor_plan.ROOM[1]
    brush = Brush(world, "look_kitchen")
    small = Brush(world, "look_kitchen_small", group=INDOORS)
    brush.box("back", (0, y + 0.75, 1.0), (half + 0.1, 0.03, 1.0), hue(SAGE, 0.62))
    for name, sign in (("west", -1), ("east", 1)):
        brush.box(name, (sign * (half + 0.05), y + 0.45, 1.0), (0.03, 0.3, 1.0), hue(SAGE, 0.55))
    counter = (0, y + 0.13, low + 0.02)
    brush.box("counter", counter, (half + 0.05, 0.17, 0.025), props.WOOD, surface="satin")
    lintel = (0, y + _THICK, high + 0.02)
    brush.box("lintel", lintel, (half + 0.05, _THICK + 0.015, 0.03), DARK_WOOD)
    for k, height in enumerate((1.30, 1.62)):
        brush.box(f"shelf{k}", (0, y + 0.62, height), (half, 0.1, 0.015), props.WOOD)
    glass = ((0.30, 0.50, 0.38), (0.72, 0.47, 0.22), (0.86, 0.84, 0.78), (0.55, 0.22, 0.20))
    for k, x in enumerate(np.linspace(-half + 0.15, half - 0.15, 12)):
        tall = 0.09 + 0.02 * (k * 5 % 3)
        bottle = (x, y + 0.6, 1.315 + tall)
        brush.disc(f"bottle{k}", bottle, 0.04, tall, glass[k % 4], surface="gloss")
        neck = (x, y + 0.6, 1.315 + 2 * tall + 0.03)
        small.disc(f"neck{k}", neck, 0.014, 0.04, glass[k % 4], surface="gloss")
    for k, x in enumerate((-1.1, -0.75, 0.8, 1.15)):
        brush.disc(f"plates{k}", (x, y + 0.13, low + 0.07), 0.12, 0.03, CREAM, surface="gloss")
    for k, x in enumerate((-0.9, 0.0, 0.9)):
        lamp = (x, y + 0.12, high - 0.16)
        small.rod(f"cord{k}", (x, y + 0.12, high), (x, y + 0.12, high - 0.1), 0.006, props.RUBBER)
        brush.ball(f"lamp{k}", lamp, (0.09, 0.09, 0.06), props.BRASS, surface="satin")
        glow = (x, y + 0.12, high - 0.20)
        brush.ball(f"glow{k}", glow, (0.06, 0.06, 0.04), GLOW, surface="lamp")


def _pendant(brush: Brush, at: np.ndarray) -> None:
    x, y = at
    brush.rod("cord", (x, y, 2.15), (x, y, _WALL), 0.006, props.RUBBER)
    brush.disc("lamp", (x, y, 2.10), 0.15, 0.055, props.BRASS, surface="satin")
    brush.ball("glow", (x, y, 2.04), (0.09, 0.09, 0.05), GLOW, surface="lamp")
