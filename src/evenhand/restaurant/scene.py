"""The restaurant as a MuJoCo model, built with MjSpec and compiled once.

Two models share bodies, joints, actuators and sensors. The lean one has footprints only: spheres
whose centres lie at one height, so that contact is exactly contact of discs in the plane. The
dressed one adds what eyes need. A state of one is a state of the other.
"""

from __future__ import annotations

import functools

import mujoco
import numpy as np

from evenhand.restaurant import dressing, plan

FOOTPRINT_HEIGHT = 0.30
"""Height of all footprint spheres and of the sensor."""
PERSON = 0
"""Index of the guest who asks for service."""
SENSOR_PERSON = slice(0, 3)
"""Sensor data: position of the person in the robot's sensor frame, metres."""
SENSOR_TIMER = 3
"""Sensor data: time since the service began, seconds."""
SENSOR_CONTACTS = 4
"""Sensor data: contacts, where they are counted."""
DRIVE_GAIN = 800.0
"""Newton per metre per second of speed error."""


def guest_name(index: int) -> str:
    """Name of a guest's body."""
    return f"guest{index}"


def build(dressed: bool = False, counting: bool = False) -> mujoco.MjSpec:
    """The scene as a specification that can be edited before it is compiled.

    Args:
        dressed: add looks, lights, and cameras for rendering.
        counting: add a sensor of how many contacts there are, after the others.
    """
    spec = mujoco.MjSpec()
    spec.modelname = "restaurant"
    spec.option.timestep = plan.TIMESTEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = [0.0, 0.0, 0.0]  # nothing can fall: the robot moves in the plane
    spec.option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    world = spec.worldbody
    _walls(world)
    for t, centre in enumerate(plan.TABLES):
        _footprint(world, f"table{t}", centre, plan.TABLE_RADIUS)
    for c, centre in enumerate(plan.CHAIRS):
        _footprint(world, f"chair{c}", centre, plan.CHAIR_RADIUS)
    robot = _robot(spec)
    guests = [_guest(world, i) for i in range(plan.N_GUESTS)]
    _sensors(spec)
    if counting:
        spec.add_sensor(
            name="contacts",
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            intprm=[1 << int(mujoco.mjtConDataField.mjCONDATA_FOUND), 0, 1],
        )
    if dressed:
        dressing.dress(spec, robot, guests, PERSON)
    return spec


@functools.cache
def model(dressed: bool = False) -> mujoco.MjModel:
    """The compiled scene; callers that change it copy it first."""
    return build(dressed).compile()


def _footprint(
    body: mujoco.MjsBody, name: str, centre: np.ndarray | tuple[float, float], radius: float
) -> None:
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[radius, 0, 0],
        pos=[centre[0], centre[1], FOOTPRINT_HEIGHT],
        contype=0,
        conaffinity=1,
        condim=1,
        group=3,
        rgba=[0.6, 0.6, 0.6, 1.0],
    )


def _walls(world: mujoco.MjsBody) -> None:
    x, y = plan.ROOM
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
    body = spec.worldbody.add_body(name="robot", pos=[0, 0, FOOTPRINT_HEIGHT])
    body.add_geom(
        name="robot_base",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[plan.ROBOT_RADIUS, 0, 0],
        mass=plan.ROBOT_MASS,
        contype=1,
        conaffinity=0,
        condim=1,
        group=3,
    )
    body.add_site(name="robot_sensor", pos=[0, 0, 0])
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    inertia = 0.4 * plan.ROBOT_MASS * plan.ROBOT_RADIUS**2
    for name, kind, axis, gain, limit in (
        ("x", slide, (1, 0, 0), DRIVE_GAIN, plan.ROBOT_MASS * plan.MAX_ACCELERATION),
        ("y", slide, (0, 1, 0), DRIVE_GAIN, plan.ROBOT_MASS * plan.MAX_ACCELERATION),
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


def _guest(world: mujoco.MjsBody, index: int) -> mujoco.MjsBody:
    """A guest is placed by writing its mocap pose; its radius is set for each simulation.

    The model holds the largest radius, so that bounding volumes are safe for every shape.
    """
    body = world.add_body(
        name=guest_name(index), mocap=True, pos=[index - 6.0, 0.0, FOOTPRINT_HEIGHT]
    )
    body.add_geom(
        name=f"{guest_name(index)}_footprint",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[float(plan.SHAPE_RADIUS.max()), 0, 0],
        contype=0,
        conaffinity=1,
        condim=1,
        group=3,
    )
    return body


def _sensors(spec: mujoco.MjSpec) -> None:
    spec.add_sensor(
        name="person_position",
        type=mujoco.mjtSensor.mjSENS_FRAMEPOS,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        objname=guest_name(PERSON),
        reftype=mujoco.mjtObj.mjOBJ_SITE,
        refname="robot_sensor",
    )
    spec.add_sensor(name="timer", type=mujoco.mjtSensor.mjSENS_CLOCK)
