"""Files that appear whole or not at all, and folders that can be written."""

import contextlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from evenhand.core.errors import InputError


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write text aside, then rename it."""
    write_bytes(path, text.encode())


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write bytes aside, then rename it."""
    target = Path(path)
    aside = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        with aside.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(aside, target)
    except OSError as error:
        raise InputError(
            "unavailable file", f"{target} cannot be written: {error.strerror or error}"
        ) from error
    finally:
        # also after Ctrl-C; after a success there is nothing left to remove
        with contextlib.suppress(OSError):
            aside.unlink()


def append_text(path: str | os.PathLike[str], text: str) -> None:
    """Add text to the end of a file, for good: it is on the disk when this returns.

    Raises:
        InputError: when it cannot be written; a part of the text may stand there then.
    """
    try:
        with Path(path).open("a", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise InputError(
            "unavailable file", f"{path} cannot be written: {error.strerror or error}"
        ) from error


def write_json(path: str | os.PathLike[str], content: Any) -> None:
    """Write JSON with stable order of keys, aside and renamed."""
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def read_json(path: str | os.PathLike[str]) -> Any:
    """Read JSON.

    Raises:
        InputError: when the file is missing, cut off or not JSON.
    """
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError("missing file", f"{path} does not exist") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("unavailable file", f"{path} cannot be read: {error}") from error
    except json.JSONDecodeError as error:
        raise InputError(
            "format file",
            f"{path} is no JSON or was cut off (line {error.lineno}): delete it or restore it",
        ) from error


def read_record(path: str | os.PathLike[str], *fields: str) -> dict[str, Any]:
    """Read a JSON object that has these fields.

    Raises:
        InputError: as ``read_json``, or when it is no object or lacks a field.
    """
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(
            "format file", f"{path} is no record of fields and values: delete it or restore it"
        )
    if any(field not in content for field in fields):
        raise InputError(
            "missing file",
            f"{path} is damaged, it needs the fields {', '.join(fields)}: delete it or restore it",
        )
    return content


def make_folder(path: str | os.PathLike[str]) -> Path:
    """A folder that exists and can be written."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".{os.getpid()}.part"
        probe.touch()
        probe.unlink()
    except FileExistsError as error:
        raise InputError(
            "conflict folder", f"{folder} is a file, not a folder: give another one"
        ) from error
    except OSError as error:
        raise InputError(
            "unavailable folder",
            f"folder {folder} cannot be written ({error.strerror or error}): give another one",
        ) from error
    return folder


def sweep(folder: Path) -> None:
    """Remove what a killed process left half-written; nobody else may be writing there."""
    for pattern in ("*.part", ".*.part"):
        for path in folder.glob(pattern):
            with contextlib.suppress(OSError):
                path.unlink()


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes out of a folder."""
    import fcntl

    try:
        file = (folder / ".lock").open("w")
    except OSError as error:
        raise InputError(
            "unavailable folder",
            f"folder {folder} cannot be written ({error.strerror or error}): give another one",
        ) from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InputError(
                "unavailable folder",
                f"another process works in {folder}: wait for it or give another folder",
            ) from error
        yield


def claim_folder(folder: Path, note: str, content: dict[str, Any]) -> None:
    """Make a folder belong to one experiment, or check that it does."""
    path = folder / note
    if path.exists():
        differs = differences(read_record(path), content)
        if differs:
            raise InputError(
                "conflict folder",
                f"{folder} holds another experiment ({differs}): give another folder, or delete "
                "this one",
            )
        return
    if any(folder.glob("[!.]*")):
        raise InputError(
            "conflict folder",
            f"{folder} is not empty and holds no such experiment: give another folder",
        )
    write_json(path, content)


def differences(there: dict[str, Any], here: dict[str, Any]) -> str:
    """What differs between two nested records, as words for a sentence; empty if nothing does."""
    return ", ".join(_differences(there, here, ""))


def _differences(there: dict[str, Any], here: dict[str, Any], prefix: str) -> Iterator[str]:
    for name in sorted({*there, *here}):
        a, b = there.get(name), here.get(name)
        if isinstance(a, dict) and isinstance(b, dict):
            yield from _differences(a, b, f"{prefix}{name}.")
        elif a != b:
            yield f"{prefix}{name} {json.dumps(a)} there and {json.dumps(b)} here"
