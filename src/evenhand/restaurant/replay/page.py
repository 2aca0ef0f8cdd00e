"""The page: one HTML file with everything in it, which asks the network for nothing."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from evenhand import __version__
from evenhand.core import files, templates
from evenhand.core.errors import InputError
from evenhand.methods.paper import issues
from evenhand.methods.paper.issues import PAPER_ISSUES, Issue
from evenhand.methods.services import Services
from evenhand.restaurant import floor_plan
from evenhand.restaurant.replay import looks, services
from evenhand.restaurant.simulation.recording import Recording

SCRIPT = Path(__file__).parent / "static" / "replay.js"
"""What draws and plays, built from ``frontend/``; it is not in git."""
TITLE = "Services, replayed"

_TEMPLATES = Path(__file__).parent / "templates"


def write(
    recording: Recording,
    table: Services,
    path: str | os.PathLike[str],
    *,
    title: str = TITLE,
    note: str = "",
    named: Sequence[Issue] = PAPER_ISSUES,
) -> Path:
    """Write recorded services as one page that can be played, sought and filtered.

    The file needs no network and no other file; the same services give the same bytes. A page can
    be opened at a service: ``replay.html#service-17``.

    Args:
        recording: 1 to 300 services, in the order in which they are listed.
        table: the table that holds their rows, and may hold others.
        path: of the HTML file.
        title: of the page; plain text.
        note: stands under the title, for instance how the services were chosen; plain text.
        named: issues of the world.

    Returns:
        The path.

    Raises:
        InputError: for no service or too many, a service without a row, a script that has not
            been built, or a file that cannot be written.
    """
    if not 1 <= len(recording) <= services.MOST:
        raise InputError(
            "range services",
            f"{len(recording)} services are to be replayed: name 1 to {services.MOST} of them",
        )
    script = read_script()
    page = render(payload(recording, table, named), script, title, note, named)
    target = Path(path)
    files.write_text(target, page)
    return target


def read_script() -> str:
    """The built script.

    Raises:
        InputError: when it has not been built.
    """
    try:
        return SCRIPT.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(
            "unavailable script",
            "this copy of Evenhand lacks the script of its replay page "
            "(restaurant/replay/static/replay.js): run `python frontend/build.py` in the checkout, "
            "or `make`, or install a released wheel",
        ) from None


def payload(
    recording: Recording, table: Services, named: Sequence[Issue] = PAPER_ISSUES
) -> dict[str, Any]:
    """Everything that the script is told, as JSON holds it.

    Raises:
        InputError: when a service has no row.
    """
    rows = table.take(services.rows_of(recording, table))
    guests = looks.figures(recording)
    limits = issues.Thresholds()
    packed = services.pack(recording, rows, named)
    for row, service in enumerate(packed):
        service["shape"] = guests.shape[row].tolist()
        service["coat"] = guests.coat[row].tolist()
    identities = {name: list(rows.identity(name)[1]) for name in rows.identities}
    return {
        "grid": services.GRID,
        "turn_grid": services.TURN_GRID,
        "nothing": services.NOTHING,
        "interval": recording.interval,
        "timestep": floor_plan.TIMESTEP,
        "most_steps": floor_plan.MAX_STEPS,
        "limits": {
            "nearest": limits.nearest,
            "farthest": limits.farthest,
            "risk": limits.risk,
        },
        "issues": [issue.name for issue in named],
        "identities": identities,
        "scene": looks.still(),
        "figures": guests.shapes,
        "coats": guests.coats,
        "colours": guests.colours,
        "services": packed,
    }


def render(
    content: dict[str, Any],
    script: str,
    title: str,
    note: str = "",
    named: Sequence[Issue] = PAPER_ISSUES,
) -> str:
    """The page as text.

    Args:
        content: as ``payload`` makes it.
        script: as ``read_script`` reads it.
        title: of the page; plain text.
        note: stands under the title; plain text.
        named: issues of the world.
    """
    limits = issues.Thresholds()
    return templates.fill(
        "replay.html.j2",
        _TEMPLATES,
        title=title,
        note=note,
        paper=[issue.name for issue in named if issue in PAPER_ISSUES],
        own=[issue.name for issue in named if issue not in PAPER_ISSUES],
        drawn=[name for name in ("age", "disability", "skin") if name in content["identities"]],
        undrawn=[
            name for name in content["identities"] if name not in ("age", "disability", "skin")
        ],
        limits={
            "risk": limits.risk,
            "nearest": limits.nearest,
            "farthest": limits.farthest,
            "late_step": f"{limits.late:.0f}",
            "late": limits.late * floor_plan.TIMESTEP,
        },
        version=__version__,
        count=len(content["services"]),
        style=Markup((_TEMPLATES / "style.css").read_text(encoding="utf-8")),
        data=Markup(as_json(content)),
        script=Markup(script),
    )


def as_json(content: Any) -> str:
    """JSON that can stand inside a script element: nothing in it ends or opens an element."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"), ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
