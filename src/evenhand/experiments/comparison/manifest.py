"""What a comparison says of itself: ``manifest.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from evenhand.core import files
from evenhand.experiments import provenance
from evenhand.experiments.comparison import earlier as compare_earlier
from evenhand.experiments.comparison.settings import Cell, CompareSettings, place
from evenhand.experiments.settings import TEST_SEED
from evenhand.restaurant import worlds
from evenhand.training import evaluate


def write(
    out: Path,
    settings: CompareSettings,
    command: str,
    made: provenance.Origin,
    found: Mapping[Cell, dict[str, Any]],
    earlier: compare_earlier.Earlier | None,
    prints: Mapping[str, str],
) -> None:
    """Write it.

    Args:
        out: folder of the comparison.
        settings: of this call.
        command: of this call.
        made: versions and commit of now.
        found: what ``done.json`` says of every finished run, and its ``folder``.
        earlier: runs that were taken from elsewhere.
        prints: fingerprint of each arm's settings.
    """
    plain = {n: v for n, v in asdict(settings).items() if n not in ("out", "earlier")}
    cells = sorted({*found, *(earlier.results if earlier else ())}, key=place)
    seeds = sorted({cell.seed for cell in cells})
    arms = list(dict.fromkeys(cell.arm for cell in cells))
    places = list(dict.fromkeys(cell.scenario for cell in cells))
    origins = [provenance.of_run(done["folder"], done) for done in found.values()]
    files.write_json(
        out / "manifest.json",
        {
            **provenance.heading(made, command),
            "settings": {n: list(v) if isinstance(v, tuple) else v for n, v in plain.items()},
            "versions": made["versions"],
            "made_with": provenance.distinct(origins),
            "runs": len(found),
            "run_seconds": round(sum(done["seconds"] for done in found.values()), 1),
            "earlier": earlier.manifest if earlier else None,
            "scenarios": places,
            "worlds": {name: worlds.scenario(name).described() for name in places},
            "algorithms": list(dict.fromkeys(cell.algorithm for cell in cells)),
            "arms": arms,
            "fingerprints": {arm: prints[arm] for arm in arms},
            "detector": provenance.shipped_detector(),
            "seeds": seeds,
            "test_seeds": [TEST_SEED + seed for seed in seeds],
            "people": evaluate.WINDOW,
        },
    )
