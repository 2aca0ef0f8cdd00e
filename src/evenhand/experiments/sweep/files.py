"""How the files of a run come from the machine where it runs to the folder of the sweep."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from evenhand.core import files
from evenhand.core.errors import InputError

_ORDER = (
    "settings.json", "detector.json", "services", "states", "epochs.jsonl", "checkpoint.npz",
    "clock.json", "done.json",
)  # fmt: skip
"""What a run resumes from is whole whenever the writing stops: the checkpoint comes after all that
it belongs to, and the note that the run has ended comes last."""

Files = dict[str, bytes]
"""Content by name inside the folder of a run."""


def listed(folder: Path) -> list[str]:
    """Names of the files of a run, those first that others rely on."""
    names = [
        path.relative_to(folder)
        for path in folder.rglob("*")
        if path.is_file() and not path.name.startswith(".") and path.suffix != ".part"
    ]
    known = [name for name in names if name.parts[0] in _ORDER]
    return [str(n) for n in sorted(known, key=lambda n: (_ORDER.index(n.parts[0]), str(n)))]


class Keeper:
    """Keeps the folders of runs; lives on the machine of the driver.

    An attempt is known by its number. When a machine was given up and comes back, its attempt is
    an old one, and nothing of it is taken.
    """

    def __init__(self, out: str) -> None:
        self._out = Path(out)
        self._numbers: dict[str, int] = {}

    def begin(self, path: str) -> tuple[int, Files]:
        """Begin an attempt.

        Returns:
            Its number, and what earlier attempts left.
        """
        self._numbers[path] = self._numbers.get(path, 0) + 1
        folder = self._out / path
        held = {name: (folder / name).read_bytes() for name in listed(folder)}
        return self._numbers[path], held

    def keep(self, path: str, number: int, new: Files, names: list[str]) -> None:
        """Take what is new of a run.

        Raises:
            InputError: when another attempt has begun, or a file cannot be written.
        """
        if self._numbers.get(path) != number:
            raise InputError("changed file", f"{path} was given to another machine")
        folder = files.make_folder(self._out / path)
        files.sweep(folder)
        for name in reversed(listed(folder)):
            if name not in names:
                (folder / name).unlink()
        for name, content in new.items():
            files.make_folder((folder / name).parent)
            files.write_bytes(folder / name, content)


Send = Callable[[Files, list[str]], object]
"""``Keeper.keep`` of this attempt."""


class Carrier:
    """Sends the files of a run that are new since it sent them last."""

    def __init__(self, folder: Path, send: Send) -> None:
        self._folder, self._send = folder, send
        self._sent: dict[str, tuple[int, int]] = {}

    def unpack(self, held: Mapping[str, bytes]) -> None:
        """Put what was kept into the folder."""
        for name, content in held.items():
            files.make_folder((self._folder / name).parent)
            files.write_bytes(self._folder / name, content)
        self._sent = self._stamps(held)

    def send_after_checkpoint(self) -> None:
        """Send if there is another checkpoint than at the last time."""
        checkpoint = self._stamps(["checkpoint.npz"])
        if checkpoint and not checkpoint.items() <= self._sent.items():
            self.send()

    def send(self) -> None:
        """Send what is new."""
        names = listed(self._folder)
        stamps = self._stamps(names)
        new = [name for name in names if self._sent.get(name) != stamps[name]]
        self._send({name: (self._folder / name).read_bytes() for name in new}, names)
        self._sent = stamps

    def _stamps(self, names: Iterable[str]) -> dict[str, tuple[int, int]]:
        """When each file that is there was written, in nanoseconds, and its bytes."""
        found = {}
        for name in names:
            path = self._folder / name
            if path.exists():
                status = path.stat()
                found[name] = (status.st_mtime_ns, status.st_size)
        return found
