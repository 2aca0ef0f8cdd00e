"""Options that several commands have; what one means to a command stands under its field."""

from __future__ import annotations

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
Population = Annotated[str | None, arg(metavar="uniform|us|fairface", help_behavior_hint=OPTIONAL)]
