"""Participants begin, answer and finish: each answer once, in order, whatever browsers send."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenhand.study.server import participants, progress, rows
from evenhand.study.server.open_store import open_store
from evenhand.study.server.participants import Sent
from evenhand.study.server.refusal import STATUS, RefusalError
from support.studies import ANSWERS, STUDY, Clock

HOUR = 3600.0


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def kept(clock):
    one = open_store("sqlite://", STUDY, clock=clock)
    yield one
    one.dispose()


def begin(kept, **more):
    return participants.begin(kept, STUDY, "1", **more)[0]


def put(kept, token, page, values, key="k1", **more):
    sent = Sent(key, 1, values, more.pop("shown_ms", 1500), more.pop("clip_views", {}), **more)
    return participants.save(kept, STUDY, token, page, sent)


def go(kept, token, until="finished"):
    """Answer pages up to one."""
    while (page := participants.state(kept, STUDY, token).next) != until:
        put(kept, token, page, ANSWERS[page.partition(":")[0]], key=page)


def refused(code, call, *words, **more):
    with pytest.raises(RefusalError) as error:
        call(*words, **more)
    assert error.value.code == code
    assert error.value.status == STATUS[code]
    return error.value


def stored(kept):
    return list(rows.read(kept, previews=True, exact_times=True))


# --- the way through ---


def test_a_whole_study_as_rows(kept, clock):
    token = begin(kept)
    clock.now += 90
    put(kept, token, "about", {"years": "Prefer not to say"}, key="a")
    first, second = (f"set:s{n}" for n in ((1, 2) if participants.state(
        kept, STUDY, token).next == "set:s1" else (2, 1)))  # fmt: skip
    clips = {"set:s1": {"s1a.mp4": 2, "s1b.mp4": 1}, "set:s2": {"s2a.mp4": 3}}
    put(kept, token, first, ANSWERS["set"], key="b", clip_views=clips[first])
    put(kept, token, "check:look", {"look": "red"}, key="c")
    put(kept, token, second, {"fair": 5, "issue": "none"}, key="d", clip_views=clips[second])
    put(kept, token, "pair:p1", {"which": "same"}, key="e")
    assert put(kept, token, "end", {"why": "  \x00 "}, key="f") == ("finished", False)
    participants.finish(kept, STUDY, token)
    found = stored(kept)
    told = [(r["page"], r["question"], r["value"], r["number"], r["right"], r["views"], r["role"])
            for r in found]  # fmt: skip
    views = {"set:s1": 1, "set:s2": 3}
    assert told == [
        ("about", "years", None, None, None, None, "about"),
        (first, "fair", "2", 2.0, None, views[first], "fair"),
        (first, "issue", "risk", None, None, views[first], "issue"),
        (first, "whom", "age|race", None, None, views[first], "identity"),
        ("check:look", "look", "red", None, False, None, "check"),
        (second, "fair", "5", 5.0, None, views[second], "fair"),
        (second, "issue", "none", None, None, views[second], "issue"),
        (second, "whom", None, None, None, views[second], "identity"),
        ("pair:p1", "which", "same", None, None, 0, "pair"),  # no clip of it was spoken of
        ("end", "why", None, None, None, None, "free"),
    ]
    assert {r["received"] for r in found} == {"2023-11-14T22:14:50.000Z"}
    assert {r["received"] for r in rows.read(kept)} == {"2023-11-14T22:14Z"}
    assert [r["position"] for r in found] == [1, 2, 2, 2, 3, 4, 4, 4, 5, 6]
    assert {(r["status"], r["seconds"], r["consent_version"]) for r in found} == {
        ("finished", 1.5, "1")
    }
    assert found[1]["item"] == first[4:]
    real = progress.read(kept, STUDY)["real"]
    assert real["counts"]["finished"] == 1
    assert real["minutes"] == {"median": 1.5, "n": 1}
    assert real["checks"] == [{"check": "look", "answered": 1, "failed": 1}]


def test_the_same_again_changes_nothing(kept):
    token = begin(kept)
    assert put(kept, token, "about", {"years": "18-39"}) == (
        participants.state(kept, STUDY, token).next, False,
    )  # fmt: skip
    before = stored(kept)
    # the same request, the same answer from another tab, and the order of several values
    assert put(kept, token, "about", {"years": "18-39"})[1]
    assert put(kept, token, "about", {"years": "18-39"}, key="k2", shown_ms=9)[1]
    assert stored(kept) == before
    page = participants.state(kept, STUDY, token).next
    values = {"fair": 1, "issue": "none"}
    put(kept, token, page, {**values, "whom": ["race", "age"]}, key="k3")
    assert put(kept, token, page, {**values, "whom": ["age", "race"]}, key="k4")[1]
    # also after the end
    go(kept, token)
    participants.finish(kept, STUDY, token)
    participants.finish(kept, STUDY, token)
    assert put(kept, token, "about", {"years": "18-39"}) == ("finished", True)


def test_another_answer_from_another_tab_counts_for_nothing(kept):
    token = begin(kept)
    put(kept, token, "about", {"years": "18-39"})
    for key in ("k1", "k2"):
        error = refused("already-answered", put, kept, token, "about", {"years": None}, key)
        assert error.next == participants.state(kept, STUDY, token).next
    assert [r["value"] for r in stored(kept)] == ["18-39"]


def test_what_comes_out_of_order_or_too_late(kept):
    token = begin(kept)
    error = refused("out-of-order", put, kept, token, "end", ANSWERS["end"])
    assert error.next == "about"
    assert refused("not-finished", participants.finish, kept, STUDY, token).next == "about"
    refused("already-answered", put, kept, token, "consent", {})
    refused("out-of-order", put, kept, token, "finished", {})
    refused("unknown-page", put, kept, token, "set:s9", {})
    put(kept, token, "about", {}, key="same")
    following = participants.state(kept, STUDY, token).next
    refused("key-reused", put, kept, token, following, ANSWERS["set"], key="same")
    go(kept, token)
    participants.finish(kept, STUDY, token)
    refused("closed", put, kept, token, "about", {"years": "18-39"}, "late")
    assert len(stored(kept)) == 10


def test_a_closed_study_takes_nothing_until_it_is_opened_again(kept):
    token = begin(kept)
    kept.close_study(True)
    refused("closed", begin, kept)
    refused("closed", put, kept, token, "about", {})
    assert progress.read(kept, STUDY)["closed"]
    kept.close_study(False)
    put(kept, token, "about", {})
    begin(kept)


def test_consent_to_another_text_is_no_consent(kept):
    refused("other-consent", participants.begin, kept, STUDY, "0")


# --- wrong values ---

WRONG = [
    ("set", {"fair": 6}), ("set", {"fair": 0}), ("set", {"fair": "3"}), ("set", {"fair": True}),
    ("set", {"fair": None}), ("set", {"fair": [1]}), ("set", {"issue": "quality"}),
    ("set", {"issue": ["risk"]}), ("set", {"issue": 1}), ("set", {"whom": "age"}),
    ("set", {"whom": ["age", "age"]}), ("set", {"whom": ["Age"]}), ("set", {"more": 1}),
    ("about", {"years": "17"}), ("about", {"years": ["18-39"]}), ("pair", {"which": "third"}),
    ("pair", {"which": None}), ("check", {"look": None}), ("check", {"look": "green"}),
    ("end", {"why": 3}), ("end", {"why": "x" * 51}), ("end", {"why": ["x"]}),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "values"), WRONG)
def test_wrong_values_are_refused_by_the_name_of_their_question(kept, kind, values):
    token = begin(kept)
    while not (page := participants.state(kept, STUDY, token).next).startswith(kind):
        put(kept, token, page, ANSWERS[page.partition(":")[0]], key=page)
    before = stored(kept)
    error = refused("invalid", put, kept, token, page, {**ANSWERS[kind], **values})
    assert repr(next(iter(values))) in error.sentence
    assert stored(kept) == before


def test_clips_of_another_page_were_not_seen_here(kept):
    token = begin(kept)
    error = refused("invalid", put, kept, token, "about", {}, clip_views={"s1a.mp4": 1})
    assert "s1a.mp4" in error.sentence


@pytest.mark.parametrize(
    ("shown", "seconds"),
    [(0, 0.0), (1234, 1.234), (-5, None), (2**53, None), (7 * 86400_000, 604800.0)],
)
def test_a_clock_that_jumps_costs_no_answer(kept, clock, shown, seconds):
    token = begin(kept)
    clock.now -= 10 * HOUR  # the server's, too
    put(kept, token, "about", {}, shown_ms=shown, at="1969-07-20T20:17:40Z")
    assert [r["seconds"] for r in stored(kept)] == [seconds]
    go(kept, token)
    participants.finish(kept, STUDY, token)
    real = progress.read(kept, STUDY)["real"]
    # nobody finishes before beginning: no time is known
    assert (real["counts"]["finished"], real["minutes"]["n"]) == (1, 0)


NASTY = st.one_of(
    st.text(max_size=50),
    st.sampled_from(
        ["'; DROP TABLE study_answers; --", '" OR 1=1', "<script>alert(1)</script>", "%s %(x)s :x",
         "\\'; --", "=cmd|' /C calc'!A0", "\u202e\u0000", "{{7*7}}", "a|b"]
    ),
)  # fmt: skip


@settings(max_examples=25)
@given(st.lists(NASTY, min_size=1, max_size=4))
def test_any_text_comes_back_as_it_was_written(texts):
    one = open_store("sqlite://", STUDY)
    for text in texts:
        token = begin(one)
        go(one, token, until="end")
        put(one, token, "end", {"why": text})
        mine = participants.everything(one, token)["answers"]
        [row] = [row["value"] for row in mine if row["question"] == "why"]
        kept_text = "".join(
            c for c in text if (c >= " " and not "\x7f" <= c <= "\x9f") or c in "\n\t"
        )
        assert row == (kept_text.strip() or None)
    assert len(stored(one)) == 10 * len(texts)
    one.dispose()


@settings(max_examples=50)
@given(name=NASTY, page=NASTY, token=NASTY, value=st.one_of(NASTY, st.integers(), st.none()))
def test_no_name_is_more_than_a_name(name, page, token, value):
    one = open_store("sqlite://", STUDY)
    real = begin(one)
    with pytest.raises(RefusalError):
        put(one, token, page, {name: value})
    with pytest.raises(RefusalError):
        put(one, real, page, {name: value})
    with pytest.raises(RefusalError):
        put(one, real, "about", {name: value}, clip_views={name: 1})
    assert stored(one) == []
    one.dispose()


# --- orders ---


def order_of(kept, token):
    return participants.everything(kept, token)["participant"]["order_number"]


def test_the_least_filled_order_is_given(kept, clock):
    tokens = [begin(kept) for _ in range(4)]
    assert [order_of(kept, token) for token in tokens] == [0, 1, 0, 1]
    # who finishes keeps a place, who is gone for an hour gives it back
    go(kept, tokens[1])
    participants.finish(kept, STUDY, tokens[1])
    clock.now += HOUR + 1
    assert [order_of(kept, begin(kept)) for _ in range(3)] == [0, 0, 1]
    real = progress.read(kept, STUDY)["real"]
    assert real["counts"] == {
        "began": 7, "finished": 1, "under_way": 3, "dropped_out": 3, "withdrawn": 0,
    }  # fmt: skip
    assert [one["dropped_out"] for one in real["orders"]] == [2, 1]


def test_previews_and_simulated_participants_fill_nothing_of_real_ones(kept):
    assert order_of(kept, begin(kept, simulated=True)) == 0
    assert order_of(kept, begin(kept, preview=True)) == 0
    assert order_of(kept, begin(kept)) == 0
    assert order_of(kept, begin(kept, simulated=True)) == 1


def test_orders_without_end_are_given_once(clock):
    study = replace(STUDY, order="random")
    one = open_store("sqlite://", study, clock=clock)
    tokens = [participants.begin(one, study, "1")[0] for _ in range(5)]
    assert [order_of(one, token) for token in tokens] == [0, 1, 2, 3, 4]
    participants.withdraw(one, tokens[2])
    assert order_of(one, participants.begin(one, study, "1")[0]) == 2
    one.dispose()


# --- rights ---


def test_who_withdraws_leaves_a_row_that_says_so(kept):
    token, other = begin(kept, ids={"PROLIFIC_PID": "p", "STUDY_ID": "s"}), begin(kept)
    for one in (token, other):
        go(kept, one)
    mine = participants.everything(kept, token)
    assert mine["external"] == [{"prolific_pid": "p", "study_id": "s", "session_id": None}]
    assert len(mine["answers"]) == 10
    assert "token" not in mine["participant"]
    participants.withdraw(kept, token)
    participants.withdraw(kept, token)
    assert {r["participant"] for r in stored(kept)} == {
        participants.everything(kept, other)["participant"]["participant"]
    }
    for call in (participants.everything, lambda k, t: participants.state(k, STUDY, t)):
        refused("withdrawn", call, kept, token)
    refused("withdrawn", put, kept, token, "about", {})
    assert progress.read(kept, STUDY)["real"]["counts"]["withdrawn"] == 1
    refused("unknown-token", participants.withdraw, kept, "x")
    # ids are gone as well, so nobody knows that it is the same person
    begin(kept, ids={"PROLIFIC_PID": "p", "STUDY_ID": "s"})


def test_the_same_person_begins_once(kept):
    ids = {"PROLIFIC_PID": "p", "STUDY_ID": "s"}
    begin(kept, ids=ids)
    refused("already-begun", begin, kept, ids=ids)
    assert progress.read(kept, STUDY)["real"]["counts"]["began"] == 1
    begin(kept, ids={**ids, "STUDY_ID": "other"})
    begin(kept, ids={"SESSION_ID": "x"})
    begin(kept, ids={"SESSION_ID": "x"})
    # a lead who forgot STUDY_ID in the link: the person is still one
    begin(kept, ids={"PROLIFIC_PID": "p"})
    refused("already-begun", begin, kept, ids={"PROLIFIC_PID": "p"})
    # a lead may look as often as wanted, and leaves no ids
    preview = begin(kept, ids=ids, preview=True)
    assert participants.everything(kept, preview)["external"] == []


def test_agreement_by_hand(kept):
    # two judge s1 and s2 alike: complete agreement; fair has both 1 and 5
    for _ in range(2):
        token = begin(kept)
        put(kept, token, "about", {})
        for turn in range(3):
            page = participants.state(kept, STUDY, token).next
            values = {"fair": 1 if page == "set:s1" else 5, "issue": "none"}
            put(kept, token, page, ANSWERS["check"] if "check" in page else values, key=str(turn))
    found = {one["question"]: one for one in progress.read(kept, STUDY)["real"]["agreement"]}
    assert found["fair"] == {"question": "fair", "alpha": 1.0, "answers": 4}
    # nobody differs from anybody: it cannot be told from chance
    assert found["issue"] == {"question": "issue", "alpha": None, "answers": 4}
