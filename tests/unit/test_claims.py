"""Verdicts by hand, and the claims on made-up results whose outcome is known."""

import json
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from evenhand import robots
from evenhand.detector_report import wilson
from evenhand.experiments import claims, verdicts
from evenhand.experiments.demos import Demos, Study
from evenhand.interactions import Interactions
from evenhand.people import IDENTITIES
from evenhand.study.respondents import NAMEABLE, Questionnaire

NAN = float("nan")
YES, NO, UNTESTED = "reproduced", "contradicted", "cannot be tested"


class TestReduction:
    def test_by_hand(self):
        # differences 1 and 3: mean 2 of 3; s = √2; t(0.975, 1) = 12.7062; 12.7062·√2/√2/3
        found = verdicts.reduction(np.array([2.0, 4.0]), np.array([1.0, 1.0]))
        assert found == pytest.approx((2 / 3, 2 / 3 - 4.23540, 2 / 3 + 4.23540), abs=1e-4)

    def test_three_seeds_by_hand(self):
        # differences 1, 2, 3 of a mean of 10: 0.2 ± 4.302653·1/√3/10
        found = verdicts.reduction(np.array([9.0, 10.0, 11.0]), np.array([8.0, 8.0, 8.0]))
        assert found == pytest.approx((0.2, 0.2 - 0.2484138, 0.2 + 0.2484138), abs=1e-6)

    def test_a_rise_is_negative(self):
        estimate, *_ = verdicts.reduction(np.array([1.0]), np.array([1.5]))
        assert estimate == -0.5

    def test_one_seed_has_no_interval(self):
        assert verdicts.reduction(np.array([2.0]), np.array([1.0])) == pytest.approx(
            (0.5, NAN, NAN), nan_ok=True
        )

    def test_nothing_can_be_less_than_nothing(self):
        found = verdicts.reduction(np.zeros(3), np.array([0.0, 1.0, 0.0]))
        assert np.isnan(found).all()


class TestVerdicts:
    @pytest.mark.parametrize(
        ("low", "high", "verdict"),
        [
            (0.22, 0.5, YES),
            (0.3, 0.5, YES),
            (0.1, 0.22, UNTESTED),
            (-0.1, 0.3, UNTESTED),
            (-0.1, 0.21, NO),
            (NAN, 0.3, UNTESTED),
            (0.3, NAN, UNTESTED),
        ],
    )
    def test_at_least(self, low, high, verdict):
        assert verdicts.at_least(low, high, 0.22) == verdict

    @pytest.mark.parametrize(
        ("low", "high", "verdict"),
        [(0.2, 0.5, YES), (0.357, 0.5, YES), (0.1, 0.357, YES), (0.1, 0.3, NO), (0.4, 0.5, NO)],
    )
    def test_contains(self, low, high, verdict):
        assert verdicts.contains(low, high, 0.357) == verdict

    @pytest.mark.parametrize(
        ("low", "high", "verdict"),
        [(0.1, 0.2, YES), (0.0, 0.2, UNTESTED), (-0.1, 0.1, UNTESTED), (-0.2, -0.1, NO),
         (-0.1, 0.0, UNTESTED), (NAN, NAN, UNTESTED)],
    )  # fmt: skip
    def test_above_zero(self, low, high, verdict):
        assert verdicts.above_zero(low, high) == verdict

    def test_t_interval_by_hand(self):
        low, high = verdicts.t_interval(np.array([1.0, 2.0, 3.0]))
        assert (low, high) == pytest.approx((2 - 2.484138, 2 + 2.484138), abs=1e-6)
        assert np.isnan(verdicts.t_interval(np.array([1.0]))).all()

    @pytest.mark.parametrize(
        ("numbers", "said"),
        [
            ((0.3, 0.25, 0.35, 0.22), ""),
            ((0.1, 0.05, 0.15, 0.22), ""),
            ((0.2, 0.1, 0.3, 0.22), "The interval holds 0.22: these seeds cannot tell."),
            ((0.2, 0.1, 0.3, 15 / 54), "The interval holds 0.278: these seeds cannot tell."),
            ((0.2, NAN, NAN, 0.22), "One seed gives no interval: run more seeds."),
            ((NAN, NAN, NAN, 0.22), "Without guidance there was nothing to lower."),
        ],
    )
    def test_why_it_cannot_be_told(self, numbers, said):
        assert verdicts.undecided(*numbers) == said


SEEDS, EPOCHS = (0, 1, 2), 60


def learned(preset: str, **changed: Any) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Rows of epochs and of the test in which guidance does exactly what the paper says."""
    is_ = {"total": 0.7, "biased": 39, "early": 0.2, "late": 0.6, "swing": 0.1, **changed}
    epochs, test = [], []
    for arm in ("reinforce", "reinforce+guidance", "ppo", "ppo+guidance"):
        guided = arm.endswith("guidance")
        for seed in SEEDS:
            biased = is_["biased"] if guided else 54
            test.append(
                {
                    "preset": preset,
                    "arm": arm,
                    "seed": seed,
                    "total": (is_["total"] if guided else 1.0) * (1 + 0.1 * seed),
                    "floor": 0.4,
                    "perfect_rate": 0.5,
                }
            )
            for epoch in range(EPOCHS):
                quality = is_["early"] if epoch < 10 else is_["late"]
                epochs.append(
                    {
                        "preset": preset,
                        "arm": arm,
                        "seed": seed,
                        "epoch": epoch,
                        "biased_detector": epoch < biased,
                        # up and down by so much in the second half, wildly before
                        "total": (is_["swing"] if guided else 0.2)
                        * (1 + 0.1 * seed)
                        * (-1) ** epoch
                        * (9.0 if epoch < EPOCHS // 2 else 1.0),
                        # 10 epochs in between, which count for neither end
                        "perfect_rate": 9.0 if 10 <= epoch < 20 else quality + 0.01 * seed,
                    }
                )
    return epochs, test[::-1]  # in whatever order


def made_demos(ignored: int = 6) -> Demos:
    """Two windows of each biased robot at full strength, and one of the even robot.

    The ableist robot serves disabled people from 2 m. The ageist robot serves children late. The
    racist robot ignores the first ``ignored`` Black people of each window.
    """
    robot, strength = [0, 1, 1, 2, 2, 3, 3], [0.0, 1, 1, 1, 1, 1, 1]
    person = np.tile(np.arange(30), 7)
    kind = np.repeat(robot, 30)
    codes = {
        "race": person // 5,
        "gender": person % 3,
        "age": person // 6,
        "disability": person % 2,
    }
    codes["skin"] = person // 5
    responded = ~((kind == 1) & (codes["race"] == 1) & (person % 5 < ignored))
    responded &= ~((kind == 1) & (codes["race"] == 2) & (person % 5 < ignored - 5))
    step = np.where((kind == 2) & (codes["age"] == 0), 250, 100)
    distance = np.where((kind == 3) & (codes["disability"] == 0), 2.0, 1.25)
    table = Interactions.build(
        {one.name: (codes[one.name], one.categories) for one in IDENTITIES},
        {
            "responded": responded,
            "response_step": np.ma.array(step, mask=~responded),
            "response_distance": np.ma.array(distance, mask=~responded),
            "min_distance": np.where(responded, distance, 0.42),
        },
    )
    return Demos(table, np.array(robot), np.array(strength, float))


def made_study(agree: int = 980, race: int = 9, disability: int = 5) -> Study:
    """A study whose detector agrees in ``agree`` of 1,000 judgements; 24 respondents."""
    named = ["race"] * race + ["gender"] * (24 - race)
    named += ["age"] * 48
    named += ["disability"] * disability + [NAMEABLE[0]] * (24 - disability)
    answers = Questionnaire(
        np.repeat([1, 2, 3, 4], 24), np.tile(np.arange(24), 4), tuple(named), ("risk",) * 96
    )
    evaluation = SimpleNamespace(
        n=1000,
        folds=5,
        agreement=wilson(agree, 1000),
        accuracy=wilson(900, 1000),
        manual_accuracy=wilson(890, 1000),
        baseline=0.6,
    )
    return cast(Study, SimpleNamespace(questionnaire=answers, evaluation=evaluation))


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
            # 1.0, 1.1, 1.2 against 0.7, 0.77, 0.84: 0.33 of 1.1, and 4.302653·0.03/√3/1.1
            assert one["ours"] == pytest.approx(0.3)
            assert one["ci95"] == pytest.approx([0.3 - 0.0677492, 0.3 + 0.0677492], abs=1e-6)
            assert one["status"] == YES
            assert one["seeds"] == 3
        assert (
            "Total 1.100 without and 0.770 with" in found["total_score_reduction_ppo"]["evidence"]
        )

    def test_the_papers_own_epochs_are_reproduced(self):
        one = judged()["biased_epochs_reduction_ppo"]
        assert one["paper"] == 0.278
        assert one["ours"] == pytest.approx(15 / 54)
        assert one["status"] == YES
        assert "54.0 biased epochs without and 39.0 with guidance, of 60" in one["evidence"]

    def test_one_epoch_more_is_not(self):
        assert (
            judged(learned=learned("paper", biased=40))["biased_epochs_reduction_ppo"]["status"]
            == NO
        )

    def test_less_than_the_paper_says(self):
        found = judged(learned=learned("paper", total=0.9))
        assert found["total_score_reduction_ppo"]["status"] == NO

    def test_too_little_to_tell(self):
        found = judged(learned=learned("paper", total=0.78))
        one = found["total_score_reduction_ppo"]
        assert one["status"] == UNTESTED
        assert one["evidence"].endswith("The interval holds 0.22: these seeds cannot tell.")

    def test_quality_compares_the_first_10_epochs_with_the_last_40(self):
        one = judged()["quality_improved"]
        assert one["ours"] == pytest.approx(0.4)
        assert one["status"] == YES
        assert "21.0 % in the first 10 epochs, 61.0 % in the last 40" in one["evidence"]

    def test_quality_that_falls_is_said_plainly(self):
        one = judged(learned=learned("paper", late=0.1))["quality_improved"]
        assert one["ours"] == pytest.approx(-0.1)
        assert one["status"] == NO
        assert "it levels down" in one["evidence"]

    def test_the_score_is_confined_when_it_swings_less_in_the_second_half(self):
        # swings 0.20, 0.22, 0.24 without and half of it with guidance: lowered by 0.1, 0.11, 0.12
        # of 0.22, so by 0.5; the half width is 4.303 * 0.01 / sqrt(3) / 0.22 = 0.113
        one = judged()["score_confined_ppo"]
        assert one["ours"] == pytest.approx(0.5)
        assert one["ci95"] == pytest.approx([0.387, 0.613], abs=1e-3)
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
            assert found[name]["status"] == UNTESTED, name
            assert found[name]["ci95"] is None
            assert found[name]["seeds"] == 1
        assert "One seed gives no interval" in found["biased_epochs_reduction_ppo"]["evidence"]

    def test_no_biased_epoch_to_lower(self):
        epochs, test = learned("paper")
        epochs = [{**row, "biased_detector": False} for row in epochs]
        one = judged(learned=(epochs, test))["biased_epochs_reduction_ppo"]
        assert (one["ours"], one["ci95"], one["status"]) == (None, None, UNTESTED)
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
        assert judged()["signature_ableism"]["status"] == YES

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
            assert found[name]["status"] == YES, name

    def test_nobody_is_ignored_most(self):
        assert judged(demos=made_demos(ignored=0))["most_ignored_is_racism"]["status"] == UNTESTED


class TestStudy:
    @pytest.mark.parametrize(("agree", "status"), [(980, YES), (975, YES), (1000, YES), (960, NO)])
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

    @pytest.mark.parametrize(("count", "status"), [(9, YES), (0, NO), (20, NO)])
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
