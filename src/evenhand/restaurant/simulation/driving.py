"""What happens between two decisions, as machine code: steering, tracking, sensing.

All of it is in one file, because kept machine code is known by the age of its own file alone. Lanes
are rows of structured arrays, whose fields are described where they are made (``world.TRUTH``,
``lanes.PERCEIVED``). Lengths are in metres, points of the plane x + iy.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from evenhand.core.machine_code import Records, compiled, compiled_apart

Network = tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...], np.ndarray, np.ndarray, bool]
"""Numbers of a policy; see ``forward``."""
Engine = Arrays = Numbers = tuple[Any, ...]
"""See ``serve``."""
STEP, SET_STATE = "evenhand_mj_step", "evenhand_mj_setState"
"""Names under which ``native`` makes MuJoCo's functions known."""
_step: Any = types.ExternalFunction(STEP, types.void(types.intp, types.intp))
_set_state: Any = types.ExternalFunction(
    SET_STATE, types.void(types.intp, types.intp, types.intp, types.int32)
)

_FRONT = np.cos(np.deg2rad(55.0))
"""As in ``route``."""
_REACHED = 0.20
"""Metres from a corner of the way at which the robot turns to the next point."""
_YAW_GAIN, _YAW_SPEED = 6.0, 3.0
_APPROACH_GAIN = 4.0
"""Metres per second for each metre that is left; low enough not to overshoot between decisions."""


@compiled
def steer(
    robot: complex, heading: float, target: complex, gap: float, top_speed: float, brake: float
) -> tuple[float, float, float]:
    """Velocities that drive to a point, slowing down as the gap to the person closes.

    Args:
        robot: centre.
        heading: radians.
        target: next point of the way.
        gap: metres left to the person before ``walk`` stops.
        top_speed: of the drive, m/s.
        brake: greatest deceleration of the drive, m/s²; the approach counts on half of it.

    Returns:
        Commands of the three velocity servos: x, y (m/s) and yaw (rad/s).
    """
    way = target - robot
    gap = max(gap, 0.0)
    speed = min(np.sqrt(brake * gap), _APPROACH_GAIN * gap, top_speed) / max(abs(way), 1e-9)
    turn = (np.arctan2(way.imag, way.real) - heading + np.pi) % (2 * np.pi) - np.pi
    return way.real * speed, way.imag * speed, min(max(_YAW_GAIN * turn, -_YAW_SPEED), _YAW_SPEED)


@compiled
def follow(
    ids: np.ndarray,
    pose: np.ndarray,
    truth: Records,
    command: np.ndarray,
    top_speed: float,
    brake: float,
) -> None:
    """Steer robots to the next point of their ways.

    Args:
        ids: lanes, int [k].
        pose: x, y (m), yaw (rad), [n, 3].
        truth: ``world.TRUTH``, [n]; the next point, and where the robot is, are written.
        command: of the servos, written, [n, 3].
        top_speed: see ``steer``.
        brake: see ``steer``.
    """
    for i in ids:
        lane = truth[i]
        robot = complex(pose[i, 0], pose[i, 1])
        lane.robot = robot
        k = lane.next
        if k < lane.last:
            near = abs(lane.way[k] - robot) < _REACHED
            # the point before a seat may be skipped once the robot is in front of it
            if k == lane.last - 1 and lane.front != 0:
                to_person = lane.way[-1] - robot
                away = -(to_person * lane.front.conjugate()).real
                near = near or away >= _FRONT * abs(to_person)
            if near:
                k += 1
                lane.next = k
        x, y, yaw = steer(
            robot, pose[i, 2], lane.way[k], lane.distance - lane.stop, top_speed, brake
        )
        command[i, 0], command[i, 1], command[i, 2] = x, y, yaw


@compiled
def track(ids: np.ndarray, pose: np.ndarray, contacts: np.ndarray, truth: Records) -> None:
    """Add up what happened in the physics steps since ``follow``.

    Args:
        ids: lanes, int [k].
        pose: after every step, [k, s, 3].
        contacts: number of them in every step, [k, s].
        truth: ``world.TRUTH``, [n], written.
    """
    steps = pose.shape[1]
    for row, i in enumerate(ids):
        lane = truth[i]
        person, robot = lane.way[-1], lane.robot
        least, path, touched, distance = lane.min_distance, lane.path_length, 0, lane.distance
        for s in range(steps):
            now = complex(pose[row, s, 0], pose[row, s, 1])
            path += abs(now - robot)
            robot = now
            distance = abs(now - person)
            least = min(least, distance)
            touched += contacts[row, s] > 0
        lane.robot, lane.distance, lane.min_distance = robot, distance, least
        lane.path_length = path
        lane.contact_steps += touched
        lane.steps += steps


@compiled
def answer(ids: np.ndarray, truth: Records) -> None:
    """A response in these lanes, which is one if the person notices it.

    Args:
        ids: lanes, int [k].
        truth: ``world.TRUTH``, [n], written.
    """
    for i in ids:
        lane = truth[i]
        lane.responded = lane.room <= lane.distance <= lane.reach and lane.steps >= lane.signal


@compiled
def read(
    ids: np.ndarray,
    seen: np.ndarray,
    clock: np.ndarray,
    noise: np.ndarray,
    perceived: Records,
    timestep: float,
    interval: int,
    max_steps: int,
) -> np.ndarray:
    """One reading of the distance sensor and the timer of these lanes.

    As MuJoCo leaves them after a step, readings are one physics step old; the timer adds it.

    Args:
        ids: lanes, int [k].
        seen: place of the person by the distance sensor, x and y, [n, 2].
        clock: seconds by the timer, [n].
        noise: error of every reading of a service, NaN for one that fails, [n, K].
        perceived: ``lanes.PERCEIVED``, [n], written: a reading that fails leaves the last one,
            which grows old.
        timestep: seconds of a physics step.
        interval: physics steps between two readings.
        max_steps: of a service.

    Returns:
        Which lanes have run out of time, bool [k].
    """
    over = np.empty(len(ids), np.bool_)
    for row, i in enumerate(ids):
        lane = perceived[i]
        lane.steps = int(np.rint(clock[i] / timestep)) + 1
        error = noise[i, lane.steps // interval]
        if np.isnan(error):
            lane.age += interval * timestep
        else:
            lane.reading = max(lane.stretch * np.hypot(seen[i, 0], seen[i, 1]) + error, 0.0)
            lane.age = 0.0
        over[row] = lane.steps >= max_steps
    return over


@compiled
def observe(
    ids: np.ndarray,
    one_hot: np.ndarray,
    distance: np.ndarray,
    steps: np.ndarray,
    age: np.ndarray,
    units: tuple[float, float, float],
    limit: float,
) -> np.ndarray:
    """What a network takes of these lanes; see ``task.observe``."""
    out = np.empty((len(ids), one_hot.shape[1] + 3), np.float32)
    for row, i in enumerate(ids):
        _observe(one_hot[i], distance[i], steps[i], age[i], units, limit, out[row])
    return out


@compiled
def _observe(
    one_hot: np.ndarray,
    distance: Any,
    steps: Any,
    age: Any,
    units: tuple[float, float, float],
    limit: float,
    out: np.ndarray,
) -> None:
    groups = len(one_hot)
    for g in range(groups):
        out[g] = one_hot[g]
    out[groups] = min(distance / units[0], limit)
    out[groups + 1] = steps / units[1]
    out[groups + 2] = min(age / units[2], 1.0)


@compiled
def forward(seen: np.ndarray, network: Network, wide: np.ndarray) -> float:
    """Probability of the second of two actions by a multilayer perceptron.

    Args:
        seen: observation, float32 [O].
        network: weights and biases of every layer, what is taken from an observation and what it
            is then multiplied by, and whether the activation is relu; else it is tanh.
        wide: float32 [2, W], room for the values of the widest layer, written.
    """
    weights, biases, centre, scale, relu = network
    last = len(weights) - 1
    at, to = wide[0], wide[1]
    for i in range(len(seen)):
        at[i] = (seen[i] - centre[i]) * scale[i]
    for layer in range(last):
        weight, bias = weights[layer], biases[layer]
        rows, columns = weight.shape
        for j in range(columns):
            to[j] = 0.0
        for i in range(rows):
            value = at[i]
            if value != 0.0:  # most identities are not the person's
                for j in range(columns):
                    to[j] += value * weight[i, j]
        if relu:
            for j in range(columns):
                to[j] = max(to[j] + bias[j], np.float32(0.0))
        else:
            for j in range(columns):  # tanh by exp, which compilers do for many at once
                rise = np.exp(np.float32(2.0) * (to[j] + bias[j]))
                to[j] = np.float32(1.0) - np.float32(2.0) / (rise + np.float32(1.0))
        at, to = to, at
    weight, bias = weights[last], biases[last]
    odds = np.float32(0.0)
    for i in range(weight.shape[0]):
        odds += at[i] * (weight[i, 1] - weight[i, 0])
    odds += bias[1] - bias[0]
    return 1.0 / (1.0 + np.exp(-np.float64(odds)))


@compiled_apart
def serve(
    i: int,
    engine: Engine,
    lanes: Arrays,
    network: Network,
    wide: np.ndarray,
    kept: Arrays,
    numbers: Numbers,
) -> None:
    """One service from its beginning to its end.

    Args:
        i: which, of n.
        engine: addresses of a model and a data of MuJoCo, the state of one that is fresh and what
            of the data that is, the geoms of the guests [12]; then places and sizes of geoms, pose
            of the robot, command, place of the person by the sensor, timer, and how many contacts
            there are, all of them written.
        lanes: places [n, 12, 2] and radii [n, 12] of the guests, noise of readings [n, K]; truth
            and perceived [n], pose at the beginning [n, 3], command [n, 3], place of the person by
            the sensor [n, 2] and timer [n], all of them written.
        network: see ``forward``.
        wide: see ``forward``.
        kept: uniform [n, L], and written observation [n, L, O], action [n, L], mask [n, L], and
            the pose at every decision [n, L + 1, 3], or nothing, [0, 0, 3].
        numbers: physics steps between decisions and between commands, and of a service; seconds of
            a step; top speed and brake of ``steer``; units and limit of ``observe``.
    """
    model, data, fresh, spec, geoms, places, sizes, qpos, ctrl, place, timer, contacts = engine
    guests, radius, noise, truth, perceived, pose, command, sensed, clock = lanes
    uniform, observation, action, mask, seen = kept
    interval, steered, most, timestep, top_speed, brake, units, limit = numbers
    _set_state(model, data, fresh.ctypes.data, spec)
    qpos[:] = pose[i]
    for guest, geom in enumerate(geoms):
        places[geom, 0], places[geom, 1] = guests[i, guest, 0], guests[i, guest, 1]
        sizes[geom, 0] = radius[i, guest]
    ids = np.full(1, i)
    poses, touched = np.empty((1, steered, 3)), np.empty((1, steered))
    known = perceived[i]
    for k in range(uniform.shape[1]):
        now = observation[i, k]
        _observe(known.one_hot, known.reading, known.steps, known.age, units, limit, now)
        mask[i, k] = 1.0
        if len(seen):
            seen[i, k] = qpos
        if uniform[i, k] < forward(now, network, wide):
            action[i, k] = 1
            answer(ids, truth)
            return
        for first in range(0, interval, steered):
            pose[i] = qpos
            follow(ids, pose, truth, command, top_speed, brake)
            ctrl[:] = command[i]
            steps = min(steered, interval - first)
            for s in range(steps):
                _step(model, data)
                poses[0, s] = qpos
                touched[0, s] = contacts[0]
            track(ids, poses[:, :steps], touched[:, :steps], truth)
        sensed[i, 0], sensed[i, 1] = place[0], place[1]
        clock[i] = timer[0]
        if read(ids, sensed, clock, noise, perceived, timestep, interval, most)[0]:
            if len(seen):
                seen[i, k + 1] = qpos
            return
