"""A sweep on a real Ray cluster of two nodes, of which one is killed in the middle."""

from importlib.util import find_spec
from pathlib import Path

import pytest

from support import ray_cluster

FILE = """
scenarios = ["tips"]
arms = ["reference", "service", "levelup"]
algorithms = ["reinforce"]
seeds = 2
epochs = 1500
people = 4
services = 300
"""
CLOCKED = ("clock.json", "manifest.json", "report.html", "runs.csv")

pytestmark = [pytest.mark.slow, pytest.mark.long]


def steady(whole: dict[str, bytes]) -> dict[str, bytes]:
    """Without the files that tell how long something took."""
    return {name: what for name, what in whole.items() if not name.endswith(CLOCKED)}


def ended(out: Path) -> set[Path]:
    return {path.parent for path in out.rglob("done.json")}


def both_at_work(out: Path) -> bool:
    """Of two runs a checkpoint has come back, but no result: one on each node of one CPU."""
    return len({path.parent for path in out.rglob("checkpoint.npz")} - ended(out)) == 2


def test_a_machine_is_lost_and_nothing_else(require, apart, content, tmp_path, monkeypatch):
    require(find_spec("ray") is not None, "Ray: the extra ray")
    for name, value in ray_cluster.QUIET.items():
        monkeypatch.setenv(name, value)
    file, here = tmp_path / "sweep.toml", tmp_path / "here"
    file.write_text(FILE)
    shown = tmp_path / "of-the-driver"
    shown.mkdir()
    there = shown / "there"
    with ray_cluster.two_nodes(hidden=shown) as cluster:
        words = ("sweep", file, "--out", there, "--ray", cluster.address)
        with apart.at_work(*words, when=lambda: ended(there) and both_at_work(there)) as process:
            before = {run: (run / "done.json").stat().st_mtime_ns for run in ended(there)}
            cluster.kill_other()
            out, err = process.communicate()
        assert process.returncode == 0, err
        assert out.endswith(f"\n{there / 'report.html'}\n")
        lost = [line for line in err.splitlines() if "was lost; tried again" in line]
        assert len(lost) == 1
        assert err.splitlines() == lost  # and nothing else was said
    for run, when in before.items():  # nothing that had ended was done again
        assert (run / "done.json").stat().st_mtime_ns == when
    assert apart("sweep", file, "--out", here).code == 0
    local, remote = content(here), content(there)
    assert remote.keys() == local.keys()
    wanted, found = steady(local), steady(remote)
    assert [name for name in wanted if found[name] != wanted[name]] == []
    # weights, logs, services and numbers of 4 runs that learn and 2 that do not, and the tables
    for name, count in (("checkpoint.npz", 4), ("epochs.jsonl", 4), ("done.json", 6)):
        assert len([path for path in wanted if path.endswith(name)]) == count
    assert {"results.csv", "summary.csv", "fronts.csv"} < wanted.keys()
