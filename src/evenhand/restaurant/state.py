"""The state of an environment as numbers that JSON can hold: enough to go on bit for bit.

Services of a lane are drawn in blocks. A state holds no block, but the generator as it was before
the block was drawn, and a checksum of the block: so it is small, and nothing in it is an index that
compiled code would trust. Where a block is drawn differently, by another version of NumPy or
another processor, the checksum tells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evenhand.core.errors import InputError
from evenhand.restaurant import floor_plan
from evenhand.restaurant.env_base import BLOCK, Block, Source

VERSION = 2
_TRUTH = {
    "next": "i", "distance": "f", "min_distance": "f", "path_length": "f", "contact_steps": "i",
    "steps": "i", "responded": "b",
}  # fmt: skip
"""Fields of ``physics.TRUTH`` that change during a service, and their kinds."""
_PERCEIVED = {"reading": "f", "age": "f"}
"""Those of ``lanes.PERCEIVED``; its number of steps is that of the truth between two decisions."""
_KINDS = {"b": "b", "i": "iu", "f": "iuf"}
"""Kinds of numbers that may stand for a kind."""
_GENERATORS = {"PCG64": np.random.PCG64, "PCG64DXSM": np.random.PCG64DXSM}


@dataclass(frozen=True)
class Running:
    """What an environment knows besides its services.

    Attributes:
        generators: of each lane.
        begun: whether there was a reset.
        ended: lanes in which the service has ended, bool [n].
    """

    generators: list[np.random.Generator]
    begun: bool
    ended: np.ndarray


def save(source: Source, settings: dict[str, Any], running: Running) -> dict[str, Any]:
    """The state of an environment.

    Args:
        source: its services.
        settings: what another environment must have in common with it.
        running: what it knows besides.

    Raises:
        InputError: for a generator whose state is more than two numbers.
    """
    state: dict[str, Any] = {
        "version": VERSION,
        "settings": settings,
        "generators": [_plain(one) for one in running.generators],
        "begun": running.begun,
    }
    if not running.begun:
        return state
    lanes = source.lanes
    blocks = [source.block(lane) for lane in range(lanes.n)]
    return state | {
        "ended": running.ended.tolist(),
        "origins": [block.origin for block in blocks],
        "checksums": [block.checksum() for block in blocks],
        "rows": [source.current(lane)[1] for lane in range(lanes.n)],
        "simulation": lanes.physics.simulation.tolist(),
        **{name: lanes.physics.truth[name].tolist() for name in _TRUTH},
        **{name: lanes.perceived[name].tolist() for name in _PERCEIVED},
    }


def restore(state: Any, source: Source, settings: dict[str, Any]) -> Running:
    """Put services into a state that was saved; nothing is changed unless all of it fits.

    Args:
        state: from ``save``, perhaps through JSON.
        source: the services, written.
        settings: of the environment.

    Returns:
        What the environment knows besides.

    Raises:
        InputError: for a state of another version, of an environment with other settings, or of
            a computer on which services are drawn differently, and for one that is damaged.
    """
    _check(state, settings)
    lanes = source.lanes
    n, physics = lanes.n, lanes.physics
    generators = [_generator(one) for one in _listed(state, "generators", n)]
    begun = state.get("begun")
    if begun is False:
        for lane in range(n):
            source.forget(lane)
        return Running(generators, False, np.ones(n, bool))
    if begun is not True:
        raise _damaged("begun")
    ended = _array(state, "ended", "b", (n,))
    rows = _array(state, "rows", "i", (n,), 0, BLOCK - 1)
    checksums = _array(state, "checksums", "i", (n,))
    simulation = _array(state, "simulation", "f", physics.simulation.shape)
    truth = {name: _array(state, name, kind, (n,), 0) for name, kind in _TRUTH.items()}
    perceived = {name: _array(state, name, kind, (n,), 0) for name, kind in _PERCEIVED.items()}
    # the number of a reading is taken from the timer
    elapsed = np.rint(simulation[:, physics.time] / floor_plan.TIMESTEP)
    if (truth["steps"] > floor_plan.MAX_STEPS).any() or (elapsed != truth["steps"]).any():
        raise _damaged("steps")
    blocks = []
    for lane, origin in enumerate(_listed(state, "origins", n)):
        block = _block(source, lane, origin)
        if block.checksum() != checksums[lane]:
            raise InputError(
                "changed state",
                "the services of this state come out differently here: use it with the versions "
                "of Evenhand and NumPy, and on the kind of computer, that it was saved with",
            )
        if truth["next"][lane] > block.beginning.rows.truth["last"][rows[lane]]:
            raise _damaged("next")
        blocks.append(block)
    source.resume(blocks, rows)
    physics.simulation[:] = simulation
    for name, values in truth.items():
        physics.truth[name] = values
    for name, values in perceived.items():
        lanes.perceived[name] = values
    lanes.perceived["steps"] = truth["steps"]
    return Running(generators, True, ended)


def _check(state: Any, settings: dict[str, Any]) -> None:
    if not isinstance(state, dict):
        raise InputError(
            "type state", f"a state is a dictionary, not {type(state).__name__}: use get_state()"
        )
    if state.get("version") != VERSION:
        raise InputError(
            "changed state",
            f"the state has version {state.get('version')}, and this Evenhand reads version "
            f"{VERSION}: use it with the Evenhand that saved it",
        )
    theirs = state.get("settings")
    if not isinstance(theirs, dict):
        raise _damaged("settings")
    for name in [*settings, *theirs]:
        if theirs.get(name) != settings.get(name):
            raise InputError(
                "changed state",
                f"the state is of an environment with {name}={theirs.get(name)!r}, and here it is "
                f"{settings.get(name)!r}: make the environment with the settings of the state",
            )


def _block(source: Source, lane: int, origin: Any) -> Block:
    """The block of a lane, drawn anew unless it is the one that is there."""
    known = source.known(lane)
    if known is not None and known.origin == origin:
        return known
    return source.draw(_generator(origin, "origins"))


def _plain(generator: np.random.Generator) -> dict[str, Any]:
    state = dict(generator.bit_generator.state)
    if state["bit_generator"] not in _GENERATORS:
        raise InputError(
            "unsupported np_random",
            f"np_random draws from {state['bit_generator']}, which a state cannot hold: use "
            f"{' or '.join(_GENERATORS)}",
        )
    return state


def _generator(state: Any, name: str = "generators") -> np.random.Generator:
    try:
        bits = _GENERATORS[state["bit_generator"]](0)
        bits.state = state
    except (KeyError, TypeError, ValueError, OverflowError):
        raise _damaged(name) from None
    return np.random.Generator(bits)


def _listed(state: dict[str, Any], name: str, n: int) -> list[Any]:
    found = state.get(name)
    if not isinstance(found, list) or len(found) != n:
        raise _damaged(name)
    return found


def _array(
    state: dict[str, Any],
    name: str,
    kind: str,
    shape: tuple[int, ...],
    least: float = -np.inf,
    most: float = np.inf,
) -> np.ndarray:
    """An entry of a state as an array of finite numbers of a kind, a shape and a range."""
    try:
        found = np.asarray(state[name])
    except (KeyError, ValueError):
        raise _damaged(name) from None
    if found.shape != shape or found.dtype.kind not in _KINDS[kind] or not np.isfinite(found).all():
        raise _damaged(name)
    if ((found < least) | (found > most)).any():
        raise _damaged(name)
    return found


def _damaged(name: str) -> InputError:
    return InputError(
        "format state", f"the state is damaged at {name!r}: give what get_state() gave"
    )
