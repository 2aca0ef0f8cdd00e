"""Room: the aims of a comparison, judged and in words. Takes: the tables. Gives: text. Pure.

Each of Evenhand's methods is judged at its standard strength, for choosing the strength that came
out best would be choosing on the test; only where the standard one was not run, each other is.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import isnan, nan

from evenhand.core.wording import NOT_DEFINED, percent, points
from evenhand.experiments.comparison import aims, settings
from evenhand.experiments.comparison.aims import Verdict
from evenhand.experiments.comparison.figures import looks, own
from evenhand.experiments.comparison.read import NO_ALGORITHM, Comparison, arm_label, method_of
from evenhand.report.table import say
from evenhand.statistics.means import Estimate
from evenhand.training.learners import LABELS

ICONS = {aims.REACHED: "✓", aims.MISSED: "✗", aims.UNKNOWN: "?"}
EVENNESS, PERFECT, WORST, BLIND, VOLUME = (
    "Corrected total", "Perfect services", "Worst-served group", "Against blind",
    "Hypervolume",
)  # fmt: skip
BIASED, MOST = "Biased epochs in training", "Hypervolume in 6 of 8 scenarios"
AIMS = (EVENNESS, PERFECT, WORST, BLIND, VOLUME)
"""Judged in every scenario; in ``even`` the last two alone."""


@dataclass(frozen=True)
class Cell:
    """A verdict as text."""

    state: str
    icon: str
    value: str
    interval: str
    why: str


@dataclass(frozen=True)
class Line:
    """The verdicts of one scenario with one algorithm; None where there is no aim."""

    scenario: str
    algorithm: str
    cells: tuple[Cell | None, ...]


@dataclass(frozen=True)
class Judged:
    """What the aims came to for one arm."""

    arm: str
    lines: list[Line]
    whole: list[tuple[str, str, Cell]]
    counts: list[tuple[str, str, int]]
    words: str


def algorithm_label(algorithm: str) -> str:
    """The name of an algorithm for readers; nothing for what learns nothing."""
    if algorithm == NO_ALGORITHM:
        return ""
    return LABELS.get(algorithm, algorithm)


def judged_arms(comparison: Comparison) -> list[str]:
    """Evenhand's arms, the recommended first."""
    found: list[str] = []
    for method in own():
        arms = [arm for arm in comparison.arms if method_of(arm) == method]
        found += [method] if method in arms else arms
    return found


def judge(comparison: Comparison) -> list[Judged]:
    """Every aim for every arm of Evenhand's."""
    return [_judge(comparison, arm) for arm in judged_arms(comparison)]


def _judge(c: Comparison, arm: str) -> Judged:
    lines, whole = [], []
    found: list[tuple[str, str, Verdict]] = []
    for scenario in c.scenarios:
        for algorithm in c.algorithms:
            if not c.has(scenario, algorithm, arm):
                continue
            verdicts = list(_verdicts(c, scenario, algorithm, arm))
            where = f"{scenario} with {algorithm_label(algorithm)}"
            found += [(a, where, v) for a, v in zip(AIMS, verdicts, strict=True) if v]
            cells = tuple(
                cell(aim, verdict) if verdict else None
                for aim, verdict in zip(AIMS, verdicts, strict=True)
            )
            lines.append(Line(scenario, algorithm_label(algorithm), cells))
    for algorithm in c.algorithms:
        for aim, verdict in _whole(c, algorithm, arm):
            found.append((aim, f"with {algorithm_label(algorithm)}", verdict))
            whole.append((aim, algorithm_label(algorithm), cell(aim, verdict)))
    whole.sort(key=lambda one: one[0])
    states = [verdict.state for _, _, verdict in found]
    counts = [(state, ICONS[state], states.count(state)) for state in aims.STATES]
    return Judged(arm_label(arm), lines, whole, counts, " ".join(_sentences(found)))


def _verdicts(c: Comparison, scenario: str, algorithm: str, arm: str) -> Iterator[Verdict | None]:
    if scenario == "even":
        yield from (None, None, None)
    else:
        verdict = _evenness(c, scenario, algorithm, arm)
        yield verdict
        for metric in ("perfect_rate", "worst_group_rate"):
            yield aims.perfect(c.estimate(scenario, algorithm, arm, metric, "difference"))
    yield against_blind(c, scenario, algorithm, arm)
    volumes = c.hypervolumes(scenario, algorithm)
    own = volumes.get(method_of(arm), Estimate(nan, nan, nan, 0))
    yield aims.hypervolume(own, _rivals(volumes))


def against_blind(c: Comparison, scenario: str, algorithm: str, arm: str) -> Verdict:
    """An arm against the cost without groups."""
    return aims.against_blind(
        c.estimate(scenario, algorithm, arm, "corrected_total", "to_blind"),
        c.estimate(scenario, algorithm, arm, "perfect_rate", "to_blind"),
        bool({*scenario.split("+")} & {*aims.SCARCE}),
    )


def added(c: Comparison) -> list[str]:
    """What guidance adds to a cost without groups: the first thing that a reader has to know."""
    arms = judged_arms(c)
    if not arms:
        return []
    if settings.BLIND not in {method_of(arm) for arm in c.arms}:
        return [
            "The control blind (a cost of issues without groups) was not run. So nothing here "
            "tells better service from fairness."
        ]
    found = []
    for algorithm in c.algorithms:
        parts: dict[str, list[str]] = {"more": [], "less": [], "none": []}
        for scenario in c.scenarios:
            one = c.estimate(scenario, algorithm, arms[0], "corrected_total", "to_blind")
            if isnan(one.mean) or isnan(one.low):
                continue
            kind = "more" if one.high < 0 else "less" if one.low > 0 else "none"
            parts[kind].append(f"{scenario} ({say(one.mean)})")
        label, name = algorithm_label(algorithm), arm_label(arms[0])
        if not any(parts.values()):
            found.append(f"{label}: too few seeds to compare {name} with a cost without groups.")
            continue
        said = [
            (parts["none"], f"{name} adds nothing to a cost without groups that these seeds show"),
            (parts["more"], f"{name} is more even than a cost without groups"),
            (parts["less"], f"{name} is less even than a cost without groups"),
        ]
        sentences = [f"In {', '.join(where)} {what}." for where, what in said if where]
        found.append(f"{label}: {' '.join(sentences)}")
    return found


def _rivals(volumes: dict[str, Estimate]) -> dict[str, Estimate]:
    known, ours = looks(), own()
    return {known[name].label: one for name, one in volumes.items() if name not in ours}


def _evenness(c: Comparison, scenario: str, algorithm: str, arm: str) -> Verdict:
    def total(algorithm: str, arm: str) -> Estimate:
        return c.estimate(scenario, algorithm, arm, "corrected_total")

    own, service = total(algorithm, arm), total(algorithm, "service")
    best = total(NO_ALGORITHM, "reference")
    share = c.estimate(scenario, algorithm, arm, "corrected_total", "share")
    seeds = min(own.n, service.n, best.n)
    share = Estimate(share.mean, share.low, share.high, seeds)
    verdict = aims.evenness(share, service.mean, own.mean, best.mean)
    if verdict.state != aims.MISSED:
        return verdict
    parts = [
        (c.estimate(scenario, algorithm, arm, f"corrected_{issue}").mean, issue)
        for issue in c.issues(scenario)
    ]
    known = [part for part in parts if not isnan(part[0])]
    if not known or own.mean <= 0 or max(known)[0] <= 0:
        return verdict
    part, issue = max(known)
    left = f"most of what is left is {issue}, {say(part)} of {say(own.mean)}"
    if part > own.mean:
        left = f"its largest part is {issue}, {say(part)}; parts can be below 0"
    return Verdict(verdict.state, verdict.number, f"{verdict.why}; {left}")


def _whole(c: Comparison, algorithm: str, arm: str) -> Iterator[tuple[str, Verdict]]:
    if c.has("prejudiced", algorithm, arm):
        service, own = (
            c.estimate("prejudiced", algorithm, name, "biased_epochs") for name in ("service", arm)
        )
        yield BIASED, aims.biased(service, own)
    states = {}
    for scenario in c.scenarios:
        volumes = c.hypervolumes(scenario, algorithm)
        if method_of(arm) in volumes:
            own = volumes[method_of(arm)]
            states[scenario] = aims.hypervolume(own, _rivals(volumes)).state
    if states:
        yield MOST, aims.in_most(states)


# --- words --------------------------------------------------------------------------------------


def interval(number: Estimate, tell: Callable[[float], str]) -> str:
    """The limits in brackets; nothing without them."""
    if isnan(number.mean) or isnan(number.low):
        return ""
    return f"[{tell(number.low)}, {tell(number.high)}]"


def cell(aim: str, verdict: Verdict) -> Cell:
    """A verdict as text, in the unit of its aim."""
    number, limits = verdict.number, ""
    if isnan(number.mean):
        value = NOT_DEFINED
    elif aim == EVENNESS:
        value = f"{percent(number.mean)} attained"
        limits = interval(number, percent)
    elif aim == BLIND:
        value, limits = say(number.mean), interval(number, say)
    elif aim in (PERFECT, WORST):
        value, limits = f"{points(number.mean)} points", interval(number, points)
    elif aim == BIASED:
        value = f"{percent(abs(number.mean))} {'fewer' if number.mean >= 0 else 'more'}"
    elif aim == MOST:
        value = f"in {number.mean:.0f} of {number.n}"
    else:
        value, limits = say(number.mean), interval(number, say)
    return Cell(verdict.state, ICONS[verdict.state], value, limits, verdict.why)


def _sentences(found: Sequence[tuple[str, str, Verdict]]) -> Iterator[str]:
    for aim in (*AIMS, BIASED, MOST):
        cases = [(where, verdict) for name, where, verdict in found if name == aim]
        if not cases:
            continue
        parts = []
        for state in aims.STATES:
            held = [(where, verdict) for where, verdict in cases if verdict.state == state]
            if not held:
                continue
            if len(held) == len(cases) and len(cases) > 1:
                many = "both cases" if len(cases) == 2 else f"all {len(cases)} cases"
                parts.append(f"{state} in {many}")
            elif state == aims.REACHED and len(cases) > 1:
                parts.append(f"{state} in {len(held)} of {len(cases)} cases")
            else:
                named = (f"{where} ({cell(aim, verdict).value})" for where, verdict in held)
                parts.append(f"{state} {'in ' if aim in AIMS else ''}{', '.join(named)}")
        yield f"{aim}: {'; '.join(parts)}."
