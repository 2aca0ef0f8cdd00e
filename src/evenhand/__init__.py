"""Evenhand: software for robots that serve people evenly."""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "AuditSettings": "evenhand.audits.judge.results",
    "Detector": "evenhand.methods.paper.detector",
    "Guidance": "evenhand.methods.guidance",
    "InputError": "evenhand.core.errors",
    "Interactions": "evenhand.methods.services",
    "JudgeServices": "evenhand.adapters",
    "JudgeVectorServices": "evenhand.adapters",
    "RestaurantEnv": "evenhand.restaurant.env",
    "RestaurantVectorEnv": "evenhand.restaurant.vector",
    "ScaleObservation": "evenhand.restaurant.observation",
    "ScaleVectorObservation": "evenhand.restaurant.observation",
    "Scheme": "evenhand.methods.scheme",
    "ScriptedRobot": "evenhand.restaurant.robots",
    "Thresholds": "evenhand.methods.paper.issues",
    "TrainSettings": "evenhand.training.settings",
    "audit": "evenhand.audits.api",
    "load_detector": "evenhand.methods.detector_file",
    "load_plugin": "evenhand.core.plugins",
    "method": "evenhand.methods.registry",
    "paper_issues": "evenhand.methods.paper.issues",
    "score": "evenhand.methods.paper.scores",
    "train": "evenhand.training.train",
}
"""Public name -> where it lives; imported when first asked for: `import evenhand` is light."""

__all__ = ["__version__", *_PUBLIC]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'evenhand' has no attribute {name!r}")
    module = importlib.import_module(_PUBLIC[name])
    return getattr(module, "load" if name == "load_detector" else name)
