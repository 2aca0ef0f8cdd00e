"""The summary says what the numbers say, whatever they are. Texts were written by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from evenhand.audits.judge.results import Resemblance
from evenhand.audits.show import sentences as words
from evenhand.audits.show import wording
from evenhand.methods.paper.issues import Thresholds

NAN = math.nan


def plain(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ").replace("\N{MINUS SIGN}", "-")


def lines(sentences) -> list[str]:
    return [plain(sentence) for sentence in sentences]


@pytest.fixture
def told(made_up, about):
    return words.summary(made_up(), about)


def test_a_disparity_is_said_with_group_rates_difference_interval_and_p(told):
    assert lines(told.disparities) == [
        "“Elder” (age) was not answered in 30.0 % of 240 services, the others in 12.0 % of 760: "
        "18.0 percentage points more (95 % interval +13.0 to +23.0; adjusted p < 0.001).",
        "“Elder” (age) was approached too closely in 30.0 % of 240 services, the others in 12.0 % "
        "of 760: 18.0 percentage points more (95 % interval +13.0 to +23.0; adjusted p < 0.001).",
        "“Child” (age) was not answered in 5.0 % of 160 services, the others in 18.8 % of 840: "
        "13.8 percentage points less (95 % interval -18.8 to -8.8; adjusted p = 0.012).",
    ]


@pytest.mark.parametrize(
    ("issue", "said"),
    [
        ("willingness", "was not answered in 50.0 % of 10 services"),
        ("quality", "was answered from an improper distance in 50.0 % of 10 answered services"),
        ("priority", "was answered late in 50.0 % of 10 answered services"),
        ("risk", "was approached too closely in 50.0 % of 10 services"),
        ("rudeness", "met rudeness in 50.0 % of 10 services"),
    ],
)
def test_every_issue_has_everyday_words(made_up, one, issue, said):
    found = one("age", "Elder", issue, (5, 10), (1, 10), "disparity")
    others = [one("age", name, issue, (1, 10), (5, 10)) for name in ("Child", "Adult")]
    (sentence,) = words.disparity_sentences(made_up(findings=(found, *others)))
    assert f"“Elder” (age) {said}, the others" in plain(sentence)


def test_two_groups_of_an_identity_share_a_sentence(made_up, one):
    pair = (
        one("gender", "Female", "risk", (10, 100), (30, 100), "disparity", p_adjusted=0.02),
        one("gender", "Male", "risk", (30, 100), (10, 100), "disparity", p_adjusted=0.02),
        one("gender", "unknown", "risk", (0, 0), (40, 200), "insufficient data"),
    )
    assert lines(words.disparity_sentences(made_up(findings=pair))) == [
        "“Male” (gender) was approached too closely in 30.0 % of 100 services, “Female” in 10.0 % "
        "of 100: 20.0 percentage points more (95 % interval +15.0 to +25.0; adjusted p = 0.020)."
    ]


def test_the_verdict_of_a_log_with_a_disparity(told):
    assert plain(told.verdict) == (
        "Disparity: in 3 of 32 comparisons of a group with the others, the difference is larger "
        "than chance explains (risk of any false alarm at most 5 %); in 12 there are too few "
        "services to tell."
    )


def test_the_verdict_of_an_even_log_and_of_a_small_one_say_other_things(made_up, one):
    even = [one("gender", group, "risk", (1, 9), (1, 9)) for group in ("a", "b")]
    assert plain(words.verdict_sentence(made_up(findings=even, verdict="no evidence"))) == (
        "No evidence of uneven service: in 2 of 2 comparisons of a group with the others, a "
        "difference of 10 percentage points would probably have been found, and none was."
    )
    few = [one("gender", "a", "risk", (1, 9), (1, 9), "insufficient data")]
    assert plain(words.verdict_sentence(made_up(findings=few, verdict="insufficient data"))) == (
        "Insufficient data: in none of 1 comparison of a group with the others are there enough "
        "services to find a difference of 10 percentage points."
    )


def test_what_is_not_known_yet_says_how_many_services_would_do(told):
    assert lines(told.unknown) == [
        "“visitor” (badge), 7 services, 993 others: too few to tell for willingness, quality, "
        "priority and risk; a log of about 13,000 services would do.",
        "“staff” (badge), 993 services, 7 others: too few to tell for willingness, quality, "
        "priority and risk; a log of about 13,000 services would do.",
        "“unknown” (badge): no service of this group says anything of willingness, quality, "
        "priority and risk.",
    ]


def test_a_group_without_others_is_said(one):
    alone = one("site", "only", "risk", (1, 9), (0, 0), "insufficient data", needed=NAN)
    assert words.unknown_sentences([alone]) == [
        "“only” (site): no service of others says anything of risk."
    ]
    # 9 here and 30 there, but never at the same site
    apart = replace(one("age", "old", "risk", (1, 9), (3, 30), "insufficient data"), difference=NAN)
    assert words.unknown_sentences([apart]) == [
        "“old” (age): no service of others of the same stratum says anything of risk."
    ]


def test_waiting_names_the_groups_that_differ_and_counts_the_rest(told):
    assert lines(told.waiting) == [
        "After 4 s, 55.0 % of “Elder” (age) still waited, of the others 15.0 % (+40.0 points, "
        "95 % interval +33.0 to +46.0); whole waiting times differ, adjusted log-rank p < 0.001.",
        "For 2 groups no difference in waiting was found.",
        "For 1 group the waiting could not be compared.",
    ]


def test_waiting_within_strata_is_said_to_be(made_up, about):
    told = lines(words.waiting_sentences(made_up(), replace(about, within="site")))
    assert "of the others 15.0 % (within the same site +40.0 points, 95 % interval" in told[0]
    assert told[1] == "For 2 groups no difference in waiting within the same site was found."


def test_a_log_without_waiting_says_nothing_of_it(made_up, about):
    told = words.summary(made_up(waits=(), measures=(), resemblance=()), about)
    assert (told.waiting, told.measures, told.resemblance) == ((), (), ())
    assert "Waiting" not in words.text(told)


def test_measures_tell_mean_and_median_apart(told, made_up):
    assert lines(told.measures) == [
        "smiles of “Elder” (age), 240 services: mean 1.25, of the others 2.50 (adjusted p = "
        "0.002).",
        "smiles: for 1 group no difference of mean or median was found.",
    ]
    unlike = replace(made_up().measures[0], mean_p=NAN, median_p=0.01)
    (sentence,) = lines(words.measure_sentences(made_up(measures=(unlike,))))
    assert "mean" not in sentence
    assert "median 1.00, of the others 2.00 (adjusted p = 0.010)" in sentence


def test_resemblance_says_what_it_does_not_mean(told, about):
    first, second, third, last = lines(told.resemblance)
    assert first == (
        "age: to the detector the pattern looks like ageism; it calls 42.0 % of windows of 30 "
        "services biased, and 11.0 % when outcomes are shuffled among people."
    )
    assert second.startswith("gender: the detector names no discrimination; it calls 12.0 %")
    assert third == "badge: the detector could not judge it."
    assert "simulated respondents" in last
    assert "does not change the verdict" in last
    asked = [Resemblance("age", (0.1,) * 4, 0.4, 0.1, "ageism")]
    real = words.resemblance_sentences(asked, replace(about, judges="respondents"))
    assert "issues respondents called" in real[-1]


def test_limits_depend_on_the_log(made_up, about):
    heads = [head for head, _ in words.limits(made_up(), about)]
    assert heads[0] == "The log is synthetic."
    assert {"Association is not cause.", "No evidence is not evenness."} <= set(heads)
    assert "Strata." not in heads
    real = words.limits(made_up(), replace(about, synthetic=False, within="site", left_out=()))
    heads = [head for head, _ in real]
    assert "The log is synthetic." not in heads
    assert "Left out." not in heads
    assert "the same site" in dict(real)["Strata."]


def test_relevant_difference_and_level_come_from_the_settings(made_up, about):
    found = made_up()
    strict = replace(found.settings.verdict, alpha=0.01, delta=0.025)
    told = words.summary(replace(found, settings=replace(found.settings, verdict=strict)), about)
    assert "(99 % interval" in plain(told.disparities[0])
    assert "at most 1 %" in plain(told.verdict)
    assert "smaller than 2.5 percentage points" in dict(told.limits)["No evidence is not evenness."]


def test_the_text_holds_every_sentence(told):
    text = words.text(told)
    for part in (told.disparities, told.unknown, told.waiting, told.measures, told.resemblance):
        assert all(f"- {sentence}" in text for sentence in part)
    assert text.startswith(told.verdict)
    assert told.total in text


def test_the_total_stands_beside_chance(told, made_up):
    assert plain(told.total) == (
        "The total issue score of the log is 0.31; serving everybody alike would give 0.12 on "
        "average, by chance (p < 0.001)."
    )
    assert "not known" in words.total_sentence(made_up(total=NAN, even_total=NAN, p_total=NAN))


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        (wording.number(-0.001), "0.00"),
        (wording.number(-1234.5, 1), "-1,234.5"),
        (wording.points(-0.00001), "0.0"),
        (wording.points(0.123), "+12.3"),
        (wording.points(-0.5), "-50.0"),
        (wording.share(NAN), "not known"),
        (wording.number(NAN), "not known"),
        (wording.points(NAN), "not known"),
        (wording.p_value(NAN), "not known"),
        (wording.p_value(0.00099), "< 0.001"),
        (wording.p_value(0.05), "0.050"),
        (wording.seconds(1200.0), "1,200 s"),
        (wording.seconds(0.02), "0.02 s"),
        (wording.seconds(NAN), "not known"),
    ],
)
def test_numbers_for_readers(said, expected):
    assert plain(said) == expected


@pytest.mark.parametrize(("needed", "said"), [(7, 7), (99, 99), (101, 110), (12345, 13000)])
def test_needs_are_rounded_up_to_two_digits(needed, said):
    assert wording.rounded_up(float(needed)) == said


def test_names_cannot_break_or_turn_a_line():
    assert wording.shown("a\nb\x1b[31m\u202ec\x00") == "a�b�[31m�c�"
    assert wording.shown("نیم‌فاصله 日本 👩‍🦽") == "نیم‌فاصله 日本 👩‍🦽"


def test_issues_are_explained_with_their_thresholds():
    said = wording.meanings(Thresholds(0.9, 1.6, 150.0, 0.4), late=3.0)
    assert {issue: plain(text) for issue, text in said.items()} == {
        "willingness": "no response",
        "quality": "a response nearer than 0.9 m or farther than 1.6 m",
        "priority": "a response after more than 3 s",
        "risk": "nearer than 0.4 m at any moment",
    }
