"""Eq. 1 and 2 by hand, against a plain loop, and against fairlearn."""

from fractions import Fraction

import numpy as np
import pytest
from fairlearn.metrics import demographic_parity_difference

from evenhand.core.errors import InputError
from evenhand.methods.paper import issues
from evenhand.methods.paper import scores as paper_scores
from evenhand.methods.paper.issues import PAPER_ISSUES, Thresholds, paper_issues
from evenhand.methods.services import Services
from support.refusals import refused

NAN = np.nan

# Eight services: gender, disability, step and distance of the response, least distance.
# The first lies on every limit of the paper and has no issue.
SERVICES = [
    ("Female", "Yes", 200, 1.0, 0.5),
    ("Female", "No", 201, 1.5, 0.5),
    ("Female", "No", None, None, 0.499),
    ("Male", "Yes", 50, 0.999, 0.999),
    ("Male", "No", 10, 1.501, 1.501),
    ("Male", None, 300, 1.2, 0.3),
    ("Other", "No", None, None, 0.5),
    (None, "Yes", 100, 1.25, 1.25),
]
HAPPENED = [
    # willingness, quality, priority, risk
    [0, 0, 0, 0],
    [0, 0, 1, 0],
    [1, NAN, NAN, 1],
    [0, 1, 0, 0],
    [0, 1, 0, 0],
    [0, 0, 1, 1],
    [1, NAN, NAN, 0],
    [0, 0, 0, 0],
]
GROUPS = (
    ("gender", "Female"),
    ("gender", "Male"),
    ("gender", "Other"),
    ("disability", "Yes"),
    ("disability", "No"),
)
# |rate in the group - rate outside it|, by hand; a person of unknown gender is on neither side.
# "Other" has no response, so quality and priority cannot be said of it.
GAP = np.array(
    [
        [1 / 3 - 1 / 4, 2 / 3 - 0 / 2, 1 / 2 - 1 / 3, 1 / 3 - 1 / 4],
        [2 / 4 - 0 / 3, 2 / 3 - 0 / 2, 1 / 2 - 1 / 3, 1 / 3 - 1 / 4],
        [1 / 1 - 1 / 6, NAN, NAN, 2 / 6 - 0 / 1],
        [2 / 4 - 0 / 3, 1 / 2 - 1 / 3, 1 / 2 - 0 / 3, 1 / 4 - 0 / 3],
        [2 / 4 - 0 / 3, 1 / 2 - 1 / 3, 1 / 2 - 0 / 3, 1 / 4 - 0 / 3],
    ]
)


def window(rows=SERVICES) -> Services:
    gender, disability, step, distance, least = zip(*rows, strict=True)
    kinds = {"gender": ("Female", "Male", "Other"), "disability": ("Yes", "No")}
    given = {"gender": gender, "disability": disability}
    return Services.build(
        {
            name: (np.array([-1 if v is None else kinds[name].index(v) for v in given[name]]), kind)
            for name, kind in kinds.items()
        },
        {
            "responded": [s is not None for s in step],
            "response_step": list(step),
            "response_distance": list(distance),
            "min_distance": list(least),
        },
    )


class TestIndicators:
    def test_the_window_by_hand(self):
        np.testing.assert_array_equal(issues.indicators(window()), HAPPENED)

    @pytest.mark.parametrize(
        ("step", "distance", "least", "expected"),
        [
            (200, 1.25, 1.25, (0, 0, 0, 0)),
            (201, 1.25, 1.25, (0, 0, 1, 0)),
            (0, 1.0, 1.0, (0, 0, 0, 0)),
            (0, np.nextafter(1.0, 0), 1.0, (0, 1, 0, 0)),
            (0, 1.5, 1.5, (0, 0, 0, 0)),
            (0, np.nextafter(1.5, 2), 1.5, (0, 1, 0, 0)),
            (0, 1.25, 0.5, (0, 0, 0, 0)),
            (0, 1.25, np.nextafter(0.5, 0), (0, 0, 0, 1)),
            (300, 0.3, 0.3, (0, 1, 1, 1)),
            (None, None, 0.4, (1, NAN, NAN, 1)),
        ],
    )
    def test_the_limits_of_the_paper(self, step, distance, least, expected):
        x = issues.indicators(window([("Female", "Yes", step, distance, least)]))
        np.testing.assert_array_equal(x, [expected])

    def test_other_limits(self):
        limits = Thresholds(nearest=0.8, farthest=1.1, late=60, risk=1.2)
        x = issues.indicators(window(), paper_issues(limits))
        np.testing.assert_array_equal(x[:, 1], [0, 1, NAN, 0, 1, 1, NAN, 1])
        np.testing.assert_array_equal(x[:, 2], [1, 1, NAN, 0, 0, 1, NAN, 1])
        np.testing.assert_array_equal(x[:, 3], [1, 1, 1, 1, 0, 1, 1, 0])

    def test_what_is_not_known_is_nan(self):
        table = Services.build(
            {}, {"responded": [None], "response_step": [None], "min_distance": [None]}
        )
        chosen = [issue for issue in PAPER_ISSUES if issue.name != "quality"]
        assert np.isnan(issues.indicators(table, chosen)).all()

    def test_quality_and_priority_are_said_of_responses_only(self):
        # a log may write the last distance and step of a service that ran out of time
        facts = {"response_distance": [3.0, 1.2, 3.0], "response_step": [300, 1, 300]}
        least = {"min_distance": [1.0, 1.0, 1.0]}
        table = Services.build({}, {"responded": [False, False, True], **facts, **least})
        np.testing.assert_array_equal(
            issues.indicators(table), [[1, NAN, NAN, 0], [1, NAN, NAN, 0], [0, 1, 1, 0]]
        )
        # where it is not told whether there was a response, its distance tells that there was one
        chosen = PAPER_ISSUES[1:3]
        for unknown in ({}, {"responded": [None] * 3}):
            x = issues.indicators(Services.build({}, {**unknown, **facts}), chosen)
            np.testing.assert_array_equal(x, [[1, 1], [0, 0], [1, 1]])

    @pytest.mark.parametrize("issue", PAPER_ISSUES, ids=lambda issue: issue.name)
    def test_an_absent_fact_names_the_issue(self, issue):
        facts = {f: [None] for i in PAPER_ISSUES if i is not issue for f in i.needs}
        with pytest.raises(InputError, match=f"'{issue.name}' needs the fact '{issue.needs[0]}'"):
            issues.indicators(Services.build({}, facts))

    def test_any_rule_on_facts_is_an_issue(self):
        far = issues.Issue(
            "detour", lambda x: (x.fact("path_length") > 5.0).astype(float), ("path_length",)
        )
        table = Services.build(
            {"a": (np.array([0, 0, 1]), ("x", "y"))}, {"path_length": [6.0, 1.0, 2.0]}
        )
        scores = paper_scores.score(table, [far])
        assert scores.issues == ("detour",)
        assert scores.overall == pytest.approx([0.5])

    @pytest.mark.parametrize(
        "wrong",
        [
            {"nearest": -0.1},
            {"risk": np.nan},
            {"late": np.inf},
            {"nearest": 1.6},
            {"farthest": 0.9},
        ],
    )
    def test_impossible_limits(self, wrong):
        with refused("range thresholds", "0"):
            Thresholds(**wrong)


class TestScores:
    def test_gaps_by_hand(self):
        scores = paper_scores.score(window())
        assert scores.groups == GROUPS
        assert scores.issues == ("willingness", "quality", "priority", "risk")
        np.testing.assert_allclose(scores.gap, GAP, rtol=1e-12)

    def test_scores_by_hand(self):
        scores = paper_scores.score(window())
        # (1/12 + 1/2 + 5/6 + 1/2 + 1/2)/5, (2/3 + 2/3 + 1/6 + 1/6)/4, ...
        np.testing.assert_allclose(scores.overall, [29 / 60, 5 / 12, 1 / 3, 1 / 5], rtol=1e-12)
        np.testing.assert_allclose(
            scores.by_identity["gender"], [17 / 36, 2 / 3, 1 / 6, 1 / 6], rtol=1e-12
        )
        np.testing.assert_allclose(
            scores.by_identity["disability"], [1 / 2, 1 / 6, 1 / 2, 1 / 4], rtol=1e-12
        )

    def test_totals_by_hand(self):
        scores = paper_scores.score(window())
        assert scores.total == pytest.approx(43 / 30)
        assert scores.total_of("gender") == pytest.approx(53 / 36)
        assert scores.total_of("disability") == pytest.approx(17 / 12)

    def test_what_cannot_be_said_is_counted(self):
        np.testing.assert_array_equal(paper_scores.score(window()).missing, [0, 1, 1, 0])

    def test_the_sign_says_who_has_it_worse(self):
        who = paper_scores.membership(window())
        signed = paper_scores.signed_gaps(paper_scores.count(np.array(HAPPENED, float), who.inside))
        np.testing.assert_allclose(signed[1], [-1 / 2, 2 / 3, -1 / 6, 1 / 12], rtol=1e-12)

    def test_counts_by_hand(self):
        who = paper_scores.membership(window())
        counts = paper_scores.count(np.array(HAPPENED, float), who.inside)
        # Female: three services, two of them with a response
        np.testing.assert_array_equal(counts.inside_n[0], [3, 2, 2, 3])
        np.testing.assert_array_equal(counts.inside_x[0], [1, 0, 1, 1])
        np.testing.assert_array_equal(counts.outside_n[0], [4, 3, 3, 4])
        np.testing.assert_array_equal(counts.outside_x[0], [1, 2, 1, 1])

    def test_one_group_alone_has_no_other_side(self):
        alone = window([("Female", "Yes", 10, 1.2, 1.2)] * 3)
        scores = paper_scores.score(alone)
        assert np.isnan(scores.gap).all()
        assert np.isnan(scores.overall).all()
        assert np.isnan(scores.total)
        np.testing.assert_array_equal(scores.missing, [5, 5, 5, 5])

    def test_nobody_known(self):
        scores = paper_scores.score(window([(None, None, 10, 1.2, 1.2)] * 3))
        assert np.isnan(scores.total)

    def test_a_window_without_services(self):
        scores = paper_scores.score(window().take(np.zeros(8, bool)))
        assert np.isnan(scores.gap).all()

    def test_a_total_leaves_out_what_is_missing(self):
        parts = np.array([[0.1, NAN, 0.2, NAN], [NAN] * 4, [0.1, 0.2, 0.3, 0.4]])
        np.testing.assert_allclose(paper_scores.total(parts), [0.3, NAN, 1.0])

    def test_many_windows_at_once_are_each_window_alone(self):
        rng = np.random.default_rng(4)
        x = np.where(rng.random((7, 30, 4)) < 0.2, NAN, rng.integers(0, 2, (7, 30, 4)))
        inside = np.where(rng.random((7, 30, 5)) < 0.1, NAN, rng.integers(0, 2, (7, 30, 5)))
        names = ("a", "b", "c", "d")
        together = paper_scores.scores_of(paper_scores.count(x, inside), GROUPS, names)
        assert together.total.shape == (7,)
        for i in range(7):
            alone = paper_scores.scores_of(paper_scores.count(x[i], inside[i]), GROUPS, names)
            np.testing.assert_array_equal(together.gap[i], alone.gap)
            np.testing.assert_array_equal(together.overall[i], alone.overall)
            np.testing.assert_array_equal(together.missing[i], alone.missing)
            np.testing.assert_array_equal(together.total[i], alone.total)
            np.testing.assert_array_equal(
                together.by_identity["gender"][i], alone.by_identity["gender"]
            )

    def test_groups_are_needed(self):
        with refused("missing identities"):
            paper_scores.score(Services.build({}, {"responded": [True]}))

    def test_an_absent_fact(self):
        table = Services.build({"a": (np.array([0]), ("x",))}, {"responded": [True]})
        with refused("missing issue", "'quality'", "'response_distance'"):
            paper_scores.score(table)


class TestMembership:
    def test_columns_of_an_identity(self):
        who = paper_scores.membership(window())
        assert who.identities == ("gender", "disability")
        assert who.columns("disability").tolist() == [3, 4]
        with refused("unknown identity", "'gendre'", "'gender'"):
            who.columns("gendre")

    def test_unknown_is_neither_inside_nor_outside(self):
        inside = paper_scores.membership(window()).inside
        np.testing.assert_array_equal(inside[0], [1, 0, 0, 1, 0])
        np.testing.assert_array_equal(inside[5], [0, 1, 0, NAN, NAN])
        np.testing.assert_array_equal(inside[7], [NAN, NAN, NAN, 1, 0])


class TestOwnGroups:
    def test_by_hand(self):
        mine = paper_scores.own_groups_score(GAP, paper_scores.membership(window()).inside)
        np.testing.assert_allclose(mine[0], [7 / 24, 5 / 12, 1 / 3, 1 / 6], rtol=1e-12)
        # a man whose disability is not known: his gender alone
        np.testing.assert_allclose(mine[5], GAP[1], rtol=1e-12)
        # "Other" has no gap in quality and priority: disability alone
        np.testing.assert_allclose(mine[6], [2 / 3, 1 / 6, 1 / 2, 7 / 24], rtol=1e-12)
        np.testing.assert_allclose(mine[7], GAP[3], rtol=1e-12)

    def test_nothing_known_of_a_persons_groups(self):
        gap = np.array([[NAN, 0.5], [0.25, NAN]])
        inside = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [NAN, NAN]])
        np.testing.assert_array_equal(
            paper_scores.own_groups_score(gap, inside),
            [[NAN, 0.5], [0.25, NAN], [0.25, 0.5], [NAN, NAN]],
        )


def plain_scores(rows, categories):
    """Eq. 1 and 2 as a person would work them out: dictionaries, loops and fractions."""
    gaps = {}
    for identity, names in enumerate(categories):
        for name in names:
            for k in range(4):
                here = [r[k] for g, r in rows if g[identity] == name and r[k] is not None]
                there = [
                    r[k]
                    for g, r in rows
                    if g[identity] is not None and g[identity] != name and r[k] is not None
                ]
                if here and there:
                    rate, other = Fraction(sum(here), len(here)), Fraction(sum(there), len(there))
                    gaps[identity, name, k] = abs(rate - other)
    overall = []
    for k in range(4):
        known = [gap for (_, _, issue), gap in gaps.items() if issue == k]
        overall.append(sum(known) / len(known) if known else None)
    return gaps, overall


@pytest.mark.parametrize("seed", range(20))
def test_a_plain_loop_agrees(seed):
    rng = np.random.default_rng(seed)
    n, sizes = int(rng.integers(1, 40)), (2, 3, 6)
    codes = np.stack([rng.integers(-1, size, n) for size in sizes], axis=1)
    responded = rng.random(n) < rng.random()
    step, distance = rng.integers(100, 301, n), rng.uniform(0.4, 2.0, n)
    least = rng.uniform(0.3, 0.7, n)
    table = Services.build(
        {f"identity {i}": (codes[:, i], [str(c) for c in range(s)]) for i, s in enumerate(sizes)},
        {
            "responded": responded,
            "response_step": np.ma.array(step, mask=~responded),
            "response_distance": np.ma.array(distance, mask=~responded),
            "min_distance": least,
        },
    )
    rows = [
        (
            [int(c) if c >= 0 else None for c in codes[i]],
            (
                int(not responded[i]),
                int(not 1.0 <= distance[i] <= 1.5) if responded[i] else None,
                int(step[i] > 200) if responded[i] else None,
                int(least[i] < 0.5),
            ),
        )
        for i in range(n)
    ]
    gaps, overall = plain_scores(rows, [range(s) for s in sizes])
    scores = paper_scores.score(table)
    for g, (identity, category) in enumerate(scores.groups):
        for k in range(4):
            known = gaps.get((int(identity[-1]), int(category), k))
            expected = NAN if known is None else float(known)
            assert scores.gap[g, k] == pytest.approx(expected, abs=1e-12, nan_ok=True)
    expected = [NAN if value is None else float(value) for value in overall]
    assert scores.overall == pytest.approx(np.array(expected), abs=1e-12, nan_ok=True)


@pytest.mark.parametrize("seed", range(10))
def test_fairlearn_agrees_on_two_categories(seed):
    rng = np.random.default_rng(seed)
    inside = rng.integers(0, 2, 50)
    x = rng.integers(0, 2, (50, 4)).astype(float)
    counts = paper_scores.count(x, np.stack([inside, 1 - inside], axis=1).astype(float))
    for k in range(4):
        theirs = demographic_parity_difference(x[:, k], x[:, k], sensitive_features=inside)
        assert paper_scores.gaps(counts)[:, k] == pytest.approx([theirs, theirs])
        assert paper_scores.issue_score(paper_scores.gaps(counts))[k] == pytest.approx(theirs)
