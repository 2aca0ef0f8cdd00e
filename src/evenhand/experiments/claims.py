"""The paper's claims against what came out. Every verdict follows a rule in ``verdicts``."""

from __future__ import annotations

import numpy as np

from evenhand import people
from evenhand.experiments import tables
from evenhand.experiments.calibrate import SIGNATURES
from evenhand.experiments.demos import KINDS, Demos, Study
from evenhand.experiments.tables import Row
from evenhand.experiments.verdicts import (
    CONTRADICTED,
    REPRODUCED,
    UNTESTED,
    Claim,
    above_zero,
    at_least,
    claim,
    contains,
    interval,
    number,
    reduction,
    t_interval,
    undecided,
)
from evenhand.judgements import ISSUES
from evenhand.robots import BIASES

LOWER_SCORE = 0.22
"""Share by which guidance lowers the total issue score in the paper's test."""
FEWER_EPOCHS = 15 / 54
"""Share by which guidance lowers PPO's biased epochs in the paper, printed as 27.8 %."""
SIGNATURE_TOLERANCE = 0.05


def all_claims(demos: Demos, study: Study, epochs: list[Row], test: list[Row]) -> list[Claim]:
    """Every claim, in the order of the report.

    Args:
        demos: demonstrations of the scripted robots.
        study: simulated judgements and the detector.
        epochs: rows of ``epochs.csv``.
        test: rows of ``test.csv``.
    """
    presets = list(dict.fromkeys(row["preset"] for row in test))
    out = _detector_claims(study)
    for preset in presets:
        out += _learning_claims(preset, epochs, test)
    out += _signature_claims(demos)
    out += _behaviour_claims(demos)
    out += _study_claims(study)
    return out


def _detector_claims(study: Study) -> list[Claim]:
    found = study.evaluation
    common = (
        f"{found.n} judgements by simulated respondents, {found.folds} folds that never share a "
        "respondent. "
    )
    return [
        claim(
            "detector_agreement",
            "Detector and manual threshold 0.5 agree in 98 % of cases",
            0.98,
            found.agreement.value,
            (found.agreement.low, found.agreement.high),
            1,
            REPRODUCED if found.agreement.high >= 0.98 else CONTRADICTED,
            common + "Partly by construction: simulated respondents judge by a threshold near 0.5.",
        ),
        claim(
            "detector_accuracy",
            "Accuracy of the detector against people's judgements",
            None,
            found.accuracy.value,
            (found.accuracy.low, found.accuracy.high),
            1,
            UNTESTED,
            common + "The paper prints no accuracy against people, only the agreement above. "
            f"The manual threshold alone is right in {100 * found.manual_accuracy.value:.1f} %; "
            f"always giving the more frequent answer in {100 * found.baseline:.1f} %.",
        ),
    ]


def _by_seed(rows: list[Row], preset: str, arm: str, name: str) -> np.ndarray:
    chosen = sorted(
        (row for row in rows if row["preset"] == preset and row["arm"] == arm),
        key=lambda row: row["seed"],
    )
    return np.array([row[name] for row in chosen], float)


def _learning_claims(preset: str, epochs: list[Row], test: list[Row]) -> list[Claim]:
    out: list[Claim] = []
    suffix = "" if preset == "paper" else f"_{preset}"
    reward = "Eq. 4/5 alone" if preset == "paper" else "service quality plus Eq. 4/5"
    for algorithm in ("reinforce", "ppo"):
        arms = (algorithm, f"{algorithm}+guidance")
        without, guided = (_by_seed(test, preset, arm, "total") for arm in arms)
        floor = _by_seed(test, preset, arms[1], "floor").mean()
        perfect = [100 * _by_seed(test, preset, arm, "perfect_rate").mean() for arm in arms]
        estimate, low, high = reduction(without, guided)
        out.append(
            claim(
                f"total_score_reduction_{algorithm}{suffix}",
                f"Guidance lowers {algorithm.upper()}'s total issue score in the test by more "
                f"than 22 % (reward: {reward})",
                LOWER_SCORE,
                number(estimate),
                interval(low, high),
                len(guided),
                at_least(low, high, LOWER_SCORE),
                f"Total {without.mean():.3f} without and {guided.mean():.3f} with guidance; chance "
                f"alone gives {floor:.3f} at these issue rates. Perfect services: "
                f"{perfect[0]:.1f} % without, {perfect[1]:.1f} % with. "
                + (
                    "A factor on all rewards nearly cancels when advantages are normalised. "
                    if preset == "paper"
                    else ""
                )
                + undecided(estimate, low, high, LOWER_SCORE),
            )
        )
    counts = [_biased_epochs(epochs, preset, arm) for arm in ("ppo", "ppo+guidance")]
    estimate, low, high = reduction(*counts)
    out.append(
        claim(
            f"biased_epochs_reduction_ppo{suffix}",
            f"Guidance lowers PPO's biased epochs from 54 to 39 of 300 (reward: {reward})",
            round(FEWER_EPOCHS, 3),
            number(estimate),
            interval(low, high),
            len(counts[0]),
            at_least(low, high, FEWER_EPOCHS),
            f"Detector: {counts[0].mean():.1f} biased epochs without and {counts[1].mean():.1f} "
            f"with guidance, of {_epochs(epochs)} each. "
            + undecided(estimate, low, high, FEWER_EPOCHS),
        )
    )
    spread = [_spread(epochs, preset, arm) for arm in ("ppo", "ppo+guidance")]
    estimate, low, high = reduction(*spread)
    out.append(
        claim(
            f"score_confined_ppo{suffix}",
            "Guidance confines PPO's total issue score to a smaller interval while it learns "
            f"(reward: {reward})",
            "less volatile",
            number(estimate),
            interval(low, high),
            len(spread[0]),
            above_zero(low, high),
            "Standard deviation of the total over the second half of the epochs: "
            f"{spread[0].mean():.3f} without and {spread[1].mean():.3f} with guidance; this is the "
            "share by which guidance lowers it.",
        )
    )
    first, last = _quality(epochs, preset, "ppo+guidance")
    change = last - first
    low, high = t_interval(change)
    out.append(
        claim(
            f"quality_improved{suffix}",
            f"Guided PPO improves the quality of service while it learns (reward: {reward})",
            "improved",
            number(float(change.mean())),
            interval(low, high),
            len(change),
            above_zero(low, high),
            f"Share of perfect services: {100 * first.mean():.1f} % in the first 10 epochs, "
            f"{100 * last.mean():.1f} % in the last 40. "
            + (
                "The printed reward pays for equal treatment only, and a robot that fails everyone "
                "alike earns it: it levels down."
                if high < 0
                else ""
            ),
        )
    )
    return out


def _epochs(epochs: list[Row]) -> int:
    return 1 + max(int(row["epoch"]) for row in epochs)


def _biased_epochs(epochs: list[Row], preset: str, arm: str) -> np.ndarray:
    rows = [row for row in epochs if row["preset"] == preset and row["arm"] == arm]
    seeds = sorted({row["seed"] for row in rows})
    return np.array(
        [sum(row["biased_detector"] for row in rows if row["seed"] == seed) for seed in seeds],
        float,
    )


def _spread(epochs: list[Row], preset: str, arm: str) -> np.ndarray:
    """Standard deviation of the total score over the second half of the epochs of every seed."""
    rows = [row for row in epochs if row["preset"] == preset and row["arm"] == arm]
    half = _epochs(rows) // 2
    return np.array(
        [
            np.std([row["total"] for row in rows if row["seed"] == seed and row["epoch"] >= half])
            for seed in sorted({row["seed"] for row in rows})
        ]
    )


def _quality(epochs: list[Row], preset: str, arm: str) -> tuple[np.ndarray, np.ndarray]:
    """Share of perfect services in the first 10 and the last 40 epochs of every seed."""
    rows = [row for row in epochs if row["preset"] == preset and row["arm"] == arm]
    end = _epochs(rows)
    parts = []
    for first, last in ((0, 10), (end - 40, end)):
        parts.append(
            [
                np.mean(
                    [
                        row["perfect_rate"]
                        for row in rows
                        if row["seed"] == seed and first <= row["epoch"] < last
                    ]
                )
                for seed in sorted({row["seed"] for row in rows})
            ]
        )
    return np.array(parts[0]), np.array(parts[1])


def _signature_claims(demos: Demos) -> list[Claim]:
    rows = tables.signatures(demos)
    out = []
    for kind in KINDS[1:]:
        name = people.DISCRIMINATION[BIASES[kind].identity]
        mine = [row for row in rows if row["discrimination"] == name]
        off = {row["issue"]: abs(row["ours"] - row["paper"]) for row in mine}
        worst = max(off, key=lambda issue: off[issue])
        out.append(
            claim(
                f"signature_{name}",
                f"Issue scores of {name} ({', '.join(ISSUES)})",
                list(SIGNATURES[kind]),
                [round(row["ours"], 3) for row in mine],
                (
                    [round(row["ci_low"], 3) for row in mine],
                    [round(row["ci_high"], 3) for row in mine],
                ),
                1,
                REPRODUCED if off[worst] <= SIGNATURE_TOLERANCE else CONTRADICTED,
                f"{mine[0]['windows']} windows of 30 services by the {kind} robot, which was "
                f"calibrated to these numbers; farthest off in {worst}, by {off[worst]:.3f} "
                f"(tolerance {SIGNATURE_TOLERANCE}).",
            )
        )
    return out


def _behaviour_claims(demos: Demos) -> list[Claim]:
    rows = tables.behaviour(demos)
    out = []
    for name, kind, measure, text in (
        ("farthest_is_ableism", "ableist", "mean_response_distance", "responds farthest away"),
        ("slowest_is_ageism", "ageist", "mean_response_time", "responds latest"),
        ("most_ignored_is_racism", "racist", "ignore_rate", "ignores most"),
    ):
        mine = next(row for row in rows if row["robot"] == kind and row["measure"] == measure)
        others = [row for row in rows if row["robot"] != kind and row["measure"] == measure]
        beyond = all(mine["ci_low"] > other["ci_high"] for other in others)
        below = any(mine["ci_high"] < other["ci_low"] for other in others)
        listed = ", ".join(f"{other['robot']} {other['value']:.2f}" for other in others)
        out.append(
            claim(
                name,
                f"Of the biased robots the {kind} one {text} ({mine['unit']})",
                mine["paper"],
                mine["value"],
                (mine["ci_low"], mine["ci_high"]),
                1,
                REPRODUCED if beyond else CONTRADICTED if below else UNTESTED,
                f"{mine['services']} services at full strength; the others: {listed}. The verdict "
                "is on the order; the odds of the robots were calibrated with the paper's figures "
                "for distance and time in view.",
            )
        )
    return out


def _study_claims(study: Study) -> list[Claim]:
    from evenhand.detector_report import wilson

    named, _ = tables.questionnaire(study)
    out = []
    for name, scenario, identity, text in (
        ("study_race_willingness", "1", "race", "name race in the willingness scenario"),
        ("study_disability_scenario4", "4", "disability", "name disability in scenario 4"),
    ):
        row = next(r for r in named if r["scenario"] == scenario and r["identity"] == identity)
        share = wilson(row["count"], row["respondents"])
        out.append(
            claim(
                name,
                f"{100 * row['paper_share']:.1f} % of respondents {text}",
                row["paper_share"],
                row["share"],
                (share.low, share.high),
                1,
                contains(share.low, share.high, row["paper_share"]),
                f"{row['count']} of {row['respondents']} simulated respondents, whose model was "
                "fitted to this number: consistent, but no evidence about people. No count out of "
                "24 gives the printed share.",
            )
        )
    return out
