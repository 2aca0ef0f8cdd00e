"""How often may be asked, without knowing who asks.

Nothing here, nor anywhere in the study, looks at addresses. What belongs to one participant is
counted by the SHA-256 of the token; everything else is counted together. Counts live in memory and
a participant's is forgotten as soon as it no longer limits anything, some seconds after the last
request.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Rate:
    """So many requests at once, and so many a second after that."""

    burst: float
    per_second: float


@dataclass(frozen=True)
class Limits:
    """Rates of a server.

    The defaults let 200 participants begin in one second behind one address, and stop a program
    that asks without end.
    """

    token: Rate = Rate(60, 5)
    begin: Rate = Rate(400, 40)
    everything: Rate = Rate(4000, 1000)
    login: Rate = Rate(10, 0.2)


class Buckets:
    """Token buckets by key: each holds ``burst``, and fills at ``per_second``."""

    def __init__(self, rate: Rate, clock: Callable[[], float] = time.monotonic) -> None:
        self.rate, self._clock = rate, clock
        self._lock = threading.Lock()
        self._levels: dict[str, tuple[float, float]] = {}
        self._swept = clock()

    def __len__(self) -> int:
        return len(self._levels)

    def take(self, key: str = "") -> float:
        """Take one; returns 0, or the seconds until there is one again."""
        with self._lock:
            now = self._clock()
            self._sweep(now)
            level, before = self._levels.get(key, (self.rate.burst, now))
            level = min(self.rate.burst, level + (now - before) * self.rate.per_second)
            if level < 1:
                self._levels[key] = (level, now)
                return (1 - level) / self.rate.per_second
            self._levels[key] = (level - 1, now)
            return 0.0

    def _sweep(self, now: float) -> None:
        """Forget buckets that must be full again."""
        full = self.rate.burst / self.rate.per_second
        if now - self._swept > full:
            self._levels = {k: v for k, v in self._levels.items() if now - v[1] < full}
            self._swept = now


class TooManyError(Exception):
    """Refused for now; ``seconds`` until it is worth asking again."""

    def __init__(self, seconds: float) -> None:
        super().__init__(f"{seconds:.1f} s")
        self.seconds = seconds


class Gate:
    """All buckets of a server."""

    def __init__(self, limits: Limits, clock: Callable[[], float] = time.monotonic) -> None:
        self.token = Buckets(limits.token, clock)
        self.begin = Buckets(limits.begin, clock)
        self.everything = Buckets(limits.everything, clock)
        self.login = Buckets(limits.login, clock)

    def __call__(self, buckets: Buckets, key: str = "") -> None:
        """Pass, or raise.

        Raises:
            TooManyError: when there were too many.
        """
        wait = buckets.take(key)
        if wait:
            raise TooManyError(wait)
