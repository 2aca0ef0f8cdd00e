"""What an audit found, in plain words: every sentence is made from the numbers.

Nothing is written beforehand for one outcome. A group is compared, never blamed; what is not
known is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from evenhand.audits.show.wording import (
    HAPPENED,
    NOT_KNOWN,
    About,
    OfGroup,
    delta,
    last,
    level,
    number,
    of_groups,
    p_value,
    points,
    rounded_up,
    same,
    seconds,
    services,
    share,
    shown,
    who,
)
from evenhand.core.wording import SPACE, joined
from evenhand.statistics.verdicts import DISPARITY, INSUFFICIENT, NO_EVIDENCE

if TYPE_CHECKING:
    from evenhand.audits.judge.results import (
        Finding,
        Findings,
        MeasureFinding,
        Resemblance,
        WaitFinding,
    )


@dataclass(frozen=True)
class Summary:
    """A finished audit as sentences.

    Attributes:
        verdict: of the whole log, one sentence.
        disparities: one for each, the largest first.
        unknown: what is not known yet, one for each group.
        total: the total issue score beside what chance gives.
        waiting: where groups wait differently.
        measures: where a further measure differs.
        resemblance: what the detector sees, one an identity, then what that means.
        limits: (head, text) of each.
    """

    verdict: str
    disparities: tuple[str, ...]
    unknown: tuple[str, ...]
    total: str
    waiting: tuple[str, ...]
    measures: tuple[str, ...]
    resemblance: tuple[str, ...]
    limits: tuple[tuple[str, str], ...]


def summary(findings: Findings, about: About) -> Summary:
    """All sentences of an audit."""
    return Summary(
        verdict=verdict_sentence(findings),
        disparities=tuple(disparity_sentences(findings, about.within)),
        unknown=tuple(unknown_sentences(findings.findings)),
        total=total_sentence(findings),
        waiting=tuple(waiting_sentences(findings, about)),
        measures=tuple(measure_sentences(findings)),
        resemblance=tuple(resemblance_sentences(findings.resemblance, about)),
        limits=tuple(limits(findings, about)),
    )


def text(told: Summary) -> str:
    """The summary for a terminal or a text file."""
    parts = [
        ("", (told.verdict,)),
        ("Disparities", told.disparities),
        ("Not known yet", told.unknown),
        ("Total", (told.total,)),
        ("Waiting", told.waiting),
        ("Measures", told.measures),
        ("Resemblance", told.resemblance),
        ("Limits", tuple(f"{head} {said}" for head, said in told.limits)),
    ]
    blocks = []
    for head, sentences in parts:
        if not sentences:
            continue
        blocks.append(
            "\n".join([f"{head}:", *(f"- {s}" for s in sentences)] if head else sentences)
        )
    return "\n\n".join(blocks)


# --- sentences ------------------------------------------------------------------------------------


def _mirrored(items: Sequence[OfGroup], defined: Sequence[bool]) -> dict[tuple[str, str], str]:
    """The only other group of each group whose identity has two that can be compared."""
    groups: dict[str, list[str]] = {}
    for one, known in zip(items, defined, strict=True):
        found = groups.setdefault(one.identity, [])
        if known and one.group not in found:
            found.append(one.group)
    pairs = {identity: found for identity, found in groups.items() if len(found) == 2}
    return {
        (identity, found[place]): found[1 - place]
        for identity, found in pairs.items()
        for place in (0, 1)
    }


def verdict_sentence(findings: Findings) -> str:
    """What the log as a whole shows."""
    verdicts = [one.verdict for one in findings.findings]
    whole, unequal = len(verdicts), verdicts.count(DISPARITY)
    enough, few = verdicts.count(NO_EVIDENCE), verdicts.count(INSUFFICIENT)
    open_ = f"; in {few:,} there are too few services to tell" if few else ""
    of = f"{whole:,} comparison{'s' if whole != 1 else ''} of a group with the others"
    if findings.verdict == DISPARITY:
        risk = f"{100 * findings.settings.verdict.alpha:g}{SPACE}%"
        return (
            f"Disparity: in {unequal:,} of {of}, the difference is larger than chance explains "
            f"(risk of any false alarm at most {risk}){open_}."
        )
    if findings.verdict == NO_EVIDENCE:
        return (
            f"No evidence of uneven service: in {enough:,} of {of}, a difference of "
            f"{delta(findings)} would probably have been found, and none was{open_}."
        )
    return (
        f"Insufficient data: in none of {of} are there enough services to find a difference of "
        f"{delta(findings)}."
    )


def disparity_sentences(findings: Findings, within: str = "") -> list[str]:
    """One for each disparity, the largest first; two groups of one identity share theirs.

    ``within`` names the strata, if there are any.
    """
    listed = findings.findings
    said: list[tuple[float, str]] = []
    seen: set[tuple[str, str, str]] = set()
    for issue in dict.fromkeys(one.issue for one in listed):
        these = [one for one in listed if one.issue == issue]
        other = _mirrored(these, [not math.isnan(one.difference) for one in these])
        unequal = [one for one in these if one.verdict == DISPARITY]
        for one in sorted(unequal, key=lambda found: -found.difference):
            twin = other.get((one.identity, one.group))
            if twin is not None and (one.identity, twin, issue) in seen:
                continue
            seen.add((one.identity, one.group, issue))
            said.append((abs(one.difference), _disparity(findings, one, twin, within)))
    return [sentence for _, sentence in sorted(said, key=lambda pair: -pair[0])]


def _disparity(findings: Findings, one: Finding, twin: str | None, within: str) -> str:
    happened, kind = HAPPENED.get(one.issue, (f"met {shown(one.issue)}", "services"))
    rest = "the others" if twin is None else f"“{shown(twin)}”"
    more = "more" if one.difference > 0 else "less"
    like = f"{same(within)}, " if within else ""
    gap = f"{like}{100 * abs(one.difference):.1f} percentage points {more}"
    sure = f"{level(findings)} interval {points(one.low)} to {points(one.high)}"
    return (
        f"{who(one)} {happened} in {share(one.rate)} of {services(one.n, kind)}, {rest} in "
        f"{share(one.rest_rate)} of {one.rest_n:,}: {gap} ({sure}; "
        f"adjusted p{SPACE}{p_value(one.p_adjusted, sign=True)})."
    )


def unknown_sentences(listed: Sequence[Finding]) -> list[str]:
    """For each group what is not known yet, and how many services would do."""
    said = []
    for identity, group in dict.fromkeys((one.identity, one.group) for one in listed):
        few = [
            one
            for one in listed
            if (one.identity, one.group, one.verdict) == (identity, group, INSUFFICIENT)
        ]
        some = [one for one in few if not math.isnan(one.difference)]
        if some:
            needed = [one.needed for one in some if not math.isnan(one.needed)]
            do = f"; a log of about {rounded_up(max(needed)):,} services would do" if needed else ""
            sizes = (
                f"{services(max(one.n for one in some))}, {max(o.rest_n for o in some):,} others"
            )
            said.append(
                f"{who(some[0])}, {sizes}: too few to tell for "
                f"{joined([shown(one.issue) for one in some])}{do}."
            )
        empty = [one for one in few if math.isnan(one.difference)]
        if empty:
            others = "others of the same stratum" if empty[0].rest_n else "others"
            said.append(
                f"{who(empty[0])}: no service of {others if empty[0].n else 'this group'} says "
                f"anything of {joined([shown(one.issue) for one in empty])}."
            )
    return said


def total_sentence(findings: Findings) -> str:
    """The total issue score beside what an even robot would get by chance."""
    if math.isnan(findings.total):
        return f"The total issue score of the log is {NOT_KNOWN}."
    return (
        f"The total issue score of the log is {number(findings.total)}; serving everybody alike "
        f"would give {number(findings.even_total)} on average, by chance "
        f"(p{SPACE}{p_value(findings.p_total, sign=True)})."
    )


def waiting_sentences(findings: Findings, about: About) -> list[str]:
    """Groups that wait differently, then how many do not; nothing if the log does not tell."""
    listed = findings.waits
    alpha = findings.settings.verdict.alpha
    limit = "the limit" if math.isnan(about.late) else seconds(about.late)
    other = _mirrored(listed, [not math.isnan(one.p) for one in listed])
    said, seen, alike = [], set(), 0
    for one in listed:
        if math.isnan(one.p) or one.p > alpha:
            alike += not math.isnan(one.p)
            continue
        twin = other.get((one.identity, one.group))
        if (one.identity, twin) in seen:
            continue
        seen.add((one.identity, one.group))
        said.append(_waiting(findings, one, twin, limit, about.within))
    if alike:
        like = f" {same(about.within)}" if about.within else ""
        said.append(f"For {of_groups(alike)} no difference in waiting{like} was found.")
    lost = sum(math.isnan(one.p) for one in listed)
    if lost:
        said.append(f"For {of_groups(lost)} the waiting could not be compared.")
    return said


def _waiting(
    findings: Findings, one: WaitFinding, twin: str | None, limit: str, within: str
) -> str:
    rest = "the others" if twin is None else f"“{shown(twin)}”"
    like = f"{same(within)} " if within else ""
    return (
        f"After {limit}, {share(one.unserved)} of {who(one)} still waited, of {rest} "
        f"{share(one.rest_unserved)} ({like}{points(one.difference)} points, {level(findings)} "
        f"interval {points(one.low)} to {points(one.high)}); whole waiting times differ, adjusted "
        f"log-rank p{SPACE}{p_value(one.p, sign=True)}."
    )


def measure_sentences(findings: Findings) -> list[str]:
    """Groups with another mean or median of a measure, then how many have not."""
    alpha = findings.settings.verdict.alpha
    said = []
    for name in dict.fromkeys(one.measure for one in findings.measures):
        these = [one for one in findings.measures if one.measure == name]
        unequal = [one for one in these if min(last(one.mean_p), last(one.median_p)) <= alpha]
        said += [_measure(one, alpha) for one in unequal]
        lost = sum(math.isnan(one.mean_p) and math.isnan(one.median_p) for one in these)
        if len(these) - len(unequal) - lost:
            alike = of_groups(len(these) - len(unequal) - lost)
            said.append(f"{shown(name)}: for {alike} no difference of mean or median was found.")
        if lost:
            said.append(f"{shown(name)}: for {of_groups(lost)} it could not be compared.")
    return said


def _measure(one: MeasureFinding, alpha: float) -> str:
    parts = [
        f"{what} {number(mine)}, of the others {number(rest)} "
        f"(adjusted p{SPACE}{p_value(p, sign=True)})"
        for what, mine, rest, p in (
            ("mean", one.mean, one.rest_mean, one.mean_p),
            ("median", one.median, one.rest_median, one.median_p),
        )
        if last(p) <= alpha
    ]
    return f"{shown(one.measure)} of {who(one)}, {services(one.n)}: {'; '.join(parts)}."


def resemblance_sentences(listed: Sequence[Resemblance], about: About) -> list[str]:
    """What the detector sees in each identity, then what that does and does not mean."""
    said = []
    for one in listed:
        name = shown(one.identity)
        if math.isnan(one.biased):
            said.append(f"{name}: the detector could not judge it.")
            continue
        rates = (
            f"it calls {share(one.biased)} of windows of 30 services biased, and "
            f"{share(one.biased_even)} when outcomes are shuffled among people"
        )
        said.append(
            f"{name}: the detector names no discrimination; {rates}."
            if one.looks_like is None
            else f"{name}: to the detector the pattern looks like {shown(one.looks_like)}; {rates}."
        )
    if said:
        said.append(
            f"The detector repeats which patterns of the four issues {shown(about.judges)} called "
            "by which name. It does not see which identity it is shown, so that the name need not "
            "fit the identity. A likeness is no test, says nothing of intent or cause, and does "
            "not change the verdict."
        )
    return said


def limits(findings: Findings, about: About) -> list[tuple[str, str]]:
    """What this audit does not show, as (head, text)."""
    said = []
    if about.synthetic:
        said.append(
            ("The log is synthetic.", "It says so itself: no real person was served, and nothing "
             "here describes a real robot.")
        )  # fmt: skip
    said += [
        ("Association is not cause.", "A difference may come from when, where or for what people "
         "were served. It says where to look, not why it is so."),
        ("No evidence is not evenness.", f"Differences smaller than {delta(findings)} may be there "
         "and stay unseen; where data are insufficient, larger ones too."),
        ("Even is not good.", "A robot that fails everybody alike shows no disparity: read the "
         "rates beside the differences."),
        ("Issues depend on thresholds.", "Other limits of time and distance can give other "
         "findings. Those used here stand with the mapping."),
        ("Services count as independent.", "Somebody served many times counts many times, which "
         "makes the findings look surer than they are."),
        ("Groups are those of the log.", "How people came to be labelled is not examined; who is "
         "not in the log is not seen."),
    ]  # fmt: skip
    if about.within:
        said.append(
            ("Strata.", "Differences, their intervals and p-values compare services "
             f"{same(about.within)}; rates, shares still waiting, means, medians and the total are "
             "of the whole log.")
        )  # fmt: skip
    said += [("Left out.", shown(sentence)) for sentence in about.left_out]
    return said
