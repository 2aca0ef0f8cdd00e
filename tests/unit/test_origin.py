"""What made a run: noted, read back, and refused where it differs."""

import pytest

from evenhand import files
from evenhand.errors import InputError
from evenhand.experiments import origin
from evenhand.learn import run

OTHER = run.versions() | {"mujoco": "3.9.9"}
DIFFERS = r'mujoco "3\.9\.9" there and "[\d.]+" here'


def test_a_run_says_what_made_it_or_its_settings_do(tmp_path):
    nothing = {"versions": None, "commit": None, "world": None, "detector": None}
    assert origin.of_run(tmp_path, {"key": "k"}) == nothing
    noted = {"versions": OTHER, "fingerprints": {"settings": "a", "detector": "b"}}
    files.write_json(tmp_path / "settings.json", noted)
    assert origin.of_run(tmp_path, {}) == nothing | {"versions": OTHER, "detector": "b"}
    now = origin.now()
    assert origin.of_run(tmp_path, {"key": "k"} | now) == nothing | now
    files.write_json(tmp_path / "settings.json", noted | {"versions": "4"})
    with pytest.raises(InputError, match="is damaged, its versions are no record"):
        origin.of_run(tmp_path, {})


def test_what_was_made_otherwise_is_not_mixed(tmp_path):
    here = origin.now() | {"world": {"tips": 1.0}, "detector": "b"}
    unknown = dict.fromkeys(here)
    origin.check(tmp_path, unknown, here)
    origin.check(tmp_path, here, here)
    # neither another commit nor another Python is refused
    python = run.versions() | {"python": "3.99"}
    origin.check(tmp_path, unknown | {"versions": python, "commit": {"hash": "x"}}, here)
    for then, said in (
        ({"versions": OTHER}, f"was begun with other versions .{DIFFERS}.: install those, or"),
        ({"world": {"tips": 0.5}}, "another scenario or .*world.tips 0.5 there and 1.0 here"),
        ({"detector": "c"}, 'detector "c" there and "b" here'),
    ):
        with pytest.raises(InputError, match=said):
            origin.check(tmp_path, unknown | then, here)


def test_a_folder_belongs_to_one_experiment_and_one_set_of_versions(tmp_path, monkeypatch):
    origin.claim(tmp_path, "note.json", {"epochs": 3})
    origin.claim(tmp_path, "note.json", {"epochs": 3})
    with pytest.raises(InputError, match=r"holds another experiment .epochs 3 there and 4 here"):
        origin.claim(tmp_path, "note.json", {"epochs": 4})
    monkeypatch.setattr(run, "versions", lambda: OTHER)
    with pytest.raises(InputError, match="was begun with other versions"):
        origin.claim(tmp_path, "note.json", {"epochs": 3})
    files.write_json(tmp_path / "note.json", {"epochs": 3})  # as before they were noted
    origin.claim(tmp_path, "note.json", {"epochs": 3})


def test_runs_are_counted_by_what_made_them():
    new, old = origin.now(), {"versions": OTHER, "commit": None}
    assert origin.distinct([old, new, old]) == [old | {"runs": 2}, new | {"runs": 1}]
    assert origin.distinct([]) == []
