"""What has to be loaded in the right order.

PyTorch loads Triton, and Triton brings an LLVM of its own. Where Mesa has already loaded another
one to draw pictures, that ends the process; the other way round both work.
"""

# pyright: reportMissingImports=false
from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path

from evenhand.core.errors import InputError


def triton_first() -> None:
    """Load Triton, if it is there, before anything can draw.

    Raises:
        InputError: when something has drawn already, by an LLVM that Triton cannot bear.
    """
    if "triton" in sys.modules or importlib.util.find_spec("triton") is None:
        return
    if "libLLVM" in _loaded():
        raise InputError(
            "unavailable torch",
            "pictures were drawn in this process before PyTorch was loaded, and Mesa and Triton "
            "cannot meet in that order: import evenhand.adapters.sb3 before anything is rendered",
        )
    importlib.import_module("triton")


def _loaded() -> str:
    try:
        return Path("/proc/self/maps").read_text()
    except OSError:
        return ""
