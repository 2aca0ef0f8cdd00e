"""MuJoCo's clock, which simulations here do without."""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable
from typing import Any

import mujoco
import numba

_lock = threading.Lock()
_simulating = 0
"""How many simulate without a clock now."""


@functools.cache
def _stopped() -> Callable[[], float]:
    """A clock in machine code that stands still."""
    make: Any = numba.cfunc("float64()")
    return make(lambda: 0.0).ctypes


class untimed:  # noqa: N801
    """Simulate without looking at the clock; a context.

    MuJoCo's Python package installs one (``mjcb_time``). Every step reads it several times to fill
    ``MjData.timer``, which takes a good part of a small model's step. While this lasts, it stands
    still in all threads. A clock that somebody set by ``mujoco.set_mjcb_time`` stays.
    """

    def __enter__(self) -> None:
        global _simulating
        stopped = _stopped()
        with _lock:
            clock = mujoco.get_mjcb_time()
            if clock is None:
                mujoco.set_mjcb_time(stopped)
            self._counted = clock is None or clock is stopped
            _simulating += self._counted

    def __exit__(self, *_: object) -> None:
        global _simulating
        with _lock:
            _simulating -= self._counted
            if _simulating == 0 and mujoco.get_mjcb_time() is _stopped():
                mujoco.set_mjcb_time(None)


def _forked() -> None:
    """In a forked process no simulation runs, whoever ran one before."""
    global _lock, _simulating
    if _simulating and mujoco.get_mjcb_time() is _stopped():
        mujoco.set_mjcb_time(None)
    _lock, _simulating = threading.Lock(), 0


os.register_at_fork(after_in_child=_forked)
