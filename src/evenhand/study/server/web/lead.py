"""The lead's dashboard."""

import time
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import parse_qs

from fastapi import APIRouter, Cookie, Depends, Header, Request
from fastapi.responses import FileResponse, HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.exceptions import HTTPException

from evenhand.core import templates
from evenhand.study.server import progress
from evenhand.study.server.web import models
from evenhand.study.server.web.desk import Desk

COOKIE = "evenhand_lead"
_HERE = Path(__file__).parent
_FILES = {name: _HERE / "dashboard" / name for name in ("lead.css", "lead.js")}
_KEPT = 2.0
"""Seconds for which numbers are kept, so that many dashboards cost what one does."""
_TEMPLATES = _HERE / "templates"

Session = Annotated[str, Cookie(alias=COOKIE)]


def router(desk: Desk) -> APIRouter:
    """Pages and numbers for who has the admin token; none of them is told of anybody else."""
    found = APIRouter(prefix="/lead", include_in_schema=False)
    kept: dict[str, Any] = {"until": 0.0}

    def lead(session: Session = "", authorization: Annotated[str, Header()] = "") -> None:
        if desk.logged_in(session):
            return
        scheme, _, token = authorization.partition(" ")
        if scheme.lower() == "bearer" and token:
            if desk.is_lead(token):
                return
            desk.gate(desk.gate.login)
        raise HTTPException(401, headers={"www-authenticate": "Bearer"})

    def form(status: int, sentence: str = "") -> Response:
        page = templates.fill("login.html", _TEMPLATES, study=desk.study, sentence=sentence)
        return HTMLResponse(page, status)

    @found.api_route("", methods=["GET", "HEAD"])
    def dashboard(session: Session = "") -> Response:
        if not desk.logged_in(session):
            return form(200)
        return HTMLResponse(templates.fill("lead.html", _TEMPLATES, study=desk.study))

    @found.post("/login")
    async def login(request: Request) -> Response:
        fields = parse_qs((await request.body()).decode(errors="replace"))
        # only wrong ones are counted, so nobody can lock the lead out
        if not desk.is_lead(fields.get("token", [""])[0].strip()):
            desk.gate(desk.gate.login)
            return form(401, "That is not the token.")
        answer = RedirectResponse("/lead", 303)
        answer.set_cookie(
            COOKIE,
            desk.log_in(),
            httponly=True,
            samesite="strict",
            secure=request.url.scheme == "https",
            path="/lead",
        )
        return answer

    @found.post("/logout")
    def logout(session: Session = "") -> Response:
        desk.log_out(session)
        answer = RedirectResponse("/lead", 303)
        answer.delete_cookie(COOKIE, path="/lead", httponly=True, samesite="strict")
        return answer

    @found.get("/numbers", dependencies=[Depends(lead)])
    def told() -> Response:
        if time.monotonic() > kept["until"]:
            kept["numbers"] = progress.read(desk.store, desk.study)
            kept["until"] = time.monotonic() + _KEPT
        return JSONResponse(kept["numbers"])

    @found.post("/closed", dependencies=[Depends(lead)])
    def closed(sent: models.Closed) -> models.Closed:
        desk.store.close_study(sent.closed)
        kept["until"] = 0.0
        return sent

    @found.get("/static/{name}")
    def file(name: str) -> Response:
        if name not in _FILES:
            raise HTTPException(404)
        return FileResponse(_FILES[name], headers={"cache-control": "no-cache"})

    return found
