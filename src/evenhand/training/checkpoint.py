"""Checkpoints from which a run resumes bit for bit.

A checkpoint is one ``.npz`` file without pickle: the leaves of learner and memory under their
names, in declared order, and a JSON header with fingerprints of the settings that it belongs to
and whatever else the run needs (epoch, random state). It is written aside and renamed, so that
an interruption leaves the earlier file whole.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from evenhand.core import tree
from evenhand.core.errors import InputError
from evenhand.training.update import LearnerState

_FORMAT = "evenhand checkpoint"
_VERSION = 2
_HEADER = "header"


class State(NamedTuple):
    """All that changes from epoch to epoch.

    Attributes:
        learner: policy and optimiser.
        memory: what training remembers beside it, see ``core.tree``; None for nothing.
    """

    learner: LearnerState
    memory: Any = None


@dataclass(frozen=True)
class Checkpoint:
    """What was read back.

    Attributes:
        state: bit for bit as it was saved.
        extra: what else was saved, as JSON gives it back.
    """

    state: State
    extra: dict[str, Any]


def fingerprint(value: Any) -> str:
    """16 hexadecimal digits that change when the value does.

    Args:
        value: a settings dataclass, or anything that JSON can hold, nested as you like.
    """
    text = json.dumps(value, sort_keys=True, default=_as_json)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _as_json(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    raise TypeError(f"a fingerprint cannot be taken of {type(value).__name__}")


def _named_leaves(state: State) -> dict[str, Any]:
    """Leaves by name, such as ``learner.policy.actor.weights.0``, in declared order."""
    leaves = jax.tree_util.tree_flatten_with_path(state.learner)[0]
    named = {
        f"learner.{jax.tree_util.keystr(path, simple=True, separator='.')}": leaf
        for path, leaf in leaves
    }
    return named | tree.leaves(state.memory, "memory")


def save(
    path: str | os.PathLike[str],
    state: State,
    *,
    fingerprints: Mapping[str, str],
    extra: Mapping[str, Any],
) -> None:
    """Write a checkpoint; the file appears whole or not at all.

    Args:
        path: of the file; its folder exists.
        state: learner and memory.
        fingerprints: name → `fingerprint` of all that must be the same when the run resumes
            (settings, detector).
        extra: anything that JSON can hold, with names as keys: the epoch,
            ``rng.bit_generator.state`` of NumPy's default generator, running means. Floats come
            back exactly; tuples come back as lists.

    Raises:
        InputError: the file cannot be written.
    """
    path = Path(path)
    header = {
        "format": _FORMAT,
        "version": _VERSION,
        "fingerprints": dict(fingerprints),
        "extra": dict(extra),
    }
    text = np.frombuffer(json.dumps(header).encode(), np.uint8)
    arrays = {name: np.asarray(leaf) for name, leaf in _named_leaves(state).items()}
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with open(aside, "wb") as file:
            np.savez(file, allow_pickle=False, **{_HEADER: text}, **arrays)
            file.flush()
            os.fsync(file.fileno())
        os.replace(aside, path)
        _sync_folder(path.parent)
    except OSError as error:
        reason = error.strerror or error
        raise InputError(
            "unavailable checkpoint", f"checkpoint {path} cannot be written: {reason}"
        ) from error
    finally:
        # Also after Ctrl-C; after a success there is nothing left to remove.
        with contextlib.suppress(OSError):
            aside.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable where the file system can."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def load(path: str | os.PathLike[str], like: State, expect: Mapping[str, str]) -> Checkpoint:
    """Read a checkpoint whole, or say why not.

    Args:
        path: of the file.
        like: a state of the same shapes, for instance that of the beginning. Where its memory is
            None, only the learner is read.
        expect: the fingerprints that it must have been saved with.

    Raises:
        InputError: the file is missing, cut off, no checkpoint, or belongs to other settings or
            to a policy of another shape.
    """
    path = Path(path)
    header, arrays = _read(path)
    saved = header["fingerprints"]
    others = [name for name, value in expect.items() if saved.get(name) != value]
    if others:
        raise InputError(
            "conflict checkpoint",
            f"checkpoint {path} belongs to other settings ({', '.join(others)}); "
            "resume with the settings that it was saved with, or start in a new folder",
        )
    if like.memory is None:
        arrays = {name: a for name, a in arrays.items() if not name.startswith("memory.")}
    wanted = _named_leaves(like)
    if list(wanted) != list(arrays):
        odd = sorted({*wanted} ^ {*arrays})
        raise InputError(
            "conflict checkpoint",
            f"checkpoint {path} holds another policy, or the memory of another method "
            f"({', '.join(odd[:3])}); resume with the settings that it was saved with",
        )
    for name, leaf in wanted.items():
        found = arrays[name]
        if found.shape != leaf.shape or found.dtype != leaf.dtype:
            raise InputError(
                "shape checkpoint",
                f"checkpoint {path} holds {name} of another shape: it is "
                f"{found.dtype}{list(found.shape)} there and {leaf.dtype}{list(leaf.shape)} here",
            )
    leaves = [jnp.asarray(a) for name, a in arrays.items() if name.startswith("learner.")]
    learner = jax.tree_util.tree_unflatten(jax.tree_util.tree_structure(like.learner), leaves)
    memory = tree.fill(like.memory, arrays, "memory")
    return Checkpoint(State(learner, memory), header["extra"])


def _read(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Header and arrays of a file that is what it says; every byte is checked by the archive."""
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError("missing checkpoint", f"checkpoint {path} does not exist") from error
    except OSError as error:
        raise InputError(
            "unavailable checkpoint", f"checkpoint {path} cannot be read: {error.strerror or error}"
        ) from error
    if not content.startswith(b"PK"):
        raise InputError(
            "format checkpoint",
            f"{path} is not a checkpoint of Evenhand; give the file of a run folder",
        )
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {name.removesuffix(".npy"): archive.read(name) for name in archive.namelist()}
        arrays = {
            name: np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
            for name, data in members.items()
        }
    # A damaged archive raises whatever its damaged bytes suggest, so nothing can be singled out.
    except Exception as error:
        raise InputError(
            "format checkpoint",
            f"checkpoint {path} is cut off or damaged; use an earlier one or start anew",
        ) from error
    try:
        header = json.loads(arrays.pop(_HEADER).tobytes())
        ours = header["format"] == _FORMAT
    except (KeyError, TypeError, ValueError):
        ours = False
    if not ours:
        raise InputError(
            "format checkpoint",
            f"{path} is not a checkpoint of Evenhand; give the file of a run folder",
        )
    if header["version"] != _VERSION:
        raise InputError(
            "changed checkpoint",
            f"checkpoint {path} has format version {header['version']}, and this Evenhand reads "
            f"version {_VERSION}; resume with the Evenhand that saved it",
        )
    return header, arrays
