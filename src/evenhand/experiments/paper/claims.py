"""The paper's claims against what came out. Every verdict follows a rule in ``verdicts``."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy import stats

from evenhand.experiments.paper import tables
from evenhand.experiments.paper.calibrate import SIGNATURES
from evenhand.experiments.paper.demonstrations import KINDS, Demos, Study
from evenhand.experiments.paper.report.results import (
    CALIBRATED,
    CONTRADICTED,
    EQUIVALENT,
    OPEN,
    REPRODUCED,
    UNTESTED,
)
from evenhand.methods.vocabulary import ISSUES
from evenhand.report.table import Row
from evenhand.restaurant import people
from evenhand.restaurant.robots import BIASES
from evenhand.statistics.means import mean_interval

SAME = 1e-12
"""Seeds that differ by less are alike."""
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


def difference(without: np.ndarray, with_guidance: np.ndarray) -> tuple[float, float, float]:
    """By how much guidance lowers a number, with a 95 % interval over paired seeds (Student's t).

    Args:
        without: one number a seed, [S].
        with_guidance: of the same seeds, [S].

    Returns:
        Estimate, lower and upper end; NaN for the ends with one seed.
    """
    each = without - with_guidance
    n = len(each)
    estimate = float(each.mean())
    if n < 2:
        return estimate, float("nan"), float("nan")
    half = float(stats.t.ppf(0.975, n - 1)) * float(each.std(ddof=1)) / np.sqrt(n)
    return estimate, estimate - half, estimate + half


def lowered_by(low: float, high: float, goal: float, alike: float) -> str:
    """Verdict on "lowers by at least ``goal``", for a difference with an interval.

    Args:
        low: lower end of the interval.
        high: upper end.
        goal: what the paper says, in the unit of the difference.
        alike: differences within this to either side are none that matters.
    """
    if no_interval(low, high):
        return OPEN
    if -alike < low and high < alike:
        return EQUIVALENT
    if low >= goal:
        return REPRODUCED
    return CONTRADICTED if high < goal else OPEN


def pairs_needed(each: np.ndarray, alike: float) -> int:
    """Pairs of seeds by which no effect would be shown with power 0.9, if there is none.

    The least n with (t₀.₉₇₅ + t₀.₉₅) s / √n <= δ, t of n - 1 degrees of freedom: both ends of a
    95 % interval have to lie within ±δ (two one-sided tests, Schuirmann 1987; Chow, Shao and Wang
    2008, section 3.2). At least one more than there are, for these did not show it.

    Args:
        each: differences of the pairs there are, [S], at least two.
        alike: δ.
    """
    spread = float(each.std(ddof=1))
    n = np.arange(len(each) + 1, MOST_PAIRS + 1)
    half = (stats.t.ppf(0.975, n - 1) + stats.t.ppf(0.95, n - 1)) * spread / np.sqrt(n)
    enough = np.flatnonzero(half <= alike)
    return int(n[enough[0]]) if len(enough) else MOST_PAIRS


def contains(low: float, high: float, number: float) -> str:
    """Verdict on "equals ``number``", to which something was fitted, by its interval."""
    return CALIBRATED if low <= number <= high else CONTRADICTED


def above_zero(low: float, high: float) -> str:
    """Verdict on "greater than 0": the interval lies above, below, or around it."""
    if no_interval(low, high):
        return OPEN
    if low > 0:
        return REPRODUCED
    return CONTRADICTED if high < 0 else OPEN


def no_interval(low: float, high: float) -> bool:
    """Whether seeds say nothing of how they vary: an end is NaN, or all of them are alike."""
    return bool(np.isnan(low) or np.isnan(high) or high - low < SAME)


def undecided(status: str, low: float, high: float) -> str:
    """Why a verdict is open for want of an interval; nothing for another one."""
    if status != OPEN:
        return ""
    if np.isnan(low):
        return "One seed gives no interval: run more seeds."
    if no_interval(low, high):
        return "The difference is the same in every seed, which gives no interval: run more seeds."
    return "These seeds cannot tell."


def number(value: float) -> float | None:
    """The number, or None for NaN, which JSON cannot hold."""
    return None if np.isnan(value) else value


def interval(low: float, high: float) -> tuple[float, float] | None:
    """Both ends, or None if one is NaN."""
    return None if np.isnan(low) or np.isnan(high) else (low, high)


LOWER_SCORE = 0.22
"""Share by which guidance lowers the total issue score in the paper's test."""
FEWER_EPOCHS = 15 / 54
"""Share by which guidance lowers PPO's biased epochs in the paper, printed as 27.8 %."""
ALIKE = 0.02
"""Corrected totals within this are alike: half a point in each of four issues, an eleventh of the
0.22 that separates the paper's arms."""
EPOCHS_ALIKE = 5 / 300
"""Shares of biased epochs within this are alike: a third of the paper's 15 of 300."""
MOST_PAIRS = 100_000
"""More are not looked for."""
SPREAD_ALIKE = 0.01
"""Standard deviations of the total within this are alike: a tenth of what chance alone makes of
windows of 30."""
SIGNATURE_TOLERANCE = 0.05
REWARDS = {
    "paper": "Eq. 4/5 alone",
    "service": "service quality plus Eq. 4/5",
    "prejudiced": "service quality plus Eq. 4/5, after imitating biased robots",
}
"""What is rewarded in each preset."""


def all_claims(demos: Demos, study: Study, epochs: list[Row], test: list[Row]) -> list[Claim]:
    """Every claim, in the order of the report."""
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
            CALIBRATED if found.agreement.high >= 0.98 else CONTRADICTED,
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


def _learning_claims(preset: str, epochs: list[Row], test: list[Row]) -> list[Claim]:
    out: list[Claim] = []
    suffix = "" if preset == "paper" else f"_{preset}"
    reward = REWARDS[preset]
    for algorithm in ("reinforce", "ppo"):
        total, raw, floor, perfect = (
            _without_and_with(test, preset, algorithm, name)
            for name in ("corrected_total", "total", "floor", "perfect_rate")
        )
        out.append(
            _lowered(
                f"total_score_reduction_{algorithm}{suffix}",
                f"Guidance lowers {algorithm.upper()}'s total issue score in the test by more "
                f"than 22 % (reward: {reward})",
                total,
                f"Total without chance {total[0].mean():.3f} without and {total[1].mean():.3f} "
                f"with guidance (printed total {raw[0].mean():.3f} and {raw[1].mean():.3f}, of "
                f"which chance alone gives {floor[0].mean():.3f} and {floor[1].mean():.3f}). "
                f"Perfect services: {100 * perfect[0].mean():.1f} % without, "
                f"{100 * perfect[1].mean():.1f} % with. "
                + (
                    "A factor on all rewards nearly cancels when advantages are normalised. "
                    if preset == "paper"
                    else ""
                ),
                LOWER_SCORE,
                ALIKE,
            )
        )
    end = 1 + max(int(row["epoch"]) for row in epochs)
    biased = _without_and_with(epochs, preset, "ppo", "biased_detector", np.sum)
    out.append(
        _lowered(
            f"biased_epochs_reduction_ppo{suffix}",
            f"Guidance lowers PPO's biased epochs from 54 to 39 of 300 (reward: {reward})",
            biased,
            f"Detector: {biased[0].mean():.1f} biased epochs without and {biased[1].mean():.1f} "
            f"with guidance, of {end} each. ",
            FEWER_EPOCHS,
            EPOCHS_ALIKE * end,
        )
    )
    late = _between(epochs, end // 2, end)
    spread = _without_and_with(late, preset, "ppo", "total", np.std)
    out.append(
        _lowered(
            f"score_confined_ppo{suffix}",
            "Guidance confines PPO's total issue score to a smaller interval while it learns "
            f"(reward: {reward})",
            spread,
            "Standard deviation of the total over the second half of the epochs: "
            f"{spread[0].mean():.3f} without and {spread[1].mean():.3f} with guidance. ",
            None,
            SPREAD_ALIKE,
        )
    )
    out.append(_improved(f"quality_improved{suffix}", preset, reward, epochs))
    return out


def _improved(name: str, preset: str, reward: str, epochs: list[Row]) -> Claim:
    """Whether the last 40 epochs are better than the first 10; of few epochs, what is left."""
    end = 1 + max(int(row["epoch"]) for row in epochs)
    early = min(10, end // 2)
    late = min(40, end - early)
    text = f"Guided PPO improves the quality of service while it learns (reward: {reward})"
    if not early:
        why = "A single epoch has no beginning to compare its end with."
        return claim(name, text, "improved", None, None, None, UNTESTED, why)
    first, last = (
        _by_seed(_between(epochs, *part), preset, "ppo+guidance", "perfect_rate")
        for part in ((0, early), (end - late, end))
    )
    change = last - first
    found = mean_interval(change, within=(-1.0, 1.0))  # a change of shares
    low, high = found.low, found.high
    status = above_zero(low, high)
    return claim(
        name,
        text,
        "improved",
        number(float(change.mean())),
        interval(float(low), float(high)),
        len(change),
        status,
        f"Share of perfect services: {100 * first.mean():.1f} % in the first {early} epochs, "
        f"{100 * last.mean():.1f} % in the last {late}. "
        + undecided(status, low, high)
        + (
            "The printed reward pays for equal treatment only, and a robot that fails everyone "
            "alike earns it: it levels down."
            if status == CONTRADICTED
            else ""
        ),
    )


def _lowered(
    name: str,
    text: str,
    pair: tuple[np.ndarray, np.ndarray],
    evidence: str,
    share: float | None,
    alike: float,
) -> Claim:
    """A claim on a difference; the paper says by which share of what is without guidance.

    ``share`` is None where the paper says that a number is lower, not by how much; ``alike`` is
    the bound of equivalence.
    """
    without, with_guidance = pair
    estimate, low, high = difference(without, with_guidance)
    goal = 0.0 if share is None else share * float(without.mean())
    status = lowered_by(low, high, goal, alike)
    if share is None and status == REPRODUCED and low <= 0.0:
        status = OPEN
    if not without.any() and not with_guidance.any():
        status, why = UNTESTED, "Without guidance there was nothing to lower."
    elif status == EQUIVALENT:
        why = f"The interval lies within ±{alike:.3g}: guidance changes nothing that matters."
    else:
        why = undecided(status, low, high)
    if status == OPEN and not no_interval(low, high):
        more = pairs_needed(without - with_guidance, alike)
        why += f" About {more:,} seeds would show no effect with power 0.9, if there is none."
    if share is not None:
        evidence += f"{100 * share:.1f} % of it would be {goal:.3g}. "
    return claim(
        name,
        text,
        "less volatile" if share is None else f"{100 * share:.1f} % lower",
        number(estimate),
        interval(low, high),
        len(without),
        status,
        evidence + why,
    )


def _between(epochs: list[Row], first: int, end: int) -> list[Row]:
    return [row for row in epochs if first <= row["epoch"] < end]


def _by_seed(
    rows: list[Row], preset: str, arm: str, name: str, measure: Callable[..., Any] = np.mean
) -> np.ndarray:
    mine = [row for row in rows if row["preset"] == preset and row["arm"] == arm]
    seeds = sorted({row["seed"] for row in mine})
    return np.array(
        [measure([row[name] for row in mine if row["seed"] == seed]) for seed in seeds], float
    )


def _without_and_with(
    rows: list[Row], preset: str, algorithm: str, name: str, measure: Callable[..., Any] = np.mean
) -> tuple[np.ndarray, np.ndarray]:
    without, guided = (
        _by_seed(rows, preset, arm, name, measure) for arm in (algorithm, f"{algorithm}+guidance")
    )
    return without, guided


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
                CALIBRATED if off[worst] <= SIGNATURE_TOLERANCE else CONTRADICTED,
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
                CALIBRATED if beyond else CONTRADICTED if below else OPEN,
                f"{mine['services']} services at full strength; the others: {listed}. The verdict "
                "is on the order; the odds of the robots were calibrated with the paper's figures "
                "for distance and time in view.",
            )
        )
    return out


def _study_claims(study: Study) -> list[Claim]:
    from evenhand.statistics.detector_accuracy import wilson

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
