"""What can happen to a run: its process is killed, its disk is full, it is of another version."""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from evenhand.core.errors import InputError
from evenhand.methods import detector_file
from evenhand.training import checkpoint, run_folder
from evenhand.training.settings import settings_of
from support import disks

MORTAL = Path(__file__).parents[1] / "support" / "mortal.py"
KILLS = 10
SEEDS = {"reinforce": 20, "ppo": 21}

pytestmark = pytest.mark.slow


# --- killed ---


@pytest.fixture(scope="module")
def killed(tmp_path_factory) -> Iterator[dict[str, Path]]:
    """Folders of both algorithms with a calm sweep and killed ones, made side by side."""
    folders = {algorithm: tmp_path_factory.mktemp(algorithm) for algorithm in SEEDS}
    at_work = {
        algorithm: subprocess.Popen(
            [sys.executable, MORTAL, folders[algorithm], algorithm, str(KILLS), str(seed)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for algorithm, seed in SEEDS.items()
    }
    for process in at_work.values():
        said, complaint = process.communicate()
        assert process.returncode == 0, complaint
        assert json.loads(said)["kills"] == KILLS
    yield folders
    for folder in folders.values():
        shutil.rmtree(folder)


def without_clock(name: str, content: bytes) -> bytes:
    """Manifests and pages without the moment when they were written, and how long it took."""
    if name.endswith(("manifest.json", "report.html")):
        content = re.sub(rb"\d{4}-\d\d-\d\dT[\d:]+\+00:00", b"", content)
        content = re.sub(rb'("run_seconds": )[\d.]+', rb"\1", content)
        content = re.sub(rb"<dt>Computing</dt><dd>.*?</dd>", b"", content)
    return content


@pytest.mark.long
@pytest.mark.parametrize("algorithm", SEEDS)
def test_killed_at_random_moments_a_run_ends_with_the_same_bits(killed, content, algorithm):
    """Weights, logs, services, tables, figures and pages, after twenty kills in all."""
    calm, *others = [
        {
            name: without_clock(name, whole)
            for name, whole in content(folder).items()
            if not name.endswith("clock.json")
        }
        for folder in sorted(killed[algorithm].iterdir())
    ]
    for suffix in ("checkpoint.npz", "epochs.jsonl", "100-000110.parquet", "report.html", ".svg"):
        assert [name for name in calm if name.endswith(suffix)], suffix
    assert others
    for other in others:
        assert other.keys() == calm.keys()
        assert [name for name in calm if other[name] != calm[name]] == []


# --- disks ---

DISKS = """
set -e
mount -t tmpfs -o size=160k tmpfs "$1"
shift
code=0; "$@" || code=$?
echo "full $code $(find "$DISK" -name '*.part' | wc -l) $(find "$DISK" -name done.json | wc -l)"
mount -o remount,size=64m tmpfs "$DISK"
"$@"
mount -o remount,ro tmpfs "$DISK"
code=0; "$@" || code=$?
echo "read-only $code"
cp -r "$DISK/run" "$KEPT"
"""


def test_a_full_disk_and_one_that_can_only_be_read(apart, require, content, tmp_path, monkeypatch):
    """A real disk of 160 kB: refused in a sentence; with more room it goes on to the same bits."""
    require(bool(disks.ALONE), "the right to mount a disk of one's own")
    disk, kept, calm = tmp_path / "disk", tmp_path / "kept", tmp_path / "calm"
    disk.mkdir()
    monkeypatch.setenv("DISK", str(disk))
    monkeypatch.setenv("KEPT", str(kept))
    words = ("--algorithm", "reinforce", "--epochs", 120, "--people", 8, "--no-states")
    train = (*apart.program, "train", "--out", disk / "run", *words)
    ended = apart.of(*disks.ALONE, DISKS, "sh", disk, *train)()
    assert ended.code == 0, ended
    assert ended.out.splitlines() == ["full 2 0 0", str(disk / "run"), "read-only 2"]
    full, read_only = ended.err.splitlines()
    assert re.fullmatch(r"evenhand: .* cannot be written: No space left on device", full)
    assert read_only == (
        f"evenhand: folder {disk / 'run'} cannot be written (Read-only file system): give another "
        "one"
    )
    assert apart("train", "--out", calm, *words).code == 0
    assert content(kept) == content(calm)


# --- versions ---

SETTINGS = replace(settings_of("service", "reinforce", "penalty", epochs=2), people=3)


@pytest.fixture
def older(tmp_path) -> Callable[[Callable[[dict], None]], Path]:
    """``older(change)``: a run's folder whose settings are as another version noted them."""

    def make(change: Callable[[dict], None]) -> Path:
        folder = tmp_path / "run"
        run_folder.execute(folder, SETTINGS, detector_file.load(detector_file.SHIPPED))
        noted = json.loads((folder / "settings.json").read_text())
        change(noted)
        noted["whole"] = checkpoint.fingerprint(noted["settings"])
        (folder / "settings.json").write_text(json.dumps(noted))
        return folder

    return make


@pytest.mark.parametrize("name", ["reflect", "method"])
def test_a_run_that_knew_fewer_settings(older, content, name):
    folder = older(lambda noted: noted["settings"].pop(name))
    before = content(folder)
    with pytest.raises(
        InputError,
        match=rf"is of another version of Evenhand, which differs in {name}: use that version, or "
        "begin anew",
    ):
        run_folder.execute(folder, SETTINGS, detector_file.load(detector_file.SHIPPED))
    assert content(folder) == before


def test_settings_inside_settings(older):
    folder = older(lambda noted: noted["settings"]["update"].update(momentum=0.9))
    with pytest.raises(InputError, match=r"another version of Evenhand, which differs in momentum"):
        run_folder.execute(folder, SETTINGS, detector_file.load(detector_file.SHIPPED))


def test_a_checkpoint_of_another_format(tmp_path, monkeypatch):
    folder = tmp_path / "run"
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "_VERSION", 0)
        run_folder.execute(folder, SETTINGS, detector_file.load(detector_file.SHIPPED))
    with pytest.raises(InputError, match=r"has format version 0, and this Evenhand reads version"):
        run_folder.execute(folder, SETTINGS, detector_file.load(detector_file.SHIPPED))
