"""Packages that not everybody needs, and the extras of Evenhand that bring them."""

from __future__ import annotations

import re
from importlib import metadata
from importlib.util import find_spec

from evenhand.core.errors import InputError

_SIM = ("gymnasium", "mujoco", "numba")
_TRAIN = (*_SIM, "jax", "equinox", "optax", "pandas")
_STUDY = ("fastapi", "pydantic", "sqlalchemy", "starlette", "uvicorn")

EXTRAS = {
    "sim": _SIM,
    "train": _TRAIN,
    "film": (*_SIM, "imageio_ffmpeg", "PIL"),
    "study": _STUDY,
    "pages": (*_STUDY, "playwright"),
    "minari": (*_SIM, "minari", "h5py", "PIL"),
    "tensorboard": ("tensorboardX",),
    "wandb": ("wandb",),
    "sb3": (*_SIM, "stable_baselines3", "torch"),
    "ray": (*_TRAIN, "ray"),
    "postgres": ("psycopg",),
    "spark": ("pyspark",),
}
"""Extra -> the packages that it brings, as they are imported."""

LEAST = {"stable_baselines3": ("stable-baselines3", "2.7")}
"""Package that people have of their own accord -> its name in registries, and the oldest version
that will do."""


def require(extra: str, what: str) -> None:
    """Check an extra before anything of it is imported.

    Args:
        extra: a key of ``EXTRAS``.
        what: needs it, the subject of a sentence.

    Raises:
        InputError: names the first package that is missing or too old, and what installs it.
    """
    for package in EXTRAS[extra]:
        if find_spec(package) is None:
            raise InputError(
                f"unavailable {package}", f"{what} needs the package {package}: {install(extra)}"
            )
        name, least = LEAST.get(package, ("", ""))
        if name and _numbers(metadata.version(name)) < _numbers(least):
            raise InputError(
                f"changed {name}",
                f"{what} needs {name} {least} or newer, and {metadata.version(name)} is installed: "
                f"{install(extra)}",
            )


def install(*extras: str) -> str:
    """What brings extras, for the end of a sentence."""
    return f"run pip install '.[{','.join(extras)}]' in a clone of Evenhand"


def _numbers(version: str) -> tuple[int, ...]:
    """The release of a version; what follows it, such as rc1, does not count."""
    release = re.match(r"\d+(\.\d+)*", version)
    return tuple(int(part) for part in release.group().split(".")) if release else ()
