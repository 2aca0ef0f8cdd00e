"""Options that several commands have; what one means to a command stands under its field."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

OPTIONAL = "(optional)"
RunFolder = Annotated[Path | None, arg(metavar="RUN", help_behavior_hint=OPTIONAL)]
Robot = Annotated[str | None, arg(metavar="NAME", help_behavior_hint=OPTIONAL)]
Strength = Annotated[float | None, arg(metavar="FLOAT", help_behavior_hint="(default: 1)")]
Plugin = Annotated[
    tuple[Path, ...],
    arg(
        metavar="FILE ...",
        help="Python files of your own that add methods, scenarios or policies.",
        help_behavior_hint=OPTIONAL,
    ),
]
Scenario = Annotated[str | None, arg(metavar="NAME[+NAME]", help_behavior_hint=OPTIONAL)]
SCENARIOS = "even, prejudiced, perception, minority, tips, everyday"


def registered(module: str, names: str) -> str:
    """Names of what can be chosen, with those that plugins have registered.

    Args:
        module: that holds the registry; imported only by plugins, since a help need not wait.
        names: that Evenhand brings.
    """
    loaded = sys.modules.get(module)
    return names if loaded is None else ", ".join(loaded.names())


def scenario_help(otherwise: str = "") -> str:
    """Help of an option that names a scenario."""
    names = registered("evenhand.restaurant.worlds", SCENARIOS)
    return f"""Where people are served: {names}.
    Several are joined by a plus: perception+tips. {otherwise}""".rstrip()


Population = Annotated[str | None, arg(metavar="uniform|us|fairface", help_behavior_hint=OPTIONAL)]
