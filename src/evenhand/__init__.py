"""Evenhand: software for robots that serve people evenly."""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "AuditSettings": "evenhand.audits.results",
    "Detector": "evenhand.detector",
    "InputError": "evenhand.errors",
    "Interactions": "evenhand.interactions",
    "JudgeServices": "evenhand.adapters",
    "JudgeVectorServices": "evenhand.adapters",
    "RestaurantEnv": "evenhand.restaurant.env",
    "RestaurantVectorEnv": "evenhand.restaurant.vector",
    "Scheme": "evenhand.schemes",
    "ScriptedRobot": "evenhand.robots",
    "Thresholds": "evenhand.issues",
    "TrainSettings": "evenhand.learn.settings",
    "audit": "evenhand.audits.api",
    "load_detector": "evenhand.detector_io",
    "paper_issues": "evenhand.issues",
    "score": "evenhand.issues",
    "train": "evenhand.learn.train",
}
"""Public name -> where it lives; imported when first asked for: `import evenhand` is light."""

__all__ = ["__version__", *_PUBLIC]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'evenhand' has no attribute {name!r}")
    module = importlib.import_module(_PUBLIC[name])
    return getattr(module, "load" if name == "load_detector" else name)
