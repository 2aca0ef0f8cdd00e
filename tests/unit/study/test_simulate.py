"""Simulated participants: marked for ever, seeded, and answering only what pages ask."""

import numpy as np
import pytest

from evenhand.study.analysis import judgements
from evenhand.study.analysis.answer_columns import pc
from evenhand.study.design import orders
from evenhand.study.design.protocol import Question
from evenhand.study.server import check_reply
from evenhand.study.simulated.participants import Habits, answers, recruit, visit
from support.answered import SCORES, options, protocol
from support.refusals import refused

CAREFUL = Habits(careless=0, leaves=0)


def test_every_row_is_simulated_and_the_same_seed_gives_the_same_rows():
    one, two, other = (answers(protocol(), 12, seed) for seed in (1, 1, 2))
    assert pc.all(one.table["simulated"]).as_py()
    assert one.table.equals(two.table)
    assert not one.table.equals(other.table)
    assert len(one.participants) == 12


def test_more_participants_do_not_change_the_orders_of_the_first():
    made = answers(protocol(), 14, 0, CAREFUL)
    numbers = made.table.group_by("participant", use_threads=False).aggregate([("order", "first")])
    assert numbers["order_first"].to_pylist() == [k % 6 for k in range(14)]


def test_judgements_go_by_the_scores_that_the_study_states():
    judged = judgements.judge(answers(protocol(), 200, 3, CAREFUL), protocol())
    biased = dict(zip(judged.sets, np.nanmean(judged.biased, axis=0), strict=True))
    # totals of 1.4 to 1.5 against thresholds of 0.5 on average, and 0.2 for even robots
    assert all(biased[name] > 0.9 for name in SCORES if not name.startswith("even"))
    assert all(biased[name] < 0.1 for name in SCORES if name.startswith("even"))
    late = judged.sets.index("late")
    assert np.mean(judged.identity[:, late] == judged.identities.index("age")) > 0.8
    assert np.mean(judged.issue[:, late] == judged.issues.index("priority")) > 0.8


def test_a_set_without_scores_is_judged_as_an_even_one():
    plain = protocol(
        sets=tuple(type(one)(one.id, one.clips, kind=one.kind) for one in protocol().sets)
    )
    judged = judgements.judge(answers(plain, 100, 0, CAREFUL), plain)
    assert np.nanmean(judged.biased) < 0.05


def test_turned_scales_are_answered_the_other_way():
    fair = Question("fair", "How unfair?", "scale", "fair", points=4, lowest_is_unfair=False)
    turned = protocol(questions=(fair, *protocol().questions[1:]))
    judged = judgements.judge(answers(turned, 60, 3, CAREFUL), turned)
    assert np.nanmean(judged.biased[:, judged.sets.index("late")]) > 0.9
    assert np.nanmean(judged.biased[:, judged.sets.index("even-one")]) < 0.1


def test_those_who_leave_do_not_finish_and_the_others_do():
    gone = answers(protocol(), 40, 0, Habits(leaves=1))
    assert set(gone.table["status"].to_pylist()) == {"begun"}
    assert len(gone.participants) < 40  # some leave before the first answer
    assert set(answers(protocol(), 10, 0, CAREFUL).table["status"].to_pylist()) == {"finished"}


def fair(made):
    """The ratings of fairness."""
    return made.where(pc.equal(made.table["role"], "fair")).table["number"]


def test_the_careless_are_quick_and_answer_alike_or_at_random():
    made = answers(protocol(), 40, 0, Habits(careless=1, alike=1, leaves=0))
    assert set(fair(made).to_pylist()) == {1.0}
    careful = answers(protocol(), 40, 0, CAREFUL)
    quick, slow = (
        np.median(a.where(pc.equal(a.table["kind"], "check")).table["seconds"].to_numpy())
        for a in (made, careful)
    )
    assert quick < slow / 3
    at_random = answers(protocol(), 200, 0, Habits(careless=1, alike=0, leaves=0))
    shares = np.bincount(fair(at_random).to_numpy().astype(int))[1:]
    assert shares.min() > 0.7 * shares.max()


@pytest.mark.parametrize("kind", ["scale", "choice", "choices", "text"])
def test_every_type_of_question_is_answered_as_the_server_wants_it(kind):
    asked = Question(
        "extra", "What?", kind, "other", points=11, options=options("a", "b", "c") if kind in
        ("choice", "choices") else (), longest=5)  # fmt: skip
    study = protocol(questions=(*protocol().questions, asked))
    pages = orders.pages(study, 1)
    rng = np.random.default_rng(0)
    crowd = recruit(30, rng)
    for who in range(30):
        for payload in visit(study, pages, crowd, who, rng).payloads:
            page = next(page for page in pages if page["id"] == payload["page"])
            check_reply.check(study, page, payload["values"])  # raises where an answer does not fit
            assert set(payload) == {
                "page", "key", "sequence", "values", "shown_ms", "clip_views", "at"}  # fmt: skip
            clips = payload["clip_views"]
            assert payload["shown_ms"] >= 10_000 * len(clips)


def test_keys_differ_and_the_sequence_counts_up():
    rng = np.random.default_rng(0)
    made = visit(protocol(), orders.pages(protocol(), 0), recruit(1, rng, CAREFUL), 0, rng)
    assert len({payload["key"] for payload in made.payloads}) == len(made.payloads)
    assert [payload["sequence"] for payload in made.payloads] == list(range(len(made.payloads)))
    assert made.finished


def test_impossible_habits_and_crowds_are_refused():
    with refused("range careless", "1.5", "0", "1"):
        Habits(careless=1.5)
    with refused("range clip", "0", "3600"):
        Habits(clip=0)
    with refused("range respondents", "0", "1"):
        recruit(0, np.random.default_rng(0))
