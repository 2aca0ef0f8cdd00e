"""A synthetic log of a mixed fleet, to try an audit on: what is uneven in it is known.

No person is behind it. Three robots serve guests at two sites. By construction:

* children are ignored more often than others (30 % against 10 %) and come to be approached too
  closely (15 % against 4 %);
* gender makes no difference to anything;
* guests in a wheelchair are so few that nothing can be said of them;
* the harbour site is slower for everybody and has more older guests: compared over both sites,
  older guests seem to wait longer; within each site they do not.
"""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
import pyarrow as pa

from evenhand.core.errors import whole

SITES = ("garden", "harbour")
ROBOTS = ("fetcher-1", "fetcher-2", "waiter-7")
AGES = ("child", "teen", "adult", "older adult")
GENDERS = ("female", "male", "non-binary")
MOBILITY = ("walks", "wheelchair")
_AGES_AT = np.array([[0.15, 0.15, 0.55, 0.15], [0.10, 0.10, 0.40, 0.40]])
"""Share of each age at each site."""
_GENDER_SHARE, _WHEELCHAIR = (0.49, 0.48, 0.03), 0.004
_IGNORED, _IGNORED_CHILD = 0.10, 0.30
_CLOSE, _CLOSE_CHILD = 0.04, 0.15
_WAIT_AT = (1.9, 2.9)
"""Median wait at each site, seconds; the paper calls more than 4 s late."""
_BEGIN = datetime(2026, 3, 2, 9, 0, 0)


def synthetic_log(services: int, rng: np.random.Generator) -> pa.Table:
    """Draw the log.

    Args:
        services: rows, at least 1.
        rng: source of all randomness.

    Returns:
        Columns ``service``, ``source`` (always "synthetic"), ``site``, ``robot``, ``age_group``,
        ``gender``, ``mobility``, ``asked_at`` and ``answered_at`` (null without a response),
        ``responded`` (yes or no), ``waited_s`` (until the response, or until the guest gave up),
        ``response_distance_m`` (null without a response), ``min_distance_m`` and
        ``smiles_per_minute``.

    Raises:
        InputError: for fewer than one service or more than ten million.
    """
    whole("services", services, 1, 10_000_000)
    n = services
    site = rng.integers(len(SITES), size=n)
    age = (rng.random((n, 1)) > np.cumsum(_AGES_AT, axis=1)[site]).sum(axis=1)
    age = np.minimum(age, len(AGES) - 1)  # a cumulated share may end just below 1
    gender = rng.choice(len(GENDERS), size=n, p=_GENDER_SHARE)
    wheelchair = rng.random(n) < _WHEELCHAIR
    # a few guests are not known to the log
    unseen = rng.random(n) < 0.01
    child = age == 0
    responded = rng.random(n) >= np.where(child, _IGNORED_CHILD, _IGNORED)
    wait = np.take(_WAIT_AT, site) * np.exp(0.35 * rng.standard_normal(n))
    patience = rng.uniform(4.5, 12.0, n)
    waited = np.where(responded, np.minimum(wait, patience), patience)
    close = rng.random(n) < np.where(child, _CLOSE_CHILD, _CLOSE)
    least = np.where(close, rng.uniform(0.30, 0.49, n), rng.uniform(0.55, 1.30, n))
    distance = np.maximum(rng.normal(1.25, 0.14, n), least)
    smiles = rng.gamma(2.0, 0.6, n)
    asked = _seconds(rng, n)
    moments = [_BEGIN + timedelta(seconds=float(s)) for s in asked.round(1)]
    answered = [
        moment + timedelta(seconds=float(w)) if yes else None
        for moment, w, yes in zip(moments, waited.round(2), responded, strict=True)
    ]
    ignored = ~responded
    return pa.table(
        {
            "service": pa.array(np.arange(n)),
            "source": pa.array(["synthetic"] * n),
            "site": _named(SITES, site),
            "robot": _named(ROBOTS, rng.integers(len(ROBOTS), size=n)),
            "age_group": _named(AGES, age, unseen),
            "gender": _named(GENDERS, gender),
            "mobility": _named(MOBILITY, wheelchair.astype(int)),
            "asked_at": pa.array(moments, pa.timestamp("ms")),
            "answered_at": pa.array(answered, pa.timestamp("ms")),
            "responded": _named(("no", "yes"), responded.astype(int)),
            "waited_s": pa.array(waited.round(2)),
            "response_distance_m": pa.array(distance.round(2), mask=ignored),
            "min_distance_m": pa.array(least.round(2)),
            "smiles_per_minute": pa.array(smiles.round(1)),
        }
    )


def _seconds(rng: np.random.Generator, n: int) -> np.ndarray:
    """When people asked, seconds since the log began, in order."""
    return np.cumsum(rng.exponential(40.0, n))


def _named(
    names: tuple[str, ...], codes: np.ndarray, missing: np.ndarray | None = None
) -> pa.Array:
    return pa.array(np.array(names)[codes], pa.string(), mask=missing)
