"""Code of users: files and installed packages that add methods, scenarios or policies.

A registry calls `ready` before it looks a name up: then the files that were loaded (also by the
process that started this one) and the packages that name themselves under its entry point have
registered what they bring.
"""

import hashlib
import importlib.metadata
import importlib.util
import os
import re
import sys
import tempfile
import traceback
from collections.abc import Mapping
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

from evenhand.core.errors import InputError

VARIABLE = "EVENHAND_PLUGINS"
"""Environment variable with the files that were loaded: worker processes load them, too."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_files: dict[Path, ModuleType] = {}
_groups: set[str] = set()
_received: dict[tuple[str, str], Path] = {}
_sent: str | None = None


def load_plugin(path: str | os.PathLike[str]) -> ModuleType:
    """Run a Python file that registers something, once.

    Args:
        path: of the file; modules beside it can be imported by it.

    Raises:
        InputError: when there is no such file, or it raises. Its own traceback is printed first.
    """
    file = Path(path).resolve()
    if file in _files:
        return _files[file]
    if file.suffix != ".py" or not file.is_file():
        raise InputError(
            "missing plugin", f"plugin {path} is no Python file: give the path of a file NAME.py"
        )
    name = f"evenhand_plugin_{file.stem}_{hashlib.sha256(str(file).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    _files[file] = sys.modules[name] = module
    if str(file.parent) not in sys.path:
        sys.path.append(str(file.parent))
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del _files[file], sys.modules[name]
        raise _failed(f"plugin {path}", error) from error
    os.environ[VARIABLE] = os.pathsep.join(map(str, _files))
    return module


def ready(group: str) -> None:
    """Let every plugin register what it brings; the second call does nothing.

    Args:
        group: entry point of packages, such as ``evenhand.methods``.

    Raises:
        InputError: when a file or a package raises. Its own traceback is printed first.
    """
    for file in filter(None, os.environ.get(VARIABLE, "").split(os.pathsep)):
        load_plugin(file)
    if group in _groups:
        return
    _groups.add(group)
    for point in importlib.metadata.entry_points(group=group):
        try:
            point.load()
        except Exception as error:
            _groups.discard(group)
            package = point.dist.name if point.dist is not None else point.value
            raise _failed(f"entry point {point.name} of package {package}", error) from error


def reaches_workers(module: str, group: str) -> bool:
    """Whether a worker process registers what a module does: ours, a plugin file, or a package's.

    Args:
        module: its name.
        group: entry point of packages.
    """
    if module.partition(".")[0] == "evenhand" or module.startswith("evenhand_plugin_"):
        return True
    packages = {one.module for one in importlib.metadata.entry_points(group=group)}
    return module in packages


def texts() -> dict[str, str]:
    """Content of each file that was loaded by its name, for a machine that does not have them."""
    return {file.name: file.read_text(encoding="utf-8") for file in _files}


def load_texts(files: Mapping[str, str]) -> None:
    """Load files that another machine sent, see `texts`, each content once.

    Raises:
        InputError: as `load_plugin`.
    """
    global _sent
    for name, text in files.items():
        key = (name, text)
        if key not in _received:
            _sent = _sent or tempfile.mkdtemp(prefix="evenhand-plugins-")
            _received[key] = Path(_sent) / str(len(_received)) / name
            _received[key].parent.mkdir()
            _received[key].write_text(text, encoding="utf-8")
        load_plugin(_received[key])


def _failed(what: str, error: BaseException) -> InputError:
    if isinstance(error, InputError):
        return error.at(what)
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if "importlib" not in f.filename and f.filename != __file__]
    lines = traceback.format_list(own) + traceback.format_exception_only(error)
    print("Traceback (most recent call last):\n" + "".join(lines), end="", file=sys.stderr)
    return InputError(
        "format plugin", f"{what} cannot be loaded ({type(error).__name__}): correct it"
    )


def source_of(code: Any) -> str | None:
    """A hash of what a class or function was written as, to notice when it is edited.

    Args:
        code: a class or function.

    Returns:
        16 hexadecimal digits of its module's file, or of its byte code where there is no file;
        None for Evenhand's own, which version and commit stand for.
    """
    if code.__module__.partition(".")[0] == "evenhand":
        return None
    file = getattr(sys.modules.get(code.__module__), "__file__", None)
    if file is not None and Path(file).is_file():
        text = Path(file).read_bytes()
    else:
        parts = vars(code).values() if isinstance(code, type) else [code]
        codes = [getattr(part, "__code__", None) for part in parts]
        text = repr([(c.co_code, c.co_names, _constants(c)) for c in codes if c]).encode()
    return hashlib.sha256(text).hexdigest()[:16]


def check_name(kind: str, name: Any) -> None:
    """Whether something can be registered by a name: it becomes part of names of folders.

    Raises:
        InputError: when it cannot.
    """
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError(
            f"format {kind}", f"a {kind} cannot be called {name!r}: give letters, digits, - and _"
        )


def origin(frame: FrameType, *code: Any) -> tuple[str, str | None]:
    """Where something is registered from.

    Args:
        frame: that registers it.
        code: what is registered; functions and classes count.

    Returns:
        Where it is defined, equal for a cell of a notebook that is run again; and a hash of its
        source and of the file that registers it, None for Evenhand's own, see ``source_of``.
    """
    module = frame.f_globals.get("__name__", "")
    written = [one for one in code if hasattr(one, "__module__") and hasattr(one, "__qualname__")]
    found = [source_of(one) for one in written]
    if module.partition(".")[0] != "evenhand":
        file = frame.f_globals.get("__file__")
        text = module.encode()
        if file is not None and Path(file).is_file():
            text = Path(file).read_bytes()
        found.append(hashlib.sha256(text).hexdigest()[:16])
    names = [f"{one.__module__}.{one.__qualname__}" for one in written]
    hashes = sorted({one for one in found if one is not None})
    place = f"{frame.f_globals.get('__file__', module)}: {' '.join(names) or frame.f_lineno}"
    return place, "+".join(hashes) or None


def _constants(code: Any) -> list[Any]:
    """Constants of byte code, without addresses of memory."""
    return [
        (inner.co_code, _constants(inner)) if hasattr(inner, "co_code") else inner
        for inner in code.co_consts
    ]
