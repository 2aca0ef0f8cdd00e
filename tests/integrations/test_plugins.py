"""A method of a stranger's file through the commands, and what happens when it is edited."""

import json
from pathlib import Path

import pytest

from support.plugins import SOURCE

RUN = (
    "--scenarios", "tips", "--algorithms", "reinforce", "--seeds", 1, "--epochs", 2,
    "--services", 300, "--workers", 2,
)  # fmt: skip


@pytest.fixture
def plugin(tmp_path) -> Path:
    file = tmp_path / "mine.py"
    file.write_text(SOURCE)
    return file


def source_of(run: Path) -> dict:
    return json.loads((run / "settings.json").read_text())["settings"]["method"]


@pytest.mark.slow
def test_compare_knows_it_and_trains_an_edited_one_again(apart, plugin, tmp_path):
    out = tmp_path / "out"
    words = ("compare", "--out", out, "--plugin", plugin, *RUN)
    words += ("--arms", "service", "mine", "mine@0.1")
    first = apart(*words)
    assert first.code == 0, first.err
    runs = out / "runs" / "tips" / "reinforce"
    before = {arm: source_of(runs / arm / "seed-00") for arm in ("mine", "mine@0.1")}
    assert [one["settings"]["strength"] for one in before.values()] == [0.3, 0.1]
    stamp = (runs / "service" / "seed-00" / "checkpoint.npz").stat().st_mtime_ns
    mine = (runs / "mine" / "seed-00" / "checkpoint.npz").stat().st_mtime_ns
    assert "mine" in (out / "report.html").read_text()
    assert apart(*words).code == 0
    assert (runs / "mine" / "seed-00" / "checkpoint.npz").stat().st_mtime_ns == mine
    plugin.write_text(SOURCE.replace("sum(axis=1)", "sum(axis=1) * 2"))
    again = apart(*words)
    assert again.code == 0, again.err
    after = source_of(runs / "mine" / "seed-00")
    assert after["source"] != before["mine"]["source"]
    assert (runs / "mine" / "seed-00" / "checkpoint.npz").stat().st_mtime_ns > mine
    assert (runs / "service" / "seed-00" / "checkpoint.npz").stat().st_mtime_ns == stamp


@pytest.mark.slow
def test_train_refuses_to_go_on_with_an_edited_one(apart, plugin, tmp_path):
    out = tmp_path / "run"
    words = ("train", "--out", out, "--plugin", plugin, "--guidance", "mine", "--epochs", 2)
    assert apart(*words, "--people", 4).code == 0
    plugin.write_text(SOURCE + "# edited\n")
    refused = apart(*words, "--people", 4)
    assert refused.code == 2
    assert "holds another run (method.source" in refused.err
    known = apart("evaluate", out, "--plugin", plugin, "--services", 30)
    assert known.code == 0, known.err
    lacking = apart("evaluate", out, "--services", 30)
    assert lacking.code == 2
    assert "unknown method 'mine'" in lacking.err
    assert "is named by --plugin" in lacking.err


def test_a_file_that_raises_shows_its_own_traceback_and_one_sentence(apart, plugin):
    plugin.write_text("import evenhand\n\nraise RuntimeError('mine')\n")
    ended = apart("train", "--out", plugin.parent / "run", "--plugin", plugin)
    assert ended.code == 2
    lines = ended.err.splitlines()
    assert lines[0] == "Traceback (most recent call last):"
    assert "RuntimeError: mine" in lines
    assert lines[-1] == f"evenhand: plugin {plugin} cannot be loaded (RuntimeError): correct it"
    assert not (plugin.parent / "run").exists()


@pytest.mark.slow
def test_a_sweep_names_the_file(apart, plugin, tmp_path):
    (tmp_path / "sweep.toml").write_text(
        'plugin = "mine.py"\nscenarios = ["tips"]\narms = ["mine", "mine@0.1"]\n'
        'algorithms = ["reinforce"]\nseeds = 1\nepochs = 2\nservices = 300\n'
    )
    ended = apart("sweep", tmp_path / "sweep.toml", "--out", tmp_path / "out", "--workers", 2)
    assert ended.code == 0, ended.err
    assert "mine@0.1" in (tmp_path / "out" / "results.csv").read_text()
    (tmp_path / "sweep.toml").write_text('plugin = "absent.py"\nscenarios = ["tips"]\n')
    wrong = apart("sweep", tmp_path / "sweep.toml", "--out", tmp_path / "other")
    assert wrong.code == 2
    assert "line 1, plugin: plugin " in wrong.err
