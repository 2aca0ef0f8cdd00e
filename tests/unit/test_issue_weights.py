"""What people mind, as weights: recovered from answers, refused where they say nothing usable."""

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest
import statsmodels.api as sm
from scipy.stats import chi2

from evenhand.methods import asked, detector_file, issue_weights
from evenhand.methods.paper import detector
from evenhand.methods.paper.issues import PAPER_ISSUES
from evenhand.methods.scheme import own_issue
from evenhand.methods.services import Services
from evenhand.methods.vocabulary import ISSUES, SIMULATED
from support.refusals import refused


def answers(slopes, n=600, seed=0, base=-1.0):
    rng = np.random.default_rng(seed)
    scores = rng.uniform(0.0, 1.0, (n, len(slopes)))
    odds = base + scores @ np.array(slopes)
    return scores, rng.random(n) < 1 / (1 + np.exp(-odds))


def services(**columns):
    facts = {name: pa.array(values) for name, values in columns.items()}
    return Services.build({"side": (np.zeros(6, int), ("left", "right"))}, facts)


def fit(scores, biased, issues=ISSUES):
    return issue_weights.fit(scores, biased, source=SIMULATED, issues=issues)


def test_weights_add_up_to_the_number_of_issues_in_proportion_to_positive_slopes():
    found = fit(*answers([6.0, 3.0, -4.0, 0.0], n=6000))
    assert sum(found.tau) == pytest.approx(4.0)
    assert found.tau[2] == 0.0
    # the penalty of the regression is nothing beside 6,000 answers
    assert found.slopes[0] / found.slopes[1] == pytest.approx(2.0, rel=0.15)
    assert found.tau[0] == pytest.approx(4 * 6 / 9, rel=0.1)
    up = np.maximum(found.slopes, 0)
    np.testing.assert_allclose(found.tau, 4 * up / up.sum())


def test_what_scores_hardly_vary_in_does_not_weigh_more():
    """Slopes are by score, not by standard deviation: stretching a score changes no odds."""
    scores, biased = answers([4.0, 4.0, 0.0, 0.0], n=6000)
    narrow = scores.copy()
    narrow[:, 1] *= 0.1
    rng = np.random.default_rng(1)
    odds = -1.0 + 4.0 * narrow[:, 0] + 40.0 * narrow[:, 1]
    found = fit(narrow, rng.random(len(odds)) < 1 / (1 + np.exp(-odds)))
    assert found.tau[1] / found.tau[0] == pytest.approx(10.0, rel=0.15)
    assert fit(scores, biased).tau[1] / fit(scores, biased).tau[0] == pytest.approx(1.0, rel=0.15)


def test_the_likelihood_ratio_is_that_of_another_library():
    scores, biased = answers([1.0, 0.5, 0.0, 0.0], n=200)
    theirs = sm.Logit(biased.astype(float), sm.add_constant(scores)).fit(disp=0)
    assert fit(scores, biased).p == pytest.approx(theirs.llr_pvalue, rel=1e-3)
    assert theirs.llr_pvalue == pytest.approx(chi2.sf(theirs.llr, 4))


def test_answers_that_depend_on_nothing_weigh_nothing_at_the_stated_rate():
    """2,000 crowds that mind nothing: 1 % of them are believed; twice that would not pass."""
    rng, believed = np.random.default_rng(5), 0
    scores = rng.uniform(0.0, 1.0, (100, 4))
    crowds = 2000
    for _ in range(crowds):
        try:
            found = fit(scores, rng.random(100) < 0.3)
            believed += any(found.tau)
            assert found.p is not None
            assert any(found.tau) == (found.p <= issue_weights.LEVEL)
        except issue_weights.InputError:
            believed += 1  # all slopes point down, which is no finding either
    # chi-square with 100 answers is a little too large; 3.5 standard errors of 1 %
    assert believed / crowds < 0.01 + 3.5 * np.sqrt(0.01 * 0.99 / crowds)


@pytest.mark.parametrize("said", [True, False])
def test_answers_all_alike_weigh_nothing(said):
    scores, _ = answers([1.0] * 4, n=50)
    found = fit(scores, np.full(50, said))
    assert found.tau == (0.0,) * 4
    assert found.p is None


def test_answers_that_can_be_told_apart_are_finite():
    scores, _ = answers([1.0] * 4, n=80)
    found = fit(scores, scores[:, 3] > 0.5)
    assert np.isfinite(found.slopes).all()
    assert found.tau[3] > 3.0


def test_reversed_answers_are_refused():
    scores, biased = answers([5.0] * 4, n=2000, base=-10.0)
    with refused("conflict judges"):
        fit(scores, ~biased)


class TestDetector:
    def test_its_direction_is_that_of_its_components(self):
        found = issue_weights.of_detector(detector_file.load(detector_file.SHIPPED))
        # as measured when it was made: b = 11.7, 12.7, 8.1, 10.7
        assert found.slopes == pytest.approx([11.7, 12.7, 8.1, 10.7], abs=0.06)
        assert found.tau == pytest.approx([1.09, 1.17, 0.75, 0.99], abs=0.01)

    def test_one_that_points_down_is_refused(self, tmp_path):
        shipped = detector_file.load(detector_file.SHIPPED)
        down = replace(shipped, weights=tuple(-w for w in shipped.weights))
        with refused("conflict judges"):
            issue_weights.of_detector(down)
        detector_file.save(down, tmp_path / "down.json")
        with refused("conflict judges", "down.json"):
            issue_weights.read(tmp_path / "down.json")

    def test_components_throw_away_closeness_against_ignoring(self):
        """Five issues in three components; a crowd that minds one of them is not recovered."""
        scores, biased = answers([0.0, 8.0, 0.0, 0.0, 0.0], n=4000, base=-4.0)
        plain = fit(scores, biased, asked.ASKED)
        fitted = detector.fit(scores, biased, source=SIMULATED, seed=0, issues=asked.ASKED)
        by_parts = issue_weights.of_detector(fitted)
        assert plain.tau[1] > 4.5
        assert by_parts.tau[1] < plain.tau[1]


class TestFiles:
    @staticmethod
    def write(path, names, scores, biased):
        rows = [",".join([*names, "biased"])]
        rows += [
            ",".join([*(f"{x:.6f}" for x in row), "yes" if said else "no"])
            for row, said in zip(scores, biased, strict=True)
        ]
        path.write_text("\n".join(rows) + "\n")
        return path

    @pytest.mark.parametrize("names", [ISSUES, asked.ASKED])
    def test_answers_about_four_or_five_issues(self, tmp_path, names):
        scores, biased = answers([6.0] + [0.0] * (len(names) - 1), n=1500)
        path = self.write(tmp_path / "answers.csv", names, scores, biased)
        found = issue_weights.read(path, SIMULATED)
        assert found.issues == names
        assert found.source == SIMULATED
        assert found.tau == pytest.approx(fit(scores.round(6), biased, names).tau)

    def test_one_of_both_distances_is_not_enough(self, tmp_path):
        names = ("willingness", "too_near", "priority", "risk")
        scores, biased = answers([1.0] * 4, n=30)
        path = self.write(tmp_path / "answers.csv", names, scores, biased)
        with refused("missing too_far", "answers.csv"):
            issue_weights.read(path)

    def test_a_file_that_is_not_there(self, tmp_path):
        with refused("unavailable file", "nowhere.csv"):
            issue_weights.read(tmp_path / "nowhere.csv")

    def test_windows_with_a_missing_score_are_left_out(self, tmp_path):
        scores, biased = answers([6.0, 0.0, 0.0, 0.0], n=400)
        path = self.write(tmp_path / "answers.csv", ISSUES, scores, biased)
        text = path.read_text().splitlines()
        text.append(",0.5,0.5,0.5,yes")
        path.write_text("\n".join(text) + "\n")
        assert issue_weights.read(path).rows == 400


class TestIssues:
    def test_the_paper_s_quality_is_the_union_of_both_distances(self):
        facts = services(
            responded=[True] * 5 + [False],
            response_distance=[0.7, 1.0, 1.2, 1.5, 1.7, None],
            response_step=[10] * 5 + [None],
            min_distance=[0.6] * 6,
        )
        near, far = (one.rule(facts) for one in asked.DISTANCES)
        quality = PAPER_ISSUES[1].rule(facts)
        np.testing.assert_array_equal(near, [1, 0, 0, 0, 0, np.nan])
        np.testing.assert_array_equal(far, [0, 0, 0, 0, 1, np.nan])
        np.testing.assert_array_equal(np.maximum(near, far), quality)

    def test_they_are_looked_up_in_the_world(self):
        five = fit(*answers([6.0, 0, 0, 0, 0]), asked.ASKED)
        assert [one.name for one in five.of(PAPER_ISSUES)] == list(asked.ASKED)
        four = fit(*answers([6.0, 0, 0, 0]))
        assert four.of(PAPER_ISSUES) == PAPER_ISSUES
        own = (own_issue("slow", ["steps"], lambda steps: steps > 3),)
        with refused("conflict judges", "slow", "too_near"):
            five.of(own)
