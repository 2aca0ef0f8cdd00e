"""How the restaurant is shown: the robot's shell, lights, and three cameras.

Looks belong to a second model that shares every body, joint, actuator and sensor with the one
that is simulated, see ``scene``. Lengths are in metres.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from types import MappingProxyType

import mujoco
import numpy as np

from evenhand.restaurant import floor_plan
from evenhand.restaurant.drawing import guests as figures
from evenhand.restaurant.drawing import props, room
from evenhand.restaurant.drawing.props import CREAM, Brush, Rgb
from evenhand.restaurant.simulation import scene

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

_FOVY = {"room": 24.0, "robot": 55.0, "guest": 56.0}
"""Vertical field of view of each camera, degrees."""
_WIDEST = 1.0
"""Angle between two places that still fit on one picture of a camera in the room, radians."""
_NEAREST = 1.0
"""Distance at which such a camera still shows a whole figure, metres."""
_WHITE: Rgb = (0.95, 0.96, 0.97)
_SHADOW: Rgb = (0.20, 0.23, 0.28)
_TEAL: Rgb = (0.10, 0.62, 0.64)
_EYES: Rgb = (0.55, 0.98, 0.95)


def build() -> mujoco.MjSpec:
    """The dressed restaurant as a specification that can be edited before it is compiled."""
    spec = scene.build()
    guests = [spec.body(scene.guest_name(i)) for i in range(floor_plan.N_GUESTS)]
    dress(spec, spec.body(scene.ROBOT), guests, scene.PERSON)
    return spec


@functools.cache
def model() -> mujoco.MjModel:
    """The compiled dressed restaurant; callers that change it copy it first."""
    return build().compile()


def dress(
    spec: mujoco.MjSpec, robot: mujoco.MjsBody, guests: Sequence[mujoco.MjsBody], asking: int
) -> None:
    """Add everything that eyes need; it touches nothing and weighs nothing.

    Args:
        spec: the lean scene.
        robot: its robot.
        guests: its guests.
        asking: index of the guest who asks for service.
    """
    _show(spec)
    props.add_materials(spec)
    room.furnish(spec)
    _dress_robot(robot)
    for index, guest in enumerate(guests):
        figures.dress(guest, index, index == asking)


def _show(spec: mujoco.MjSpec) -> None:
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
    for name in CAMERAS:
        world.add_camera(name=name, fovy=_FOVY[name])


def _dress_robot(body: mujoco.MjsBody) -> None:
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
    person, others = guests[0], guests[1:]
    if camera == "room":
        eye, target = np.array([0.0, -20.4, 21.6]), np.array([0.0, -0.1, 0.35])
    elif camera == "robot":
        # the shoulder is chosen once, so that the camera does not jump while the robot drives
        turn = _clear(
            start, person, 1.65, (20.0, -20.0, 45.0, -45.0, 70.0, -70.0, 95.0, -95.0), others
        )
        eye, target = _look(_behind(robot, person, 1.65, turn), robot, person)
    else:
        turn = _clear(person, start, 2.0, (35.0, -35.0, 60.0, -60.0, 85.0, -85.0), others)
        eye, target = _look(_behind(person, start, 2.0, turn), person, start)
    back = _unit(eye - target)
    right = _unit(np.cross([0.0, 0.0, 1.0], back))
    rotation = np.stack([right, np.cross(back, right), back], axis=1)
    index = model.camera(camera).id
    model.cam_pos[index] = eye
    mujoco.mju_mat2Quat(model.cam_quat[index], rotation.ravel())


def _behind(near: np.ndarray, far: np.ndarray, distance: float, turn: float) -> np.ndarray:
    """A place in the room from where ``far`` lies behind ``near``, but for a turn; shape (2,)."""
    x, y = _unit(near - far)
    cos, sin = np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))
    place = near + distance * np.array([cos * x - sin * y, sin * x + cos * y])
    return np.clip(place, -(floor_plan.ROOM - 0.15), floor_plan.ROOM - 0.15)


def _clear(
    near: np.ndarray, far: np.ndarray, distance: float, turns: Sequence[float], others: np.ndarray
) -> float:
    """The turn, degrees, at which walls and guests stand least in the way of looking."""

    def fault(turn: float) -> float:
        eye = _behind(near, far, distance, turn)
        room = float(np.linalg.norm(eye - near))
        amiss = distance - room + 10.0 * max(_NEAREST - room, 0.0) + abs(turn) / 300.0
        apart = np.arccos((_unit(near - eye) @ _unit(far - eye)).clip(-1.0, 1.0))
        amiss += 10.0 * max(float(apart) - _WIDEST, 0.0)
        for goal in (near, far):
            way = goal - eye
            share = ((others - eye) @ way / (way @ way)).clip(0.0, 1.0)
            gap = np.linalg.norm(others - eye - share[:, None] * way, axis=1)
            amiss += 4.0 * float(np.maximum(0.5 - gap, 0.0).sum())
        return amiss

    return min(turns, key=fault)


def _look(eye: np.ndarray, one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eye and target of a camera above head height that has two places in its middle."""
    between = _unit(_unit(one - eye) + _unit(other - eye))
    return np.append(eye, 1.85), np.append(eye + 2.5 * between, 0.8)


def _unit(way: np.ndarray) -> np.ndarray:
    return way / max(float(np.linalg.norm(way)), 1e-9)
