"""Recorded services as the page takes them: packed poses, and what happened in words.

Lengths and angles are packed as whole steps of the recording's own grid, so that nothing is lost.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from evenhand.core.errors import InputError
from evenhand.methods.paper import issues
from evenhand.methods.paper.issues import PAPER_ISSUES, Issue
from evenhand.methods.services import Services
from evenhand.restaurant import floor_plan
from evenhand.restaurant.replay import looks
from evenhand.restaurant.simulation.recording import Recording

MOST = 300
"""Services on one page."""
SHOWN = 30
"""Services on a page if nobody says which."""
EACH = 5
"""Of those, services with each issue."""
GRID = 4000.0
"""Steps to a metre or a radian, as recordings are rounded to."""
TURN_GRID = 32767.0
"""Steps to 1 of a quaternion."""
NOTHING = -32768
"""Stands for what is missing."""


def choose(
    table: Services, epoch: int | None = None, named: Sequence[Issue] = PAPER_ISSUES
) -> list[int]:
    """Numbers of 30 services that are worth a look, in order.

    Args:
        table: services to choose from.
        epoch: the first 30 services of this epoch. By default, the latest services of all: five
            with each issue, as far as there are such, and as many others as there is room for.
        named: issues of the world.

    Raises:
        InputError: when there is no such epoch, or no service at all.
    """
    if not len(table):
        raise InputError("empty services", "there is no service to replay")
    number = table.fact("service").astype(np.int64)
    if epoch is not None:
        epochs = table.fact("epoch")
        rows = np.flatnonzero(epochs == epoch)
        if not len(rows):
            raise InputError(
                "range epoch",
                f"there is no epoch {epoch}: the run has epochs {np.nanmin(epochs):.0f} to "
                f"{np.nanmax(epochs):.0f}",
            )
        return number[rows[:SHOWN]].tolist()
    met = issues.indicators(table, named) >= 0.5
    wanted = np.zeros(len(number), bool)
    for k in range(met.shape[1]):
        wanted[np.flatnonzero(met[:, k])[-EACH:]] = True
    others = np.flatnonzero(~wanted)
    room = max(SHOWN - int(wanted.sum()), 0)
    wanted[others[len(others) - min(room, len(others)) :]] = True
    return sorted(number[wanted].tolist())


def rows_of(recording: Recording, table: Services) -> np.ndarray:
    """Which row of the table belongs to each recorded service, int64 [N].

    Raises:
        InputError: when a service has no row.
    """
    at = {int(number): row for row, number in enumerate(table.fact("service"))}
    missing = [int(number) for number in recording.number if int(number) not in at]
    if missing:
        raise InputError(
            "missing service",
            f"service {missing[0]} was recorded, but is not in the table of services: give the "
            "table of the same run",
        )
    return np.array([at[int(number)] for number in recording.number], np.int64)


def issue_times(
    recording: Recording,
    indicators: np.ndarray,
    limits: issues.Thresholds,
    named: Sequence[Issue] = PAPER_ISSUES,
) -> np.ndarray:
    """When each issue becomes true.

    Risk begins when the distance falls below its limit, taken as straight between two poses.
    Priority begins at the step after which a response is late. All others are known
    at the end, those of a world's own too.

    Args:
        recording: N services.
        indicators: of the issues, 1, 0, a severity or NaN, [N, K].
        limits: the limits of the issues.
        named: the issues.

    Returns:
        Seconds since the service began, [N, K]; NaN for an issue that it does not have.
    """
    tick = recording.interval * floor_plan.TIMESTEP
    end = (recording.frames - 1) * tick
    risk = [_risk_time(d[:n], limits.risk) * tick for d, n in zip(
        recording.distance, recording.frames, strict=True)]  # fmt: skip
    late = np.full(len(recording), limits.late * floor_plan.TIMESTEP)
    begins = (end, end, np.minimum(late, end), np.array(risk))
    known = dict(zip(PAPER_ISSUES, begins, strict=True))
    times = np.stack([known.get(issue, end) for issue in named], axis=1)
    return np.where(indicators >= 0.5, times, np.nan)


def _risk_time(distance: np.ndarray, limit: float) -> float:
    """The pose, with fractions, at which a distance falls below a limit."""
    below = np.flatnonzero(distance < limit)
    if not len(below):
        return float(np.argmin(distance))  # it happened between two poses
    k = int(below[0])
    if k == 0:
        return 0.0
    before, after = distance[k - 1], distance[k]
    return k - 1 + float((before - limit) / (before - after))


def pack(
    recording: Recording, table: Services, named: Sequence[Issue] = PAPER_ISSUES
) -> list[dict[str, Any]]:
    """What the page needs of every service, but for how guests look.

    Args:
        recording: N services.
        table: their rows, in the same order.
        named: issues of the world.
    """
    indicators = issues.indicators(table, named)
    times = issue_times(recording, indicators, issues.Thresholds(), named)
    who = [_names(table, name) for name in table.identities]
    out = []
    for row in range(len(recording)):
        n = int(recording.frames[row])
        pose = recording.pose[row, :n].copy()
        pose[:, 2] = np.remainder(pose[:, 2] + np.pi, 2 * np.pi) - np.pi
        facing = np.remainder(recording.facing[row] + np.pi, 2 * np.pi) - np.pi
        shoulder = looks.views(recording, row, "robot", pose)
        beside = looks.views(recording, row, "guest", pose[:1])
        out.append(
            {
                "number": int(recording.number[row]),
                "epoch": _whole(table, "epoch", row),
                "who": [names[row] for names in who],
                "position": coded(recording.position[row]),
                "facing": coded(facing),
                "pose": coded(pose),
                "sensed": coded(recording.sensed[row, :n]),
                "shoulder": _coded_views(shoulder),
                "beside": _coded_views(beside),
                "issues": [_value(x) for x in indicators[row]],
                "times": [None if np.isnan(t) else round(float(t), 4) for t in times[row]],
                "outcome": outcome(table, row, indicators[row], named),
            }
        )
    return out


def coded(values: np.ndarray) -> str:
    """Lengths or angles as steps of the grid, int16 little endian in base 64; NaN as NOTHING."""
    steps = np.where(np.isnan(values), NOTHING, np.rint(values * GRID))
    return base64.b64encode(steps.astype("<i2").tobytes()).decode()


def _coded_views(views: np.ndarray) -> str:
    """Camera poses: three lengths of the grid, then four parts of a quaternion."""
    steps = np.concatenate([views[:, :3] * GRID, views[:, 3:] * TURN_GRID], axis=1)
    return base64.b64encode(np.rint(steps).astype("<i2").tobytes()).decode()


def _value(indicator: float) -> float | None:
    """1, 0, or a severity that no rounding takes over the half that makes it an issue."""
    if np.isnan(indicator):
        return None
    return int(indicator) if indicator in (0.0, 1.0) else float(indicator)


def outcome(
    table: Services,
    row: int,
    indicators: np.ndarray,
    named: Sequence[Issue] = PAPER_ISSUES,
) -> str:
    """How a service ended, as sentences."""
    step, distance, steps, least = (
        float(table.fact(name)[row])
        for name in ("response_step", "response_distance", "steps", "min_distance")
    )
    if table.fact("responded")[row] == 1.0:
        at = f" at {distance:.2f} m" if np.isfinite(distance) else ""
        after = f" after {step * floor_plan.TIMESTEP:.1f} s" if np.isfinite(step) else ""
        said = f"Response{at}{after}."
    else:
        said = f"No response within {steps * floor_plan.TIMESTEP:.1f} s."
    limits = issues.Thresholds()
    reasons = (
        "no response",
        f"not at {limits.nearest:.1f} to {limits.farthest:.1f} m",
        f"later than {limits.late * floor_plan.TIMESTEP:.1f} s",
        f"as near as {least:.2f} m",
    )
    why = dict(zip(PAPER_ISSUES, reasons, strict=True))
    met = []
    for issue, x in zip(named, indicators, strict=True):
        reason = why.get(issue, "" if x == 1.0 else f"severity {x:.2f}")
        if x >= 0.5:
            met.append(f"{issue.name} ({reason})" if reason else issue.name)
    if not met:
        return f"{said} No issue."
    return f"{said} {'Issue' if len(met) == 1 else 'Issues'}: {', '.join(met)}."


def _names(table: Services, identity: str) -> Sequence[str]:
    """The category of every person; "not known" where it is missing."""
    codes, categories = table.identity(identity)
    return ["not known" if code < 0 else categories[code] for code in codes]


def _whole(table: Services, fact: str, row: int) -> int | None:
    if fact not in table:
        return None
    value = table.fact(fact)[row]
    return None if np.isnan(value) else int(value)
