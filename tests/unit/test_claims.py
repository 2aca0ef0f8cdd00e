"""The claims on made-up results whose outcome is known."""

import json
from typing import Any

import numpy as np
import pytest

from evenhand.experiments.paper import claims
from evenhand.restaurant import robots
from support.claimed import learned, made_demos, made_study

YES, NO, FITTED = "reproduced", "contradicted", "reproduced by calibration"
UNTOLD, NOTHING, UNTESTED = "open", "no effect", "not testable"


def judged(**changed: Any) -> dict[str, dict[str, Any]]:
    """Claims by name; what is not changed is as the paper says."""
    given = {"demos": made_demos(), "study": made_study(), "learned": learned("paper"), **changed}
    found = claims.all_claims(given["demos"], given["study"], *given["learned"])
    json.dumps(found, allow_nan=False)  # all of it can be written
    return {one["id"]: one for one in found}


class TestLearning:
    def test_as_in_the_paper(self):
        found = judged()
        for algorithm in ("reinforce", "ppo"):
            one = found[f"total_score_reduction_{algorithm}"]
            # 1.0, 1.1, 1.2 against 0.7, 0.77, 0.84: lower by 0.3, 0.33, 0.36; 4.302653·0.03/√3;
            # 22 % of 1.1 are 0.242
            assert one["ours"] == pytest.approx(0.33)
            assert one["ci95"] == pytest.approx([0.33 - 0.0745241, 0.33 + 0.0745241], abs=1e-6)
            assert one["status"] == YES
            assert one["seeds"] == 3
            assert "22.0 % of it would be 0.242" in one["evidence"]
        evidence = found["total_score_reduction_ppo"]["evidence"]
        assert "Total without chance 1.100 without and 0.770 with" in evidence

    @pytest.mark.parametrize(
        ("biased", "status"),
        # 53, 54 and 55 without guidance: the half width is 4.303 * 1 / sqrt(3) = 2.484 epochs,
        # and the interval of 54 - 39 holds the paper's 15; of 60 epochs, 1 is a third of 15 of 300
        [(39, UNTOLD), (36, YES), (37, UNTOLD), (41, UNTOLD), (42, NO), (54, NO)],
    )
    def test_the_papers_epochs_are_compared_with(self, biased, status):
        one = judged(learned=learned("paper", biased=biased))["biased_epochs_reduction_ppo"]
        assert one["paper"] == "27.8 % lower"
        assert one["ours"] == pytest.approx(54 - biased)
        assert one["status"] == status
        said = f"54.0 biased epochs without and {biased}.0 with guidance, of 60 each"
        assert said in one["evidence"]

    def test_no_effect_is_shown_and_not_called_open(self):
        """Totals 1, 1.1, 1.2, and 0.001 less with guidance, give or take."""
        epochs, test = learned("paper", total=1.0)
        for row in test:
            if row["arm"].endswith("guidance"):
                row["corrected_total"] -= 0.001 * (row["seed"] + 1)
        one = judged(learned=(epochs, test))["total_score_reduction_ppo"]
        assert one["ours"] == pytest.approx(0.002)
        assert one["status"] == NOTHING
        assert "within ±0.02" in one["evidence"]

    def test_how_many_seeds_would_decide(self):
        # with 83 degrees of freedom t is 1.98896 and 1.66342: 3.65238 · 0.05 / √84 = 0.019925, and
        # with one pair less 3.65279 · 0.05 / √83 = 0.020047
        each = np.array([-0.05, 0.0, 0.05])
        assert claims.pairs_needed(each, 0.02) == 84
        # at least one more than there are, and not without end
        assert claims.pairs_needed(np.zeros(3), 0.02) == 4
        assert claims.pairs_needed(1000.0 * each, 0.02) == claims.MOST_PAIRS
        one = judged(learned=learned("paper", total=0.78))["total_score_reduction_ppo"]
        # differences 0.22, 0.242, 0.264 with a spread of 0.022: with 17 degrees of freedom 2.10982
        # and 1.73961, 3.84943 · 0.022 / √18 = 0.01996; with 16 3.86577 · 0.022 / √17 = 0.02063
        assert "About 18 seeds would show no effect with power 0.9" in one["evidence"]

    def test_that_many_seeds_do_show_it(self):
        """Simulated: with the pairs needed, no effect is shown in 90 % of cases."""
        rng, runs = np.random.default_rng(4), 4000
        n = claims.pairs_needed(np.array([-0.05, 0.0, 0.05]), 0.02)
        shown = 0
        for _ in range(runs):
            found = claims.difference(rng.normal(0, 0.05, n), np.zeros(n))
            shown += claims.lowered_by(*found[1:], goal=0.3, alike=0.02) == NOTHING
        assert abs(shown / runs - 0.9) < 4 * np.sqrt(0.09 / runs) + 0.01

    @pytest.mark.parametrize("biased", [39, 54])
    def test_seeds_that_are_all_alike_cannot_tell(self, biased):
        rows = learned("paper", biased=biased, apart=0)
        one = judged(learned=rows)["biased_epochs_reduction_ppo"]
        assert one["status"] == UNTOLD
        assert one["evidence"].endswith("gives no interval: run more seeds.")

    def test_less_than_the_paper_says(self):
        found = judged(learned=learned("paper", total=0.9))
        assert found["total_score_reduction_ppo"]["status"] == NO

    def test_too_little_to_tell(self):
        found = judged(learned=learned("paper", total=0.78))
        one = found["total_score_reduction_ppo"]
        assert one["status"] == UNTOLD
        assert "These seeds cannot tell." in one["evidence"]

    def test_quality_compares_the_first_10_epochs_with_the_last_40(self):
        one = judged()["quality_improved"]
        # 0.2, 0.22, 0.24 at first; 0.6, 0.66, 0.72 at last
        assert one["ours"] == pytest.approx(0.44)
        assert one["status"] == YES
        assert "22.0 % in the first 10 epochs, 66.0 % in the last 40" in one["evidence"]

    def test_of_few_epochs_none_is_at_both_ends(self):
        rows = [row for row in learned("paper")[0] if row["epoch"] < 40]
        one = judged(learned=(rows, learned("paper")[1]))["quality_improved"]
        assert "in the first 10 epochs" in one["evidence"]
        assert "in the last 30" in one["evidence"]
        # 10 epochs of 9.0 and 20 of 0.66, of 30: 3.44; less 0.22
        assert one["ours"] == pytest.approx(3.22)
        rows = [row for row in rows if row["epoch"] < 5]
        few = judged(learned=(rows, learned("paper")[1]))["quality_improved"]
        assert "first 2 epochs, 22.0 % in the last 3" in few["evidence"]
        assert few["status"] == UNTOLD

    def test_a_share_changes_by_all_of_it_at_most(self):
        # two seeds that improve by 0.44 and 0.88: 0.66 ± 12.706 * 0.22
        rows = learned("paper")[0]
        for row in rows:
            row["perfect_rate"] *= 1 + (row["seed"] == 1)
        rows = [row for row in rows if row["seed"] < 2]
        one = judged(learned=(rows, learned("paper")[1]))["quality_improved"]
        assert one["ci95"] == [-1.0, 1.0]

    def test_one_epoch_has_no_end(self):
        rows = [row for row in learned("paper")[0] if row["epoch"] < 1]
        one = judged(learned=(rows, learned("paper")[1]))["quality_improved"]
        assert (one["ours"], one["status"]) == (None, UNTESTED)

    def test_quality_that_falls_is_said_plainly(self):
        one = judged(learned=learned("paper", late=0.1))["quality_improved"]
        assert one["ours"] == pytest.approx(-0.11)
        assert one["status"] == NO
        assert "it levels down" in one["evidence"]

    def test_the_score_is_confined_when_it_swings_less_in_the_second_half(self):
        # swings 0.20, 0.22, 0.24 without and half of it with guidance: lowered by 0.1, 0.11, 0.12
        # the half width is 4.303 * 0.01 / sqrt(3) = 0.0248
        one = judged()["score_confined_ppo"]
        assert one["ours"] == pytest.approx(0.11)
        assert one["ci95"] == pytest.approx([0.0852, 0.1348], abs=1e-4)
        assert one["status"] == YES
        assert "0.220 without and 0.110 with guidance" in one["evidence"]

    def test_one_seed_cannot_tell(self):
        rows = [[row for row in part if row["seed"] == 1] for part in learned("paper")]
        found = judged(learned=rows)
        for name in (
            "total_score_reduction_ppo",
            "biased_epochs_reduction_ppo",
            "quality_improved",
        ):
            assert found[name]["status"] == UNTOLD, name
            assert found[name]["ci95"] is None
            assert found[name]["seeds"] == 1
        assert "One seed gives no interval" in found["biased_epochs_reduction_ppo"]["evidence"]

    def test_no_biased_epoch_to_lower(self):
        epochs, test = learned("paper")
        epochs = [{**row, "biased_detector": False} for row in epochs]
        one = judged(learned=(epochs, test))["biased_epochs_reduction_ppo"]
        assert (one["ours"], one["status"]) == (0.0, UNTESTED)
        assert one["evidence"].endswith("Without guidance there was nothing to lower.")

    def test_every_preset_has_claims_of_its_own(self):
        both = [a + b for a, b in zip(learned("paper"), learned("service", total=0.9), strict=True)]
        found = judged(learned=both)
        assert found["total_score_reduction_ppo"]["status"] == YES
        assert found["total_score_reduction_ppo_service"]["status"] == NO


class TestRobots:
    def test_a_signature_far_from_the_paper(self):
        one = judged()["signature_ableism"]
        # disabled people are all served from too far, others never; and nothing else happens
        assert one["ours"] == [0.0, 1.0, 0.0, 0.0]
        assert one["paper"] == [0.05, 0.66, 0.0, 0.0]
        assert one["status"] == NO
        assert "farthest off in quality, by 0.340" in one["evidence"]
        assert one["evidence"].startswith("2 windows of 30 services by the ableist robot")

    def test_a_signature_within_the_tolerance(self, monkeypatch):
        near = {**claims.SIGNATURES, "ableist": (0.04, 0.96, 0.0, 0.04)}
        monkeypatch.setattr(claims, "SIGNATURES", near)
        monkeypatch.setattr(claims.tables, "SIGNATURES", near)
        assert judged()["signature_ableism"]["status"] == FITTED

    def test_the_papers_signatures(self):
        assert claims.SIGNATURES == {
            "racist": (0.49, 0.25, 0.38, 0.43),
            "ageist": (0.42, 0.68, 0.54, 0.49),
            "ableist": (0.05, 0.66, 0.00, 0.00),
        }
        assert set(claims.SIGNATURES) < set(robots.NAMES)

    def test_who_is_farthest_latest_and_ignores_most(self):
        found = judged()
        # 15 of 30 from 2 m: 1.625 m; 6 of 30 after 250 steps: 130; 6 people of 30
        for name, paper, ours in (
            ("farthest_is_ableism", 1.89, 1.625),
            ("slowest_is_ageism", 124.93, 130.0),
            ("most_ignored_is_racism", 4.36, 6.0),
        ):
            assert found[name]["paper"] == paper
            assert found[name]["ours"] == pytest.approx(ours)
            assert found[name]["status"] == FITTED, name

    def test_nobody_is_ignored_most(self):
        assert judged(demos=made_demos(ignored=0))["most_ignored_is_racism"]["status"] == UNTOLD


class TestStudy:
    @pytest.mark.parametrize(
        ("agree", "status"), [(980, FITTED), (975, FITTED), (1000, FITTED), (960, NO)]
    )
    def test_agreement_with_the_threshold(self, agree, status):
        one = judged(study=made_study(agree=agree))["detector_agreement"]
        assert one["ours"] == agree / 1000
        assert one["status"] == status

    def test_accuracy_is_against_what_respondents_said(self):
        one = judged()["detector_accuracy"]
        assert one["ours"] == 0.9
        assert one["paper"] is None  # of which the paper prints nothing
        assert one["status"] == UNTESTED
        assert "threshold alone is right in 89.0 %" in one["evidence"]
        assert "more frequent answer in 60.0 %" in one["evidence"]

    @pytest.mark.parametrize(("count", "status"), [(9, FITTED), (0, NO), (20, NO)])
    def test_shares_of_the_questionnaire(self, count, status):
        found = judged(study=made_study(race=count, disability=count))
        race, disability = found["study_race_willingness"], found["study_disability_scenario4"]
        assert race["paper"] == 0.357
        assert race["ours"] == pytest.approx(count / 24)
        assert race["status"] == status
        assert disability["paper"] == 0.214
        assert disability["status"] == status

    def test_simulated_respondents_are_called_so(self):
        found = judged()
        for name in ("detector_agreement", "detector_accuracy", "study_race_willingness"):
            assert "simulated respondents" in found[name]["evidence"]
