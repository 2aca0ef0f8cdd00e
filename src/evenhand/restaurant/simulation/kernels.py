"""Compiled loops over lanes: who does what, what a service was worth, how services begin.

Lanes are rows of structured arrays, whose fields are described where they are made
(``physics.TRUTH``, ``lanes.PERCEIVED``). Lengths are in metres, points of the plane x + iy.
"""

from __future__ import annotations

import numpy as np

from evenhand.core.machine_code import Records, compiled

NEAREST, FARTHEST = 1.0, 1.5
"""Proper distances of a response."""
LATE = 200
"""Physics steps after which a response is late."""
RISK = 0.5
"""Nearer than this is a risk."""


@compiled
def sort_out(actions: np.ndarray, idle: np.ndarray) -> tuple[bool, np.ndarray, np.ndarray]:
    """Who does what.

    Args:
        actions: 0 (walk) or 1 (respond), [n].
        idle: lanes that do nothing, bool [n].

    Returns:
        Whether all actions are valid, lanes that respond, and lanes that walk.
    """
    n = len(actions)
    responds, walks = np.empty(n, np.int64), np.empty(n, np.int64)
    r = w = 0
    for i in range(n):
        if actions[i] != 0 and actions[i] != 1:
            return False, responds[:0], walks[:0]
        if idle[i]:
            continue
        if actions[i] == 1:
            responds[r] = i
            r += 1
        else:
            walks[w] = i
            w += 1
    return True, responds[:r], walks[:w]


@compiled
def worth(
    responded: bool, steps: int, distance: float, min_distance: float, max_steps: int
) -> tuple[float, float, float, float, bool]:
    """Reward terms of one finished service and whether it was perfect; see ``task.quality``."""
    safety = -0.5 if min_distance < RISK else 0.0
    if not responded:
        return 0.0, 0.0, 0.0, safety, False
    # one number falls on both sides of the proper distances
    placed = min((distance - RISK) / (NEAREST - RISK), (2 * FARTHEST - distance) / FARTHEST, 1.0)
    prompt = min((max_steps - steps) / (max_steps - LATE), 1.0)
    proper = NEAREST <= distance <= FARTHEST and steps <= LATE and min_distance >= RISK
    return 0.2, 0.5 * max(placed, 0.0), 0.3 * max(prompt, 0.0), safety, proper


@compiled
def quality(
    responded: np.ndarray,
    steps: np.ndarray,
    distance: np.ndarray,
    min_distance: np.ndarray,
    max_steps: int,
) -> tuple[np.ndarray, np.ndarray]:
    """The same of n services; see ``task.quality``."""
    n = len(steps)
    terms, perfect = np.empty((n, 4)), np.empty(n, np.bool_)
    for i in range(n):
        a, b, c, d, perfect[i] = worth(
            responded[i], steps[i], distance[i], min_distance[i], max_steps
        )
        terms[i, 0], terms[i, 1], terms[i, 2], terms[i, 3] = a, b, c, d
    return terms, perfect


@compiled
def finish(
    ids: np.ndarray,
    truth: Records,
    perceived: Records,
    facts: Records,
    reward: np.ndarray,
    max_steps: int,
) -> None:
    """Facts and rewards of the services of these lanes, which have ended.

    Args:
        ids: lanes, int [k].
        truth: ``physics.TRUTH``, [n].
        perceived: ``lanes.PERCEIVED``, [n].
        facts: ``episodes.FACTS``, [n], written at ``ids``.
        reward: [n], written likewise.
        max_steps: of a service.
    """
    for i in ids:
        true, known, out = truth[i], perceived[i], facts[i]
        responded = true.responded
        out.responded = responded
        out.response_step = true.steps if responded else np.nan
        out.response_distance = true.distance if responded else np.nan
        out.min_distance = true.min_distance
        out.steps = true.steps
        out.start_distance = true.start_distance
        out.path_length = true.path_length
        out.contact_steps = true.contact_steps
        out.sensed_error = known.reading - true.distance
        a, b, c, d, out.perfect = worth(
            responded, true.steps, true.distance, true.min_distance, max_steps
        )
        out.reward_response, out.reward_distance = a, b
        out.reward_promptness, out.reward_safety = c, d
        reward[i] = a + b + c + d


@compiled
def place(
    ids: np.ndarray,
    at: np.ndarray,
    rows: tuple[np.ndarray, Records, np.ndarray, np.ndarray],
    state: np.ndarray,
    truth: Records,
    geoms: tuple[np.ndarray, np.ndarray],
    guests: np.ndarray,
) -> None:
    """Copy what begins services into simulations.

    Args:
        ids: simulations, int [k].
        at: which of the rows, int [k].
        rows: state [N, nstate], ``physics.TRUTH`` [N], places [N, 12, 2] and radii [N, 12] of the
            guests.
        state: of the simulations, written, [n, nstate].
        truth: written, [n].
        geoms: places and sizes of all geoms, written, [n, ngeom, 3] each.
        guests: which geoms their footprints are, [12].
    """
    places, sizes = geoms
    for row, i in enumerate(ids):
        j = at[row]
        state[i] = rows[0][j]
        truth[i] = rows[1][j]
        for guest, geom in enumerate(guests):
            places[i, geom, 0] = rows[2][j, guest, 0]
            places[i, geom, 1] = rows[2][j, guest, 1]
            sizes[i, geom, 0] = rows[3][j, guest]


@compiled
def meet(
    ids: np.ndarray,
    at: np.ndarray,
    rows: tuple[Records, np.ndarray],
    perceived: Records,
    noise: np.ndarray,
) -> None:
    """Copy what robots know when services begin, and the errors of their readings, into lanes.

    Args:
        ids: lanes, int [k].
        at: which of the rows, int [k].
        rows: ``lanes.PERCEIVED`` [N] and errors [N, K].
        perceived: written, [n].
        noise: written, [n, K].
    """
    for row, i in enumerate(ids):
        perceived[i] = rows[0][at[row]]
        noise[i] = rows[1][at[row]]
