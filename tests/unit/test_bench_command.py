"""What ``make bench`` measures, and in which order; nothing is measured here."""

import json
from importlib import import_module
from pathlib import Path

import pytest

from benchmarks.__main__ import Bench, main
from evenhand.core import extras
from evenhand.core.errors import InputError
from support.refusals import refused

PARTS = {
    "env": "environment",
    "train": "training",
    "audit": "audit",
    "film": "film",
    "adapters": "adapters",
    "study": "study",
    "sweep": "sweep",
    "sb3": "stable_baselines3",
}


@pytest.fixture
def measured(monkeypatch) -> list[str]:
    """What is measured; each takes no time."""
    names: list[str] = []

    def measure(name: str):
        return lambda *_: names.append(name) or {name: 1}

    for name, room in PARTS.items():
        module = import_module(f"benchmarks.{room}")
        monkeypatch.setattr(module, "measure", measure(name))
        monkeypatch.setattr(module, "show", lambda found: print(*found))
    monkeypatch.setattr(extras, "require", lambda *_: None)
    return names


def test_everything(measured, capsys):
    assert Bench().run("") == 0
    assert measured == list(PARTS)
    assert capsys.readouterr().out.split() == list(PARTS)
    assert Bench(json=True).run("") == 0
    assert json.loads(capsys.readouterr().out) == dict.fromkeys(PARTS, 1)


@pytest.mark.parametrize("name", PARTS)
def test_one_thing(measured, capsys, name):
    assert Bench(what=name, json=True).run("") == 0
    assert measured == [name]
    assert capsys.readouterr().out == f'{{"{name}": 1}}\n'


def test_a_commit_to_train_against(measured, monkeypatch):
    given = []
    training = import_module("benchmarks.training")
    monkeypatch.setattr(training, "measure", lambda against: given.append(against) or {})
    assert Bench(what="train", against=Path("old"), json=True).run("") == 0
    assert given == [Path("old")]
    with refused("conflict against", "--against", "--what"):
        Bench(what="audit", against=Path("old")).run("")
    assert measured == []


class TestWithoutStableBaselines3:
    @pytest.fixture(autouse=True)
    def gone(self, measured, monkeypatch):
        def gone(extra: str, what: str) -> None:
            if extra == "sb3":
                raise InputError("unavailable it", "it is not installed")

        monkeypatch.setattr(extras, "require", gone)

    def test_everything_else(self, measured, capsys):
        assert Bench().run("") == 0
        assert measured == list(PARTS)[:-1]
        assert capsys.readouterr().err == "sb3 is left out: it is not installed\n"

    def test_alone(self, measured):
        with refused("unavailable it"):
            Bench(what="sb3").run("")
        assert measured == []


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--seconds", "nan"), "seconds is nan: give 0.01 to 600"),
        (("--seconds", "0"), "seconds is 0.0: give 0.01 to 600"),
        (("now",), "unexpected word 'now': options begin with --"),
    ],
)
def test_wrong_words_get_one_sentence(capsys, words, sentence):
    assert main(words) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert sentence in shown.err
    assert "Traceback" not in shown.err
