"""A browser that brings its own token begins once, however often it asks."""

import secrets

import pytest

from evenhand.study.server import participants as participating
from evenhand.study.server.refusal import RefusalError
from support.studies import STUDY, Browser, served

IDS = {"PROLIFIC_PID": "5f0", "STUDY_ID": "77a"}


@pytest.fixture
def kept():
    _, made = served()
    yield made
    made.dispose()


def participants(kept) -> int:
    with kept.read() as connection:
        return connection.exec_driver_sql("SELECT count(*) FROM study_participants").scalar()


def test_asking_again_with_the_same_token_finds_the_same_participant(kept):
    token = secrets.token_urlsafe(32)
    first = participating.begin(kept, STUDY, "1", IDS, token=token)
    assert first[0] == token
    assert participating.begin(kept, STUDY, "1", IDS, token=token) == first
    assert participants(kept) == 1
    # even when the study has been closed in between: nobody is locked out who has begun
    kept.close_study(True)
    assert participating.begin(kept, STUDY, "1", IDS, token=token) == first
    with pytest.raises(RefusalError, match="closed"):
        participating.begin(kept, STUDY, "1", token=secrets.token_urlsafe(32))


def test_another_token_is_another_participant_and_ids_stay_unique(kept):
    participating.begin(kept, STUDY, "1", IDS, token=secrets.token_urlsafe(32))
    with pytest.raises(RefusalError) as refused:
        participating.begin(kept, STUDY, "1", IDS, token=secrets.token_urlsafe(32))
    assert refused.value.code == "already-begun"
    participating.begin(kept, STUDY, "1", token=secrets.token_urlsafe(32))
    assert participants(kept) == 2


def test_who_has_withdrawn_cannot_begin_again_with_the_token(kept):
    token = secrets.token_urlsafe(32)
    participating.begin(kept, STUDY, "1", token=token)
    participating.withdraw(kept, token)
    with pytest.raises(RefusalError) as refused:
        participating.begin(kept, STUDY, "1", token=token)
    assert refused.value.code == "withdrawn"
    assert participants(kept) == 1


@pytest.mark.parametrize(
    "token", ["", "short", "x" * 42, "x" * 44, "x" * 42 + "!", "x" * 43 + "\n"]
)
def test_a_token_that_is_none_is_refused(token):
    app, made = served()
    told = Browser(app).begin(token=token)
    assert (told.status_code, told.json()["code"]) == (422, "invalid")
    assert Browser(app).begin(token="x" * 43).json()["token"] == "x" * 43
    made.dispose()
