"""Files and packages of users: loaded once, in worker processes too, and said when they fail."""

import os
import subprocess
import sys
from importlib.metadata import EntryPoint, EntryPoints

import pytest

from evenhand.core import plugins
from support.refusals import refused


@pytest.fixture(autouse=True)
def nothing_loaded(monkeypatch):
    monkeypatch.setattr(plugins, "_files", {})
    monkeypatch.setattr(plugins, "_groups", set())
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setenv(plugins.VARIABLE, "")


def test_a_file_is_run_once_and_its_neighbours_can_be_imported(tmp_path, monkeypatch):
    (tmp_path / "neighbour_of_mine.py").write_text("NUMBER = 7\n")
    file = tmp_path / "mine.py"
    file.write_text("import neighbour_of_mine\nNUMBER = neighbour_of_mine.NUMBER\n")
    found = plugins.load_plugin(file)
    assert found.NUMBER == 7
    assert plugins.load_plugin(str(file)) is found
    assert plugins.texts() == {"mine.py": file.read_text()}


def test_another_process_loads_what_this_one_loaded(tmp_path):
    file = tmp_path / "mine.py"
    seen = tmp_path / "seen"
    file.write_text(f"with open({str(seen)!r}, 'a') as file:\n    file.write('x')\n")
    plugins.load_plugin(file)
    code = "from evenhand.core import plugins; plugins.ready('evenhand.none'); plugins.ready('a')"
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))
    assert seen.read_text() == "xx"


def test_a_file_that_raises_shows_its_own_traceback_and_one_sentence(tmp_path, capsys):
    file = tmp_path / "mine.py"
    file.write_text("def f():\n    return 1 / 0\n\nf()\n")
    with refused("format plugin", "mine.py"):
        plugins.load_plugin(file)
    said = capsys.readouterr().err
    assert "return 1 / 0" in said
    assert said.endswith("ZeroDivisionError: division by zero\n")
    assert "importlib" not in said
    file.write_text("OK = True\n")
    assert plugins.load_plugin(file).OK


@pytest.mark.parametrize("name", ["mine.txt", "absent.py"])
def test_what_is_no_python_file(tmp_path, name):
    (tmp_path / "mine.txt").write_text("")
    with refused("missing plugin"):
        plugins.load_plugin(tmp_path / name)


def test_a_machine_without_the_file_loads_its_text_once(monkeypatch):
    monkeypatch.setattr(plugins, "_received", {})
    sent = {"mine.py": "CONTENT = object()\n"}
    plugins.load_texts(sent)
    first = list(plugins._files.values())
    plugins.load_texts(sent)
    assert list(plugins._files.values()) == first
    plugins.load_texts({"mine.py": "CONTENT = 2\n"})
    assert [hasattr(module, "CONTENT") for module in plugins._files.values()] == [True, True]


def test_entry_points_are_loaded_once(monkeypatch):
    calls = []
    point = EntryPoint("mine", "json:loads", "evenhand.methods")
    monkeypatch.setattr(
        plugins.importlib.metadata,
        "entry_points",
        lambda group: calls.append(group) or EntryPoints([point]),
    )
    plugins.ready("evenhand.methods")
    plugins.ready("evenhand.methods")
    assert calls == ["evenhand.methods"]


def test_a_package_that_does_not_load_is_named(monkeypatch, capsys):
    point = EntryPoint("mine", "json:absent", "evenhand.methods")
    monkeypatch.setattr(
        plugins.importlib.metadata, "entry_points", lambda group: EntryPoints([point])
    )
    with refused("format plugin"):
        plugins.ready("evenhand.methods")
    assert "AttributeError" in capsys.readouterr().err


class TestSource:
    def test_it_follows_the_file(self, tmp_path):
        text = "class Mine:\n    pass\n"
        found = []
        for number, content in enumerate((text, text, text + "# edited\n")):
            file = tmp_path / f"mine_{number}.py"
            file.write_text(content)
            found.append(plugins.source_of(plugins.load_plugin(file).Mine))
        assert found[0] == found[1] != found[2]

    def test_our_own_needs_none(self):
        assert plugins.source_of(plugins.load_plugin) is None

    def test_without_a_file_its_code_counts(self):
        found = []
        for body in ("return 1", "return 1", "return 2"):
            room = {"__name__": "nowhere"}
            exec(f"class Mine:\n    def f(self):\n        {body}\n", room)
            found.append(plugins.source_of(room["Mine"]))
        assert found[0] == found[1] != found[2]
