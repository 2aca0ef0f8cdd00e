"""What a fork leaves behind: threads. A forked process that needs them waits for ever.

Evenhand spawns its own processes. Others may be forked, for instance those of Gymnasium's
``AsyncVectorEnv``. There, what would wait raises an error.
"""

import ctypes
import os
import sys
import weakref

from evenhand.core.errors import InputError

_held: weakref.WeakSet[object] = weakref.WeakSet()
_forks = 0
_jax_used = False


class Home:
    """The process in which something has threads that belong to it."""

    def __init__(self, what: str, remedy: str = "") -> None:
        """Remember this process.

        Args:
            what: beginning of the sentence, for instance "this environment was made".
            remedy: what else helps, for instance "make it in the new process, or ".
        """
        self._what, self._remedy, self._forks = what, remedy, _forks

    def check(self) -> None:
        """Go on only at home.

        Raises:
            InputError: in a process that was forked since.
        """
        if self._forks != _forks:
            raise _left_behind(self._what, self._remedy)


def hold(thing: object) -> None:
    """Never free a thing in a forked process: that would wait for its threads, too."""
    _held.add(thing)


def check_jax() -> None:
    """Go on only where JAX works.

    Raises:
        InputError: in a process that was forked after JAX had computed something.
    """
    if _jax_used:
        raise _left_behind("JAX was used")


def _left_behind(what: str, remedy: str = "") -> InputError:
    return InputError(
        "unsupported fork",
        f"{what} before this process was forked, and a fork leaves threads behind: {remedy}"
        "start processes by the method 'spawn' of multiprocessing",
    )


def _forked() -> None:
    global _forks, _jax_used
    _forks += 1
    for thing in list(_held):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(thing))
    bridge = sys.modules.get("jax._src.xla_bridge")
    _jax_used = _jax_used or bool(getattr(bridge, "_backends", None))


os.register_at_fork(after_in_child=_forked)
