"""The example runs, and says that its groups are made up."""

import importlib.util
from pathlib import Path

import pytest

PATH = Path(__file__).resolve().parents[2] / "examples" / "cartpole.py"


@pytest.fixture
def example():
    spec = importlib.util.spec_from_file_location("cartpole_example", PATH)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_it_writes_its_report(example, monkeypatch, tmp_path):
    monkeypatch.setattr(example, "ROUNDS", 2)
    text = example.main(tmp_path / "out").read_text()
    assert "Passengers and their groups are made up" in text
    assert "simulated respondents" in text
    kept = sorted(path.name for path in (tmp_path / "out" / "services").iterdir())
    assert kept == [
        "reward_alone.parquet",
        "reward_alone_tested.parquet",
        "with_level_up.parquet",
        "with_level_up_tested.parquet",
    ]


def test_it_is_short_enough_to_read():
    assert len(PATH.read_text().splitlines()) < 200
