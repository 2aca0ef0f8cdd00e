"""How JAX runs here: on the CPU, in one thread, with compiled functions kept between runs."""

from __future__ import annotations

import hashlib
import os
import platform
import tempfile
import warnings
from importlib.metadata import version
from pathlib import Path

import jax

_ONE_THREAD = "--xla_cpu_multi_thread_eigen=false"


def cache_folder() -> Path:
    """Where Evenhand keeps what it can make again.

    ``$EVENHAND_CACHE``, else ``$XDG_CACHE_HOME/evenhand``, else ``~/.cache/evenhand``.
    """
    own = os.environ.get("EVENHAND_CACHE")
    if own:
        return Path(own)
    shared = os.environ.get("XDG_CACHE_HOME")
    return (Path(shared) if shared else Path("~/.cache").expanduser()) / "evenhand"


def set_up_jax(folder: Path | None = None) -> Path | None:
    """Prepare JAX for this process; call it before the first computation.

    * CPU only.
    * One thread: the arrays are too small to gain by more, parallel seeds are processes, and
      sums come out in the same order on every number of cores.
    * Compiled functions are kept on disk, so that the next process needs a fraction of the time.

    Args:
        folder: for compiled functions; `cache_folder` when not given.

    Returns:
        The folder in use, or None when it cannot be written; then everything is compiled anew.
    """
    flags = os.environ.get("XLA_FLAGS", "")
    if _ONE_THREAD not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {_ONE_THREAD}".strip()
    jax.config.update("jax_platforms", "cpu")
    try:
        kept = (folder or cache_folder()) / "jax" / _machine()
        kept.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=kept):  # permission bits alone do not tell
            pass
    except (OSError, RuntimeError):  # RuntimeError: no home folder
        return None
    jax.config.update("jax_compilation_cache_dir", str(kept))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
    # A full disk or a half-written entry costs only time: it is compiled anew.
    warnings.filterwarnings("ignore", message="Error (reading|writing) persistent compilation")
    return kept


def _machine() -> str:
    """Name for compiled code that may run here: a home folder can be shared by unlike machines."""
    features = platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        features += next(line for line in lines if line.startswith(("flags", "Features")))
    except (OSError, StopIteration):
        features += platform.processor()
    digest = hashlib.sha256(features.encode()).hexdigest()[:12]
    return f"{version('jaxlib')}-{digest}"
