"""What made a run: versions, commit, world, detector. Runs that differ in it are not mixed.

Every finished run notes it in its ``done.json``. Of a run from before that was noted, its
``settings.json`` still names versions and detector.
"""

import functools
import subprocess
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from evenhand.core import files
from evenhand.core.errors import InputError
from evenhand.methods import detector_file
from evenhand.training import checkpoint, run_folder

Origin = dict[str, Any]
"""``versions``, ``commit`` and perhaps ``world`` and ``detector``; None for what is not known."""


def now() -> Origin:
    """Versions and commit of the code that runs."""
    return {"versions": run_folder.versions(), "commit": commit()}


def heading(made: Origin, command: str) -> dict[str, Any]:
    """What a manifest begins with: version, moment, command, commit.

    Args:
        made: as ``now`` gives it.
        command: as it was typed.
    """
    return {
        "version": made["versions"]["evenhand"],
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": command,
        "commit": made["commit"],
    }


@functools.cache
def shipped_detector() -> str:
    """Fingerprint of the detector that comes with Evenhand."""
    return checkpoint.fingerprint(run_folder.as_dict(detector_file.load(detector_file.SHIPPED)))


def of_run(folder: Path, done: dict[str, Any]) -> Origin:
    """What made a finished run."""
    found = {name: done.get(name) for name in ("versions", "commit", "world", "detector")}
    path = folder / "settings.json"
    if "versions" not in done and path.exists():
        noted = files.read_record(path, "versions", "fingerprints")
        prints = noted["fingerprints"]
        found["versions"] = noted["versions"]
        found["detector"] = prints.get("detector") if isinstance(prints, dict) else None
    for name in ("versions", "commit", "world"):
        if not isinstance(found[name], dict | None):
            raise InputError(
                "format folder",
                f"{folder} is damaged, its {name} are no record: delete it, and it is run again",
            )
    return found


def check(folder: Path, then: Origin, here: Origin) -> None:
    """Refuse to mix a run with others; its commit may be another one."""
    if then["versions"] is not None:
        run_folder.check_versions(folder, then["versions"])
    differs = files.differences(
        *({name: one[name] for name in ("world", "detector") if then.get(name) and name in here}
          for one in (then, here))
    )  # fmt: skip
    if differs:
        raise InputError(
            "changed folder",
            f"{folder} was made in another scenario or with another detector ({differs}): use the "
            "version that made it, or begin anew in another folder",
        )


def claim(out: Path, note: str, content: dict[str, Any]) -> None:
    """Make a folder belong to one experiment of one set of versions, or check that it does.

    Raises:
        InputError: when the folder holds something else, or was begun with other versions.
    """
    path = out / note
    then = files.read_record(path).get("versions") if path.exists() else run_folder.versions()
    if then is None:  # a folder from before they were noted
        files.claim_folder(out, note, content)
        return
    then = {name: number for name, number in then.items() if name != "python"}
    files.claim_folder(out, note, content | {"versions": then})
    run_folder.check_versions(out, then)


def distinct(found: Iterable[Origin]) -> list[dict[str, Any]]:
    """Every set of versions and commit that runs were made with, and how many runs.

    Returns:
        ``versions``, ``commit`` (None where not known) and ``runs`` of each, first seen first.
    """
    out: list[dict[str, Any]] = []
    for one in found:
        head = {"versions": one["versions"], "commit": one["commit"]}
        same = next((each for each in out if head.items() <= each.items()), None)
        if same is None:
            out.append(head | {"runs": 1})
        else:
            same["runs"] += 1
    return out


def commit() -> dict[str, Any] | None:
    """The commit that this code is of, and whether the code was changed since.

    Returns:
        ``hash`` and ``changed``; None when the code is in no git checkout of its own.
    """
    here = Path(__file__).resolve()

    def git(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["git", "-C", str(here.parent), *words], capture_output=True, text=True, check=False
        )

    try:
        if git("ls-files", "--error-unmatch", here.name).returncode:
            return None  # installed somewhere inside another project
        head = git("rev-parse", "HEAD").stdout.strip()
        changed = git("status", "--porcelain", "--", str(here.parents[1])).stdout
    except OSError:  # no git
        return None
    return {"hash": head, "changed": bool(changed.strip())} if head else None
