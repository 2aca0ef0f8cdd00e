"""MuJoCo's C library as it is loaded: where its functions are, and its clock."""

from __future__ import annotations

import ctypes
import functools
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import mujoco

_CLOCK = "mjcb_time"


@functools.cache
def address(name: str) -> int | None:
    """Where a function or a variable of the library is; None where it cannot be found."""
    folder = Path(mujoco.__file__).parent
    files = [path for path in folder.glob("*mujoco*") if path.suffix in (".dll", ".dylib")]
    for path in [*folder.glob("libmujoco.so*"), *files]:
        try:
            symbol = getattr(ctypes.CDLL(str(path)), name)
        except (OSError, AttributeError):
            continue
        return ctypes.cast(symbol, ctypes.c_void_p).value
    return None


class _Running:
    """Simulations that run untimed now, and the clock that was taken away for them."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.how_many = 0
        self.clock: int | None = None

    def forked(self) -> None:
        """In a forked process no simulation runs, whoever ran one before."""
        where = address(_CLOCK) if self.how_many else None
        if where is not None:
            clock = ctypes.c_void_p.from_address(where)
            clock.value = clock.value or self.clock
        self.lock, self.how_many = threading.Lock(), 0


_running = _Running()
os.register_at_fork(after_in_child=_running.forked)


@contextmanager
def untimed() -> Iterator[None]:
    """Simulate without looking at the clock.

    The Python package gives MuJoCo one (``mjcb_time``), which is asked several times in every step
    to fill ``MjData.timer``, and takes a good part of a small model's step. There is none while
    this lasts, in all threads. Somebody's own clock, set by ``mujoco.set_mjcb_time``, stays.
    """
    where = address(_CLOCK)
    if where is None or mujoco.get_mjcb_time() is not None:
        yield
        return
    clock = ctypes.c_void_p.from_address(where)
    with _running.lock:
        if _running.how_many == 0:
            _running.clock, clock.value = clock.value, None
        _running.how_many += 1
    try:
        yield
    finally:
        with _running.lock:
            _running.how_many -= 1
            # whoever set another clock meanwhile keeps it
            if _running.how_many == 0 and clock.value is None:
                clock.value = _running.clock
