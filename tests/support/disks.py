"""Disks of a process's own: mounted for it and its children, and gone with them."""

import os
import subprocess

_USER = () if os.geteuid() == 0 else ("--map-root-user",)
_WORDS = ("unshare", *_USER, "--mount", "sh", "-c")
_MOUNT = [*_WORDS, "mount -t tmpfs tmpfs /mnt"]


def _allowed() -> bool:
    try:
        return subprocess.run(_MOUNT, capture_output=True, check=False).returncode == 0
    except OSError:  # no unshare
        return False


ALONE = _WORDS if _allowed() else ()
"""Runs a script of the shell in which a disk can be mounted; empty where that is not allowed."""
