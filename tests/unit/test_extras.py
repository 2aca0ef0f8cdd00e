"""What is said of a package that is missing or too old, before it is imported."""

import subprocess
import sys
from importlib import metadata

import pytest

from evenhand.core import extras
from evenhand.core.errors import InputError
from support.refusals import refused


def test_the_first_package_that_is_missing_is_named_and_what_brings_it(monkeypatch):
    there = {"gymnasium", "mujoco", "numba", "jax"}
    monkeypatch.setattr(extras, "find_spec", lambda name: True if name in there else None)
    extras.require("sim", "this")
    with refused("unavailable equinox") as caught:
        extras.require("train", "this")
    assert str(caught.value) == (
        "this needs the package equinox: run pip install '.[train]' in a clone of Evenhand"
    )


def test_several_extras_are_installed_at_once():
    assert "pip install '.[study,postgres]'" in extras.install("study", "postgres")


def too_old(monkeypatch, installed):
    monkeypatch.setattr(extras, "find_spec", lambda name: True)
    monkeypatch.setattr(metadata, "version", lambda name: installed)
    try:
        extras.require("sb3", "an adapter")
    except InputError as error:
        return str(error)
    return None


@pytest.mark.parametrize("version", ["2.7", "2.7.0", "2.7.0rc1", "2.10.1", "3.0.0a2"])
def test_new_enough(monkeypatch, version):
    assert too_old(monkeypatch, version) is None


@pytest.mark.parametrize("version", ["2.6.9", "2.0.0", "1.8.0", "0.11.1", "unknown"])
def test_too_old(monkeypatch, version):
    said = too_old(monkeypatch, version)
    assert said is not None
    assert said.startswith(f"an adapter needs stable-baselines3 2.7 or newer, and {version} is")
    assert "pip install '.[sb3]'" in said


def test_nothing_of_a_missing_package_is_imported():
    code = """
import sys
sys.modules["stable_baselines3"] = None
from evenhand.core.errors import InputError
try:
    import evenhand.adapters.sb3
except InputError as error:
    print(error)
print([name for name in ("torch", "mujoco") if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    first, second = done.stdout.splitlines()
    assert first.startswith("an adapter for Stable-Baselines3 needs the package stable_baselines3")
    assert second == "[]"
