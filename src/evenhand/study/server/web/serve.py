"""A server of one study: uvicorn, without its access log."""

import logging
import socket

import uvicorn
from fastapi import FastAPI

from evenhand.core.errors import InputError
from evenhand.study.server.web.security import log


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens; 0 is any free port."""
    found = None
    try:
        kind, _, _, _, at = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        found = socket.socket(kind, socket.SOCK_STREAM)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind(at)
        found.listen(2048)
    except OSError as error:
        if found is not None:
            found.close()
        raise InputError(
            "unavailable port",
            f"{host}, port {port} cannot be listened to ({error.strerror or error}): give another "
            "--port or --host",
        ) from error
    return found


def address(listening: socket.socket) -> str:
    """Where a browser on this machine finds it."""
    host, port = listening.getsockname()[:2]
    name = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(host, f"[{host}]" if ":" in host else host)
    return f"http://{name}:{port}"


def run(app: FastAPI, listening: socket.socket) -> None:
    """Serve until the process is told to end; requests under way are finished first.

    Neither uvicorn nor the application writes addresses or browsers down: the access log is off,
    and the study's own log has routes and the minute only.
    """
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%Y-%m-%d %H:%M"))
    for one, level in ((log, logging.INFO), (logging.getLogger("uvicorn.error"), logging.WARNING)):
        one.handlers, one.propagate = [handler], False
        one.setLevel(level)
    config = uvicorn.Config(
        app,
        access_log=False,
        log_config=None,
        server_header=False,
        ws="none",
        lifespan="off",
        timeout_keep_alive=30,
        timeout_graceful_shutdown=10,
        backlog=2048,
    )
    uvicorn.Server(config).run(sockets=[listening])
