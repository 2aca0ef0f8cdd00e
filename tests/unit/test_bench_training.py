"""The bench of whole trainings: who trains what and when, and which ratio comes of it."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks import training
from support.refusals import refused

MAIN = """
import os
from pathlib import Path

def main(words):
    if words[words.index("--guidance") + 1] not in {known}:
        return 2
    with open({log!r}, "a") as log:
        print({name!r}, words[words.index("--guidance") + 1], file=log)
    out = Path(words[words.index("--out") + 1])
    assert out.parent.is_dir() and not out.exists()
    print("not part of the answer")
    return {code}
"""


def checkout(
    folder: Path, name: str, code: int = 0, known: tuple[str, ...] = ("levelup", "service")
) -> Path:
    """One whose command line only writes down that it was asked to train."""
    package = folder / name / "src" / "evenhand"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    log = str(folder / "log")
    (package / "cli.py").write_text(MAIN.format(log=log, name=name, code=code, known=known))
    return folder / name


def test_both_sides_train_every_arm_in_turns(tmp_path, monkeypatch):
    monkeypatch.setattr(training, "_HERE", checkout(tmp_path, "here"))
    old = checkout(tmp_path, "there", known=("levelup", "none"))  # another name of service alone
    found = training.measure(old, epochs=2, rounds=2)
    rounds = ["there here", "here there", "there here"]  # the first one is warm-up
    names = {"here": ("levelup", "service"), "there": ("levelup", "none")}
    expected = [f"{side} {names[side][i]}" for r in rounds for i in (0, 1) for side in r.split()]
    assert (tmp_path / "log").read_text().splitlines() == expected
    assert [*found["train_wall_s"]] == [*found["train_wall_ratio"]] == ["levelup", "service"]


@pytest.mark.parametrize("compared", [True, False])
def test_numbers_by_hand(tmp_path, monkeypatch, capsys, compared):
    # processor and wall time of four rounds, the warm-up first; here, there
    here = iter([(99, 99), (2, 10), (3, 30), (8, 24)])
    there = iter([(99, 99), (1, 20), (2, 20), (2, 12)])
    monkeypatch.setattr(training, "_HERE", tmp_path / "here")
    (tmp_path / "there" / "src" / "evenhand").mkdir(parents=True)

    class Trainer:
        def __init__(self, source: Path) -> None:
            self.spent = {"here": here, "there": there}[source.parent.name]

        def __enter__(self):
            return self.spent

        def __exit__(self, *_: object) -> None:
            pass

    monkeypatch.setattr(training, "_trainer", Trainer)
    monkeypatch.setattr(training, "_train", lambda spent, words, names: next(spent))
    against = tmp_path / "there" if compared else None
    found = training.measure(against, epochs=5, rounds=3, arms=["service"])
    assert found["train_processor_s"] == {"service": 3}
    assert found["train_wall_s"] == {"service": 24}
    if compared:  # medians of 2, 1.5, 4 and of 0.5, 1.5, 2
        assert found["train_processor_ratio"] == {"service": 2}
        assert found["train_wall_ratio"] == {"service": 1.5}
    assert ("train_wall_ratio" in found) == compared
    assert (found["train_epochs"], found["train_rounds"]) == (5, 3)
    training.show(found)
    shown = capsys.readouterr().out
    assert "A training of 5 epochs" in shown
    assert ("to the other" in shown) == compared


def test_a_folder_without_the_package_is_no_checkout(tmp_path):
    with refused("missing against"):
        training.measure(tmp_path)


def test_a_training_that_fails_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(training, "_HERE", checkout(tmp_path, "here", code=2))
    with pytest.raises(RuntimeError, match="a training failed"):
        training.measure(rounds=1)


@pytest.mark.slow
def test_a_short_one():
    found = training.measure(epochs=1, rounds=1, arms=["service"])
    assert np.isfinite(
        [found["train_processor_s"]["service"], found["train_wall_s"]["service"]]
    ).all()
    assert found["train_wall_s"]["service"] > 0
