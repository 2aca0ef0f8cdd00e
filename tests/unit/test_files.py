"""Files are whole or absent, folders belong to one."""

import json
import os
import subprocess
import sys
import types
from typing import Any

import pytest

from evenhand.core import files
from evenhand.core.errors import InputError
from support.refusals import refused


class TestText:
    def test_written_as_given(self, tmp_path):
        path = tmp_path / "a.txt"
        files.write_text(path, "ä\n\r\nb")
        assert path.read_bytes() == "ä\n\r\nb".encode()
        assert os.listdir(tmp_path) == ["a.txt"]

    def test_written_over(self, tmp_path):
        path = tmp_path / "a.txt"
        path.write_text("a longer text than the new one")
        files.write_text(path, "new")
        assert path.read_text() == "new"

    def test_who_reads_meanwhile_sees_the_old_one_whole(self, tmp_path):
        path = tmp_path / "a.txt"
        path.write_text("old and long")
        with path.open() as reader:
            files.write_text(path, "new")
            assert reader.read() == "old and long"

    def test_nowhere(self, tmp_path):
        with refused("unavailable file"):
            files.write_text(tmp_path / "no" / "a.txt", "x")

    def test_nothing_is_left_of_what_failed(self, tmp_path):
        (tmp_path / "a").mkdir()
        with refused("unavailable file"):
            files.write_text(tmp_path / "a", "x")
        assert os.listdir(tmp_path) == ["a"]

    def test_what_was_there_stays_until_the_new_is_whole(self, tmp_path, monkeypatch):
        path = tmp_path / "a.txt"
        path.write_text("old")

        def full(_: int) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "fsync", full)
        with refused("unavailable file"):
            files.write_text(path, "new")
        assert path.read_text() == "old"
        assert os.listdir(tmp_path) == ["a.txt"]


class TestJson:
    def test_and_back(self, tmp_path):
        content: dict[str, Any] = {"b": [1, 2.5, None, True], "a": {"ü": "text"}}
        files.write_json(tmp_path / "a.json", content)
        assert files.read_json(tmp_path / "a.json") == content
        assert (tmp_path / "a.json").read_text().endswith("}\n")
        assert list(json.loads((tmp_path / "a.json").read_text())) == ["b", "a"]

    def test_no_number_is_no_json(self, tmp_path):
        with pytest.raises(ValueError, match="not JSON compliant"):
            files.write_json(tmp_path / "a.json", {"x": float("nan")})
        assert os.listdir(tmp_path) == []

    @pytest.mark.parametrize(
        ("content", "said"),
        [
            (None, r"a\.json does not exist"),
            (b'{"x": [1,\n 2', r"a\.json is no JSON or was cut off \(line 2\)"),
            (b"", r"a\.json is no JSON or was cut off \(line 1\)"),
            (b'{"x": "\xff"}', r"a\.json cannot be read: "),
        ],
    )
    def test_what_cannot_be_read(self, tmp_path, content, said):
        if content is not None:
            (tmp_path / "a.json").write_bytes(content)
        with pytest.raises(InputError, match=said):
            files.read_json(tmp_path / "a.json")

    def test_a_folder_is_no_json(self, tmp_path):
        with refused("unavailable file"):
            files.read_json(tmp_path)


class TestRecords:
    def test_with_its_fields(self, tmp_path):
        files.write_json(tmp_path / "a.json", {"x": 1, "y": 2, "z": 3})
        assert files.read_record(tmp_path / "a.json", "x", "y") == {"x": 1, "y": 2, "z": 3}

    def test_without_a_field(self, tmp_path):
        files.write_json(tmp_path / "a.json", {"x": 1})
        with refused("missing file", "a.json"):
            files.read_record(tmp_path / "a.json", "x", "y")

    @pytest.mark.parametrize("content", [[1, 2], "xy", None, 1])
    def test_of_another_kind(self, tmp_path, content):
        files.write_json(tmp_path / "a.json", content)
        with refused("format file", "a.json"):
            files.read_record(tmp_path / "a.json")

    def test_what_differs(self):
        there = {"a": 1, "b": {"c": 2, "d": [3]}, "e": 4}
        assert files.differences(there, there) == ""
        assert files.differences(there, {"a": 1, "b": {"c": 5, "d": [3]}, "f": None}) == (
            "b.c 2 there and 5 here, e 4 there and null here"
        )


class TestLogs:
    def test_text_is_added(self, tmp_path):
        files.append_text(tmp_path / "a", "x\n")
        files.append_text(tmp_path / "a", "y\n")
        assert (tmp_path / "a").read_text() == "x\ny\n"

    def test_nowhere(self, tmp_path):
        with refused("unavailable file"):
            files.append_text(tmp_path / "no" / "a", "x")

    def test_half_written_files_are_swept_away(self, tmp_path):
        for name in (".a.json.12.part", "b.parquet.part", "c.parquet", ".lock"):
            (tmp_path / name).touch()
        files.sweep(tmp_path)
        assert sorted(os.listdir(tmp_path)) == [".lock", "c.parquet"]


class TestFolders:
    def test_made_with_its_parents(self, tmp_path):
        folder = files.make_folder(tmp_path / "a" / "b")
        assert folder.is_dir()
        assert os.listdir(folder) == []
        assert files.make_folder(str(folder)) == folder

    def test_a_file_is_no_folder(self, tmp_path):
        (tmp_path / "a").write_text("")
        with refused("conflict folder"):
            files.make_folder(tmp_path / "a")
        with refused("unavailable folder"):
            files.make_folder(tmp_path / "a" / "b")


class TestLock:
    OTHER = """
import sys
from pathlib import Path
from evenhand.core import files
try:
    with files.locked(Path(sys.argv[1])):
        print("free")
except ValueError as error:
    print(error)
"""

    def other(self, folder) -> str:
        """What another process meets in this folder."""
        command = [sys.executable, "-c", self.OTHER, str(folder)]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    def test_one_process_at_a_time(self, tmp_path):
        with files.locked(tmp_path):
            assert self.other(tmp_path) == (
                f"another process works in {tmp_path}: wait for it or give another folder"
            )
        assert self.other(tmp_path) == "free"

    def test_free_again_after_an_error(self, tmp_path):
        with pytest.raises(KeyError), files.locked(tmp_path):
            raise KeyError
        assert self.other(tmp_path) == "free"


class TestClaim:
    IS = types.MappingProxyType({"epochs": 300, "population": "us"})

    def test_an_empty_folder_is_taken_and_kept(self, tmp_path):
        (tmp_path / ".lock").touch()  # what is hidden does not count
        files.claim_folder(tmp_path, "note.json", dict(self.IS))
        (tmp_path / "results").mkdir()
        files.claim_folder(tmp_path, "note.json", dict(self.IS))
        assert files.read_json(tmp_path / "note.json") == self.IS

    def test_another_experiment_says_what_differs(self, tmp_path):
        files.claim_folder(tmp_path, "note.json", dict(self.IS))
        with refused("conflict folder", "300", "40"):
            files.claim_folder(tmp_path, "note.json", {**self.IS, "epochs": 40})
        assert files.read_json(tmp_path / "note.json") == self.IS

    def test_a_note_with_more_in_it(self, tmp_path):
        files.write_json(tmp_path / "note.json", {**self.IS, "x": 1})
        with refused("conflict folder", "1"):
            files.claim_folder(tmp_path, "note.json", dict(self.IS))

    def test_a_folder_of_something_else_is_left_alone(self, tmp_path):
        (tmp_path / "thesis.txt").touch()
        with refused("conflict folder"):
            files.claim_folder(tmp_path, "note.json", dict(self.IS))
        assert os.listdir(tmp_path) == ["thesis.txt"]
