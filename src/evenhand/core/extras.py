"""Packages that not everybody needs, and the extras of Evenhand that bring them."""

from __future__ import annotations

from importlib.util import find_spec

from evenhand.core.errors import InputError

_SIM = ("gymnasium", "mujoco", "numba", "llvmlite")
_TRAIN = (*_SIM, "jax", "equinox", "optax")
_STUDY = ("fastapi", "sqlalchemy", "uvicorn")

EXTRAS = {
    "sim": _SIM,
    "train": _TRAIN,
    "film": (*_SIM, "imageio_ffmpeg", "PIL"),
    "study": _STUDY,
    "pages": (*_STUDY, "playwright"),
    "minari": (*_SIM, "minari", "h5py", "PIL"),
    "tensorboard": ("tensorboardX",),
    "wandb": ("wandb",),
    "sb3": (*_SIM, "stable_baselines3"),
    "ray": (*_TRAIN, "ray"),
    "postgres": ("psycopg",),
    "spark": ("pyspark",),
}
"""Extra -> the packages that it brings, as they are imported."""


def require(extra: str, what: str) -> None:
    """Check before long work that an extra is installed.

    Args:
        extra: a key of ``EXTRAS``.
        what: needs it, as the subject of a sentence.

    Raises:
        InputError: names the first package that is missing, and what installs it.
    """
    for package in EXTRAS[extra]:
        if find_spec(package) is None:
            raise InputError(f"{what} needs the package {package}: {install(extra)}")


def install(*extras: str) -> str:
    """What to do to get extras, for the end of a sentence."""
    return f"run pip install '.[{','.join(extras)}]' in a clone of Evenhand"
