"""From answers to a detector: the rule, what is refused, where it says it comes from."""

from dataclasses import replace

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.methods import detector_file
from evenhand.study.analysis import fit_detector
from evenhand.study.analysis.answers import Answers
from evenhand.study.design.protocol import ClipSet
from evenhand.study.simulated import participants
from support.answered import SCORES, judged, protocol
from support.refusals import refused

UNEVEN = [name for name in SCORES if not name.startswith("even")]


def crowd(n: int = 24, **values) -> Answers:
    """People who call every uneven robot unfair towards whom it is, and every even one fair."""
    towards = {name: max(scores, key=lambda i: sum(scores[i])) for name, scores in SCORES.items()}
    rows = []
    for who in range(n):
        for name in SCORES:
            unfair = name in UNEVEN
            rows += judged(f"p{who}", name, 1 if unfair else 5, "risk" if unfair else "none",
                           towards[name] if unfair else "none", **values)  # fmt: skip
    return Answers.of_rows(rows)


def test_judgements_by_hand():
    rows = [*judged("a", "late", 2, "priority", "age"), *judged("a", "even-one", 3, "none", "none"),
            *judged("b", "late", 1, "priority", "race|age"), *judged("b", "too-close", None),
            *judged("b", "from-afar", 1, "quality", "none")]  # fmt: skip
    asked = [replace(q, type="choices" if q.id == "towards" else q.type)
             for q in protocol().questions]  # fmt: skip
    found = fit_detector.judgements(Answers.of_rows(rows), protocol(questions=tuple(asked)))
    told = list(zip(found.participant, found.set, found.biased, found.kinds, strict=True))
    # sets in the order of the study: from-afar 1, late 2, even-one 4
    assert [(int(p), int(s), bool(b), k) for p, s, b, k in told] == [
        (0, 2, True, "ageism"), (0, 4, False, None), (1, 1, True, None), (1, 2, True, None)
    ]  # fmt: skip
    assert found.scores[0].tolist() == list(SCORES["late"]["age"])
    assert found.source == "respondents"


def test_the_scores_of_a_set_are_those_it_is_most_uneven_in_whatever_was_named():
    two = ClipSet("late", (), scores={"race": (0.1, 0, 0, 0), "age": (0.5, 0.2, 0, 0)})
    rows = judged("a", "late", 1, "priority", "race")
    found = fit_detector.judgements(Answers.of_rows(rows), protocol(sets=(two,)))
    assert found.scores.tolist() == [[0.5, 0.2, 0, 0]]
    assert found.kinds == ("racism",)


def test_sets_without_scores_are_left_out_and_counted():
    sets = (*protocol().sets[:3], *(ClipSet(one.id, one.clips) for one in protocol().sets[3:]))
    found = fit_detector.judgements(crowd(4), protocol(sets=sets))
    assert (len(found.biased), found.left_out) == (12, 12)


def test_a_clear_study_gives_a_detector_that_is_right_and_can_be_loaded(tmp_path):
    found = fit_detector.fit(crowd(), protocol())
    people, sets = found.held_out
    assert (people.over, people.groups, people.accuracy) == ("participants", 24, 1.0)
    assert (people.low, people.high) == (1.0, 1.0)
    assert (sets.over, sets.groups) == ("sets", 6)
    assert found.baseline == pytest.approx(4 / 6)
    assert found.detector.judge(SCORES["late"]["age"])
    assert not found.detector.judge((0.02, 0.02, 0.02, 0.02))
    assert found.detector.source == "respondents"
    assert found.detector.seed is None
    assert found.detector.kinds == ("ableism", "ageism", "racism")
    path = tmp_path / "detector.json"
    detector_file.save(found.detector, path)
    assert detector_file.load(path) == found.detector


def test_the_shipped_detector_judges_the_same_judgements():
    found = fit_detector.fit(crowd(), protocol())
    shipped = detector_file.load(detector_file.SHIPPED)
    vectors = [max(scores.values(), key=sum) for scores in SCORES.values()]
    right = sum(
        shipped.judge(vector) == (name in UNEVEN)
        for name, vector in zip(SCORES, vectors, strict=True)
    )
    assert (found.shipped.count, found.shipped.n) == (24 * right, 24 * 6)
    assert found.alike.n == 6


def test_one_simulated_answer_makes_the_source_simulated():
    made = participants.answers(protocol(), 5, 0, participants.Habits(careless=0, leaves=0))
    both = Answers.of_rows([*crowd().rows(), *made.rows()])
    assert fit_detector.fit(both, protocol()).detector.source == "simulated respondents"
    assert (
        fit_detector.fit(fit_detector.chosen(both, "people"), protocol()).detector.source
        == "respondents"
    )


def test_who_is_meant_has_to_be_said_where_there_are_both():
    made = participants.answers(protocol(), 5, 0, participants.Habits(leaves=0))
    both = Answers.of_rows([*crowd(3).rows(), *made.rows()])
    with refused("conflict who", "3", "5", "--who"):
        fit_detector.chosen(both, None)
    assert len(fit_detector.chosen(both, "simulated").participants) == 5
    assert len(fit_detector.chosen(both, "both").participants) == 8
    assert fit_detector.chosen(made, None).simulated
    with refused("empty answers"):
        fit_detector.chosen(made, "people")


def test_previews_are_never_fitted_to():
    with refused("empty answers"):
        fit_detector.chosen(crowd(3, preview=True), None)


@pytest.mark.parametrize(
    ("answers", "study", "complaint"),
    [
        (lambda: crowd(3), protocol(), "18 judgements are too few to fit a detector to: 20"),
        (
            lambda: Answers.of_rows([r for i in range(30) for r in judged(f"p{i}", "late", 1)]),
            protocol(),
            "all 30 judgements say biased: .* add even controls",
        ),
        (
            lambda: Answers.of_rows([r for i in range(30) for r in judged(f"p{i}", "late", 5)]),
            protocol(),
            "all 30 judgements say not biased: .* add scenarios",
        ),
        (crowd, protocol(sets=tuple(ClipSet(name, ()) for name in SCORES)), "add scores to its"),
        (crowd, protocol(sets=(ClipSet("x", (), scores=SCORES["late"]),)),
         "no set whose robot has scores was judged"),
    ],
)  # fmt: skip
def test_what_cannot_be_fitted_is_refused_in_one_sentence(answers, study, complaint):
    with pytest.raises(InputError, match=complaint) as error:
        fit_detector.fit(answers(), study)
    assert "\n" not in str(error.value)


def test_accuracy_on_new_sets_may_not_be_measurable_and_says_why():
    rows = [
        r for i in range(15) for r in (*judged(f"p{i}", "late", 1), *judged(f"p{i}", "even-one", 5))
    ]
    people, sets = fit_detector.fit(Answers.of_rows(rows), protocol()).held_out
    assert people.accuracy == 1.0
    assert np.isnan(sets.accuracy)
    assert sets.why_not


def test_limits_of_grouped_cases_are_those_of_the_groups():
    rng = np.random.default_rng(0)
    # four groups of 50 alike: as many as four cases, and not 200
    met, groups = np.repeat([True, True, True, False], 50), np.repeat(np.arange(4), 50)
    low, high = fit_detector.clustered(met, groups, rng)
    # shares of 4 draws of {1, 1, 1, 0}: below 0.5 with probability 0.051, so 2.5 % is at 0.25
    assert (low, high) == (0.25, 1.0)
