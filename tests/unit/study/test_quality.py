"""Rater quality: every number by hand, every flag raised and not raised at its threshold."""

import numpy as np
import pytest

from evenhand.study.analysis import judgements, quality
from evenhand.study.analysis.answers import Answers
from evenhand.study.analysis.quality import Limits
from support.answered import judged, protocol, row
from support.refusals import refused

SETS = ("no-answer", "from-afar", "late", "too-close", "even-one", "even-two")


def rated(*participants: list[dict]) -> quality.Quality:
    return quality.rate(Answers.of_rows([r for rows in participants for r in rows]), protocol())


def with_ratings(name: str, ratings, **values) -> list[dict]:
    return [r for place, (item, rating) in enumerate(zip(SETS, ratings, strict=False), 1)
            for r in judged(name, item, rating, position=place, **values)]  # fmt: skip


def test_runs_and_entropy_by_hand():
    found = rated(with_ratings("a", [2, 2, 2, 4, 4, 1]), with_ratings("b", [3, 1]))
    assert found.run.tolist() == [3, 1]
    # shares 1/2, 1/3, 1/6: 1/2 + log2(3)/3 + log2(6)/6
    assert found.entropy[0] == pytest.approx(0.5 + np.log2(3) / 3 + np.log2(6) / 6)
    assert found.entropy[1] == pytest.approx(1.0)
    assert found.scales.tolist() == [6, 2]


def test_a_run_goes_by_the_order_in_which_sets_were_seen():
    rows = with_ratings("a", [1, 2, 1, 2])
    for one, position in zip(rows, np.repeat([1, 3, 2, 4], 3), strict=True):
        one["position"] = int(position)
    assert rated(rows).run.tolist() == [2]


def test_answering_alike_is_flagged_from_five_answers_on():
    found = rated(with_ratings("a", [1] * 5), with_ratings("b", [1] * 4))
    alike = quality.FLAGS.index(quality.ALIKE)
    assert found.flags[:, alike].tolist() == [True, False]
    assert found.reasons(0) == [quality.ALIKE]


@pytest.mark.parametrize(
    ("right", "flagged"),
    [([False], True), ([True], False), ([False, True, True], False), ([False, False, True], True)],
)
def test_one_failed_check_counts_where_only_one_was_asked(right, flagged):
    rows = [row("a", f"check:{i}", f"c{i}", right=one) for i, one in enumerate(right)]
    found = rated(rows)
    assert (found.checks[0], found.failed[0]) == (len(right), right.count(False))
    assert found.flagged.tolist() == [flagged]


def test_contradictions_by_hand():
    rows = [
        *judged("a", "late", 1, "none", "none"),  # unfair, yet nothing named
        *judged("a", "from-afar", 5, "risk", "age"),  # fairest, yet both named
        *judged("a", "too-close", 4, "risk", "age"),  # rather fair: no contradiction
        *judged("a", "even-one", 1, "risk", "none"),  # something is named
        *judged("b", "late", 1, "none", "none"),
        *judged("b", "from-afar", 5, "none", "none"),
        *judged("b", "too-close", 1, "none", None),  # cannot be told
    ]
    found = rated(rows)
    assert found.contradictory.tolist() == [2, 1]
    assert found.sets.tolist() == [4, 2]
    contradicts = quality.FLAGS.index(quality.CONTRADICTS)
    assert found.flags[:, contradicts].tolist() == [True, False]


def test_the_robust_z_by_hand():
    # median 3, absolute deviations 2 1 0 1 97 with median 1: (100 - 3) / 1.4826
    found = quality.robust_z(np.array([1, 2, 3, 4, 100, np.nan]))
    assert found[4] == pytest.approx(97 / 1.4826)
    assert found[0] == pytest.approx(-2 / 1.4826)
    assert np.isnan(found[5])
    assert np.isnan(quality.robust_z(np.array([1.0, 1, 1, 9]))).all()
    assert np.isnan(quality.robust_z(np.array([np.nan]))).all()


def test_speed_is_held_against_others_on_the_same_page():
    # everybody needs twice as long for "late"; only e answers in a tenth of the others' time
    pace = {"a": 16.0, "b": 18.0, "c": 20.0, "d": 22.0, "e": 2.0, "f": 24.0}
    rows = [r for name, s in pace.items() for item, times in (("late", 2), ("even-one", 1))
            for r in judged(name, item, 3, seconds=s * times)]  # fmt: skip
    found = rated(*[rows])
    log = np.log(list(pace.values()))
    deviation = 1.4826 * np.median(np.abs(log - np.median(log)))
    assert found.z.tolist() == pytest.approx(((log - np.median(log)) / deviation).tolist())
    assert found.flags[:, 0].tolist() == [False, False, False, False, True, False]
    # 32 s and 16 s over three questions each
    assert found.seconds[0] == pytest.approx((32 / 3 + 16 / 3) / 2)


def test_a_page_cannot_be_done_before_its_clips_end():
    rows = judged("a", "late", 3, seconds=19.0) + judged("b", "late", 3, seconds=19.6)
    found = quality.rate(Answers.of_rows(rows), clip_seconds={"late": 20.0})
    assert found.too_quick.tolist() == [1, 0]
    assert found.flagged.tolist() == [True, False]
    assert quality.rate(Answers.of_rows(rows)).too_quick.tolist() == [0, 0]


def test_a_page_with_a_clip_that_was_not_seen_is_counted_once():
    unseen = [one | {"views": 0} for one in judged("a", "late", 3)]  # three questions, one page
    seen = [one | {"views": 1} for one in judged("b", "late", 3)]
    unknown = [one | {"views": None} for one in judged("c", "late", 3)]
    found = quality.rate(Answers.of_rows(unseen + seen + unknown))
    assert found.unseen.tolist() == [1, 0, 0]
    assert found.flagged.tolist() == [True, False, False]
    assert found.reasons(0) == ["clips not seen"]


def test_what_is_not_known_is_missing_and_flags_nobody():
    found = rated([row("a", "end", "say", seconds=None)])
    assert np.isnan(found.seconds[0])
    assert np.isnan(found.z[0])
    assert np.isnan(found.entropy[0])
    assert not found.flagged.any()


def test_every_flag_has_its_threshold_in_words_and_limits_are_numbers():
    assert tuple(Limits().said()) == quality.FLAGS
    assert "\N{MINUS SIGN}3" in Limits().said()[quality.FAST]
    with refused("type z", "'z'"):
        Limits(z=float("nan"))


def test_medians_of_groups():
    values, group = np.array([5.0, 1, 3, 2, 8]), np.array([0, 0, 0, 2, 2])
    assert quality.medians(values, group, 3)[[0, 2]].tolist() == [3.0, 5.0]
    assert np.isnan(quality.medians(values, group, 3)[1])


# --- judgements ---


def test_the_middle_of_a_scale_is_not_biased_and_ends_can_be_turned():
    rows = [r for i, rating in enumerate([1, 2, 3, 4, None])
            for r in judged(f"p{i}", "late", rating)]  # fmt: skip
    late = SETS.index("late")
    study = protocol()
    assert judgements.judge(Answers.of_rows(rows), study).biased[:4, late].tolist() == [1, 1, 0, 0]
    assert np.isnan(judgements.judge(Answers.of_rows(rows), study).biased[4, late])
    fair = study.questions[0].__class__(
        "fair", "How unfair?", "scale", "fair", points=5, lowest_is_unfair=False
    )
    turned = protocol(questions=(fair, *study.questions[1:]))
    found = judgements.judge(Answers.of_rows(rows), turned)
    assert found.biased[:4, late].tolist() == [0, 0, 0, 1]
    assert found.fairness[:4, late].tolist() == [5, 4, 3, 2]


def test_without_a_rating_what_is_named_decides():
    rows = [*judged("a", "late", None, "none", "age"), *judged("b", "late", None, "none", "none"),
            *judged("c", "late", None), *judged("d", "late", None, "risk")]  # fmt: skip
    study = protocol(questions=protocol().questions[1:])
    biased = judgements.judge(Answers.of_rows(rows), study).biased[:, SETS.index("late")]
    assert biased[[0, 1, 3]].tolist() == [1, 0, 1]
    assert np.isnan(biased[2])


def test_several_named_are_told_apart_from_none_named():
    rows = judged("a", "late", 1, "risk|quality", "age")
    found = judgements.judge(Answers.of_rows(rows), protocol())
    assert found.issue[0, SETS.index("late")] == judgements.SEVERAL
    assert found.identity[0, SETS.index("late")] == found.identities.index("age")


def test_places_count_the_sets_alone():
    rows = (
        judged("a", "late", 1, position=9)
        + judged("a", "even-one", 1, position=2)
        + judged("a", "too-close", 1, position=5)
    )
    place = judgements.judge(Answers.of_rows(rows), protocol()).place[0]
    assert dict(zip(SETS, place.tolist(), strict=True)) == {
        "no-answer": -1, "from-afar": -1, "late": 2, "too-close": 1, "even-one": 0, "even-two": -1
    }  # fmt: skip
