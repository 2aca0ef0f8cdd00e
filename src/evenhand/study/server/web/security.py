"""Around every request: size limits, headers, and a log without addresses."""

import json
import logging
from http import HTTPStatus

from starlette.types import ASGIApp, Message, Receive, Scope, Send

LARGEST = 64 * 1024
"""Bytes of a request's body."""
POLICY = "; ".join(
    [
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' data:",
        "font-src 'self'",
        "media-src 'self' blob:",
        "connect-src 'self'",
        "form-action 'self'",
        "base-uri 'none'",
        "frame-ancestors 'none'",
    ]
)
"""Scripts and styles from files of this server only, none inline; nothing from elsewhere."""
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
    "x-robots-tag": "noindex, nofollow",
}
_TRANSPORT = "max-age=31536000"

log = logging.getLogger("evenhand.study")


class Guarded:
    """An application, guarded.

    The log has one line a request: method, the route (never the address asked for, which can hold
    ids of a platform) and the status. An error that nobody expected is logged with its traceback,
    which holds no values, and answered by one sentence.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Of ASGI."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        status = 0

        async def tell(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = _with(message["headers"], scope)
            await send(message)

        body = await _body(scope, receive)
        if body is None:
            await _answer(tell, 413, f"A request can hold {LARGEST} bytes at most.", "too-large")
        else:
            try:
                await self.app(scope, _again(body, receive), tell)
            except Exception:
                log.exception("a request failed")
                if status:
                    raise
                await _answer(tell, 500, "Something went wrong here; try again.", "internal")
        route = getattr(scope.get("route"), "path", None) or "other"
        log.info("%s %s %d", scope["method"] if route != "other" else "-", route, status)


def _with(headers: list[tuple[bytes, bytes]], scope: Scope) -> list[tuple[bytes, bytes]]:
    there = {name.lower() for name, _ in headers}
    more = dict(HEADERS)
    if b"cache-control" not in there:
        more["cache-control"] = "no-store"
    if scope.get("scheme") == "https":
        more["strict-transport-security"] = _TRANSPORT
    return [*headers, *((name.encode(), value.encode()) for name, value in more.items())]


async def _body(scope: Scope, receive: Receive) -> bytes | None:
    """The whole body; None when it is too large."""
    headers = dict(scope["headers"])
    length = headers.get(b"content-length", b"")
    if length.isdigit() and int(length) > LARGEST:
        return None
    if not length and b"transfer-encoding" not in headers:
        return b""
    body = bytearray()
    while True:
        message = await receive()
        if message["type"] != "http.request":
            return bytes(body)
        body += message.get("body", b"")
        if len(body) > LARGEST:
            return None
        if not message.get("more_body"):
            return bytes(body)


def _again(body: bytes, receive: Receive) -> Receive:
    told = False

    async def again() -> Message:
        nonlocal told
        if told:
            return await receive()
        told = True
        return {"type": "http.request", "body": body, "more_body": False}

    return again


async def _answer(send: Send, status: int, sentence: str, code: str) -> None:
    body = json.dumps({"error": sentence, "code": code}).encode()
    headers = [
        (b"content-type", b"application/json"),
        (b"content-length", str(len(body)).encode()),
        # what is left of a body that was not read must not be taken for a request
        *([(b"connection", b"close")] if status == HTTPStatus.REQUEST_ENTITY_TOO_LARGE else []),
    ]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
