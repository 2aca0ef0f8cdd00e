"""The application: FastAPI, its errors, its files."""

import math
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from fastapi.staticfiles import StaticFiles
from starlette.exceptions import HTTPException
from starlette.routing import Match

from evenhand import __version__
from evenhand.study.design.protocol import Protocol
from evenhand.study.server.refusal import RefusalError, StorageError
from evenhand.study.server.store import Store
from evenhand.study.server.web import lead, participants
from evenhand.study.server.web.desk import Desk, Settings
from evenhand.study.server.web.limits import TooManyError
from evenhand.study.server.web.security import Guarded, log

UNBUILT = (
    "This copy of Evenhand lacks the pages of the study: install a released wheel, or build them "
    "in the checkout with `make`."
)
_WORDS = {
    400: ("invalid", "The request cannot be read."),
    401: ("no-lead", "Only the lead may see this: log in, or send the admin token."),
    404: ("not-found", "There is nothing here."),
    405: ("wrong-method", "This cannot be asked in this way."),
}


def build(study: Protocol, store: Store, settings: Settings) -> FastAPI:
    """The application of one study."""
    app = FastAPI(
        title="Evenhand study", version=__version__, openapi_url=None, docs_url=None, redoc_url=None
    )
    desk = Desk(study, store, settings)
    routers = (participants.router(desk), lead.router(desk))
    for router in routers:
        app.include_router(router)
    app.state.routes = [route for router in routers for route in router.routes]

    @app.api_route("/", methods=["GET", "HEAD"], include_in_schema=False)
    def page() -> Response:
        index = settings.static / "index.html"
        if not index.is_file():
            return PlainTextResponse(UNBUILT, 503)
        return FileResponse(index, headers={"cache-control": "no-cache"})

    clips = {name: study.clips / name for name in study.clip_names}

    @app.api_route("/clips/{name}", methods=["GET", "HEAD"], include_in_schema=False)
    def clip(name: str) -> Response:
        # looked up by its name, never made into a path
        if name not in clips or not clips[name].is_file():
            raise HTTPException(404)
        kept = {"cache-control": "private, max-age=86400"}
        return FileResponse(clips[name], headers=kept)

    if settings.static.is_dir():
        app.mount("/static", _Built(directory=settings.static))
    for kind, handler in _HANDLERS.items():
        app.add_exception_handler(kind, handler)
    app.add_middleware(Guarded)
    return app


class _Built(StaticFiles):
    """Files that a browser asks about each time, so that an update is seen at once."""

    def file_response(self, *args: Any, **more: Any) -> Response:
        answer = super().file_response(*args, **more)
        answer.headers.setdefault("cache-control", "no-cache")
        return answer


def _wrong(status: int, sentence: str, code: str, **more: Any) -> JSONResponse:
    headers = more.pop("headers", None)
    return JSONResponse({"error": sentence, "code": code, **more}, status, headers)


async def _refused(_: Request, error: Any) -> Response:
    more = {} if error.next is None else {"next": error.next}
    headers = {"www-authenticate": "Bearer"} if error.status == 401 else None
    return _wrong(error.status, error.sentence, error.code, headers=headers, **more)


async def _storage(_: Request, error: Any) -> Response:
    log.error("%s", error)
    sentence = "The answers cannot be stored just now; nothing that was saved is lost. Try again."
    return _wrong(503, sentence, "storage", headers={"retry-after": "5"})


async def _too_many(_: Request, error: Any) -> Response:
    wait = str(max(1, math.ceil(error.seconds)))
    sentence = f"There were too many requests: try again in {wait} s."
    return _wrong(429, sentence, "too-many", headers={"retry-after": wait})


async def _unfit(_: Request, error: Any) -> Response:
    # what was sent is not repeated: it may be personal
    first = error.errors()[0]
    if first["type"] == "json_invalid":
        return _wrong(422, "The request is no valid JSON.", "invalid")
    where = ".".join(str(part)[:40] for part in first["loc"] if part != "body")
    return _wrong(422, f"{where or 'The request'}: {first['msg']}.", "invalid")


async def _http(request: Request, error: Any) -> Response:
    code, sentence = _WORDS.get(error.status_code, ("invalid", "The request cannot be answered."))
    headers = dict(error.headers or {})
    if error.status_code == 405:
        # Starlette names the methods of the first route of a path only
        scope = {**request.scope, "root_path": ""}
        there = [one for one in request.app.state.routes if one.matches(scope)[0] != Match.NONE]
        methods = {method for one in there for method in one.methods}
        headers["Allow"] = ", ".join(sorted(methods)) or headers.pop("Allow", "GET")
    return _wrong(error.status_code, sentence, code, headers=headers)


_HANDLERS: dict[Any, Any] = {
    RefusalError: _refused,
    StorageError: _storage,
    TooManyError: _too_many,
    RequestValidationError: _unfit,
    HTTPException: _http,
}
