"""Tests of an extra that is too large for everybody: skipped without it, but never in CI."""

from __future__ import annotations

import importlib.util
import os

import pytest


def wanted(module: str, remedy: str) -> None:
    """Skip the test module that calls this where something is not installed.

    With EVENHAND_REQUIRE_ALL=1, as in CI, it is imported all the same, and fails.
    """
    if importlib.util.find_spec(module) is None and os.environ.get("EVENHAND_REQUIRE_ALL") != "1":
        pytest.skip(f"this machine lacks {module}: {remedy}", allow_module_level=True)
