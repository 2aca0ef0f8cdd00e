"""The paper's claims against what came out. Every verdict follows a rule that is written here."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

from evenhand import people
from evenhand.experiments import tables
from evenhand.experiments.calibrate import SIGNATURES
from evenhand.experiments.demos import KINDS, Demos, Study
from evenhand.experiments.tables import Row
from evenhand.judgements import ISSUES
from evenhand.robots import BIASES

REPRODUCED, CONTRADICTED, UNTESTED = "reproduced", "contradicted", "cannot be tested"
SIGNATURE_TOLERANCE = 0.05
Claim = dict[str, Any]


def claim(
    name: str,
    text: str,
    paper: Any,
    ours: Any,
    ci95: Sequence[Any] | None,
    seeds: int | None,
    status: str,
    evidence: str,
) -> Claim:
    """One row of ``claims.json``."""
    return {
        "id": name,
        "claim": text,
        "paper": paper,
        "ours": ours,
        "ci95": None if ci95 is None else list(ci95),
        "seeds": seeds,
        "status": status,
        "evidence": evidence,
    }


def reduction(without: np.ndarray, with_guidance: np.ndarray) -> tuple[float, float, float]:
    """Share by which guidance lowers a mean, with a 95 % interval over paired seeds.

    The interval is Student's t of the paired differences, divided by the mean without guidance.

    Args:
        without: one number a seed, [S].
        with_guidance: of the same seeds, [S].

    Returns:
        Estimate, lower and upper end; NaN for the ends with one seed, and for all three when
        the mean without guidance is 0.
    """
    base = float(without.mean())
    if base == 0.0:
        return float("nan"), float("nan"), float("nan")
    difference = without - with_guidance
    estimate = float(difference.mean()) / base
    n = len(difference)
    if n < 2:
        return estimate, float("nan"), float("nan")
    half = float(stats.t.ppf(0.975, n - 1)) * float(difference.std(ddof=1)) / np.sqrt(n) / base
    return estimate, estimate - half, estimate + half


def at_least(low: float, high: float, bound: float) -> str:
    """Verdict on "at least ``bound``": the interval lies above, below, or around it."""
    if np.isnan(low) or np.isnan(high):
        return UNTESTED
    if low >= bound:
        return REPRODUCED
    return CONTRADICTED if high < bound else UNTESTED


def contains(low: float, high: float, number: float) -> str:
    """Verdict on "equals ``number``" for an estimate with an interval."""
    return REPRODUCED if low <= number <= high else CONTRADICTED


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
            at_least(found.agreement.low, found.agreement.high, 0.98)
            if found.agreement.high < 0.98
            else REPRODUCED,
            common + "Partly by construction: simulated respondents judge by a threshold near 0.5.",
        ),
        claim(
            "detector_accuracy",
            "The detector is accurate (98 %, of what is not said)",
            0.98,
            found.accuracy.value,
            (found.accuracy.low, found.accuracy.high),
            1,
            REPRODUCED if found.accuracy.high >= 0.98 else CONTRADICTED,
            common
            + f"The manual threshold alone is right in {100 * found.manual_accuracy.value:.1f} %; "
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
                0.22,
                _number(estimate),
                _interval(low, high),
                len(guided),
                at_least(low, high, 0.22),
                f"Total {without.mean():.3f} without and {guided.mean():.3f} with guidance; chance "
                f"alone gives {floor:.3f} at these issue rates. Perfect services: "
                f"{perfect[0]:.1f} % without, {perfect[1]:.1f} % with. "
                + (
                    "A factor on everybody's reward cancels when advantages are normalised. "
                    if preset == "paper"
                    else ""
                )
                + _undecided(low, high, 0.22),
            )
        )
    counts = [_biased_epochs(epochs, preset, arm) for arm in ("ppo", "ppo+guidance")]
    estimate, low, high = reduction(*counts)
    out.append(
        claim(
            f"biased_epochs_reduction_ppo{suffix}",
            f"Guidance lowers PPO's biased epochs from 54 to 39 of 300 (reward: {reward})",
            round(15 / 54, 3),
            _number(estimate),
            _interval(low, high),
            len(counts[0]),
            at_least(low, high, 0.278),
            f"Detector: {counts[0].mean():.1f} biased epochs without and {counts[1].mean():.1f} "
            f"with guidance, of {_epochs(epochs)} each. " + _undecided(low, high, 0.278),
        )
    )
    first, last = _quality(epochs, preset, "ppo+guidance")
    change = last - first
    low, high = _t_interval(change)
    out.append(
        claim(
            f"quality_improved{suffix}",
            f"Guided PPO improves the quality of service while it learns (reward: {reward})",
            "improved",
            _number(float(change.mean())),
            _interval(low, high),
            len(change),
            UNTESTED
            if np.isnan(low)
            else REPRODUCED
            if low > 0
            else CONTRADICTED
            if high < 0
            else UNTESTED,
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


def _undecided(low: float, high: float, bound: float) -> str:
    if np.isnan(low):
        return "One seed gives no interval: run more seeds."
    if low < bound <= high:
        return f"The interval holds {bound:g}: these seeds cannot tell."
    return ""


def _epochs(epochs: list[Row]) -> int:
    return 1 + max(int(row["epoch"]) for row in epochs)


def _biased_epochs(epochs: list[Row], preset: str, arm: str) -> np.ndarray:
    rows = [row for row in epochs if row["preset"] == preset and row["arm"] == arm]
    seeds = sorted({row["seed"] for row in rows})
    return np.array(
        [sum(row["biased_detector"] for row in rows if row["seed"] == seed) for seed in seeds],
        float,
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


def _t_interval(values: np.ndarray) -> tuple[float, float]:
    if len(values) < 2:
        return float("nan"), float("nan")
    half = stats.t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    return float(values.mean() - half), float(values.mean() + half)


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
                "24 gives the printed share; it is a count out of 14 or 28.",
            )
        )
    return out


def _number(value: float) -> float | None:
    return None if np.isnan(value) else value


def _interval(low: float, high: float) -> tuple[float, float] | None:
    return None if np.isnan(low) or np.isnan(high) else (low, high)
