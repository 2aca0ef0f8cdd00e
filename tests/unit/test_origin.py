"""What made a run: noted, read back, and refused where it differs."""

import pytest

from evenhand.core import files
from evenhand.core.errors import InputError
from evenhand.experiments import provenance
from evenhand.training import run_folder
from support.refusals import refused

OTHER = run_folder.versions() | {"mujoco": "3.9.9"}
DIFFERS = r'mujoco "3\.9\.9" there and "[\d.]+" here'


def test_a_run_says_what_made_it_or_its_settings_do(tmp_path):
    nothing = {"versions": None, "commit": None, "world": None, "detector": None}
    assert provenance.of_run(tmp_path, {"key": "k"}) == nothing
    noted = {"versions": OTHER, "fingerprints": {"settings": "a", "detector": "b"}}
    files.write_json(tmp_path / "settings.json", noted)
    assert provenance.of_run(tmp_path, {}) == nothing | {"versions": OTHER, "detector": "b"}
    now = provenance.now()
    assert provenance.of_run(tmp_path, {"key": "k"} | now) == nothing | now
    files.write_json(tmp_path / "settings.json", noted | {"versions": "4"})
    with refused("format folder"):
        provenance.of_run(tmp_path, {})


def test_what_was_made_otherwise_is_not_mixed(tmp_path):
    here = provenance.now() | {"world": {"tips": 1.0}, "detector": "b"}
    unknown = dict.fromkeys(here)
    provenance.check(tmp_path, unknown, here)
    provenance.check(tmp_path, here, here)
    # neither another commit nor another Python is refused
    python = run_folder.versions() | {"python": "3.99"}
    provenance.check(tmp_path, unknown | {"versions": python, "commit": {"hash": "x"}}, here)
    for then, said in (
        ({"versions": OTHER}, f"was begun with other versions .{DIFFERS}.: install those, or"),
        ({"world": {"tips": 0.5}}, "another scenario or .*world.tips 0.5 there and 1.0 here"),
        ({"detector": "c"}, 'detector "c" there and "b" here'),
    ):
        with pytest.raises(InputError, match=said):
            provenance.check(tmp_path, unknown | then, here)


def test_a_folder_belongs_to_one_experiment_and_one_set_of_versions(tmp_path, monkeypatch):
    provenance.claim(tmp_path, "note.json", {"epochs": 3})
    provenance.claim(tmp_path, "note.json", {"epochs": 3})
    with refused("conflict folder", "3", "4"):
        provenance.claim(tmp_path, "note.json", {"epochs": 4})
    monkeypatch.setattr(run_folder, "versions", lambda: OTHER)
    with refused("changed file"):
        provenance.claim(tmp_path, "note.json", {"epochs": 3})
    files.write_json(tmp_path / "note.json", {"epochs": 3})  # as before they were noted
    provenance.claim(tmp_path, "note.json", {"epochs": 3})


def test_runs_are_counted_by_what_made_them():
    new, old = provenance.now(), {"versions": OTHER, "commit": None}
    assert provenance.distinct([old, new, old]) == [old | {"runs": 2}, new | {"runs": 1}]
    assert provenance.distinct([]) == []
