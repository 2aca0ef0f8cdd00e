"""Room: a report in words. Takes: results. Gives: sentences and one table at a glance. Pure.

Every sentence is composed from the numbers of the run; none is written beforehand for a certain
outcome.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from evenhand.core.wording import joined, percent
from evenhand.experiments.paper.report.figures_biased import biased_data
from evenhand.experiments.paper.report.figures_detector import judge_text, metric_text
from evenhand.experiments.paper.report.figures_study import behaviour_data, measure_title
from evenhand.experiments.paper.report.results import CONTRADICTED, STATUSES
from evenhand.methods.vocabulary import MANUAL_THRESHOLD
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.style import arms_in
from evenhand.report.table import Table, say, say_estimate
from evenhand.statistics.means import SCORE, SHARE, Estimate, mean_interval

# A robot levels down when its total score passes the manual threshold although most of its
# services are not perfect: it treats everybody alike by serving everybody badly.
LEVELLED_PERFECT = 0.5


@dataclass(frozen=True)
class Cell:
    """A number in a table: text of the value, of its interval, and of what the paper printed."""

    value: str
    interval: str = ""
    paper: str = ""
    largest: bool = False


@dataclass(frozen=True)
class Glance:
    """One arm at a glance: text for a table.

    Attributes:
        arm: its name.
        total: total issue score in the test.
        perfect: share of perfect services in the test.
        floor: the chance floor of the total score.
        worst_group: share of perfect services of the group served worst.
        biased: epochs judged as biased by the detector.
        levelled: whether it levels down.
    """

    arm: str
    total: Cell
    perfect: Cell
    floor: Cell
    worst_group: Cell
    biased: Cell
    levelled: bool


def levels_down(arm: Table) -> bool:
    """Whether one arm of one preset, as rows of the test, levels down."""
    total, perfect = mean_interval(arm["total"]).mean, mean_interval(arm["perfect_rate"]).mean
    return total < MANUAL_THRESHOLD and perfect < LEVELLED_PERFECT


def glance(results: Results) -> list[tuple[str, list[Glance]]]:
    """Score and quality of service side by side: (title of the preset, one line an arm)."""
    test, biased = results["test"], biased_data(results)
    found = []
    for preset in test.distinct("preset"):
        lines = []
        for arm in arms_in(test.where(preset=preset)):
            part = test.where(preset=preset, arm=arm)
            count = biased.where(preset=preset, arm=arm, judge="detector", seed="mean")
            epochs = [
                Estimate(row["biased_epochs"], row["ci_low"], row["ci_high"], 2)
                for row in count.rows()
            ]
            lines.append(
                Glance(
                    arm=style.arm_label(arm),
                    total=_brief(mean_interval(part["total"], within=SCORE)),
                    floor=Cell(say(mean_interval(part["floor"]).mean)),
                    perfect=_brief(mean_interval(part["perfect_rate"], within=SHARE), share=True),
                    worst_group=_brief(
                        mean_interval(part["worst_group_rate"], within=SHARE), share=True
                    ),
                    biased=_brief(epochs[0], digits=1) if epochs else Cell(say(math.nan)),
                    levelled=levels_down(part),
                )
            )
        found.append((style.preset_title(preset), lines))
    return found


def _brief(estimate: Estimate, share: bool = False, digits: int = 3) -> Cell:
    def tell(value: float) -> str:
        return percent(value) if share else say(value, digits)

    known = not math.isnan(estimate.mean) and estimate.has_interval
    interval = f"[{tell(estimate.low)}, {tell(estimate.high)}]" if known else ""
    return Cell(tell(estimate.mean), interval)


def behaviour_table(results: Results) -> tuple[list[str], list[tuple[str, list[Cell]]]]:
    """The paper's Fig. 11 as a table: heads of the measures, one line of cells a robot."""
    data = behaviour_data(results)
    heads, lines = [], []
    for measure in data.distinct("measure"):
        units = [unit for unit in data.where(measure=measure)["unit"].tolist() if unit]
        heads.append(measure_title(measure) + (f", {units[0]}" if units else ""))
    for robot in data.distinct("robot"):
        cells = []
        for measure in data.distinct("measure"):
            cell = Cell(say(math.nan))
            for row in data.where(robot=robot, measure=measure).rows():
                brief = _brief(Estimate(row["value"], row["ci_low"], row["ci_high"], 2), digits=2)
                paper = "" if math.isnan(row["paper"]) else f"{row['paper']:g}"
                cell = replace(brief, paper=paper, largest=bool(row["largest"]))
            cells.append(cell)
        lines.append((robot, cells))
    return heads, lines


def paragraphs(results: Results) -> list[tuple[str, str]]:
    """The report in plain sentences, each paragraph with a head."""
    presets = results["test"].distinct("preset")
    return [
        _claims(results),
        *(_preset(results, preset) for preset in presets),
        *(_guidance(results, preset) for preset in presets),
        _detector(results),
    ]


def status_counts(results: Results) -> list[tuple[str, int]]:
    """How many claims have each status."""
    statuses = [claim["status"] for claim in results.claims]
    return [(status, statuses.count(status)) for status in STATUSES]


def _claims(results: Results) -> tuple[str, str]:
    ids = {claim["id"] for claim in results.claims}
    unprinted = sum(claim["paper"] is None for claim in results.claims)
    again = sum(
        claim["id"].removesuffix(f"_{preset}") in ids - {claim["id"]}
        for claim in results.claims
        for preset in results["test"].distinct("preset")
    )
    claims = len(ids) - unprinted - again
    parts = [f"{claims} {'claim' if claims == 1 else 'claims'} of the paper"]
    if again:
        parts.append(f"{again} of them again, learned from another reward")
    if unprinted:
        parts.append(f"{unprinted} beside them, of which the paper prints no number")
    counts = dict(status_counts(results))
    told = [status for status in STATUSES if counts[status] or status in STATUSES[:1]]
    outcomes = [
        f"{counts[s]} {_was(counts[s]) + ' ' if 're' in s or s == CONTRADICTED else ''}{s}"
        for s in told
    ]
    return (
        "Claims.",
        f"The table has {len(ids)} {'row' if len(ids) == 1 else 'rows'}: {'; '.join(parts)}. "
        f"{', '.join(outcomes[:-1])}, and {outcomes[-1]} with this run. All people, services and "
        "respondents are simulated.",
    )


def _was(count: int) -> str:
    return "was" if count == 1 else "were"


def _span(values: Sequence[float], share: bool = False) -> str:
    known = [value for value in values if not math.isnan(value)]
    tell = percent if share else say
    if not known:
        return tell(math.nan)
    low, high = tell(min(known)), tell(max(known))
    return low if low == high else f"{low} to {high}"


def _preset(results: Results, preset: str) -> tuple[str, str]:
    test = results["test"].where(preset=preset)
    parts = {arm: test.where(arm=arm) for arm in arms_in(test)}
    totals = [mean_interval(part["total"]).mean for part in parts.values()]
    perfect = [mean_interval(part["perfect_rate"]).mean for part in parts.values()]
    floors = [mean_interval(part["floor"]).mean for part in parts.values()]
    head = f"{style.preset_title(preset)}."
    text = (
        f"In the test the total issue score is {_span(totals)} "
        f"(mean of each arm), beside {_span(perfect, share=True)} perfect services. Chance alone "
        f"gives a perfectly even robot with the same issue rates {_span(floors)}. "
    )
    down = [style.arm_label(arm) for arm, part in parts.items() if levels_down(part)]
    if not down and any(math.isnan(value) for value in (*totals, *perfect)):
        return head, text + "Whether an arm levels down cannot be said: scores are missing."
    if not down:
        return head, text + "No arm levels down."
    which = f"All {len(parts)} arms level" if len(down) == len(parts) else joined(down)
    if len(down) < len(parts):
        which += " levels" if len(down) == 1 else " level"
    return head, text + (
        f"{which} down: the score is under the manual threshold of {MANUAL_THRESHOLD} although "
        "fewer than half of the services are perfect. A robot that fails everybody alike passes as "
        "fair, so this low score is not a success."
    )


def paired(
    results: Results, preset: str, algorithm: str, column: str, kind: str = "guidance"
) -> Estimate:
    """Guided minus unguided in the test, paired by seed, with its t interval."""
    test = results["test"].where(preset=preset)
    with_, without = (
        dict(zip(part["seed"].tolist(), part[column].tolist(), strict=True))
        for part in (test.where(arm=f"{algorithm}+{kind}"), test.where(arm=algorithm))
    )
    return mean_interval(with_[seed] - without[seed] for seed in with_ if seed in without)


def _guidance(results: Results, preset: str) -> tuple[str, str]:
    arms = results["test"].where(preset=preset).distinct("arm")
    head = f"Guidance in preset {preset}."
    printed = _against_unguided(results, preset, arms, "guidance")
    own = _against_unguided(results, preset, arms, "levelup")
    if not printed and not own:
        return head, "This run has no algorithm both with and without guidance."
    text = f"Guided minus unguided, paired by seed. {' '.join(printed)}" if printed else ""
    if own:
        text += (
            " Level-up, which is not the paper's but Evenhand's, in its place: issues of people "
            f"in worse-off groups cost more. {' '.join(own)}"
        )
    return head, text.strip()


def _against_unguided(results: Results, preset: str, arms: Sequence[str], kind: str) -> list[str]:
    """A sentence for each algorithm that there is with this guidance and without any."""
    said = []
    for algorithm in (arm for arm in arms if f"{arm}+{kind}" in arms):
        score = paired(results, preset, algorithm, "total", kind)
        quality = paired(results, preset, algorithm, "perfect_rate", kind)
        said.append(
            f"{style.arm_label(algorithm)}: total score {say_estimate(score)}{_verdict(score)}, "
            f"perfect services {_points(quality)}."
        )
    return said


def _verdict(change: Estimate) -> str:
    if not change.has_interval:
        return ""
    if change.high < 0:
        return " (lower)"
    return " (higher)" if change.low > 0 else " (no clear difference)"


def _points(change: Estimate) -> str:
    if not change.n:
        return say(math.nan)
    scaled = [100 * min(max(v, -1.0), 1.0) for v in (change.mean, change.low, change.high)]
    mean, low, high = (f"{value:+.1f}".replace("-", "\N{MINUS SIGN}") for value in scaled)
    return f"{mean} [{low}, {high}] points" if change.has_interval else f"{mean} points"


def _detector(results: Results) -> tuple[str, str]:
    return (
        "Detector.",
        "Fitted to the answers of simulated respondents. Held-out windows in which it agrees with "
        f"them: {metric_text(results, 'accuracy')}; with the manual threshold: "
        f"{metric_text(results, 'threshold_agreement')} (the paper prints 98\N{NO-BREAK SPACE}%). "
        "A second one, fitted to scores without what chance makes of small windows, agrees with "
        f"respondents in {judge_text(results, 'corrected', 'accuracy')}. Windows of the even robot "
        f"called biased: {judge_text(results, 'raw', 'false_alarms')} by the first, "
        f"{judge_text(results, 'corrected', 'false_alarms')} by the second.",
    )
