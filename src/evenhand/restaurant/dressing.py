"""How the restaurant and its robot look: floor, walls, lights, furniture, and three cameras.

Looks belong to a second model that shares every body, joint, actuator and sensor with the one
that is simulated, see ``scene``. Lengths are in metres.
"""

from __future__ import annotations

from types import MappingProxyType

import mujoco
import numpy as np

from evenhand.restaurant import plan, props
from evenhand.restaurant.props import CREAM, DARK_WOOD, INDOORS, GLOW, SAGE, Brush, Rgb, hue

CAMERAS = MappingProxyType(
    {
        "room": "the whole restaurant, from above its open south side",
        "robot": "over the robot's shoulder, towards the person who asks",
        "guest": "beside the person who asks, towards the robot as it comes",
    }
)
"""Name of each camera -> what it shows."""

LARGEST = (1280, 960)
"""Width and height of the largest picture, pixels."""

_WALL = 2.6
"""Height of the north wall, and of every wall that a camera inside the room sees."""
_PARAPET = 0.95
"""Height up to which the room camera sees the walls in the east and in the west."""
_THICK = 0.08
_PASS = (1.5, 1.0, 1.85)
"""Half width, lower and upper edge of the opening to the kitchen in the north wall."""

_WHITE: Rgb = (0.95, 0.96, 0.97)
_SHADOW: Rgb = (0.20, 0.23, 0.28)
_TEAL: Rgb = (0.10, 0.62, 0.64)
_EYES: Rgb = (0.55, 0.98, 0.95)


def dress_room(spec: mujoco.MjSpec) -> None:
    """Add everything that stands still, the lights, and the cameras."""
    _picture(spec)
    props.add_materials(spec)
    world = spec.worldbody
    _floor(spec)
    _walls(world)
    _kitchen(world)
    for t, centre in enumerate(plan.TABLES):
        props.table(Brush(world, f"look_table{t}"), centre, plan.TABLE_RADIUS)
        _pendant(Brush(world, f"look_pendant{t}", group=INDOORS), centre)
    for c, centre in enumerate(plan.CHAIRS):
        brush = Brush(world, f"look_chair{c}")
        brush.spot("shade", (*centre, 0.006), 0.34)
        props.chair(brush, centre, facing=1.0 if c % 2 == 0 else -1.0)
    _outside(world)


def _picture(spec: mujoco.MjSpec) -> None:
    """Size of the picture, lights, and cameras."""
    visual = spec.visual
    visual.global_.offwidth, visual.global_.offheight = LARGEST
    visual.map.znear, visual.map.zfar = 0.02, 6.0
    spec.stat.extent, spec.stat.center = 9.0, [0.0, 0.0, 0.5]
    visual.headlight.ambient = [0.46, 0.44, 0.41]
    visual.headlight.diffuse = [0.20, 0.19, 0.18]
    visual.headlight.specular = [0.05, 0.05, 0.05]
    world = spec.worldbody
    for name, towards, colour in (
        ("lamp_warm", (0.45, 0.55, -0.9), (0.50, 0.46, 0.39)),
        ("lamp_soft", (-0.7, -0.25, -0.6), (0.14, 0.15, 0.18)),
    ):
        world.add_light(
            name=name,
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            pos=[0.0, 0.0, 6.0],
            dir=towards,
            diffuse=colour,
            specular=[0.5 * c for c in colour],
            castshadow=False,
        )
    for name, fovy in (("room", 24.0), ("robot", 55.0), ("guest", 56.0)):
        world.add_camera(name=name, fovy=fovy)


def _floor(spec: mujoco.MjSpec) -> None:
    """Boards on a slab."""
    texture = spec.add_texture(
        name="boards", type=mujoco.mjtTexture.mjTEXTURE_2D, width=512, height=512, nchannel=3
    )
    texture.data = _boards(512).tobytes()
    material = spec.add_material(
        name="boards", specular=0.15, shininess=0.3, texuniform=True, texrepeat=[0.45, 0.45]
    )
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "boards"
    x, y = plan.ROOM
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
    slab.box("ground", (0, 0, -0.25), (45.0, 45.0, 0.02), (0.79, 0.745, 0.69))
    slab.box("base", (0, 0, -0.11), (wide, deep, 0.1), hue(DARK_WOOD, 0.9))
    rgb, half = (0.35, 0.25, 0.18), (1.3 * wide, 1.45 * deep, 2e-5)
    slab.box("shade", (0, 0, -0.22), half, rgb, surface="shade", alpha=0.7)


def _boards(size: int) -> np.ndarray:
    """A picture of floor boards that repeats without a seam, uint8 [size, size, 3]."""
    rng = np.random.default_rng(7)
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


def _walls(world: mujoco.MjsBody) -> None:
    """The north wall with the kitchen's opening; the others low, and whole for inside cameras."""
    x, y = plan.ROOM
    half, low, high = _PASS
    north = Brush(world, "look_north")
    at, thick = y + _THICK, _THICK
    side = (x - half) / 2 + _THICK
    up = (_WALL - 1.0) / 2
    for name, sign in (("west", -1), ("east", 1)):
        middle = sign * (half + side)
        north.box(f"panel_{name}", (middle, at, 0.5), (side, thick, 0.5), SAGE, surface="wall")
        north.box(f"wall_{name}", (middle, at, 1 + up), (side, thick, up), CREAM, surface="wall")
    north.box("panel", (0, at, low / 2), (half, thick, low / 2), SAGE, surface="wall")
    north.box(
        "wall",
        (0, at, (high + _WALL) / 2),
        (half, thick, (_WALL - high) / 2),
        CREAM,
        surface="wall",
    )
    north.box("rail", (0, y - 0.01, 1.0), (x, 0.015, 0.025), DARK_WOOD)
    north.box("skirting", (0, y - 0.005, 0.05), (x, 0.01, 0.05), DARK_WOOD)
    north.box("cornice", (0, at, _WALL + 0.03), (x + 2 * _THICK, thick + 0.03, 0.03), DARK_WOOD)
    for k, centre in enumerate((-5.2, -3.0, 3.0, 5.2)):
        _window(Brush(world, f"look_window{k}"), centre, y)
    for k, centre in enumerate((-4.1, -1.9, 1.9, 4.1)):
        brush = Brush(world, f"look_sconce{k}")
        brush.box("plate", (centre, y - 0.01, 1.85), (0.04, 0.012, 0.09), props.BRASS)
        glow = (centre, y - 0.004, 1.92)
        brush.spot("glow", glow, 0.55, GLOW, 0.45, "shine", quat=[0.7071068, 0.7071068, 0.0, 0.0])
        brush.ball("globe", (centre, y - 0.06, 1.92), (0.06, 0.05, 0.08), GLOW, surface="lamp")
    for name, sign in (("west", -1), ("east", 1)):
        brush = Brush(world, f"look_{name}")
        at = sign * (x + _THICK)
        brush.box("panel", (at, 0, _PARAPET / 2), (_THICK, y + 2 * _THICK, _PARAPET / 2), SAGE)
        brush.box(
            "rail", (at, 0, _PARAPET + 0.02), (_THICK + 0.02, y + 2 * _THICK, 0.02), DARK_WOOD
        )
        upper = Brush(world, f"look_upper_{name}", group=INDOORS)
        half_up = (_WALL - _PARAPET) / 2
        upper.box(
            "wall",
            (at, 0, _PARAPET + half_up),
            (_THICK, y + 2 * _THICK, half_up),
            CREAM,
            surface="wall",
        )
        for k, along in enumerate((-2.0, 0.0, 2.0)):
            frame = (at - sign * _THICK, along, 1.75)
            upper.box(f"frame{k}", frame, (0.02, 0.48, 0.33), DARK_WOOD)
            upper.box(f"print{k}", frame, (0.025, 0.43, 0.28), (0.93, 0.90, 0.82))
            upper.ball(f"sun{k}", (frame[0], along + 0.1, 1.80), (0.03, 0.13, 0.13), props.CUSHION)
            upper.ball(f"hill{k}", (frame[0], along - 0.1, 1.60), (0.03, 0.24, 0.11), SAGE)
    kerb = Brush(world, "look_kerb")
    kerb.box("south", (0, -y - _THICK, 0.06), (x, _THICK, 0.06), DARK_WOOD)
    south = Brush(world, "look_south", group=INDOORS)
    at, thick = -y - _THICK, 0.9 * _THICK
    south.box("panel", (0, at, 0.5), (x, thick, 0.5), SAGE, surface="wall")
    south.box("wall", (0, at, 1 + up), (x, thick, up), CREAM, surface="wall")
    south.box("rail", (0, -y, 1.0), (x, 0.015, 0.025), DARK_WOOD)
    south.box(
        "ceiling", (0, 0, _WALL + 0.01), (x + _THICK, y + _THICK, 0.02), CREAM, surface="pane"
    )
    for k, centre in enumerate((-4.8, -1.6, 1.6, 4.8)):
        south.box(f"frame{k}", (centre, -y, 1.75), (0.75, 0.02, 0.5), DARK_WOOD)
        south.box(
            f"pane{k}", (centre, -y, 1.75), (0.69, 0.025, 0.44), (0.66, 0.82, 0.90), surface="pane"
        )
        south.box(f"bar{k}", (centre, -y, 1.75), (0.02, 0.03, 0.44), DARK_WOOD)


def _window(brush: Brush, centre: float, wall: float) -> None:
    brush.box("frame", (centre, wall, 1.75), (0.60, 0.02, 0.50), DARK_WOOD)
    pane = (0.66, 0.82, 0.90)
    brush.box("pane", (centre, wall, 1.75), (0.55, 0.025, 0.45), pane, surface="pane")
    brush.box("post", (centre, wall, 1.75), (0.02, 0.03, 0.45), DARK_WOOD)
    brush.box("bar", (centre, wall, 1.85), (0.55, 0.03, 0.02), DARK_WOOD)
    brush.box("sill", (centre, wall - 0.01, 1.24), (0.64, 0.03, 0.02), DARK_WOOD)


def _kitchen(world: mujoco.MjsBody) -> None:
    """Behind the north wall, where nobody can stand: a counter and shelves with crockery."""
    half, low, high = _PASS
    y = plan.ROOM[1]
    brush = Brush(world, "look_kitchen")
    small = Brush(world, "look_kitchen_small", group=INDOORS)
    brush.box("back", (0, y + 0.75, 1.0), (half + 0.1, 0.03, 1.0), hue(SAGE, 0.62))
    for name, sign in (("west", -1), ("east", 1)):
        brush.box(name, (sign * (half + 0.05), y + 0.45, 1.0), (0.03, 0.3, 1.0), hue(SAGE, 0.55))
    brush.box(
        "counter",
        (0, y + 0.13, low + 0.02),
        (half + 0.05, 0.17, 0.025),
        props.WOOD,
        surface="satin",
    )
    brush.box(
        "lintel", (0, y + _THICK, high + 0.02), (half + 0.05, _THICK + 0.015, 0.03), DARK_WOOD
    )
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
        brush.ball(f"shade{k}_lamp", lamp, (0.09, 0.09, 0.06), props.BRASS, surface="satin")
        glow = (x, y + 0.12, high - 0.20)
        brush.ball(f"glow{k}", glow, (0.06, 0.06, 0.04), GLOW, surface="lamp")


def _pendant(brush: Brush, at: np.ndarray) -> None:
    x, y = at
    brush.rod("cord", (x, y, 2.15), (x, y, _WALL), 0.006, props.RUBBER)
    brush.disc("shade_lamp", (x, y, 2.10), 0.15, 0.055, props.BRASS, surface="satin")
    brush.ball("glow", (x, y, 2.04), (0.09, 0.09, 0.05), GLOW, surface="lamp")


def _outside(world: mujoco.MjsBody) -> None:
    """Plants before the open south side, where the robot cannot go."""
    for k, x in enumerate((-6.4, -3.2, 0.0, 3.2, 6.4)):
        props.plant(Brush(world, f"look_plant{k}"), (x, -plan.ROOM[1] - 0.55), 0.30)


def dress_robot(body: mujoco.MjsBody) -> None:
    """Add the robot's shell, its face, which looks where it heads, and its tray."""
    brush = Brush(body, "look_robot", floor=-float(body.pos[2]))
    brush.spot("shade", (0, 0, 0.008), 0.42)
    brush.spot("halo", (0, 0, 0.010), 0.38, _TEAL, alpha=0.55, surface="shine")
    brush.disc("skirt", (0, 0, 0.06), 0.195, 0.045, _SHADOW, surface="satin")
    brush.disc("band", (0, 0, 0.115), 0.2, 0.012, _EYES, surface="lamp")
    brush.ball("base", (0, 0, 0.13), (0.195, 0.195, 0.17), _WHITE, surface="gloss")
    brush.rod("column", (-0.02, 0, 0.25), (-0.02, 0, 0.80), 0.095, _WHITE, surface="gloss")
    brush.ball("chest", (0.0, 0, 0.72), (0.13, 0.16, 0.21), _WHITE, surface="gloss")
    brush.ball("badge", (0.105, 0, 0.76), (0.03, 0.05, 0.05), _TEAL, surface="lamp")
    brush.disc("collar", (-0.01, 0, 0.94), 0.055, 0.03, _SHADOW, surface="satin")
    brush.ball("head", (0.0, 0, 1.10), (0.145, 0.185, 0.145), _WHITE, surface="gloss")
    brush.ball("face", (0.085, 0, 1.095), (0.085, 0.145, 0.10), (0.08, 0.10, 0.14), surface="gloss")
    for name, sign in (("left", 1), ("right", -1)):
        eye = (0.155, 0.055 * sign, 1.115)
        brush.ball(f"eye_{name}", eye, (0.014, 0.024, 0.034), _EYES, surface="lamp")
        corner = (0.161, 0.030 * sign, 1.062)
        brush.rod(f"smile_{name}", corner, (0.166, 0, 1.050), 0.006, _EYES, surface="lamp")
        ear = (-0.01, 0.175 * sign, 1.10)
        brush.ball(f"ear_{name}", ear, (0.045, 0.025, 0.045), _TEAL, surface="satin")
        shoulder, elbow = (0.0, 0.155 * sign, 0.80), (0.05, 0.20 * sign, 0.66)
        brush.rod(f"arm_{name}", shoulder, elbow, 0.034, _TEAL, surface="satin")
        brush.rod(f"hand_{name}", elbow, (0.20, 0.14 * sign, 0.67), 0.028, _WHITE, surface="gloss")
    brush.disc("tray", (0.22, 0, 0.69), 0.17, 0.008, props.STEEL, surface="gloss")
    brush.disc("cup", (0.25, -0.06, 0.735), 0.032, 0.035, CREAM, surface="gloss")
    brush.disc("tea", (0.25, -0.06, 0.772), 0.027, 0.002, (0.55, 0.33, 0.16))
    brush.disc("glass", (0.22, 0.06, 0.75), 0.027, 0.05, (0.95, 0.67, 0.28), surface="gloss")


def aim(
    model: mujoco.MjModel, camera: str, robot: np.ndarray, guests: np.ndarray, start: np.ndarray
) -> None:
    """Point a camera of the dressed model.

    Args:
        model: dressed; its camera is changed.
        camera: one of ``CAMERAS``.
        robot: where the robot is, shape (2,).
        guests: where the guests are, shape (12, 2); the first asks.
        start: where the robot began, shape (2,); the guest's camera keeps still all service long.
    """
    person = guests[0]
    if camera == "room":
        eye, target = np.array([0.0, -20.4, 21.6]), np.array([0.0, -0.1, 0.35])
    elif camera == "robot":
        ahead = _unit(person - robot)
        side = np.array([-ahead[1], ahead[0]])
        eye = np.append(_inside(robot - 1.6 * ahead + 0.55 * side), 1.85)
        target = np.append(robot + 0.5 * (person - robot) + 0.4 * ahead, 0.75)
    else:
        eye = np.append(_beside(guests, start), 1.85)
        target = np.append(person + 0.7 * _unit(start - person), 0.80)
    back = _unit(eye - target)
    right = _unit(np.cross([0.0, 0.0, 1.0], back))
    rotation = np.stack([right, np.cross(back, right), back], axis=1)
    index = model.camera(camera).id
    model.cam_pos[index] = eye
    mujoco.mju_mat2Quat(model.cam_quat[index], rotation.ravel())


def _beside(guests: np.ndarray, start: np.ndarray) -> np.ndarray:
    """A place behind the person from where neither walls nor guests hide the robot, shape (2,)."""
    person, others = guests[0], guests[1:]
    away = _unit(person - start)
    angle = np.deg2rad([35.0, -35.0, 60.0, -60.0, 85.0, -85.0])
    turned = np.stack(
        [
            np.cos(angle) * away[0] - np.sin(angle) * away[1],
            np.sin(angle) * away[0] + np.cos(angle) * away[1],
        ],
        axis=1,
    )
    wanted = person + 2.0 * turned
    eyes = _inside(wanted)
    fault = np.hypot(*(wanted - eyes).T) + 0.2 * np.abs(angle)
    for goal in (person, start):
        # how near each guest comes to each line of sight
        way = goal - eyes
        share = ((others - eyes[:, None]) * way[:, None]).sum(axis=2) / (way**2).sum(axis=1)[:, None]
        nearest = eyes[:, None] + share.clip(0.0, 1.0)[..., None] * way[:, None]
        gap = np.hypot(*np.moveaxis(others - nearest, 2, 0))
        fault += np.maximum(0.5 - gap, 0.0).sum(axis=1) * 4.0
    return eyes[fault.argmin()]


def _inside(point: np.ndarray) -> np.ndarray:
    return np.clip(point, -(plan.ROOM - 0.15), plan.ROOM - 0.15)


def _unit(way: np.ndarray) -> np.ndarray:
    return way / max(float(np.linalg.norm(way)), 1e-9)
