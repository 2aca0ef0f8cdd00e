"""What every request needs at hand."""

import secrets
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

from evenhand.core.errors import InputError
from evenhand.study.design.protocol import Protocol
from evenhand.study.server.participants import hashed
from evenhand.study.server.store import Store
from evenhand.study.server.web.limits import Gate, Limits

STATIC = Path(__file__).parents[1] / "static"
"""The participants' page, built from ``frontend/``; it is not in git."""
SHORTEST = 16
"""Least characters of an admin token."""
_SESSION = 12 * 3600.0


@dataclass(frozen=True)
class Settings:
    """How a study is served.

    Attributes:
        admin: SHA-256 of the lead's token.
        simulated: whether simulated participants may take part.
        preview: everybody is a preview, whatever they say.
        limits: of requests.
        static: folder of the participants' page.
    """

    admin: str
    simulated: bool = False
    preview: bool = False
    limits: Limits = field(default_factory=Limits)
    static: Path = STATIC


class Desk:
    """The study, its store, its settings, and who of the leads is logged in."""

    def __init__(self, study: Protocol, store: Store, settings: Settings) -> None:
        self.study, self.store, self.settings = study, store, settings
        self.gate = Gate(settings.limits)
        self._sessions: dict[str, float] = {}
        self._lock = threading.Lock()

    def is_lead(self, token: str) -> bool:
        """Whether this is the admin token; takes as long for any that is not."""
        return secrets.compare_digest(hashed(token), self.settings.admin)

    def log_in(self) -> str:
        """A session of the lead, for a cookie; only its SHA-256 is kept, in memory."""
        session, now = secrets.token_urlsafe(32), time.monotonic()
        with self._lock:
            self._sessions = {k: until for k, until in self._sessions.items() if until > now}
            self._sessions[hashed(session)] = now + _SESSION
        return session

    def logged_in(self, session: str) -> bool:
        """Whether such a session is going on."""
        with self._lock:
            return self._sessions.get(hashed(session), 0.0) > time.monotonic()

    def log_out(self, session: str) -> None:
        """End a session."""
        with self._lock:
            self._sessions.pop(hashed(session), None)


def admin_token(given: str | None, file: Path | None) -> tuple[str, bool]:
    """The lead's token, from the environment, from a file, or made.

    Returns:
        The token, and whether it was made just now and has to be shown.

    Raises:
        InputError: when it cannot be read or is too short.
    """
    if file is not None:
        try:
            given = file.read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise InputError("unavailable file", f"{file} cannot be read: {error}") from error
    if given is None:
        return secrets.token_urlsafe(32), True
    if len(given) < SHORTEST or not given.isprintable():
        raise InputError(
            "range admin_token",
            f"the admin token has {len(given)} characters: give at least {SHORTEST}, at random",
        )
    return given, False
