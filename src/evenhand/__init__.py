"""Evenhand: software for robots that serve people evenly."""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "AuditSettings": "evenhand.audits.judge.results",
    "Detector": "evenhand.methods.paper.detector",
    "Fact": "evenhand.methods.scheme",
    "Guidance": "evenhand.methods.guidance",
    "IDENTITIES": "evenhand.restaurant.people",
    "Identity": "evenhand.methods.vocabulary",
    "InputError": "evenhand.core.errors",
    "Services": "evenhand.methods.services",
    "Issue": "evenhand.methods.paper.issues",
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
    "World": "evenhand.restaurant.worlds",
    "audit": "evenhand.audits.api",
    "compare": "evenhand.experiments.api",
    "evaluate": "evenhand.experiments.api",
    "load_detector": "evenhand.methods.detector_file",
    "load_plugin": "evenhand.core.plugins",
    "method": "evenhand.methods.registry",
    "own_issue": "evenhand.methods.scheme",
    "paper_issues": "evenhand.methods.paper.issues",
    "register_policy": "evenhand.training.policy",
    "register_scenario": "evenhand.restaurant.worlds",
    "scenario": "evenhand.restaurant.worlds",
    "score": "evenhand.methods.paper.scores",
    "serve_people": "evenhand.restaurant.serve_people",
    "train": "evenhand.experiments.api",
}
"""Public name -> where it lives; imported when first asked for: `import evenhand` is light."""

__all__ = ["__version__", *_PUBLIC]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'evenhand' has no attribute {name!r}")
    try:
        module = importlib.import_module(_PUBLIC[name])
    except ModuleNotFoundError:
        from evenhand.core import extras

        learns = _PUBLIC[name].split(".")[1] in ("training", "experiments")
        extras.require("train" if learns else "sim", f"evenhand.{name}")
        raise
    return getattr(module, "load" if name == "load_detector" else name)


def __dir__() -> list[str]:
    return sorted(__all__)
