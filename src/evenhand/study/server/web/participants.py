"""Requests of participants."""

import json
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Response
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from evenhand.study.design import orders
from evenhand.study.server import participants
from evenhand.study.server.participants import Sent, State
from evenhand.study.server.refusal import RefusalError
from evenhand.study.server.web import models
from evenhand.study.server.web.desk import Desk

_BEARER = HTTPBearer(auto_error=False, description="The token that /api/begin gave.")
_SAID = {
    400: "The body is no JSON.",
    401: "The token is missing or unknown.",
    403: "Simulated participants are not let in.",
    404: "There is no such page.",
    409: "Not now: the sentence says why.",
    410: "The participant has withdrawn.",
    413: "The body is too large.",
    422: "The values do not fit.",
    429: "Too many requests.",
    503: "The database cannot answer.",
}
_ALWAYS = (429, 503)


def _errors(*codes: int) -> dict[int | str, dict[str, Any]]:
    return {
        code: {"model": models.Wrong, "description": _SAID[code]} for code in (*codes, *_ALWAYS)
    }


def router(desk: Desk) -> APIRouter:
    """What participants can ask for; every error is ``models.Wrong``."""
    found = APIRouter(prefix="/api")
    study, store, gate = desk.study, desk.store, desk.gate

    def counted() -> None:
        gate(gate.everything)

    def known(
        _: Annotated[None, Depends(counted)],
        given: Annotated[HTTPAuthorizationCredentials | None, Depends(_BEARER)],
    ) -> str:
        if given is None:
            raise RefusalError("unknown-token", "No token was sent: begin the study anew.")
        gate(gate.token, participants.hashed(given.credentials))
        return given.credentials

    @found.get("/study", responses=_errors(), dependencies=[Depends(counted)])
    def about() -> models.Study:
        """What the study is, and its consent text."""
        return models.Study(
            name=study.name,
            title=study.title,
            language=study.language,
            minutes=study.minutes,
            contact=study.contact,
            consent=models.Consent(version=study.consent_version, text=study.consent),
            pages_total=len(orders.pages(study, 0)),
            preview=desk.settings.preview,
            shared_computer=study.shared_computer,
        )

    @found.post(
        "/begin",
        status_code=201,
        responses=_errors(400, 403, 409, 410, 413, 422),
        dependencies=[Depends(counted)],
    )
    def begin(
        sent: models.Begin, x_evenhand_simulated: Annotated[str | None, Header()] = None
    ) -> models.Begun:
        """Agree, and get a token and the pages. With a token of its own a browser can ask again."""
        gate(gate.begin)
        # said twice and allowed, or not at all: no simulated row may pass for a real one
        signs = (sent.simulated, bool(x_evenhand_simulated), desk.settings.simulated)
        if any(signs[:2]) and not all(signs):
            raise RefusalError(
                "not-simulated",
                "This study takes no simulated participants: start it with --allow-simulated, "
                "and send the flag and the header.",
            )
        ids = sent.external.model_dump(exclude_none=True) if sent.external else None
        told, state = participants.begin(
            store,
            study,
            sent.consent_version,
            ids,
            token=sent.token,
            simulated=sent.simulated,
            preview=sent.preview or desk.settings.preview,
        )
        return models.Begun(token=told, state=_state(state))

    @found.get("/state", responses=_errors(401, 410))
    def state(token: Annotated[str, Depends(known)]) -> models.StateTold:
        """How far the participant is."""
        return _state(participants.state(store, study, token))

    @found.put("/pages/{page_id}", responses=_errors(400, 401, 404, 409, 410, 413, 422))
    def save(
        page_id: str, sent: models.Page, token: Annotated[str, Depends(known)]
    ) -> models.Saved:
        """Store one page. Sending the same again changes nothing."""
        following, repeated = participants.save(
            store,
            study,
            token,
            page_id,
            Sent(sent.key, sent.sequence, sent.values, sent.shown_ms, sent.clip_views, sent.at),
        )
        return models.Saved(saved=True, next=following, repeated=repeated)

    @found.post("/finish", responses=_errors(400, 401, 409, 410, 413, 422))
    def finish(_: models.Nothing, token: Annotated[str, Depends(known)]) -> models.Finished:
        """Everything is answered: get the code and where to go. Can be asked again."""
        participants.finish(store, study, token)
        code = study.completion_code
        return models.Finished(code=code, redirect=study.redirect.replace("{code}", code))

    @found.get(
        "/mine",
        responses={200: {"content": {"application/json": {"schema": {"type": "object"}}}}}
        | _errors(401, 410),
        response_class=Response,
    )
    def mine(token: Annotated[str, Depends(known)]) -> Response:
        """Everything that is stored about the participant, as a file."""
        told = participants.everything(store, token)
        return Response(
            json.dumps({"study": study.name, **told}, indent=1),
            media_type="application/json",
            headers={"content-disposition": f'attachment; filename="{study.name}-my-answers.json"'},
        )

    @found.delete("/mine", responses=_errors(401))
    def withdraw(token: Annotated[str, Depends(known)]) -> models.Deleted:
        """Delete everything. Can be asked again."""
        participants.withdraw(store, token)
        return models.Deleted(deleted=True)

    return found


def _state(state: State) -> models.StateTold:
    return models.StateTold(
        pages=state.pages, answered=state.answered, next=state.next, finished=state.finished
    )
