"""The page of the paper's experiment, from results and drawn figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evenhand.experiments.paper.report import summary
from evenhand.experiments.paper.report.results import STATUSES
from evenhand.report.figure import Drawn
from evenhand.report.page import NOT_PRINTED, duration, figure_context, fill, flat, value_text
from evenhand.report.read_tables import Results

_ICONS: dict[str, str] = dict(zip(STATUSES, "✓✓✗=?–", strict=True))


SECTIONS = {
    "learning": (
        "Learning and test",
        "Two learning algorithms, each with and without guidance by the detector. A score of "
        "unevenness stands beside the quality of service throughout: neither means much alone.",
    ),
    "detector": (
        "The detector",
        "A logistic regression on three principal components of the four issue scores, fitted to "
        "the judgements of simulated respondents, as the paper describes it.",
    ),
    "study": (
        "The study",
        "The paper asked 24 volunteers and simulated 1,000 judgements from their answers. Their "
        "data are not public; here the respondents are simulated too.",
    ),
    "robots": (
        "The biased robots",
        "Scripted robots that treat the groups of one identity unevenly, each compared with a "
        "robot that treats all groups alike.",
    ),
}


@dataclass(frozen=True)
class Claim:
    """A claim of the paper as text for the page."""

    id: str
    claim: str
    paper: str
    ours: str
    interval: str
    seeds: str
    status: str
    icon: str
    evidence: str


def render(results: Results, drawn: Sequence[Drawn]) -> str:
    """The whole page."""
    manifest = results.manifest
    return fill(
        "report.html.j2",
        Path(__file__).parent / "templates",
        claims=[claim_text(claim) for claim in results.claims],
        counts=[(s, n, _ICONS[s]) for s, n in summary.status_counts(results)],
        paragraphs=summary.paragraphs(results),
        glance=summary.glance(results),
        sections=[
            (name, title, intro, [figure_context(d) for d in drawn if d.plate.section == name])
            for name, (title, intro) in SECTIONS.items()
        ],
        behaviour=summary.behaviour_table(results),
        manifest=manifest,
        settings=flat(manifest["settings"]),
        versions=flat(manifest["versions"]),
        stages=[(name, f"{seconds:,.1f} s") for name, seconds in manifest["stages"].items()],
        elapsed=duration(manifest["elapsed_s"]),
        seeds=", ".join(str(seed) for seed in manifest["seeds"]),
        many_seeds=_many_seeds(manifest),
        replays=manifest.get("replays", ()),  # a folder from before there were any has none
    )


def _many_seeds(manifest: Mapping[str, Any]) -> str:
    counts = {preset: len(seeds) for preset, seeds in manifest.get("seeds_of", {}).items()}
    if len(set(counts.values())) < 2:
        return str(len(manifest["seeds"]))
    return ", ".join(f"{count} ({preset})" for preset, count in counts.items())


def claim_text(claim: Mapping[str, Any]) -> Claim:
    """One entry of claims.json as text; the interval and the seeds only where there are any."""
    interval, seeds = claim["ci95"], claim["seeds"]
    count = len(seeds) if isinstance(seeds, list) else seeds
    return Claim(
        id=claim["id"],
        claim=claim["claim"],
        paper=value_text(claim["paper"], exact=True) if claim["paper"] is not None else NOT_PRINTED,
        ours=value_text(claim["ours"]),
        interval=f"[{value_text(interval[0])}, {value_text(interval[1])}]" if interval else "",
        seeds="" if not count else "1 seed" if count == 1 else f"{count} seeds",
        status=claim["status"],
        icon=_ICONS[claim["status"]],
        evidence=claim["evidence"],
    )
