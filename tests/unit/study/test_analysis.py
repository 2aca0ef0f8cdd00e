"""The analysis: counts by hand, people apart from simulated ones, both ways beside each other."""

import numpy as np
import pytest
from statsmodels.stats.proportion import proportion_confint

from evenhand.study.analysis import analyse as analysis
from evenhand.study.analysis.analyse import Settings, analyse
from evenhand.study.analysis.answers import Answers
from evenhand.study.design.protocol import Question
from evenhand.study.simulated import participants
from support.answered import judged, options, protocol, row
from support.refusals import refused

QUICK = Settings(permutations=99, bootstraps=99)


def some(n: int = 6, **values) -> list[dict]:
    """People who rate "late" 1 or 2 and "even-one" 4 or 5, and prefer the even robot."""
    rows = []
    for who in range(n):
        name, odd = f"p{who}", who % 2
        rows += judged(name, "late", 1 + odd, "priority", "age", position=2, **values)
        rows += judged(name, "even-one", 4 + odd, "none", "none", position=3, **values)
        rows.append(row(name, "pair:duel", "even", value="first" if who == 0 else "second",
                        position=4, **values))  # fmt: skip
        rows.append(row(name, "about", "age-group", value="18-39" if odd else None, **values))
    return rows


def part(rows, study=None, settings=QUICK) -> analysis.Part:
    (found,) = analyse(Answers.of_rows(rows), study or protocol(), settings).parts
    return found


def one(table, **where) -> dict:
    (found,) = table.where(**where).rows()
    return found


def test_ratings_by_hand():
    late = one(part(some()).tables["ratings"], set="late")
    assert (late["kind"], late["n"], late["mean"], late["biased"]) == ("scenario", 6, 1.5, 1.0)
    even = one(part(some()).tables["ratings"], set="even-one")
    assert (even["kind"], even["mean"], even["biased"]) == ("control", 4.5, 0.0)
    # the t interval of three 1s and three 2s: 1.5 -+ 2.571 * 0.5477 / sqrt(6)
    assert late["high"] == pytest.approx(1.5 + 2.570582 * 0.5477226 / np.sqrt(6), abs=1e-4)
    nobody = one(part(some()).tables["ratings"], set="too-close")
    assert nobody["n"] == 0
    assert np.isnan(nobody["mean"])
    assert np.isnan(nobody["biased"])


def test_shares_have_wilsons_interval():
    rows = some(6)
    rows[2]["value"] = "race"  # p0 on "late"
    named = part(rows).tables["named"]
    age = one(named, question="identity", set="late", answer="age")
    assert (age["count"], age["n"], age["share"]) == (5, 6, 5 / 6)
    low, high = proportion_confint(5, 6, method="wilson")
    assert (age["low"], age["high"]) == pytest.approx((low, high))
    assert one(named, question="issue", set="late", answer="priority")["share"] == 1.0


def test_several_choices_are_counted_each():
    asked = Question("extra", "Which?", "choices", "other", options=options("a", "b", "c"))
    rows = [row(f"p{i}", "set:late", "extra", value=v, type="choices", role="other")
            for i, v in enumerate(["a|b", "b", None])]  # fmt: skip
    others = part(rows, protocol(questions=(*protocol().questions, asked))).tables["others"]
    found = {r["answer"]: (r["count"], r["n"]) for r in others.where(question="extra").rows()}
    assert found == {"a": (1, 2), "b": (2, 2), "c": (0, 2)}


def test_what_one_does_not_say_of_oneself_is_in_no_share():
    others = part(some()).tables["others"]
    told = one(others, question="age-group", answer="18-39")
    assert (told["count"], told["n"]) == (3, 3)


def test_pairs_by_hand():
    pairs = part(some()).tables["pairs"]
    assert one(pairs, answer="second")["count"] == 5
    decided = one(pairs, answer="of those who preferred one: first")
    assert (decided["count"], decided["n"], decided["share"]) == (1, 6, 1 / 6)


def test_progress_counts_pages_and_the_rest_of_the_study_too():
    rows = [row("a", "about", "age-group"), row("b", "about", "age-group"), *judged("b", "late", 1)]
    progress = part(rows).tables["progress"]
    # about, six sets, a check, a pair, the end
    assert progress["pages"].tolist() == list(range(1, 11))
    assert progress["participants"].tolist() == [2, 1, *[0] * 8]


def test_people_and_simulated_participants_are_never_in_one_table():
    made = participants.answers(protocol(), 7, 0).rows()
    found = analyse(Answers.of_rows([*some(), *made]), protocol(), QUICK)
    people, programs = found.parts
    assert (people.kind, programs.kind) == ("people", "simulated")
    assert one(people.tables["ratings"], set="late")["n"] == 6
    assert one(programs.tables["ratings"], set="late")["n"] <= 7
    alone = analyse(Answers.of_rows(some()), protocol(), QUICK).parts[0]
    for name, table in people.tables.items():
        for column, cells in table.columns.items():
            np.testing.assert_array_equal(cells, alone.tables[name].columns[column])


def test_previews_are_left_out_and_counted():
    looked = judged("look", "late", 5, preview=True)
    found = analyse(Answers.of_rows([*some(), *looked]), protocol(), QUICK)
    assert found.previews == 1
    assert one(found.parts[0].tables["ratings"], set="late")["n"] == 6
    with refused("empty answers", "1"):
        analyse(Answers.of_rows(looked), protocol())


def test_leaving_out_the_flagged_is_shown_both_ways():
    failed = [*judged("x", "late", 5, "none", "none"),
              row("x", "check:look", "look", right=False)]  # fmt: skip
    rows = [*some(), *failed]
    kept = part(rows)
    left = part(rows, settings=Settings(permutations=99, bootstraps=99, exclude_flagged=True))
    assert (kept.flagged, kept.used, left.flagged, left.used) == (1, 7, 1, 6)
    for table, n, mean, other_n, other in (
        (kept.tables["ratings"], 7, 2.0, 6, 1.5),
        (left.tables["ratings"], 6, 1.5, 7, 2.0),
    ):
        late = one(table, set="late")
        assert (late["n"], late["mean"], late["other_n"], late["other_mean"]) == (
            n, mean, other_n, other)  # fmt: skip
    assert kept.tables["agreement"]["alpha"].tolist() == left.tables["agreement"][
        "other_alpha"].tolist()  # fmt: skip
    assert one(left.tables["flags"], flag="any")["participants"] == 1
    assert one(left.tables["participants"], participant="x")["flags"] == "attention"


def test_everybody_flagged_leaves_nothing_and_says_so():
    rows = [*judged("x", "late", 5), row("x", "check:look", "look", right=False)]
    found = part(rows, settings=Settings(permutations=99, bootstraps=99, exclude_flagged=True))
    assert (found.used, found.flagged) == (0, 1)
    assert np.isnan(one(found.tables["ratings"], set="late")["mean"])


def test_without_a_protocol_nothing_is_made_up():
    (found,) = analyse(Answers.of_rows(some()), None, QUICK).parts
    late = one(found.tables["ratings"], set="late")
    assert (late["kind"], late["mean"]) == ("not known", 1.5)
    assert np.isnan(late["biased"])
    assert len(found.tables["controls"]) == 0
    assert one(found.tables["named"], question="identity", set="late", answer="age")["share"] == 1.0


def test_the_same_seed_gives_the_same_tables():
    rows = participants.answers(protocol(), 20, 0).rows()
    for name, table in part(rows).tables.items():
        for column, cells in part(rows).tables[name].columns.items():
            np.testing.assert_array_equal(cells, table.columns[column])


def test_answers_of_another_study_are_refused():
    rows = [row("a", "set:x", "other-question", value="1")]
    with refused("changed answers", "'small'"):
        analyse(Answers.of_rows(rows), protocol())
    with refused("empty answers"):
        analyse(Answers.of_rows([]), protocol())


def test_impossible_settings_are_refused():
    with refused("range permutations", "10", "99"):
        Settings(permutations=10)
