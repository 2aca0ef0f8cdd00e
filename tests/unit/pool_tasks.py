"""Work for the tests of the pool; other processes import it by this name."""

import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

from evenhand.core.errors import InputError
from evenhand.core.processes import Tell


def square(
    *, tell: Tell, number: int, after: Path | None = None, mark: Path | None = None
) -> dict[str, Any]:
    """Tell of two units, then give the square and who worked it out.

    Waits until there is a file ``after``, and makes a file ``mark``.
    """
    tell(1, {"number": number})
    while after is not None and not after.exists():
        time.sleep(0.01)
    if mark is not None:
        mark.touch()
    tell(1, {"number": number})
    return {"square": number**2, "process": os.getpid(), "threads": os.environ["OMP_NUM_THREADS"]}


def refuse(*, tell: Tell, why: str) -> None:
    """Refuse wrong input."""
    raise InputError("missing file", why)


def break_down(*, tell: Tell) -> None:
    """Fail by a defect."""
    raise ZeroDivisionError("a defect")


def crash(*, tell: Tell, code: int) -> None:
    """End the process in the middle of the task."""
    os._exit(code)


def leave(*, tell: Tell) -> None:
    """End the process as if all were well."""
    sys.exit(0)


def unsendable(*, tell: Tell) -> Any:
    """Give what cannot be sent to another process."""
    return lambda: None


def hears_ctrl_c(*, tell: Tell) -> bool:
    """Whether this process would be interrupted from the terminal."""
    return signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def linger(*, tell: Tell, folder: Path) -> None:
    """Note which process this is, then work until ended."""
    (folder / str(os.getpid())).touch()
    tell(1, {})
    time.sleep(600.0)


def die_once(*, tell: Tell, mark: Path, number: int) -> int:
    """End the process as the kernel does when memory runs out, but only the first time."""
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2


def long_word(*, tell: Tell, mark: Path) -> bytes:
    """Tell who works, then give more than a pipe holds."""
    tell(1, {"process": os.getpid()})
    threading.Timer(0.2, mark.touch).start()
    return bytes(64_000_000)
