"""What the page draws: the shapes, surfaces, lights, and cameras of the dressed model.

Nothing is described twice. The room and the robot are the geoms of the compiled model, a guest is
the geoms of its body after ``figures.Figures`` has set them. Lengths are in metres above the floor.
"""

from __future__ import annotations

import base64
import copy
import struct
import zlib
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from evenhand.restaurant import floor_plan
from evenhand.restaurant.drawing import dressing, props
from evenhand.restaurant.drawing.guests import Figures
from evenhand.restaurant.simulation import scene
from evenhand.restaurant.simulation.recording import Recording

KINDS = ("plane", "box", "ball", "disc", "rod")
"""Shapes by their code. Sizes are half sides, radii, radius and half height; a rod has round ends
that come on top of its half height."""

_CODES = {
    mujoco.mjtGeom.mjGEOM_PLANE: 0,
    mujoco.mjtGeom.mjGEOM_BOX: 1,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: 2,
    mujoco.mjtGeom.mjGEOM_CYLINDER: 3,
    mujoco.mjtGeom.mjGEOM_CAPSULE: 4,
}
_NOT_SET = np.array([0.5, 0.5, 0.5, 1.0], np.float32)
"""Colour of a geom that leaves its colour to its material."""
_DIGITS = 4


@dataclass(frozen=True)
class Figured:
    """The guests of N services as shapes; many look alike, so each look is kept once.

    Attributes:
        shapes: of one figure each, without colours.
        coats: colours of one figure each, as indices into ``colours``.
        colours: red, green, blue, opacity as eight hexadecimal digits.
        shape: which of the shapes a guest has, int64 [N, 12].
        coat: which of the coats, int64 [N, 12].
    """

    shapes: list[dict[str, Any]]
    coats: list[list[int]]
    colours: list[str]
    shape: np.ndarray
    coat: np.ndarray


def still() -> dict[str, Any]:
    """What is the same in all services: room, robot, surfaces, pictures on them, and lights."""
    model = dressing.model()
    return {
        "kinds": list(KINDS),
        "surfaces": _surfaces(model),
        "room": _parts(model, "world"),
        "robot": _parts(model, "robot"),
        "lights": _lights(model),
        "fovy": {name: float(model.camera(name).fovy[0]) for name in dressing.CAMERAS},
        "room_view": _room_view(),
        "room_size": [*(float(half) for half in floor_plan.ROOM), _ceiling(model)],
    }


def figures(recording: Recording) -> Figured:
    """The guests of recorded services."""
    model = copy.copy(dressing.model())
    show = Figures(model, scene.PERSON)
    bodies = [_geoms(model, scene.guest_name(g)) for g in range(floor_plan.N_GUESTS)]
    shapes: dict[str, int] = {}
    coats: dict[tuple[int, ...], int] = {}
    colours: dict[str, int] = {}
    found: list[dict[str, Any]] = []
    which = np.zeros((2, len(recording), floor_plan.N_GUESTS), np.int64)
    for row in range(len(recording)):
        show.show(recording, row)
        for guest, geoms in enumerate(bodies):
            seen = geoms[model.geom_rgba[geoms, 3] > 0]
            shape = _shapes(model, seen)
            number = shapes.setdefault(repr(shape), len(shapes))
            if number == len(found):
                found.append(shape)
            coat = tuple(colours.setdefault(c, len(colours)) for c in _colours(model, seen))
            which[:, row, guest] = number, coats.setdefault(coat, len(coats))
    return Figured(found, [list(coat) for coat in coats], list(colours), which[0], which[1])


def views(recording: Recording, row: int, camera: str, poses: np.ndarray) -> np.ndarray:
    """Where a camera stands and how it is turned, for each of these robot poses.

    Args:
        recording: services.
        row: which of them.
        camera: one of ``dressing.CAMERAS``.
        poses: x, y (m) and yaw (rad) of the robot, [L, 3].

    Returns:
        x, y, z (m) and the quaternion w, x, y, z, [L, 7]; a camera looks against its z axis.
    """
    model = copy.copy(dressing.model())
    index = model.camera(camera).id
    out = np.empty((len(poses), 7))
    for k, pose in enumerate(poses):
        dressing.aim(model, camera, pose[:2], recording.position[row], recording.start[row])
        out[k, :3], out[k, 3:] = model.cam_pos[index], model.cam_quat[index]
    return out


def _room_view() -> list[float]:
    """Place and turn of the camera that shows the room; it stands still in every service."""
    model = copy.copy(dressing.model())
    nowhere, nobody = np.zeros(2), np.zeros((floor_plan.N_GUESTS, 2))
    dressing.aim(model, "room", nowhere, nobody, nowhere)
    index = model.camera("room").id
    return [*_rounded(model.cam_pos[index]), *_rounded(model.cam_quat[index])]


def _geoms(model: mujoco.MjModel, body: str) -> np.ndarray:
    """Indices of the geoms of a body that some camera shows."""
    shown = np.isin(model.geom_group, (props.LOOKS, props.INDOORS))
    return np.flatnonzero((model.geom_bodyid == model.body(body).id) & shown)


def _parts(model: mujoco.MjModel, body: str) -> dict[str, Any]:
    geoms = _geoms(model, body)
    return _shapes(model, geoms) | {"colour": list(_colours(model, geoms))}


def _shapes(model: mujoco.MjModel, geoms: np.ndarray) -> dict[str, Any]:
    """Columns of shapes: one value a shape, but three of place and size, and four of turn."""
    place = model.geom_pos[geoms].copy()
    place[:, 2] += model.body_pos[model.geom_bodyid[geoms], 2]
    return {
        "kind": [_CODES[mujoco.mjtGeom(kind)] for kind in model.geom_type[geoms]],
        "surface": model.geom_matid[geoms].tolist(),
        "indoors": (model.geom_group[geoms] == props.INDOORS).astype(int).tolist(),
        "place": _rounded(place),
        "turn": _rounded(model.geom_quat[geoms]),
        "size": _rounded(model.geom_size[geoms]),
    }


def _colours(model: mujoco.MjModel, geoms: np.ndarray) -> list[str]:
    own = model.geom_rgba[geoms]
    unset = (own == _NOT_SET).all(axis=1, keepdims=True)
    rgba = np.where(unset, model.mat_rgba[model.geom_matid[geoms]], own)
    return [bytes(one).hex() for one in np.rint(255.0 * rgba).astype(np.uint8)]


def _surfaces(model: mujoco.MjModel) -> list[dict[str, Any]]:
    """How each material shines, and the picture on it if it has one."""
    out = []
    for m in range(model.nmat):
        one: dict[str, Any] = {
            "name": model.mat(m).name,
            "emission": round(float(model.mat_emission[m]), _DIGITS),
            "specular": round(float(model.mat_specular[m]), _DIGITS),
            "shininess": round(float(model.mat_shininess[m]), _DIGITS),
        }
        texture = int(model.mat_texid[m, mujoco.mjtTextureRole.mjTEXROLE_RGB])
        if texture >= 0:
            one["picture"] = _picture(model, texture)
            # times a metre where the picture repeats, else it covers a shape once; MuJoCo's unit is
            # the two metres from -1 to 1
            uniform = bool(model.mat_texuniform[m])
            one["repeat"] = round(float(model.mat_texrepeat[m, 0]) / 2, _DIGITS) if uniform else 0
        out.append(one)
    return out


def _picture(model: mujoco.MjModel, texture: int) -> str:
    """A texture as the address of a PNG picture that holds its own data."""
    wide, high = int(model.tex_width[texture]), int(model.tex_height[texture])
    channels, begin = int(model.tex_nchannel[texture]), int(model.tex_adr[texture])
    pixels = model.tex_data[begin : begin + wide * high * channels]
    png = _png(pixels.reshape(high, wide * channels), wide, channels)
    return "data:image/png;base64," + base64.b64encode(png).decode()


def _png(rows: np.ndarray, wide: int, channels: int) -> bytes:
    """A PNG file (ISO/IEC 15948) of 8 bits a channel, without filters."""

    def chunk(name: bytes, content: bytes) -> bytes:
        end = struct.pack(">I", zlib.crc32(name + content))
        return struct.pack(">I", len(content)) + name + content + end

    head = struct.pack(">IIBBBBB", wide, len(rows), 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    lines = np.pad(rows.astype(np.uint8), ((0, 0), (1, 0))).tobytes()
    parts = (chunk(b"IHDR", head), chunk(b"IDAT", zlib.compress(lines, 9)), chunk(b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def _lights(model: mujoco.MjModel) -> dict[str, Any]:
    """The light that goes with the camera, and those that shine one way."""
    head = model.vis.headlight
    return {
        "ambient": _rounded(head.ambient),
        "head": [_rounded(head.diffuse), _rounded(head.specular)],
        "lamps": [
            [_rounded(model.light_dir[k]), _rounded(model.light_diffuse[k]),
             _rounded(model.light_specular[k])]
            for k in range(model.nlight)
        ],
    }  # fmt: skip


def _ceiling(model: mujoco.MjModel) -> float:
    """Height of the underside of the ceiling; a camera below it and between the walls is inside."""
    ceiling = model.geom("look_south_ceiling")
    return round(float(ceiling.pos[2] - ceiling.size[2]), _DIGITS)


def _rounded(values: np.ndarray) -> list[float]:
    # adding zero turns -0.0 into 0.0
    return (np.round(np.asarray(values, float).ravel(), _DIGITS) + 0.0).tolist()
