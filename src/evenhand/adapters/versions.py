"""Is another library there, and new enough? Said before anything of it is imported."""

from __future__ import annotations

import re
from importlib import metadata

from evenhand.core.errors import InputError


def required(package: str, least: str, extra: str, what: str) -> None:
    """Check a package that an extra brings."""
    try:
        found = metadata.version(package)
    except metadata.PackageNotFoundError:
        raise InputError(
            f"{what} need {package}, which is not installed: pip install 'evenhand[{extra}]'"
        ) from None
    if _numbers(found) < _numbers(least):
        raise InputError(
            f"{package} {found} is too old for {what}, which need {least} or newer: "
            f"pip install --upgrade 'evenhand[{extra}]'"
        )


def stable_baselines3() -> None:
    """Check Stable-Baselines3."""
    required("stable-baselines3", "2.7", "sb3", "the adapters for Stable-Baselines3")


def _numbers(version: str) -> tuple[int, ...]:
    """The release of a version; what follows it, such as rc1, does not count."""
    release = re.match(r"\d+(\.\d+)*", version)
    return tuple(int(part) for part in release.group().split(".")) if release else ()
