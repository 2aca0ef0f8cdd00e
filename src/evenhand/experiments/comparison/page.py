"""The page of a comparison: from its tables to figures and one HTML file.

Takes: a folder with ``results.csv``, ``summary.csv``, ``fronts.csv`` and ``manifest.json``. Gives:
``figures/*`` and ``report.html`` in the same folder. The page needs no network, no script and no
other file. Nothing here simulates or learns.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from evenhand.core import files
from evenhand.experiments.comparison import figures as figures_compare
from evenhand.experiments.comparison import figures_fronts, judged_aims, read, words
from evenhand.experiments.comparison.read import Comparison
from evenhand.experiments.comparison.settings import computed
from evenhand.report import page as html
from evenhand.report.figure import Drawn, write

_AIMS = ("corrected_total", "perfect_rate")


def build(folder: Path | str) -> Path:
    """Draw the figures and write the report of a comparison.

    The same tables give the same bytes. Each file is written aside and renamed, so that a
    report which stands is whole.

    Returns:
        The path of ``report.html``.

    Raises:
        InputError: a table is missing or malformed (file, row and column are named), or the
            folder cannot be written.
    """
    folder = Path(folder)
    comparison = read.read(folder)
    figures = files.make_folder(folder / "figures")
    services = comparison.manifest["settings"]["services"]
    drawn = figures_compare.draw_all(_side_by_side(comparison), services)
    drawn += figures_fronts.draw_all(comparison.fronts)
    page = render(comparison, drawn)
    write(figures, drawn)
    target = folder / "report.html"
    files.write_text(target, page)
    return target


def _side_by_side(c: Comparison) -> list[Mapping[str, Any]]:
    rows: list[Mapping[str, Any]] = []
    for scenario in c.scenarios:
        for algorithm in (read.NO_ALGORITHM, *c.algorithms):
            for arm in c.arms:
                if not c.has(scenario, algorithm, arm):
                    continue
                found = {aim: c.estimate(scenario, algorithm, arm, aim) for aim in _AIMS}
                row: dict[str, Any] = {"scenario": scenario, "algorithm": algorithm, "arm": arm}
                row["seeds"] = found["corrected_total"].n
                for aim, one in found.items():
                    row |= {aim: one.mean, f"{aim}_low": one.low, f"{aim}_high": one.high}
                rows.append(row)
    return rows


def render(comparison: Comparison, drawn: Sequence[Drawn]) -> str:
    """The whole page."""
    manifest = comparison.manifest
    commit = manifest["commit"]
    return html.fill(
        "compare.html.j2",
        Path(__file__).parent / "templates",
        manifest=manifest,
        facts=_facts(comparison),
        arms=len(comparison.arms),
        places=len(comparison.scenarios),
        names=", ".join(comparison.scenarios),
        learners=_learners(comparison),
        judged=judged_aims.judge(comparison),
        aims=judged_aims.AIMS,
        added=judged_aims.added(comparison),
        figures=[html.figure_context(figure) for figure in drawn],
        scenarios=words.scenario_table(comparison),
        measures=[head for head, _, _ in words.MEASURES],
        full=words.full_table(comparison),
        full_heads=words.FULL_HEADS,
        limits=list(words.limits(comparison)),
        scored=words.scored(comparison),
        one_seed=comparison.seed_counts == [1],
        settings=html.flat(manifest["settings"]),
        versions=html.flat(manifest["versions"]),
        commit=html.flat(commit) if commit else [],
    )


def _facts(c: Comparison) -> list[tuple[str, str]]:
    manifest = c.manifest
    settings, counts, seeds = manifest["settings"], c.seed_counts, c.seeds
    many = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    which = f"{seeds[0]}" if len(seeds) == 1 else f"{seeds[0]} to {seeds[-1]}"
    runs = {tuple(row[n] for n in ("scenario", "algorithm", "arm", "seed"))
            for row in c.results.rows()}  # fmt: skip
    earlier = manifest["earlier"] or {}
    here = manifest["runs"] > 0 or not earlier
    commit = manifest["commit"] if here else earlier.get("commit")
    known = f"{str(commit.get('hash', ''))[:10]}" if commit else "not known"
    took = _hours(manifest["run_seconds"]) if here else ""
    if earlier:
        spent = computed(earlier)
        before = "not known" if spent is None else _hours(spent)
        took = f"{took}, and earlier {before}" if here else before
    return [
        ("Written", manifest["created"]),
        ("Runs", f"{len(runs):,}" + ("" if here else ", all from an earlier comparison")),
        ("Seeds an arm", f"{many} (from {which})"),
        ("Learning", f"{settings['epochs']:,} epochs × {manifest['people']} services"),
        ("Test", f"{settings['services']:,} services a run"),
        ("Computing", took),
        ("Commit", known + (", with changes" if commit and commit.get("changed") else "")),
    ]


def _learners(c: Comparison) -> str:
    labels = [judged_aims.algorithm_label(name) for name in c.algorithms]
    return f" with {' and '.join(labels)}" if labels else ""


def _hours(seconds: float) -> str:
    return f"{seconds / 3600:,.1f} h" if seconds >= 7200 else html.duration(seconds)
