"""Where the robot was between recorded poses, every 0.1 s, so that it glides in a clip.

Cubic Hermite splines with central differences as velocities (Catmull-Rom): exact wherever the
robot's acceleration is constant over three poses. Services begin at rest.
"""

from __future__ import annotations

import numpy as np

from evenhand.restaurant import floor_plan

FRAME_STEPS = 2
"""Physics steps from one frame to the next."""
RATE = round(1 / (floor_plan.TIMESTEP * FRAME_STEPS))
"""Frames a second: 25. It divides the 50 physics steps of a second, so that every frame shows one
moment of the physics and clips are as long as what they show; it is a rate that every player and
browser knows; and it looks smooth at the robot's 1 m/s (4 cm from frame to frame)."""


def moments(steps: int) -> np.ndarray:
    """Physics steps that the frames of a service show, int64 [F]: 0, 2, 4 ..., and the last."""
    return np.append(np.arange(0, steps, FRAME_STEPS), steps)


def poses(pose: np.ndarray, interval: int, steps: np.ndarray) -> np.ndarray:
    """Poses at any moments of a service.

    Args:
        pose: recorded x, y (m) and yaw (rad), one every ``interval`` steps from step 0 on, [K, 3].
        interval: physics steps between them.
        steps: moments, physics steps within the recorded time, [F].

    Returns:
        Poses [F, 3].
    """
    if len(pose) == 1:
        return np.repeat(pose, len(steps), axis=0)
    speed = _speeds(pose)  # per interval
    place = np.asarray(steps) / interval
    first = np.minimum(place.astype(int), len(pose) - 2)
    t = (place - first)[:, None]
    # the four cubics of Hermite
    return (
        (1 + 2 * t) * (1 - t) ** 2 * pose[first]
        + t * (1 - t) ** 2 * speed[first]
        + t**2 * (3 - 2 * t) * pose[first + 1]
        + t**2 * (t - 1) * speed[first + 1]
    )


def _speeds(pose: np.ndarray) -> np.ndarray:
    """Velocity at each of K >= 2 poses, [K, 3]; per interval."""
    speed = np.zeros_like(pose)
    speed[1:-1] = (pose[2:] - pose[:-2]) / 2
    # of the parabola through the last poses; a start at rest stands in for a third one
    speed[-1] = 2 * (pose[-1] - pose[-2]) - speed[-2]
    return speed
