"""Simulated participants who take a running study through its API, as browsers do.

The server has to let simulated participants in; their rows are marked for ever.
"""

import json
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable
from typing import Any

import numpy as np

from evenhand.core.errors import InputError
from evenhand.study.design.protocol import Protocol
from evenhand.study.simulated.participants import Habits, recruit, visit

HEADER = "X-Evenhand-Simulated"
TRIES = 60
"""How often a request is sent while the server asks to wait."""
_LONGEST_WAIT = 5.0
_SECONDS = 30.0


class Server:
    """A running study.

    Args:
        url: of the server, as http://127.0.0.1:8000.

    Raises:
        InputError: when that is no address of a web server.
    """

    def __init__(self, url: str) -> None:
        parts = urllib.parse.urlsplit(url)
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise InputError(
                "format url",
                f"{url!r} is no address of a server: give one as http://127.0.0.1:8000",
            )
        self.url = url.rstrip("/")

    def ask(
        self, method: str, path: str, token: str | None = None, content: Any = None
    ) -> dict[str, Any]:
        """Send a request, again while the server asks to wait.

        Raises:
            InputError: when nobody answers, or the server refuses; its own sentence is told.
        """
        headers = {"content-type": "application/json", HEADER: "yes"}
        if token is not None:
            headers["authorization"] = f"Bearer {token}"
        body = None if content is None else json.dumps(content).encode()
        request = urllib.request.Request(f"{self.url}/api{path}", body, headers, method=method)
        for last in (False,) * (TRIES - 1) + (True,):
            try:
                with urllib.request.urlopen(request, timeout=_SECONDS) as answer:
                    return json.loads(answer.read())
            except urllib.error.HTTPError as error:
                wait = error.headers.get("retry-after", "")
                told = _told(error)
                if error.code not in (429, 503) or last:
                    raise InputError("unavailable url", f"{self.url} refused: {told}") from error
                time.sleep(min(_LONGEST_WAIT, float(wait) if wait.isdigit() else 1.0))
            except (OSError, ValueError) as error:
                why = getattr(error, "reason", error)
                raise InputError(
                    "unavailable url", f"no study answers at {self.url}: {why}"
                ) from error
        raise AssertionError("the last try returns or raises")


def _told(error: urllib.error.HTTPError) -> str:
    """What the server said is wrong; its status where it said nothing that can be read."""
    try:
        return str(json.loads(error.read())["error"])
    except (OSError, ValueError, KeyError, TypeError):
        return f"status {error.code}"


def meet(server: Server, study: Protocol) -> dict[str, Any]:
    """What the server says about its study.

    Raises:
        InputError: when it has another study, or does not answer.
    """
    about = server.ask("GET", "/study")
    if about["name"] != study.name:
        raise InputError(
            "conflict url",
            f"{server.url} runs study {about['name']!r}, not {study.name!r}: give its protocol",
        )
    return about


def take(
    server: Server,
    study: Protocol,
    n: int,
    seed: int,
    habits: Habits | None = None,
    tell: Callable[[int], None] = lambda done: None,
) -> int:
    """Let simulated participants take a running study, one after another.

    Args:
        server: where it runs.
        study: the same study; its scores and right answers are not told by the server.
        n: participants.
        seed: of everything random.
        habits: how they take it; the default settings when None.
        tell: is told how many have left.

    Returns:
        How many finished.
    """
    about = meet(server, study)
    recruiting, *own = np.random.default_rng(seed).spawn(n + 1)
    crowd = recruit(n, recruiting, habits)
    finished = 0
    for who in range(n):
        agreed = {"consent_version": about["consent"]["version"], "simulated": True}
        begun = server.ask("POST", "/begin", content=agreed)
        token = begun["token"]
        made = visit(study, begun["state"]["pages"], crowd, who, own[who])
        for payload in made.payloads:
            sent = {name: value for name, value in payload.items() if name != "page"}
            server.ask("PUT", f"/pages/{payload['page']}", token, sent)
        if made.finished:
            server.ask("POST", "/finish", token, {})
            finished += 1
        tell(1)
    return finished
