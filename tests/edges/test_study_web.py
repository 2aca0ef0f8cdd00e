"""Requests to the study that are wrong, too large, too many, or not to be told."""

import json
import logging
import re
import uuid
from dataclasses import replace
from pathlib import Path

import pytest

from evenhand.study.server.open_store import open_store
from evenhand.study.server.web.app import build
from evenhand.study.server.web.desk import Settings, admin_token
from evenhand.study.server.web.limits import Limits, Rate
from evenhand.study.server.web.security import LARGEST
from support.studies import ADMIN, ANSWERS, LEAD, STUDY, Browser, Clock, pragma, sent, served


@pytest.fixture
def study(tmp_path):
    (tmp_path / "clips").mkdir()
    for name in STUDY.clip_names:
        (tmp_path / "clips" / name).write_bytes(bytes(range(256)))
    (tmp_path / "secret.mp4").write_bytes(b"secret")
    (tmp_path / "clips" / "other.mp4").write_bytes(b"secret")
    return replace(STUDY, clips=tmp_path / "clips")


@pytest.fixture
def app(study):
    made, kept = served(study=study, static=study.clips / "unbuilt")
    yield made
    kept.dispose()


@pytest.fixture
def browser(app):
    return Browser(app)


def wrong(told, status, code):
    assert (told.status_code, told.json()["code"]) == (status, code), told.text
    assert set(told.json()) <= {"error", "code", "next"}
    assert re.fullmatch(r"[^\n]{5,}[.]", told.json()["error"])
    return told


# --- what everybody gets ---


@pytest.mark.parametrize(
    ("method", "path"),
    [("GET", "/"), ("GET", "/api/study"), ("GET", "/api/state"), ("GET", "/no"), ("PUT", "/lead"),
     ("GET", "/lead"), ("GET", "/lead/numbers"), ("GET", "/clips/s1a.mp4"), ("POST", "/api/begin"),
     ("GET", "/lead/static/lead.js"), ("OPTIONS", "/api/mine"), ("GET", "/docs")],
)  # fmt: skip
def test_every_answer_is_guarded(browser, method, path):
    headers = browser(method, path).headers
    policy = dict(part.split(" ", 1) for part in headers["content-security-policy"].split("; "))
    assert policy["default-src"] == "'none'"
    assert policy["script-src"] == policy["style-src"] == policy["connect-src"] == "'self'"
    assert policy["frame-ancestors"] == policy["base-uri"] == "'none'"
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert "server" not in headers
    assert ("set-cookie" in headers) is False


def test_pages_of_the_lead_hold_no_script_inline(browser):
    login = browser("GET", "/lead").text
    session = browser("POST", "/lead/login", data={"token": ADMIN}).headers["set-cookie"]
    browser.headers["cookie"] = session.split(";")[0]
    page = browser("GET", "/lead").text
    assert "Admin token" in login
    assert 'src="/lead/static/lead.js"' in page
    for text in (login, page):
        assert not re.search(r"<script(?![^>]*src=)|\son\w+=|style=|javascript:", text)
    assert "innerHTML" not in browser("GET", "/lead/static/lead.js").text


def test_a_title_is_never_html(study):
    made, kept = served(study=replace(study, title="<script>alert(1)</script>"))
    assert "&lt;script&gt;alert(1)" in Browser(made)("GET", "/lead").text
    kept.dispose()


def test_the_page_is_served_once_it_is_built(study, tmp_path):
    static = tmp_path / "static"
    static.mkdir()
    (static / "index.html").write_text("<!doctype html><title>built</title>")
    (static / "study.js").write_text("1")
    made, kept = served(study=study, static=static)
    browser = Browser(made)
    assert "built" in browser("GET", "/?PROLIFIC_PID=x").text
    for path in ("/", "/lead"):  # as a watchdog of servers asks
        told = browser("HEAD", path)
        assert (told.status_code, told.content) == (200, b"")
    script = browser("GET", "/static/study.js")
    assert (script.text, script.headers["cache-control"]) == ("1", "no-cache")
    for path in ("/static/../../secret.mp4", "/static/%2e%2e/secret.mp4"):
        wrong(browser("GET", path), 404, "not-found")
    kept.dispose()


def test_an_unbuilt_page_is_said_plainly(browser):
    told = browser("GET", "/")
    assert told.status_code == 503
    assert "lacks the pages of the study" in told.text


# --- clips ---


def test_clips_are_served_in_parts(browser):
    told = browser("GET", "/clips/s1a.mp4")
    assert (told.status_code, told.headers["content-type"]) == (200, "video/mp4")
    assert told.content == bytes(range(256))
    for asked, got in (("bytes=0-9", range(10)), ("bytes=250-", range(250, 256)),
                       ("bytes=-3", range(253, 256)), ("bytes=255-999", [255])):  # fmt: skip
        told = browser("GET", "/clips/s1a.mp4", headers={"range": asked})
        assert (told.status_code, told.content) == (206, bytes(got))
    told = browser("GET", "/clips/s1a.mp4", headers={"range": "bytes=900-"})
    assert (told.status_code, told.headers["content-range"]) == (416, "bytes */256")
    told = browser("HEAD", "/clips/s1a.mp4")
    assert (told.headers["content-length"], told.content) == ("256", b"")
    assert told.headers["accept-ranges"] == "bytes"


@pytest.mark.parametrize(
    "name",
    ["other.mp4", "../secret.mp4", "..%2fsecret.mp4", "%2e%2e%2fsecret.mp4", "%2fetc%2fpasswd",
     "s1a.mp4/", "s1a.mp4%00", "S1A.MP4", "", "....//secret.mp4"],
)  # fmt: skip
def test_nothing_but_clips_of_the_study_is_served(browser, name):
    told = browser("GET", f"/clips/{name}")
    assert told.status_code in (307, 404)
    assert b"secret" not in told.content


def test_a_clip_that_is_gone(browser, study):
    (study.clips / "s1a.mp4").unlink()
    wrong(browser("GET", "/clips/s1a.mp4"), 404, "not-found")


# --- requests of participants ---


def test_from_beginning_to_end(browser):
    about = browser("GET", "/api/study").json()
    assert about["consent"] == {"version": "1", "text": STUDY.consent}
    assert about["pages_total"] == 8
    assert (about["preview"], about["shared_computer"]) == (False, False)
    begun = browser.begin()
    assert begun.status_code == 201
    assert begun.json()["state"]["next"] == "about"
    assert browser.put("about", {}).json() == {
        "saved": True, "next": browser.next(), "repeated": False,
    }  # fmt: skip
    wrong(browser("POST", "/api/finish", json={}), 409, "not-finished")
    browser.answer_all()
    for _ in range(2):
        told = browser("POST", "/api/finish", json={}).json()
        assert told == {"code": "C0DE", "redirect": "https://recruit.example/done?cc=C0DE"}
    mine = browser("GET", "/api/mine")
    assert 'attachment; filename="tiny-my-answers.json"' in mine.headers["content-disposition"]
    assert len(json.loads(mine.text)["answers"]) == 10
    assert browser("DELETE", "/api/mine").json() == {"deleted": True}
    wrong(browser("GET", "/api/state"), 410, "withdrawn")


@pytest.mark.parametrize(
    "changes",
    [{"key": "1"}, {"key": None}, {"sequence": -1}, {"sequence": "1"}, {"sequence": 10**400},
     {"shown_ms": 1.5}, {"shown_ms": True}, {"values": []}, {"values": {"years": 1.5}},
     {"values": {"x" * 200: 1}}, {"values": {"years": {"a": 1}}}, {"clip_views": {"a": -1}},
     {"at": "x" * 41}, {"more": 1}, {"values": {"years": "x" * 4001}}],
)  # fmt: skip
def test_bodies_that_do_not_fit(browser, changes):
    browser.begin()
    body = json.dumps({**sent({}), **changes}).encode()
    told = browser("PUT", "/api/pages/about", content=body,
                   headers={"content-type": "application/json"})  # fmt: skip
    assert told.status_code in (400, 422)
    wrong(told, told.status_code, "invalid")
    assert browser.next() == "about"


@pytest.mark.parametrize("body", [b"", b"{", b"[]", b"null", b"NaN", b"[" * 60_000, b"\xff", b"{}"])
def test_bodies_that_are_no_request(browser, body):
    told = browser("POST", "/api/begin", content=body, headers={"content-type": "application/json"})
    assert told.status_code in (400, 422)
    sentence = wrong(told, told.status_code, "invalid").json()["error"]
    assert not sentence[0].isdigit()  # no place in a text that nobody sees


def test_a_body_that_is_too_large(browser):
    browser.begin()
    body = b'{"x": "' + b"x" * LARGEST + b'"}'
    wrong(browser("PUT", "/api/pages/about", content=body), 413, "too-large")

    async def parts():
        for _ in range(LARGEST // 1000 + 2):
            yield b"x" * 1000

    wrong(browser("PUT", "/api/pages/about", content=parts()), 413, "too-large")


@pytest.mark.parametrize("header", [{}, {"authorization": "Bearer x"}, {"authorization": "Basic x"},
                                    {"authorization": "Bearer ' OR 1=1 --"}])  # fmt: skip
def test_nobody_without_a_token(app, header):
    told = wrong(Browser(app)("GET", "/api/state", headers=header), 401, "unknown-token")
    assert told.headers["www-authenticate"] == "Bearer"


def test_methods_are_told(browser):
    told = wrong(browser("PATCH", "/api/mine"), 405, "wrong-method")
    assert told.headers["allow"] == "DELETE, GET"


# --- simulated participants, previews, ids ---


def test_simulated_participants_say_so_twice_or_are_not_let_in(study):
    header = {"x-evenhand-simulated": "1"}
    for allowed in (False, True):
        made, kept = served(study=study, simulated=allowed)
        browser = Browser(made)
        wrong(browser.begin(simulated=True), 403, "not-simulated")
        wrong(browser.begin(headers=header), 403, "not-simulated")
        told = browser.begin(simulated=True, headers=header)
        assert told.status_code == (201 if allowed else 403)
        counts = browser("GET", "/lead/numbers", headers=LEAD).json()
        assert counts["simulated"]["counts"]["began"] == int(allowed)
        assert counts["real"]["counts"]["began"] == 0
        kept.dispose()


def test_a_preview_is_one_whatever_is_said(study):
    made, kept = served(study=study, preview=True)
    browser = Browser(made)
    browser.begin()
    assert browser("GET", "/api/mine").json()["participant"]["preview"] is True
    kept.dispose()


@pytest.mark.parametrize("ids", [{"PROLIFIC_PID": "=1+1"}, {"PROLIFIC_PID": "x" * 101},
                                 {"OTHER": "x"}, {"STUDY_ID": 3}])  # fmt: skip
def test_ids_that_are_none(browser, ids):
    wrong(browser.begin(external=ids), 422, "invalid")


# --- too many ---


def test_too_many_requests_are_told_to_wait(study):
    limits = Limits(token=Rate(3, 0.01), begin=Rate(2, 0.01))
    made, kept = served(study=study, limits=limits)
    browser = Browser(made)
    browser.begin()
    told = [browser("GET", "/api/state") for _ in range(4)]
    assert [one.status_code for one in told] == [200, 200, 200, 429]
    assert int(wrong(told[-1], 429, "too-many").headers["retry-after"]) > 1
    other = Browser(made)
    assert other.begin().status_code == 201
    assert other("GET", "/api/state").status_code == 200
    wrong(Browser(made).begin(), 429, "too-many")
    kept.dispose()


# --- the lead ---


def test_the_lead_needs_the_token(browser):
    for headers in ({}, {"authorization": "Bearer x"}, {"cookie": "evenhand_lead=x"}):
        wrong(browser("GET", "/lead/numbers", headers=headers), 401, "no-lead")
        assert browser("POST", "/lead/closed", json={"closed": True},
                       headers=headers).status_code == 401  # fmt: skip
    assert browser("POST", "/lead/login", data={"token": "wrong"}).status_code == 401
    told = browser("POST", "/lead/login", data={"token": ADMIN})
    assert (told.status_code, told.headers["location"]) == (303, "/lead")
    cookie = told.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert ADMIN not in cookie
    browser.headers["cookie"] = cookie.split(";")[0]
    assert browser("GET", "/lead/numbers").json()["study"] == "tiny"
    assert browser("POST", "/lead/closed", json={"closed": True}).json() == {"closed": True}
    assert browser("GET", "/lead/numbers").json()["closed"] is True
    wrong(Browser(browser.app).begin(), 409, "closed")
    browser("POST", "/lead/logout")
    assert browser("GET", "/lead/numbers").status_code == 401


def test_guesses_are_slowed_and_the_lead_is_not_locked_out(browser):
    told = [browser("POST", "/lead/login", data={"token": str(n)}) for n in range(12)]
    assert [one.status_code for one in told] == [401] * 10 + [429] * 2
    assert browser("POST", "/lead/login", data={"token": ADMIN}).status_code == 303


def test_where_the_admin_token_comes_from(tmp_path):
    (tmp_path / "token").write_text("  from-a-file-0123456789\n")
    assert admin_token("from-the-environment", None) == ("from-the-environment", False)
    assert admin_token("x", tmp_path / "token") == ("from-a-file-0123456789", False)
    made, fresh = admin_token(None, None)
    assert fresh
    assert len(made) >= 40
    assert admin_token(None, None)[0] != made
    for given, file in (("short", None), ("", None), (None, tmp_path / "none")):
        with pytest.raises(ValueError, match=r"characters: give at least 16|cannot be read"):
            admin_token(given, file)


# --- the log, and defects ---


def test_the_log_knows_routes_and_nothing_about_people(browser, caplog):
    caplog.set_level(logging.INFO, "evenhand.study")
    browser.begin(external={"PROLIFIC_PID": "pid0815"})
    browser.put("about", {"years": "18-39"}, key=str(uuid.UUID(int=7)))
    browser("GET", "/?PROLIFIC_PID=pid0815", headers={"user-agent": "Mozilla/5.0"})
    browser("GET", "/some/where/else?token=1")
    lines = [record.getMessage() for record in caplog.records if record.name == "evenhand.study"]
    assert lines == [
        "POST /api/begin 201", "PUT /api/pages/{page_id} 200", "GET / 503", "- other 404",
    ]  # fmt: skip


def test_a_defect_is_told_without_details(app, caplog, monkeypatch):
    browser = Browser(app)
    browser.begin()

    def broken(*_):
        raise ZeroDivisionError("with a secret in it")

    monkeypatch.setattr("evenhand.study.server.participants.state", broken)
    told = wrong(browser("GET", "/api/state"), 500, "internal")
    assert "secret" not in told.text
    assert told.headers["x-content-type-options"] == "nosniff"
    assert "ZeroDivisionError" in caplog.text


def test_a_full_database_is_told_and_answers_can_be_sent_again(study, tmp_path: Path, caplog):
    kept = open_store(str(tmp_path / "s.db"), study, clock=Clock(), wait=0.1)
    browser = Browser(build(study, kept, Settings("")))
    browser.begin()
    pragma(kept, "query_only=ON")
    told = wrong(browser.put("about", ANSWERS["about"]), 503, "storage")
    assert told.headers["retry-after"] == "5"
    assert "readonly" in caplog.text
    pragma(kept, "query_only=OFF")
    assert browser.put("about", ANSWERS["about"]).json()["saved"] is True
    kept.dispose()
