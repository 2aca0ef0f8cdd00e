"""Answers that their questions cannot have are refused, each with its place."""

from dataclasses import replace

import pytest

from evenhand.core.errors import InputError
from evenhand.study.analysis import check_answers, codebook, counting, fit_detector, infer_protocol
from evenhand.study.analysis.analyse import Settings, analyse
from evenhand.study.analysis.answers import Answers
from evenhand.study.design.protocol import Demographic, Option
from support.answered import judged, protocol, row
from support.refusals import refused

QUICK = Settings(permutations=99, bootstraps=99)


def some(**changes):
    """Two people, of whom the second is changed in one row."""
    rows = judged("ann", "late", 2, "priority", "age") + judged("bob", "late", 4, "none", "none")
    rows += [row("bob", "pair:duel", "even", value="first"),
             row("bob", "check:look", "look", value="blue", right=True),
             row("bob", "about", "age-group", value="18-39")]  # fmt: skip
    for question, values in changes.items():
        place = next(i for i, one in enumerate(rows)
                     if (one["participant"], one["question"]) == ("bob", question))  # fmt: skip
        rows[place] |= values
    return Answers.of_rows(rows)


def test_answers_that_belong_are_accepted():
    check_answers.check(some(), protocol())
    check_answers.check(some(fair={"value": None, "number": None}), protocol())


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"fair": {"value": "6", "number": 6.0}}, "page 'set:late': 6 is no point of the scale of "
         "1 to 5 of question 'fair': is this the protocol of these answers?"),
        ({"fair": {"value": "0", "number": 0.0}}, "0 is no point of the scale"),
        ({"fair": {"value": "3.5", "number": 3.5}}, "3.5 is no point of the scale"),
        ({"fair": {"value": "1e300", "number": 1e300}}, "1e+300 is no point of the scale"),
        ({"fair": {"value": "1"}}, "question 'fair' says '1' and its number says 4"),
        ({"fair": {"number": None}}, "question 'fair' says '4' and its number is empty"),
        ({"fair": {"value": "four"}}, "question 'fair' says 'four' and its number says 4"),
        ({"towards": {"value": "Race"}}, "'Race' is no option of question 'towards' (is it "
         "'race'?): is this the protocol of these answers?"),
        ({"issue": {"value": "risk|quality"}}, "'risk|quality' is no option of question 'issue'"),
        ({"even": {"value": "third"}}, "page 'pair:duel': 'third' is no option"),
        ({"look": {"value": "green"}}, "'green' is no option of question 'look'"),
        ({"age-group": {"value": "12"}}, "page 'about': '12' is no option"),
    ],
)  # fmt: skip
def test_what_does_not_belong_is_told_with_its_place(changes, said):
    for check in (lambda answers: analyse(answers, protocol(), QUICK),
                  lambda answers: fit_detector.judgements(answers, protocol())):  # fmt: skip
        with pytest.raises(InputError) as caught:
            check(some(**changes))
        assert str(caught.value).startswith("participant bob, page ")
        assert said in str(caught.value)


def test_several_choices_are_looked_at_each():
    questions = tuple(
        replace(one, type="choices") if one.id == "towards" else one for one in protocol().questions
    )
    check_answers.check(some(towards={"value": "race|age"}), protocol(questions=questions))
    with refused("unknown towards", "'Age'"):
        check_answers.check(some(towards={"value": "race|Age"}), protocol(questions=questions))


@pytest.mark.parametrize("number", [1e300, 2_000_000.0, 12.0, 3.5])
def test_without_a_protocol_a_scale_has_no_more_points_than_any_study(number):
    answers = some(fair={"value": f"{number!r}", "number": number})
    assert max(one.points for one in infer_protocol.study_of(answers).questions) <= 11
    with refused("range fair"):
        analyse(answers, None, QUICK)


def test_an_option_with_a_stroke_is_one_answer():
    answers = some(**{"age-group": {"value": "young|old"}})
    study = protocol(demographics=(Demographic("age-group", "How old?", ("young|old", "18-39")),))
    for plan in (study, infer_protocol.study_of(answers)):
        counts = counting.others(answers, plan).where(question="age-group", answer="young|old")
        assert [one["count"] for one in counts.rows()] == [1]
    for known in (study, None):
        told = next(q for q in codebook.codebook(answers, known)["questions"]
                    if q["id"] == "age-group")  # fmt: skip
        assert {one["value"]: one["count"] for one in told["options"]}["young|old"] == 1


def test_what_not_to_say_means_is_no_option_of_a_question_that_needs_an_answer():
    from evenhand.study.design.protocol import PREFER_NOT, Check, mistakes

    check = Check("look", "Choose.", ("blue", PREFER_NOT), "blue", 2)
    assert [said for _, said in mistakes(protocol(checks=(check,)))] == [
        "'Prefer not to say' is stored as no answer: leave it out"
    ]
    asked = protocol().questions[-1]
    for required in (True, False):
        one = replace(asked, type="choice", role="other", required=required,
                      options=(Option("a", "A"), Option(PREFER_NOT, "No")))  # fmt: skip
        wrong = list(mistakes(protocol(questions=(*protocol().questions[:-1], one))))
        assert len(wrong) == required


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"position": 2**63 - 1}, "row 1, column 'position': 9223372036854775807 is not a whole"),
        ({"position": -1}, "row 1, column 'position': -1 is not a whole number from 0"),
        ({"views": 2**40}, "column 'views'"),
        ({"item": None}, "row 1, column 'item': the cell is empty: name the set"),
        ({"item": None, "kind": "check"}, "name the check"),
    ],
)
def test_rows_that_cannot_be(values, said):
    with pytest.raises(InputError) as caught:
        Answers.of_rows([judged("ann", "late", 2)[0] | values])
    assert said in str(caught.value)


def test_what_answers_are_about_and_the_study_lacks_is_counted():
    # two people rated a set that the lead has dropped since, with three answers each
    dropped = [one for who in ("ann", "bob") for one in judged(who, "gone", 4, "none", "none")]
    everything = Answers.of_rows(some().table.to_pylist() + dropped)
    strange = check_answers.strangers(everything, protocol())
    assert strange == {"gone": len(dropped)}
    said = check_answers.told(strange)
    assert said == (
        f"{len(dropped)} answers are left out of ratings: they are about gone, which the "
        "protocol does not have"
    )
    found = analyse(everything, protocol(), QUICK)
    assert found.strange == strange
    assert "gone" not in found.parts[0].tables["ratings"].columns["set"]


def test_a_file_that_still_has_somebody_who_withdrew_is_described():
    rows = [one | {"status": "withdrawn"} for one in judged("ann", "late", 2, "none", "none")]
    found = codebook.people(Answers.of_rows(rows))
    assert found["people"] == {"finished": 0, "begun": 0, "withdrawn": 1}


def test_nothing_is_said_where_nothing_is_left_out():
    assert check_answers.strangers(some(), protocol()) == {}
    assert check_answers.told({}) == ""
    # without a protocol the answers tell themselves what there is
    assert analyse(some(), None, QUICK).strange == {}


def test_of_many_that_the_study_lacks_the_first_are_named():
    said = check_answers.told({f"set-{k}": 1000 for k in range(7)})
    assert said.startswith("7,000 answers are left out of ratings: they are about set-0, set-1, ")
    assert "set-4, ..., which" in said
    assert "set-5" not in said
