"""What is said of another library that is missing or too old, before it is imported."""

import subprocess
import sys
from importlib import metadata

import pytest

from evenhand.adapters import versions
from evenhand.core.errors import InputError


def said(monkeypatch, installed):
    """What is said when a version is installed; None where it is not."""

    def version(name):
        assert name == "stable-baselines3"
        if installed is None:
            raise metadata.PackageNotFoundError(name)
        return installed

    monkeypatch.setattr(metadata, "version", version)
    try:
        versions.required("stable-baselines3", "2.7", "sb3", "the adapters")
    except InputError as error:
        return str(error)
    return None


@pytest.mark.parametrize("version", ["2.7", "2.7.0", "2.7.0rc1", "2.10.1", "3.0.0a2"])
def test_new_enough(monkeypatch, version):
    assert said(monkeypatch, version) is None


@pytest.mark.parametrize("version", ["2.6.9", "2.0.0", "1.8.0", "0.11.1", "unknown"])
def test_too_old(monkeypatch, version):
    assert said(monkeypatch, version) == (
        f"stable-baselines3 {version} is too old for the adapters, which need 2.7 or newer: "
        "pip install --upgrade 'evenhand[sb3]'"
    )


def test_missing(monkeypatch):
    assert said(monkeypatch, None) == (
        "the adapters need stable-baselines3, which is not installed: pip install 'evenhand[sb3]'"
    )


def test_nothing_of_an_old_version_is_imported():
    code = """
import sys
from importlib import metadata
metadata.version = lambda name: "1.8.0"
from evenhand.core.errors import InputError
try:
    import evenhand.adapters.sb3
except InputError as error:
    print(error)
print([name for name in ("stable_baselines3", "torch") if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    first, second = done.stdout.splitlines()
    assert first.startswith("stable-baselines3 1.8.0 is too old for the adapters for Stable-")
    assert second == "[]"
