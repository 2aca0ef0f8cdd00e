"""Ctrl-C, which libraries lose, or make other errors of."""

import contextlib
import signal
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

_AGAIN = 0.01
"""Seconds after which a Ctrl-C that came to nothing is raised once more."""


@dataclass
class _State:
    listening: bool = False
    heard: bool = False
    over: bool = False


_state = _State()


def listen() -> None:
    """Note Ctrl-C before it is raised, and leave in order when a batch system ends this program."""

    def note(*_: Any) -> None:
        _state.heard = True
        raise KeyboardInterrupt

    def note_again(*_: Any) -> None:
        if not _state.over:
            raise KeyboardInterrupt

    def raise_again(lost: Any) -> None:
        if lost.exc_type is not KeyboardInterrupt:
            sys.__unraisablehook__(lost)
        elif not _state.over:
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else it is to be ignored
        signal.signal(signal.SIGINT, note)
        # what is raised while memory is collected comes to nothing; the alarm comes a bit later
        signal.signal(signal.SIGALRM, note_again)
        sys.unraisablehook = raise_again
        _state.listening = True
    signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))


def heard() -> bool:
    """Whether Ctrl-C was pressed: an error after that may be what a library made of it."""
    return _state.heard


def over() -> None:
    """The command has ended: a Ctrl-C that was lost is not raised again."""
    if _state.listening:
        _state.over = True
        signal.setitimer(signal.ITIMER_REAL, 0)


@contextlib.contextmanager
def expected() -> Iterator[None]:
    """Ctrl-C is the way to end what is done in here, whatever a library makes of it."""
    try:
        yield
    except Exception:
        if not _state.heard:
            raise
        over()
    except KeyboardInterrupt:
        over()
