"""Room: what a comparison cannot say, and its scenarios. Takes: the tables. Gives: text. Pure.

Every sentence about this comparison is composed from its numbers.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import isnan
from typing import Any

import numpy as np

from evenhand.core import files
from evenhand.core.wording import NOT_DEFINED, percent
from evenhand.experiments.comparison.aims import EIGHT
from evenhand.experiments.comparison.figures import POOLED, looks
from evenhand.experiments.comparison.judged_aims import algorithm_label, interval
from evenhand.experiments.comparison.read import NO_ALGORITHM, Comparison, arm_label
from evenhand.experiments.comparison.settings import UNTUNED
from evenhand.methods.vocabulary import ISSUES
from evenhand.report.table import say
from evenhand.restaurant.people import GROUPS, IDENTITIES
from evenhand.statistics.means import Estimate

SEEDS, SERVICES = 10, 5000
"""What the aims ask for."""
FIVE = 5
"""Below this many values a bootstrap interval is clearly too narrow."""
MECHANISMS = {
    "even": "nothing is uneven",
    "prejudiced": "the policy first imitates biased scripted robots",
    "perception": "children are missed more often, and height misleads the sensor",
    "minority": "few elders and wheelchair users, with other needs",
    "tips": "the operator's reward pays by age",
    "everyday": "perception, minority and tips at half strength",
    "hidden": "perception, and the policy is not told whom it serves",
    "hurry": "two people at a time share the robot's time, with needs as in minority",
    "what-if-skin": "the sensor misses dark skin more often, which is a what-if without a source",
}
ROBOTS = ("untrained", "unaware", "service", "blind", "reference")
MEASURES = (
    ("Corrected total", "corrected_total", False),
    ("Raw total", "raw_total", False),
    ("Perfect services", "perfect_rate", True),
    ("Worst-served group", "worst_group_rate", True),
    ("Corrected total by imperfect services", "per_imperfect", False),
)
FULL_HEADS = (
    "algorithm", "arm", "metric", "seeds", "interquartile mean", "difference to service alone",
    "difference to a cost without groups", "probability of improvement",
    "share of what is attainable",
)  # fmt: skip


@dataclass(frozen=True)
class Number:
    """An estimate as text."""

    value: str
    interval: str


def number(estimate: Estimate, share: bool = False) -> Number:
    """An estimate as text; missing in words."""
    tell = percent if share else say
    return Number(tell(estimate.mean), interval(estimate, tell))


def mechanism(scenario: str) -> str:
    """Where unevenness comes from; scenarios are joined by a plus."""
    return "; ".join(MECHANISMS[name] for name in scenario.split("+") if name in MECHANISMS)


def scenario_table(c: Comparison) -> list[tuple[str, str, list[tuple[str, list[Number]]]]]:
    """How uneven four robots are: (scenario, mechanism, lines of (robot, numbers))."""
    found = []
    for scenario in c.scenarios:
        lines = []
        for arm in ROBOTS:
            for algorithm in (NO_ALGORITHM, *c.algorithms):
                if not c.has(scenario, algorithm, arm):
                    continue
                label = ", ".join(filter(None, (arm_label(arm), algorithm_label(algorithm))))
                cells = [
                    number(c.estimate(scenario, algorithm, arm, metric), share)
                    for _, metric, share in MEASURES
                ]
                lines.append((label, cells))
        if lines:
            found.append((scenario, mechanism(scenario), lines))
    return found


def scored(c: Comparison) -> str:
    """What a total is made of: issues and identities, those of own worlds by their scenario."""
    paper = f"{', '.join(ISSUES)} over {len(GROUPS)} groups"
    parts = []
    for scenario in c.scenarios:
        world = c.manifest.get("worlds", {}).get(scenario, {})
        if not {"issues", "identities"} & {*world}:
            parts.append(paper)
            continue
        issues = ", ".join(world.get("issues", ISSUES))
        people = [one[0] for one in world.get("identities", ())] or [i.name for i in IDENTITIES]
        groups = sum(len(one) - 1 for one in world.get("identities", ())) or len(GROUPS)
        parts.append(f"in {scenario} {issues} over {groups} groups of {', '.join(people)}")
    return "; ".join(dict.fromkeys(parts)) or paper


def full_table(c: Comparison) -> list[tuple[str, list[list[str]]]]:
    """``summary.csv`` as text, by scenario: one line an arm and metric."""
    found: dict[str, list[list[str]]] = {}
    for row in c.summary.rows():
        head = "all scenarios but even" if row["scenario"] == POOLED else row["scenario"]
        cells = [algorithm_label(row["algorithm"]), arm_label(row["arm"])]
        of_all = f" of {c.manifest['settings']['epochs']}"
        cells.append(row["metric"].replace("_", " "))
        cells[-1] += of_all if row["metric"] == "biased_epochs" else ""
        cells.append(str(row["seeds"]))
        key = (row["scenario"], row["algorithm"], row["arm"], row["metric"])
        for of in ("iqm", "difference", "to_blind", "improvement", "share"):
            if of != "iqm" and isnan(row[of]):  # nothing to compare with
                cells.append("")
                continue
            value = number(c.estimate(*key, of=of))
            cells.append(f"{value.value} {value.interval}".strip())
        found.setdefault(head, []).append(cells)
    return list(found.items())


def limits(c: Comparison) -> Iterator[tuple[str, str]]:
    """What this comparison cannot say: (head, sentences)."""
    yield from _seeds(c)
    settings = c.manifest["settings"]
    if settings["services"] < SERVICES:
        yield (
            "Short tests.",
            f"{settings['services']:,} services a run, where the aims ask for {SERVICES:,}: small "
            "groups are few, and chance weighs more.",
        )
    lacking = [name for name in EIGHT if name not in c.scenarios]
    if lacking:
        yield "Scenarios not run.", f"{', '.join(lacking)}: nothing here is about them."
    known, there = looks(), _methods(c)
    without = [known[name].label for name in known if name not in (*UNTUNED, *there)]
    if without:
        yield "Arms not run.", f"{', '.join(without)}."
    missing = _missing(c)
    if missing:
        yield (
            "Missing numbers.",
            f"{missing:,} of {len(c.results):,} numbers of runs are not defined (for instance a "
            "rate among nobody). They are left out, never counted as 0.",
        )
    strengths = {
        known[row["method"]].label: len(row["arms"].split()) for row in c.fronts.rows()
        if row["algorithm"] != NO_ALGORITHM
    }  # fmt: skip
    if len(set(strengths.values())) > 1:
        most = max(strengths.values())
        named = [name for name, count in strengths.items() if count == most]
        yield (
            "Unequal numbers of strengths.",
            f"{', '.join(named)} ran with {most} strengths, others with fewer. A hypervolume over "
            "more strengths has more chances, so these are not quite comparable.",
        )
    commit = c.manifest["commit"]
    ran = c.manifest["runs"] or not c.manifest["earlier"]
    if ran and (commit is None or commit.get("changed")):
        yield (
            "Code.",
            "No commit is known for the code that ran."
            if commit is None
            else "The code had been changed since the commit that is named.",
        )
    earlier = c.manifest["earlier"]
    if earlier:
        code = (earlier.get("commit") or {}).get("hash")
        yield (
            "Earlier runs.",
            f"{'Some' if c.manifest['runs'] else 'All'} runs were taken from a comparison of "
            f"{earlier.get('created', NOT_DEFINED)}, version {earlier.get('version', NOT_DEFINED)}"
            f"{f', commit {code[:10]}' if code else ''}.",
        )
    yield from _origins(c)


def _origins(c: Comparison) -> Iterator[tuple[str, str]]:
    """Versions and commits, where runs were not all made with the same."""
    noted: Any = c.manifest
    versions, commits = [], []
    while isinstance(noted, Mapping):  # an earlier comparison may have had an earlier one
        for one in noted.get("made_with", [noted]):
            versions.append(one.get("versions"))
            commits.append((one.get("commit") or {}).get("hash"))
        versions.append(noted.get("versions"))
        noted = noted.get("earlier")
    here = c.manifest["versions"] | {"python": ""}
    others = [files.differences(v | {"python": ""}, here) for v in versions if isinstance(v, dict)]
    for differs in dict.fromkeys(filter(None, others)):
        yield (
            "Other versions.",
            f"Earlier runs were made with other versions than the last call ({differs}). Numbers "
            "of other versions may be others.",
        )
    known = [commit[:10] for commit in dict.fromkeys(commits) if commit]
    if len(set(commits)) > 1:
        more = " Of some runs it is not known." if None in commits else ""
        yield "Several commits.", f"Runs were made by the code of {', '.join(known)}.{more}"


def _seeds(c: Comparison) -> Iterator[tuple[str, str]]:
    counts = c.seed_counts
    least, most = (counts[0], counts[-1]) if counts else (0, 0)
    if least < SEEDS:
        n = f"{least}" if least == most else f"{least} to {most}"
        text = f"{n} {'seed' if most == 1 else 'seeds'} an arm, where the aims ask for {SEEDS}."
        if least < 2:
            text += " With one seed there is no interval, and no aim can be told."
        if 2 <= most < FIVE or 2 <= least < FIVE:
            text += (
                " An interval drawn from so few values lies within them and is too narrow: read "
                "it as the range of what was seen."
            )
        yield "Few seeds.", text
    if least != most:
        yield (
            "Unequal seeds.",
            f"Arms have {least} to {most} seeds. Differences and shares use the seeds that both "
            "sides have; interquartile means use all of their own. Rows of all scenarios use the "
            "seeds that an arm has in each of them, so that every scenario counts alike.",
        )


def _methods(c: Comparison) -> set[str]:
    return {arm.partition("@")[0] for arm in c.arms}


def _missing(c: Comparison) -> int:
    untrained = (c.results["algorithm"] == NO_ALGORITHM) & (c.results["metric"] == "biased_epochs")
    return int((np.isnan(c.results["value"]) & ~untrained).sum())
