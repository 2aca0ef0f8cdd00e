"""How many processors there are, and how busy; imports nothing heavy."""

import os
from pathlib import Path
from time import perf_counter, process_time

CORES = len(os.sched_getaffinity(0))
"""Processors that this process may use."""
THREADS = (1, 256)
"""Fewest and most threads of one batch of simulations."""
_STAT = Path("/proc/stat")


class Others:
    """How much of the processors others take: they make what is measured slower."""

    def __init__(self) -> None:
        self._began = perf_counter(), _own(), _worked()

    def share(self) -> float | None:
        """Of all processors, since this was made, 0 to 1; None where the system does not tell.

        Processes that this one has started count as its own once they have ended, and as others
        before; a host that serves others counts, too.
        """
        clock, own, before = self._began
        now = _worked()
        if now is None or before is None:
            return None
        spent = (perf_counter() - clock) * (os.cpu_count() or 1)
        return min(max((now - before - (_own() - own)) / spent, 0.0), 1.0)


def _own() -> float:
    """Seconds of processors that this process took, and those that it started and that ended."""
    ended = os.times()
    return process_time() + ended.children_user + ended.children_system


def _worked() -> float | None:
    """Seconds that all processors of this machine have worked (proc(5))."""
    try:
        user, nice, system, _, _, irq, softirq, steal, *_ = map(
            int, _STAT.read_text().splitlines()[0].split()[1:]
        )
    except (OSError, ValueError, IndexError):
        return None
    return (user + nice + system + irq + softirq + steal) / os.sysconf("SC_CLK_TCK")
