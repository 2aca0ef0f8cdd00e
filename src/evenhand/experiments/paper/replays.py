"""Services to look at beside the report: of each preset one run, as a page to step through."""

from __future__ import annotations

from pathlib import Path

from evenhand.core import files
from evenhand.restaurant import replay
from evenhand.training import recordings, run_folder

SHOWN = {"paper": ("ppo", 0), "service": ("ppo+levelup", 0)}
"""Preset -> arm and seed: what the printed reward leads to, and what Evenhand's guidance does."""


def page_of(out: Path, preset: str, arm: str, seed: int) -> Path | None:
    """Where the page of a run stands; None for a run that has none."""
    if SHOWN.get(preset) != (arm, seed):
        return None
    return out / "replays" / f"{preset}-{arm}-seed-{seed}.html"


def write(folder: Path, page: Path) -> None:
    """Write the page of a finished run, once.

    Raises:
        InputError: when the run was not recorded, or the page cannot be written.
    """
    if page.exists():
        return
    table = run_folder.read_services(folder)
    seen = recordings.read(folder, replay.choose(table))
    files.make_folder(page.parent)
    replay.write(
        seen,
        table,
        page,
        title=f"After training: {page.stem}",
        note=(
            f"The run served {len(table):,} people. These are of the latest, chosen so that every "
            "issue there is can be seen: they are no sample."
        ),
    )


def links(out: Path) -> list[dict[str, str]]:
    """The pages that are there: address beside the report, preset, arm, seed."""
    return [
        {"page": f"replays/{page.name}", "preset": preset, "arm": arm, "seed": str(seed)}
        for preset, (arm, seed) in SHOWN.items()
        if (page := page_of(out, preset, arm, seed)) is not None and page.exists()
    ]
