"""What happens between two decisions, as machine code: steering, tracking, sensing.

All of it is in one file, because kept machine code is known by the age of its own file alone. Lanes
are rows of structured arrays, whose fields are described where they are made (``physics.TRUTH``,
``lanes.PERCEIVED``). Lengths are in metres, points of the plane x + iy.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from evenhand.core.machine_code import Records, compiled, compiled_apart

_FRONT = np.cos(np.deg2rad(55.0))
"""As in ``route``."""
_REACHED = 0.20
"""Metres from a corner of the way at which the robot turns to the next point."""
_YAW_GAIN, _YAW_SPEED = 6.0, 3.0
_APPROACH_GAIN = 4.0
"""Metres per second for each metre that is left; low enough not to overshoot between decisions."""


class Simulation(NamedTuple):
    """One simulation of MuJoCo; arrays are views of what it holds."""

    model: int  # address
    data: int  # address
    spec: int  # which state ``ServiceArrays.state`` is
    geoms: np.ndarray  # footprints of the guests among all geoms, int [12]
    place: np.ndarray  # of all geoms, metres, written, [geoms, 3]
    size: np.ndarray  # of all geoms, metres, written, [geoms, 3]
    pose: np.ndarray  # of the robot, [1, 3]
    command: np.ndarray  # of the servos, written, [1, 3]
    person: np.ndarray  # place of the person by the distance sensor, [1, 2]
    timer: np.ndarray  # seconds, [1]
    contacts: np.ndarray  # how many there are, [1]


class ServiceArrays(NamedTuple):
    """N services of at most L decisions that are drawn; see ``lanes.Beginning``."""

    state: np.ndarray  # of a simulation, [N, nstate]
    place: np.ndarray  # of the guests, metres, [N, 12, 2]
    radius: np.ndarray  # of the guests, metres, [N, 12]
    uniform: np.ndarray  # decides on every action, [N, L]
    noise: np.ndarray  # of every reading, see ``read``, [N, L + 1]
    truth: Records  # ``physics.TRUTH``, written, [N]
    perceived: Records  # ``lanes.PERCEIVED``, written, [N]
    turn: np.ndarray  # place in the party; its first is 0 and comes before the others, int [N]


class Pace(NamedTuple):
    """When and how fast things happen in the task."""

    interval: int  # physics steps between decisions
    steered: int  # physics steps between commands
    max_steps: int  # physics steps of a service
    timestep: float  # seconds of a physics step
    top_speed: float  # see ``steer``
    brake: float  # see ``steer``
    units: tuple[float, float, float]  # see ``task.observe``
    limit: float  # see ``task.observe``
    time: int  # column of a state that holds the seconds since a service began


class Kept(NamedTuple):
    """What is written down of N services of at most L decisions; see ``serve.Trajectories``."""

    observation: np.ndarray  # float32 [N, L, O]
    action: np.ndarray  # int32 [N, L]
    mask: np.ndarray  # float32 [N, L]
    pose: np.ndarray  # at every decision and a time-out, [N, L + 1, 3]; [0, L + 1, 3]: unrecorded
    moment: Records  # ``MOMENT`` at every decision, [N, L]; [0, L]: not written down


MOMENT = np.dtype(
    [
        ("responded", np.bool_),
        ("steps", np.int64),
        ("distance", float),
        ("min_distance", float),
        ("path_length", float),
        ("contact_steps", np.int64),
        ("reading", float),
    ],
    align=True,
)
"""What a response at a decision would end with: whether it would be noticed, and the true facts of
the service so far; see ``lanes.Facts``. ``reading``: distance as last sensed, metres."""


class Network(NamedTuple):
    """A multilayer perceptron of two actions, walk and respond; all numbers are float32.

    It is a ``serve.Robot`` that any number of threads can ask. Its sums are in another order than
    NumPy's: where a probability and a random number differ in their last bits only, a decision can
    differ.

    Attributes:
        weights: one matrix per layer, [inputs, outputs]; the last has two outputs.
        biases: one vector per layer, [outputs].
        centre: what is subtracted from an observation, [O].
        scale: what it is then multiplied by, [O].
        relu: the activation of the hidden layers; else tanh.
    """

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    centre: np.ndarray
    scale: np.ndarray
    relu: bool

    def __call__(self, observation: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Probability of responding now, [n].

        Args:
            observation: float32 [n, O].
            rows: not used.
        """
        return probability(observation, self)


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
        truth: ``physics.TRUTH``, [n]; the next point, and where the robot is, are written.
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
        truth: ``physics.TRUTH``, [n], written.
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
        truth: ``physics.TRUTH``, [n], written.
    """
    for i in ids:
        lane = truth[i]
        lane.responded = _noticed(lane)


@compiled
def _noticed(lane: Records) -> bool:
    return lane.room <= lane.distance <= lane.reach and lane.steps >= lane.signal


@compiled
def spent(steps: int, max_steps: int, interval: int) -> int:
    """Steps of a party's time that are gone when the next person's turn comes.

    At least one decision is left, so that everybody is asked for.
    """
    return min(steps, max_steps - interval)


@compiled
def note(moment: Records, lane: Records, known: Records) -> None:
    """Write down what a response would end with now.

    Args:
        moment: ``MOMENT``, written.
        lane: ``physics.TRUTH``.
        known: ``lanes.PERCEIVED``.
    """
    moment.responded = _noticed(lane)
    moment.steps, moment.contact_steps = lane.steps, lane.contact_steps
    moment.distance, moment.min_distance = lane.distance, lane.min_distance
    moment.path_length, moment.reading = lane.path_length, known.reading


@compiled
def decide(
    ids: np.ndarray,
    rows: np.ndarray,
    k: int,
    seen: np.ndarray,
    chance: np.ndarray,
    uniform: np.ndarray,
    kept: Kept,
    pose: np.ndarray,
    truth: Records,
    perceived: Records,
) -> np.ndarray:
    """Who responds and who walks at the k-th decision.

    Args:
        ids: lanes, int [n].
        rows: their services, int [n].
        k: number of the decision.
        seen: observations, float32 [n, O].
        chance: of a response, [n].
        uniform: random numbers, one for each decision of each service, [N, L].
        kept: what is written down.
        pose: of the robots, [lanes, 3].
        truth: ``physics.TRUTH``, [lanes]; responses are written.
        perceived: ``lanes.PERCEIVED``, [lanes].

    Returns:
        Lanes that walk, int [m].
    """
    walks = np.empty_like(ids)
    m = 0
    for n, i in enumerate(ids):
        row = rows[n]
        answers = uniform[row, k] < chance[n]
        kept.observation[row, k] = seen[n]
        kept.action[row, k] = answers
        kept.mask[row, k] = 1.0
        if len(kept.pose):
            kept.pose[row, k] = pose[i]
        if len(kept.moment):
            note(kept.moment[row, k], truth[i], perceived[i])
        if answers:
            answer(ids[n : n + 1], truth)
        else:
            walks[m] = i
            m += 1
    return walks[:m]


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
    groups = one_hot.shape[1]
    out = np.empty((len(ids), groups + 3), np.float32)
    for row, i in enumerate(ids):
        out[row, :groups] = one_hot[i]
        out[row, groups] = min(distance[i] / units[0], limit)
        out[row, groups + 1] = steps[i] / units[1]
        out[row, groups + 2] = min(age[i] / units[2], 1.0)
    return out


@compiled
def probability(observation: np.ndarray, network: Network) -> np.ndarray:
    """Of the second action, [n], for observations float32 [n, O]."""
    out = np.empty(len(observation))
    for row, seen in enumerate(observation):
        out[row] = _forward(seen, network)
    return out


@compiled
def _forward(seen: np.ndarray, network: Network) -> float:
    """Probability of the second action."""
    weights, biases, centre, scale, relu = network
    last, widest = len(weights) - 1, 0
    for weight in weights:
        widest = max(widest, weight.shape[0])
    at, to = np.empty(widest, np.float32), np.empty(widest, np.float32)
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
    ids: np.ndarray,
    step: Callable[[int, int], None],
    set_state: Callable[[int, int, int, Any], None],
    simulation: Simulation,
    services: ServiceArrays,
    network: Network,
    pace: Pace,
    kept: Kept,
) -> None:
    """Services from their beginning to their end, one after the other.

    Args:
        ids: which, int [k].
        step: ``mj_step``, with addresses as arguments.
        set_state: ``mj_setState``, likewise.
        simulation: where they run.
        services: all that are drawn.
        network: who serves.
        pace: of the task.
        kept: what is written down.
    """
    one = np.zeros(1, np.int64)
    poses, contacts = np.empty((1, pace.steered, 3)), np.empty((1, pace.steered))
    pose, model, data = simulation.pose, simulation.model, simulation.data
    for i in ids:
        used = 0
        if services.turn[i] > 0:
            used = spent(services.truth[i - 1].steps, pace.max_steps, pace.interval)
        services.state[i, pace.time] = used * pace.timestep
        set_state(model, data, services.state[i].ctypes.data, np.int32(simulation.spec))
        services.state[i, pace.time] = 0.0
        for guest, geom in enumerate(simulation.geoms):
            simulation.place[geom, :2] = services.place[i, guest]
            simulation.size[geom, 0] = services.radius[i, guest]
        truth, known = services.truth[i : i + 1], services.perceived[i : i + 1]
        truth[0].steps, known[0].steps = used, used
        noise = services.noise[i : i + 1]
        for k in range(services.uniform.shape[1]):
            seen = observe(
                one, known.one_hot, known.reading, known.steps, known.age, pace.units, pace.limit
            )[0]
            kept.observation[i, k] = seen
            kept.mask[i, k] = 1.0
            if len(kept.pose):
                kept.pose[i, k] = pose[0]
            if len(kept.moment):
                note(kept.moment[i, k], truth[0], known[0])
            if services.uniform[i, k] < _forward(seen, network):
                kept.action[i, k] = 1
                answer(one, truth)
                break
            for first in range(0, pace.interval, pace.steered):
                follow(one, pose, truth, simulation.command, pace.top_speed, pace.brake)
                steps = min(pace.steered, pace.interval - first)
                for s in range(steps):
                    step(model, data)
                    poses[0, s] = pose[0]
                    contacts[0, s] = simulation.contacts[0]
                track(one, poses[:, :steps], contacts[:, :steps], truth)
            over = read(
                one, simulation.person, simulation.timer, noise, known,
                pace.timestep, pace.interval, pace.max_steps,
            )  # fmt: skip
            if over[0]:
                if len(kept.pose):
                    kept.pose[i, k + 1] = pose[0]
                break
