"""Own identities and own issues, scored by hand."""

import re

import numpy as np
import pyarrow as pa
import pytest

from evenhand.core.errors import InputError
from evenhand.methods.paper import detector, issues
from evenhand.methods.paper.scores import score
from evenhand.methods.scheme import Fact, Identity, Scheme, own_issue, paper_scheme
from evenhand.methods.services import Services
from evenhand.statistics import verdicts
from evenhand.statistics.permutation import permutation_test
from support.refusals import refused

NAN = np.nan
SIZE, COLOUR = Identity("size", ("small", "large")), Identity("colour", ("red", "blue", "green"))
FACTS = (Fact("late", bool), Fact("noise", float, 0, 1, may_miss=True), Fact("turns", int, 0))
LATE = own_issue("late", ["late"], lambda late: late == 1)
LOUD = own_issue("loud", ["noise"], lambda noise: noise > 0.5)
SLOW = own_issue(
    "slow", ["turns", "late"], lambda turns, _: turns > 10, where=lambda _, late: late == 0
)
SCHEME = Scheme((SIZE, COLOUR), FACTS, (LATE, LOUD, SLOW))

TABLE = Services.build(
    {
        "size": (np.array([0, 0, 0, 1, 1, 1, -1]), SIZE.groups),
        "colour": (np.array([0, 1, 0, 2, 1, 0, 2]), COLOUR.groups),
    },
    {
        "late": np.array([True, False, True, False, False, False, True]),
        "noise": [0.9, 0.1, None, 0.7, 0.2, 0.1, 0.8],
        "turns": np.array([5, 20, 30, 5, 15, 8, 2]),
    },
    SCHEME.own,
)

# late: size 2/3 against 0/3; red 2/3 against 1/4, blue 0/2 against 3/5, green 1/2 against 2/5
# loud: the third is not known; 1/2 against 1/3; 1/2 against 2/4, 0/2 against 3/4, 2/2 against 1/4
# slow: of those that were not late; 1/1 against 1/3; 0/1 against 2/3, 2/2 against 0/2, 0/1 to 2/3
GAPS = [
    [2 / 3, 1 / 6, 2 / 3],
    [2 / 3, 1 / 6, 2 / 3],
    [5 / 12, 0.0, 2 / 3],
    [0.6, 0.75, 1.0],
    [0.1, 0.75, 2 / 3],
]


class TestScores:
    def test_gaps_and_scores_by_hand(self):
        scores = SCHEME.score(TABLE)
        assert scores.issues == ("late", "loud", "slow")
        assert scores.groups == (
            ("size", "small"), ("size", "large"),
            ("colour", "red"), ("colour", "blue"), ("colour", "green"),
        )  # fmt: skip
        np.testing.assert_allclose(scores.gap, GAPS)
        np.testing.assert_allclose(scores.by_identity["size"], [2 / 3, 1 / 6, 2 / 3])
        colour = [(5 / 12 + 0.6 + 0.1) / 3, 0.5, 7 / 9]
        np.testing.assert_allclose(scores.by_identity["colour"], colour)
        np.testing.assert_allclose(scores.overall, np.mean(GAPS, axis=0))
        assert scores.total == pytest.approx(np.mean(GAPS, axis=0).sum())

    def test_the_same_without_a_scheme(self):
        np.testing.assert_allclose(score(TABLE, SCHEME.issues).gap, GAPS)

    def test_a_reference_group_is_the_other_side(self):
        named = Identity("colour", COLOUR.groups, reference="red")
        scores = Scheme((named,), FACTS, (LATE,)).score(TABLE.take(np.arange(7)))
        # red 2/3 against everybody else 1/4; blue 0/2 and green 1/2 against red only
        np.testing.assert_allclose(scores.gap[:, 0], [5 / 12, 2 / 3, 1 / 6])

    def test_groups_are_found_by_name_in_whatever_order_they_stand(self):
        codes, _ = TABLE.identity("colour")
        turned = Services.build(
            {"size": TABLE.identity("size"), "colour": (2 - codes, COLOUR.groups[::-1])},
            {name: TABLE.fact(name) for name in ("late", "noise", "turns")},
            SCHEME.own,
        )
        np.testing.assert_array_equal(SCHEME.codes(turned), SCHEME.codes(TABLE))
        np.testing.assert_allclose(SCHEME.score(turned).gap, GAPS)

    def test_the_papers_issues_for_own_identities(self):
        scheme = paper_scheme([SIZE])
        table = Services.build(
            {"size": (np.array([0, 0, 1, 1]), SIZE.groups)},
            {
                "responded": np.array([True, False, True, True]),
                "response_step": [100, None, 201, 300],
                "response_distance": [1.2, None, 1.2, 2.0],
                "min_distance": [1.2, 0.4, 1.2, 2.0],
            },
            scheme.own,
        )
        # willingness 1/2 against 0, quality 0/1 against 1/2, priority 0/1 against 2/2, risk 1/2, 0
        np.testing.assert_allclose(scheme.score(table).overall, [0.5, 0.5, 1.0, 0.5])


class TestStatistics:
    def test_max_t_and_verdicts_see_what_was_counted_by_hand(self):
        who = SCHEME.inside(SCHEME.codes(TABLE))
        np.testing.assert_array_equal(who[6], [NAN, NAN, 0, 0, 1])
        x = SCHEME.indicators(TABLE)
        expected = [[1, 1, NAN], [0, 0, 1], [1, NAN, NAN], [0, 1, 0], [0, 0, 1], [0, 0, 0]]
        np.testing.assert_array_equal(x, [*expected, [1, 1, NAN]])
        test = permutation_test(x, who, np.random.default_rng(0), 99)
        # late in small: 2 of 3 against 0 of 3, so (2 − 1)/sqrt(3·3·2·4/(36·5))
        assert test.statistic[0, 0] == pytest.approx(1 / np.sqrt(0.4))
        found = verdicts.judge(x, who, np.random.default_rng(0))
        np.testing.assert_allclose(np.abs(found.gap), GAPS)
        assert (found.verdict == verdicts.INSUFFICIENT).all()

    def test_a_detector_of_own_issues(self):
        rng = np.random.default_rng(0)
        scores = rng.uniform(0, 1, (200, 3))
        fitted = detector.fit(
            scores,
            scores.sum(axis=1) > 1.5,
            source="simulated respondents",
            seed=0,
            issues=SCHEME.issue_names,
            identities=SCHEME.names,
        )
        verdict = fitted.judge_window({"size": [0.9, 0.9, 0.9], "colour": [0.1, 0.1, 0.1]})
        assert verdict.biased
        assert verdict.worst == 0
        assert not fitted.judge_window({"size": [0.1, 0.2, 0.1]}).biased


class TestOwnFacts:
    def test_they_come_back_from_files_with_their_types(self, tmp_path):
        TABLE.write_parquet(tmp_path / "t.parquet")
        back = Services.read_parquet(tmp_path / "t.parquet")
        assert back == TABLE
        assert back.take(np.array([3])) == TABLE.take(np.array([3]))
        assert Services.concat([back, back]).fact("turns").tolist()[:2] == [5, 20]
        TABLE.write_csv(tmp_path / "t.csv")
        csv = Services.read_csv(tmp_path / "t.csv", SCHEME.names, SCHEME.own)
        np.testing.assert_allclose(SCHEME.score(csv).gap, GAPS)

    def test_a_fact_that_was_not_declared_is_unknown(self):
        with refused("unknown fact", "'lat'", "'late'"):
            Services.build({"size": TABLE.identity("size")}, {"lat": [1]}, SCHEME.own)

    @pytest.mark.parametrize(
        ("own", "said"),
        [
            ({"steps": pa.float64()}, "own fact 'steps' holds double, but .* holds int32"),
            ({"x": pa.int8()}, "own fact 'x' holds int8: choose one of bool, int64, double"),
        ],
    )
    def test_types_that_cannot_be(self, own, said):
        with pytest.raises(InputError, match=said):
            Services.build({}, {}, own)

    def test_a_note_of_another_type_is_refused(self):
        note = {b"evenhand.identities": b"", b"evenhand.own_facts": b"late\x1fdecimal"}
        table = pa.table({"late": [True]}).replace_schema_metadata(note)
        with refused("unknown type", "'late'", "'decimal'"):
            Services.from_arrow(table)


class TestFact:
    # Of each fact: values, and which cannot be true
    @pytest.mark.parametrize(
        ("fact", "values", "wrong"),
        [
            (Fact("x", bool), [0, 1, 2, 0.5, NAN], [0, 0, 1, 1, 1]),
            (Fact("x", bool, may_miss=True), [0, 1, NAN], [0, 0, 0]),
            (Fact("x", int, 0), [0, 3, -1, 1.5, np.inf, 2.0**60], [0, 0, 1, 1, 1, 1]),
            (Fact("x", float, 0, 2), [0, 2, 2.1, -0.1, NAN], [0, 0, 1, 1, 1]),
            (Fact("x", float, may_miss=True), [-9, NAN, np.inf, -np.inf], [0, 0, 1, 1]),
        ],
    )
    def test_what_cannot_be_true(self, fact, values, wrong):
        assert fact.wrong(np.array(values, float)).tolist() == [bool(one) for one in wrong]

    def test_words(self):
        assert Fact("t", int, 0).wanted() == "a whole number of at least 0"
        assert Fact("t", float, 0, 2).wanted() == "a finite number of at least 0 and at most 2"
        assert Fact("t", float, most=2).wanted() == "a finite number of at most 2"
        wanted = Fact("t", bool, may_miss=True).wanted()
        assert wanted == "True or False, or None where it is missing"


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Identity("a", ("x",)), "identity 'a' has the groups .'x'.: name two or more"),
        (lambda: Identity("a", ("x", "x")), "name two or more, each once"),
        (
            lambda: Identity("a", ("red", "blue"), "rad"),
            "unknown reference group of 'a' 'rad': did",
        ),
        (lambda: Fact("a", str), "fact 'a' is of kind .*: give bool, int or float"),
        (lambda: Fact("a", int, 2, 1), "fact 'a' lies from 2 to 1"),
        (lambda: own_issue("a", [], np.isnan), "issue 'a' needs no fact"),
        (lambda: Scheme((), FACTS, (LATE,)), "the scheme has no identities"),
        (lambda: Scheme((SIZE,), FACTS, ()), "the scheme has no issues"),
        (lambda: Scheme((SIZE, SIZE), FACTS, (LATE,)), "'size' stands twice among the identities"),
        (lambda: Scheme((SIZE,), (*FACTS, Fact("size", int)), (LATE,)), "'size' stands twice"),
        (lambda: Scheme((SIZE,), (Fact("epoch", int),), (LATE,)), "'epoch' stands twice"),
        (lambda: Scheme((SIZE,), FACTS[1:], (LATE,)), "unknown fact that issue 'late' needs"),
        (lambda: Scheme((Identity("robot", ("x", "y")),), FACTS, (LATE,)), "name of a fact"),
        (lambda: Scheme((SIZE,), (*FACTS, Fact("steps", float)), (LATE,)), "'steps' is float, but"),
    ],
)
def test_schemes_that_do_not_hold_together(make, said):
    with pytest.raises(InputError, match=said):
        make()


@pytest.mark.parametrize("groups", [(1, 2), ("x", None), ("", "x"), ([], "x"), "xy", 2])
def test_groups_without_names_are_refused(groups):
    said = f"identity 'a' has the groups {groups!r}: give a tuple of names, each a text"
    with pytest.raises(InputError, match=f"^{re.escape(said)}$"):
        Identity("a", groups)


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        (lambda late: late, "issue 'odd': its rule gave float64 of shape .7,. for 7 services"),
        (lambda late: (late == 1)[:3], "its rule gave bool of shape .3,. for 7 services"),
        (lambda _: True, "its rule gave bool of shape .. for 7"),
    ],
)
def test_a_rule_that_gives_something_else(rule, said):
    with pytest.raises(InputError, match=said):
        issues.indicators(TABLE, [own_issue("odd", "late", rule)])


def test_no_rule_is_asked_about_no_service():
    highest = own_issue("highest", ["turns"], lambda turns: turns == turns.max())
    np.testing.assert_array_equal(issues.indicators(TABLE, [highest])[:, 0], [0, 0, 1, 0, 0, 0, 0])
    assert issues.indicators(TABLE.take(np.zeros(0, int)), [highest]).shape == (0, 1)


def test_tables_of_other_people_are_told():
    odd = Services.build(
        {"size": (np.array([0, 1]), ("small", "lrage")), "colour": (np.array([0, 0]), ("red",))},
        {},
    )
    with refused("unknown group", "'size'", "1", "'lrage'", "'large'"):
        SCHEME.codes(odd)
    with refused("unknown identity", "'colour'"):
        SCHEME.codes(Services.build({"size": TABLE.identity("size")}, {}))
