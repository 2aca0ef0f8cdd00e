"""Guests as simple figures: age, wheelchair, skin tone, and the raised arm of who asks can be seen.

Race and gender are not drawn: there is no body that belongs to them. Clothes and hair differ from
guest to guest by their number alone, so that they say nothing about a person. A figure looks
along the x axis of its body; lengths are in metres, heights are above the floor.
"""

from __future__ import annotations

import mujoco
import numpy as np

from evenhand.restaurant import floor_plan
from evenhand.restaurant.drawing import props
from evenhand.restaurant.drawing.props import INDOORS, RUBBER, SEAT_HEIGHT, STEEL, Brush, Rgb, hue
from evenhand.restaurant.simulation.layout import Places

SKIN: tuple[Rgb, ...] = (
    (0.97, 0.84, 0.76),
    (0.92, 0.73, 0.60),
    (0.81, 0.60, 0.45),
    (0.67, 0.45, 0.30),
    (0.49, 0.30, 0.19),
    (0.30, 0.18, 0.13),
)
"""Drawn colour of the skin types I to VI of Fitzpatrick."""
STATURE = np.array([1.16, 1.52, 1.70, 1.70, 1.62])
"""Height of a figure by age: child, teenager, adult, middle aged, elder."""
HEAD = np.array([0.115, 0.122, 0.125, 0.125, 0.122])
"""Radius of the head by age."""
STOOP = np.array([0.02, 0.02, 0.02, 0.02, 0.32])
"""How far the back of a standing figure leans forward by age, radians."""
ELDER = 4

_GREY: Rgb = (0.86, 0.86, 0.87)
_HAIR: tuple[Rgb, ...] = ((0.17, 0.12, 0.10), (0.26, 0.17, 0.12), (0.11, 0.10, 0.11))
_TOPS: tuple[Rgb, ...] = (
    (0.93, 0.72, 0.27),
    (0.36, 0.55, 0.70),
    (0.74, 0.36, 0.33),
    (0.48, 0.62, 0.45),
    (0.91, 0.89, 0.83),
    (0.55, 0.45, 0.65),
    (0.25, 0.38, 0.52),
    (0.87, 0.58, 0.42),
    (0.42, 0.66, 0.66),
    (0.62, 0.57, 0.50),
    (0.80, 0.55, 0.62),
    (0.33, 0.45, 0.38),
)
_TROUSERS: tuple[Rgb, ...] = ((0.22, 0.27, 0.38), (0.36, 0.33, 0.31), (0.50, 0.43, 0.34))
_SHOES: Rgb = (0.20, 0.15, 0.13)

_SIDES = (("left", 1.0), ("right", -1.0))
_RODS = (
    "neck",
    "shoulders",
    "smile_left",
    "smile_right",
    *(f"{limb}_{side}" for limb in ("upper", "fore", "thigh", "shin") for side, _ in _SIDES),
)
_BALLS = (
    "head",
    "hair",
    "nose",
    "torso",
    "hem",
    "hips",
    *(f"{part}_{side}" for part in ("eye", "glint", "ear", "hand", "shoe") for side, _ in _SIDES),
)
_SMALL = {
    "nose",
    *(f"{part}_{side}" for part in ("smile", "eye", "glint", "ear") for side, _ in _SIDES),
}
_SMILE = ("smile_left", "smile_right")
_SKIN_PARTS = ("neck", "head", "nose", "ear_left", "ear_right", "hand_left", "hand_right")


def dress(body: mujoco.MjsBody, index: int, asking: bool) -> None:
    """Add every part a guest can have to its body; ``Figures`` decides which are seen.

    Args:
        body: of the guest.
        index: of the guest; it chooses the clothes.
        asking: lay a warm light around the guest, so that who asks is found at a glance.
    """
    brush = Brush(body, f"look_{body.name}", floor=-float(body.pos[2]))
    top, trousers = _TOPS[index], _TROUSERS[index % len(_TROUSERS)]
    colours = dict.fromkeys((*_RODS, *_BALLS), top)
    for side, _ in _SIDES:
        colours |= {f"thigh_{side}": trousers, f"shin_{side}": trousers, f"shoe_{side}": _SHOES}
        colours |= {f"eye_{side}": (0.07, 0.05, 0.05), f"glint_{side}": (1.0, 1.0, 1.0)}
    colours |= {"hips": trousers}
    brush.spot("shade", (0.0, 0.0, 0.008), 0.42)
    if asking:
        brush.spot("glow", (0.0, 0.0, 0.005), 0.75, (1.0, 0.80, 0.35), 0.6)
    small = Brush(body, brush.prefix, brush.floor, group=INDOORS)
    for name in _RODS:
        paint = small if name in _SMALL else brush
        paint.rod(name, (0.0, 0.0, 0.0), (0.0, 0.0, 0.1), 0.05, colours[name])
    for name in _BALLS:
        paint = small if name in _SMALL else brush
        paint.ball(name, (0.0, 0.0, 0.0), (0.1, 0.1, 0.1), colours[name])
    props.chair(Brush(body, f"{brush.prefix}_chair", brush.floor), (-0.03, 0.0), 1.0)
    _wheelchair(Brush(body, f"{brush.prefix}_wheels", brush.floor))
    stick = Brush(body, f"{brush.prefix}_cane", brush.floor)
    stick.rod("shaft", (0.30, 0.25, 0.01), (0.27, 0.25, 0.80), 0.016, props.DARK_WOOD)
    stick.rod("grip", (0.22, 0.25, 0.81), (0.31, 0.25, 0.81), 0.020, props.DARK_WOOD)


def _wheelchair(brush: Brush) -> None:
    frame = (0.22, 0.28, 0.36)
    on_side = [0.7071068, 0.7071068, 0.0, 0.0]
    brush.box("seat", (-0.02, 0.0, SEAT_HEIGHT - 0.02), (0.20, 0.19, 0.025), frame)
    brush.box("back", (-0.225, 0.0, 0.66), (0.02, 0.20, 0.24), frame)
    for side, sign in _SIDES:
        wheel = (-0.06, 0.245 * sign, 0.28)
        for name, radius, half, colour in (
            ("tyre", 0.28, 0.016, RUBBER),
            ("disc", 0.24, 0.019, hue(STEEL, 1.1)),
            ("hub", 0.045, 0.026, RUBBER),
        ):
            brush.disc(f"{name}_{side}", wheel, radius, half, colour, quat=on_side)
        caster = (0.30, 0.17 * sign, 0.065)
        brush.disc(f"caster_{side}", caster, 0.065, 0.014, RUBBER, quat=on_side)
        brush.box(f"handle_{side}", (-0.29, 0.18 * sign, 0.90), (0.07, 0.02, 0.018), RUBBER)
        brush.box(f"arm_{side}", (-0.03, 0.225 * sign, 0.665), (0.16, 0.028, 0.018), RUBBER)
        brush.box(f"step_{side}", (0.40, 0.09 * sign, 0.09), (0.075, 0.06, 0.010), RUBBER)
        top, bottom = (0.22, 0.17 * sign, SEAT_HEIGHT - 0.03), (0.35, 0.15 * sign, 0.09)
        brush.rod(f"shank_{side}", top, bottom, 0.014, STEEL)


class Figures:
    """Sets how the guests of one dressed model look.

    Attributes:
        model: a dressed model of the caller's own; its geoms are changed.
        asking: index of the guest who raises an arm.
    """

    def __init__(self, model: mujoco.MjModel, asking: int) -> None:
        self.model = model
        self.asking = asking
        names = [model.geom(g).name for g in range(model.ngeom)]
        at = {name: g for g, name in enumerate(names)}
        guests = [f"look_guest{i}" for i in range(floor_plan.N_GUESTS)]
        self._rods = np.array([[at[f"{g}_{part}"] for part in _RODS] for g in guests])
        self._balls = np.array([[at[f"{g}_{part}"] for part in _BALLS] for g in guests])
        self._skin = np.array([[at[f"{g}_{part}"] for part in _SKIN_PARTS] for g in guests])
        self._smile = np.array([[at[f"{g}_{part}"] for part in _SMILE] for g in guests])
        self._hair = np.array([at[f"{g}_hair"] for g in guests])
        self._hair_rgb = np.array([_HAIR[i % len(_HAIR)] for i in range(floor_plan.N_GUESTS)])
        self._props = {
            kind: np.array(
                [[i for n, i in at.items() if n.startswith(f"{g}_{kind}_")] for g in guests]
            )
            for kind in ("chair", "wheels", "cane")
        }
        # parts were compiled unturned, which lets MuJoCo skip their rotation: they will turn
        model.geom_sameframe[self._rods] = model.geom_sameframe[self._balls] = 0
        body = model.geom_bodyid[self._hair[0]]
        self._floor = np.array([0.0, 0.0, -model.body_pos[body, 2]])

    def show(self, setups: Places, row: int) -> None:
        """Draw the guests of one service.

        Args:
            setups: services.
            row: which of them.
        """
        age, skin = setups.people[row, :, 2], setups.people[row, :, 4]
        wheels = setups.shape[row] == floor_plan.SHAPES.index("wheelchair")
        seated = (setups.table[row] >= 0) | wheels
        rods, balls = pose(age, wheels, setups.table[row] >= 0, self.asking)
        m = self.model
        start, end, radius = (np.stack([rods[name][k] for name in _RODS], axis=1) for k in range(3))
        m.geom_pos[self._rods] = (start + end) / 2 + self._floor
        m.geom_size[self._rods, 0] = radius
        m.geom_size[self._rods, 1] = np.linalg.norm(end - start, axis=-1) / 2
        m.geom_quat[self._rods] = _along(end - start)
        m.geom_rbound[self._rods] = m.geom_size[self._rods, :2].sum(axis=-1)
        centre, radii, lean = (
            np.stack([balls[name][k] for name in _BALLS], axis=1) for k in range(3)
        )
        m.geom_pos[self._balls] = centre + self._floor
        m.geom_size[self._balls] = radii
        m.geom_rbound[self._balls] = radii.max(axis=-1)
        m.geom_quat[self._balls] = np.stack(
            [np.cos(lean / 2), 0 * lean, np.sin(lean / 2), 0 * lean], axis=-1
        )
        m.geom_rgba[self._skin, :3] = np.array(SKIN)[skin][:, None]
        m.geom_rgba[self._smile, :3] = (np.array(SKIN) * [0.62, 0.40, 0.40])[skin][:, None]
        m.geom_rgba[self._hair, :3] = np.where((age == ELDER)[:, None], _GREY, self._hair_rgb)
        for kind, seen in (
            ("chair", seated & ~wheels),
            ("wheels", wheels),
            ("cane", (age == ELDER) & ~seated),
        ):
            m.geom_rgba[self._props[kind], 3] = seen[:, None]


def pose(
    age: np.ndarray, wheels: np.ndarray, at_table: np.ndarray, asking: int
) -> tuple[dict[str, tuple], dict[str, tuple]]:
    """Where the parts of figures are, in the frame of each figure, heights above the floor.

    Args:
        age: codes, int [n].
        wheels: who sits in a wheelchair, bool [n].
        at_table: who sits at a table, bool [n].
        asking: index of the one who raises an arm.

    Returns:
        Rods by name: start [n, 3], end [n, 3], radius [n]; and balls by name: centre [n, 3],
        radii [n, 3], lean about the y axis [n] in radians.
    """
    n = len(age)
    s, head = STATURE[age] / 1.70, HEAD[age]
    seated = at_table | wheels
    lean = np.where(seated, 0.45 * STOOP[age], STOOP[age])
    raised = np.arange(n) == asking
    with_cane = (age == ELDER) & ~seated

    def point(x, y, z) -> np.ndarray:
        return np.stack(np.broadcast_arrays(x, y, z), axis=-1).astype(float)

    def either(choose: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.where(choose[:, None], a, b)

    zero = np.zeros(n)
    hip = either(
        seated, point(-0.08, zero, SEAT_HEIGHT + 0.075), point(-0.15 * np.sin(lean), zero, 0.84 * s)
    )
    up = point(np.sin(lean), zero, np.cos(lean))
    chest = hip + 0.50 * s[:, None] * up
    nod = point(np.sin(0.8 * lean), zero, np.cos(0.8 * lean))
    skull = chest + (0.075 * s + head)[:, None] * nod
    yoke = hip + 0.455 * s[:, None] * up
    rods: dict[str, tuple] = {
        "neck": (chest, skull, 0.048 * s),
        "shoulders": (
            yoke + point(0, 0.135 * s, zero),
            yoke - point(0, 0.135 * s, zero),
            0.072 * s,
        ),
    }
    h = head[:, None]
    balls: dict[str, tuple] = {
        "head": (skull, h * [0.97, 0.92, 1.0], zero),
        "hair": (skull + h * [-0.26, 0.0, 0.26], h * [0.98, 1.03, 0.92], zero),
        "nose": (skull + h * [0.96, 0.0, -0.12], h * [0.12, 0.10, 0.10], zero),
        "torso": (hip + 0.285 * s[:, None] * up, s[:, None] * [0.116, 0.186, 0.275], lean),
        "hem": (hip + 0.085 * s[:, None] * up, s[:, None] * [0.116, 0.164, 0.155], lean),
        "hips": (hip + point(zero, zero, 0.01), s[:, None] * [0.108, 0.145, 0.105], zero),
    }
    for side, sign in _SIDES:
        shoulder = yoke + point(zero, 0.16 * s * sign, 0.01 * s)
        elbow = shoulder + s[:, None] * [-0.03, 0.065 * sign, -0.26]
        hand = elbow + s[:, None] * [0.07, 0.0, -0.23]
        on_arm = point(0.12 + zero, 0.225 * sign, 0.72)
        on_table = point(0.20 + 0.16 * s, 0.15 * sign, props.TABLE_HEIGHT + 0.045)
        rest = either(at_table, on_table, on_arm)
        bent = shoulder + s[:, None] * [0.05, 0.09 * sign, -0.24]
        elbow, hand = either(seated, bent, elbow), either(seated, rest, hand)
        if sign > 0:
            hand = either(with_cane, point(0.27 + zero, 0.25, 0.82), hand)
            elbow = either(with_cane, (shoulder + hand) / 2 + [-0.07, 0.05, -0.05], elbow)
        else:
            lifted = shoulder + s[:, None] * [0.03, -0.15, 0.23]
            elbow = either(raised, lifted, elbow)
            hand = either(raised, lifted + s[:, None] * [0.02, -0.05, 0.30], hand)
        rods[f"upper_{side}"] = (shoulder, elbow, 0.056 * s)
        rods[f"fore_{side}"] = (elbow, hand, 0.046 * s)
        balls[f"hand_{side}"] = (hand, s[:, None] * [0.055, 0.05, 0.058], zero)
        socket = hip + point(zero, 0.08 * s * sign, zero)
        ankle = point(-0.02 + zero, 0.10 * s * sign, 0.09 * s)
        knee = (socket + ankle) / 2 + s[:, None] * [0.03, 0.0, 0.0]
        sit_knee = socket + s[:, None] * [0.43, 0.03 * sign, 0.015]
        drop = np.maximum(sit_knee[:, 2] - 0.40 * s, np.where(wheels, 0.16, 0.09))
        sit_ankle = point(sit_knee[:, 0] - 0.01, sit_knee[:, 1], drop)
        knee, ankle = either(seated, sit_knee, knee), either(seated, sit_ankle, ankle)
        rods[f"thigh_{side}"] = (socket, knee, 0.074 * s)
        rods[f"shin_{side}"] = (knee, ankle, 0.058 * s)
        shoe = ankle + s[:, None] * [0.055, 0.0, -0.035]
        balls[f"shoe_{side}"] = (shoe, s[:, None] * [0.125, 0.060, 0.055], zero)
        eye = skull + h * [0.87, 0.35 * sign, 0.06]
        balls[f"eye_{side}"] = (eye, h * [0.08, 0.105, 0.145], zero)
        balls[f"glint_{side}"] = (eye + h * [0.07, 0.03, 0.05], h * [0.03, 0.035, 0.035], zero)
        corner, middle = [0.885, 0.25 * sign, -0.31], [0.905, 0.0, -0.385]
        rods[f"smile_{side}"] = (skull + h * corner, skull + h * middle, 0.028 * head)
        ear = skull + h * [-0.02, 0.92 * sign, -0.05]
        balls[f"ear_{side}"] = (ear, h * [0.14, 0.10, 0.20], zero)
    return rods, balls


def _along(way: np.ndarray) -> np.ndarray:
    """Rotations that turn the z axis into each direction, quaternions w first, [..., 4]."""
    unit = way / np.linalg.norm(way, axis=-1, keepdims=True)
    w = 1.0 + unit[..., 2]
    # straight down has no unique axis: any will do
    down = w < 1e-9
    quat = np.stack([w, -unit[..., 1], unit[..., 0], 0.0 * w], axis=-1)
    quat[down] = [0.0, 1.0, 0.0, 0.0]
    return quat / np.linalg.norm(quat, axis=-1, keepdims=True)
