"""The restaurant as MuJoCo models, built with MjSpec and compiled once.

All have the same footprints: spheres whose centres lie at one height, so that contact is exactly
contact of discs in the plane. In the *lean* and the *dressed* model guests are bodies, and a state
of one is a state of the other; the dressed one adds what eyes need. In the *still* model guests are
part of the room: services are simulated in it, since it is much faster, and the robot moves in it
as in the lean one, to the last bit.
"""

from __future__ import annotations

import functools

import mujoco
import numpy as np

from evenhand.restaurant import floor_plan

FOOTPRINT_HEIGHT = 0.30
"""Height of all footprint spheres and of the sensor."""
PERSON = 0
"""Index of the guest who asks for service."""
ROBOT = "robot"
"""Name of a body."""
ROBOT_FOOTPRINT = "robot_base"
"""Name of a geom."""
SENSOR_PERSON = slice(0, 3)
"""Sensor data: position of the person in the robot's sensor frame, metres."""
SENSOR_TIMER = 3
"""Sensor data: time since the service began, seconds."""
SENSOR_CONTACTS = 4
"""Sensor data: contacts, where guests are part of the room."""
DRIVE_GAIN = 800.0
"""Newton per metre per second of speed error."""


def guest_name(index: int) -> str:
    """Name of a guest's body."""
    return f"guest{index}"


def footprint_name(guest: int) -> str:
    """Name of a guest's footprint."""
    return f"{guest_name(guest)}_footprint"


def build() -> mujoco.MjSpec:
    """The scene as a specification that can be edited before it is compiled."""
    spec, _ = _room()
    world = spec.worldbody
    for i in range(floor_plan.N_GUESTS):
        # placed by writing its mocap pose
        guest = world.add_body(name=guest_name(i), mocap=True, pos=_waiting(i))
        _guest_footprint(guest, i, (0.0, 0.0, 0.0))
    _sensors(spec, mujoco.mjtObj.mjOBJ_BODY, guest_name(PERSON))
    return spec


@functools.cache
def model() -> mujoco.MjModel:
    """The compiled scene; callers that change it copy it first."""
    return build().compile()


@functools.cache
def still_model() -> mujoco.MjModel:
    """The scene with guests as part of the room, and a sensor of how many contacts there are.

    It has two bodies where the others have fourteen. A guest is placed by writing the place of its
    geom; no tree of bounding volumes is used, since it would not follow. Callers that change the
    model copy it first.
    """
    spec, _ = _room()
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    for i in range(floor_plan.N_GUESTS):
        footprint = _guest_footprint(spec.worldbody, i, _waiting(i))
        footprint.conaffinity = 0
        spec.add_pair(geomname1=ROBOT_FOOTPRINT, geomname2=footprint.name, condim=1)
    _sensors(spec, mujoco.mjtObj.mjOBJ_GEOM, footprint_name(PERSON))
    spec.add_sensor(
        name="contacts",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        intprm=[1 << int(mujoco.mjtConDataField.mjCONDATA_FOUND), 0, 1],
    )
    model = spec.compile()
    # Contacts as where guests are bodies after the robot: robot first, and after those with the
    # room. So pushes are the same to the last bit.
    robot = model.geom(ROBOT_FOOTPRINT).id
    model.pair_geom2[:] = np.where(model.pair_geom1 == robot, model.pair_geom2, model.pair_geom1)
    model.pair_geom1[:] = robot
    model.pair_signature[:] += 1 << 16
    return model


def _room() -> tuple[mujoco.MjSpec, mujoco.MjsBody]:
    """The scene without guests and sensors, and the robot in it."""
    spec = mujoco.MjSpec()
    spec.modelname = "restaurant"
    spec.option.timestep = floor_plan.TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = [0.0, 0.0, 0.0]  # nothing can fall: the robot moves in the plane
    spec.option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    world = spec.worldbody
    _walls(world)
    for t, (x, y) in enumerate(floor_plan.TABLES):
        _footprint(world, f"table{t}", (x, y, FOOTPRINT_HEIGHT), floor_plan.TABLE_RADIUS)
    for c, (x, y) in enumerate(floor_plan.CHAIRS):
        _footprint(world, f"chair{c}", (x, y, FOOTPRINT_HEIGHT), floor_plan.CHAIR_RADIUS)
    return spec, _robot(spec)


def _footprint(
    body: mujoco.MjsBody, name: str, place: tuple[float, float, float], radius: float
) -> mujoco.MjsGeom:
    return body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[radius, 0, 0],
        pos=place,
        contype=0,
        conaffinity=1,
        condim=1,
        group=3,
        rgba=[0.6, 0.6, 0.6, 1.0],
    )


def _waiting(guest: int) -> tuple[float, float, float]:
    """Where a guest is who has not been placed."""
    return guest - 6.0, 0.0, FOOTPRINT_HEIGHT


def _guest_footprint(
    body: mujoco.MjsBody, guest: int, place: tuple[float, float, float]
) -> mujoco.MjsGeom:
    """Its radius is set for each simulation.

    The model holds the largest, so that bounding volumes are safe for every shape.
    """
    return _footprint(body, footprint_name(guest), place, float(floor_plan.SHAPE_RADIUS.max()))


def _walls(world: mujoco.MjsBody) -> None:
    x, y = floor_plan.ROOM
    for name, pos, axis in (
        ("wall_east", (x, 0, 0), (-1, 0, 0)),
        ("wall_west", (-x, 0, 0), (1, 0, 0)),
        ("wall_north", (0, y, 0), (0, -1, 0)),
        ("wall_south", (0, -y, 0), (0, 1, 0)),
    ):
        world.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[0, 0, 1],
            pos=pos,
            zaxis=axis,
            contype=0,
            conaffinity=1,
            condim=1,
            group=3,
        )


def _robot(spec: mujoco.MjSpec) -> mujoco.MjsBody:
    """A holonomic base: two slides and a hinge, each with a velocity servo of limited force."""
    body = spec.worldbody.add_body(name=ROBOT, pos=[0, 0, FOOTPRINT_HEIGHT])
    body.add_geom(
        name=ROBOT_FOOTPRINT,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[floor_plan.ROBOT_RADIUS, 0, 0],
        mass=floor_plan.ROBOT_MASS,
        contype=1,
        conaffinity=0,
        condim=1,
        group=3,
    )
    body.add_site(name="robot_sensor", pos=[0, 0, 0])
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    inertia = 0.4 * floor_plan.ROBOT_MASS * floor_plan.ROBOT_RADIUS**2
    for name, kind, axis, gain, limit in (
        ("x", slide, (1, 0, 0), DRIVE_GAIN, floor_plan.ROBOT_MASS * floor_plan.MAX_ACCELERATION),
        ("y", slide, (0, 1, 0), DRIVE_GAIN, floor_plan.ROBOT_MASS * floor_plan.MAX_ACCELERATION),
        ("yaw", hinge, (0, 0, 1), 20.0 * inertia, 12.0 * inertia),
    ):
        body.add_joint(name=f"robot_{name}", type=kind, axis=axis)
        actuator = spec.add_actuator(
            name=f"drive_{name}",
            target=f"robot_{name}",
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            forcelimited=True,
            forcerange=[-limit, limit],
        )
        actuator.set_to_velocity(kv=gain)
    return body


def _sensors(spec: mujoco.MjSpec, kind: mujoco.mjtObj, person: str) -> None:
    spec.add_sensor(
        name="person_position",
        type=mujoco.mjtSensor.mjSENS_FRAMEPOS,
        objtype=kind,
        objname=person,
        reftype=mujoco.mjtObj.mjOBJ_SITE,
        refname="robot_sensor",
    )
    spec.add_sensor(name="timer", type=mujoco.mjtSensor.mjSENS_CLOCK)
