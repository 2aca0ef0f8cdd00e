"""Memories as named arrays and back: what checkpoints hold, without pickle and without JAX.

A tree is made of dataclasses, tuples, lists, dicts with names as keys, and None; its leaves are
arrays, numbers, and True or False.
"""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from evenhand.core.errors import InputError

Tree = TypeVar("Tree")


def leaves(tree: Any, name: str = "") -> dict[str, np.ndarray]:
    """All leaves by their path, such as ``guard.recent.windows``, in declared order.

    Args:
        tree: the tree.
        name: what paths begin with.

    Raises:
        InputError: for a leaf that is no array or number.
    """
    parts = _parts(tree)
    if parts is None:
        leaf = np.asarray(tree)
        if leaf.dtype.kind not in "biufc":
            raise InputError(
                "type state",
                f"{name or 'the tree'} is of type {type(tree).__name__}: give arrays and numbers, "
                "in dataclasses, tuples, lists or dicts",
            )
        return {name: leaf}
    found: dict[str, np.ndarray] = {}
    for key, part in parts:
        found |= leaves(part, f"{name}.{key}" if name else key)
    return found


def shapes(tree: Any) -> dict[str, tuple[int, ...]]:
    """Shape of every leaf by its path."""
    return {name: leaf.shape for name, leaf in leaves(tree).items()}


def fill(like: Tree, arrays: Mapping[str, np.ndarray], name: str = "") -> Tree:
    """The inverse of `leaves`.

    Args:
        like: a tree of the same shape; its leaves decide on types.
        arrays: leaves by path, as many as ``like`` has.
        name: what paths begin with.

    Raises:
        InputError: for a leaf that is absent or of another shape.
    """
    parts = _parts(like)
    if parts is None:
        old = np.asarray(like)
        if name not in arrays or np.shape(arrays[name]) != old.shape:
            raise InputError("shape state", f"{name} of shape {old.shape} is not in what was saved")
        new = np.asarray(arrays[name]).astype(old.dtype)
        return new if isinstance(like, np.ndarray) else new.item()  # pyright: ignore[reportReturnType]
    made = [fill(part, arrays, f"{name}.{key}" if name else key) for key, part in parts]
    kind: Any = type(like)
    if like is None:
        return like
    if is_dataclass(like):
        return kind(**dict(zip((key for key, _ in parts), made, strict=True)))
    if isinstance(like, dict):
        return kind(zip(like, made, strict=True))
    return kind(*made) if hasattr(like, "_fields") else kind(made)


def _parts(tree: Any) -> list[tuple[str, Any]] | None:
    """Name and content of what a tree consists of; None for a leaf."""
    if tree is None:
        return []
    if is_dataclass(tree) and not isinstance(tree, type):
        return [(field.name, getattr(tree, field.name)) for field in fields(tree)]
    if isinstance(tree, dict):
        return list(_named(tree))
    if isinstance(tree, (tuple, list)):
        return [(str(place), part) for place, part in enumerate(tree)]
    return None


def _named(tree: Mapping[Any, Any]) -> Iterator[tuple[str, Any]]:
    for key, part in tree.items():
        if not isinstance(key, str):
            raise InputError("type state", f"{key!r} is no name: give dicts with text as keys")
        yield key, part
