"""What was to be seen in a run: kept beside its services, read back by number."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.methods import detector_file
from evenhand.training import recordings, run_folder
from evenhand.training.settings import settings_of

SETTINGS = replace(settings_of("service", "reinforce", "penalty", epochs=3), people=4)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A finished run of 12 services, with a checkpoint every second epoch."""
    out = tmp_path_factory.mktemp("states") / "run"
    run_folder.execute(
        out, SETTINGS, detector_file.load(detector_file.SHIPPED), every=2, recorded=True
    )
    return out


def test_every_service_was_recorded_as_it_ended(folder):
    seen, table = recordings.read(folder), run_folder.read_services(folder)
    np.testing.assert_array_equal(seen.number, table.fact("service"))
    np.testing.assert_array_equal(seen.frames, table.fact("steps") // 5 + 1)
    np.testing.assert_allclose(seen.distance[:, 0], table.fact("start_distance"), atol=0.001)
    for index, name in enumerate(("race", "gender", "age", "disability", "skin")):
        np.testing.assert_array_equal(seen.people[:, 0, index], table.identity(name)[0])


def test_services_come_in_the_order_that_was_asked_for(folder):
    seen = recordings.read(folder, [9, 0])
    assert seen.number.tolist() == [9, 0]
    whole = recordings.read(folder)
    np.testing.assert_array_equal(seen.pose[0], whole.pose[9])


def test_recording_is_no_setting_and_changes_no_bit(folder, tmp_path):
    """The same run without states: everything else is the same, and nothing can be drawn."""
    plain = tmp_path / "plain"
    run_folder.execute(plain, SETTINGS, detector_file.load(detector_file.SHIPPED), every=2)
    for path in sorted(plain.rglob("*")):
        if path.is_file() and path.name != ".lock":
            assert path.read_bytes() == (folder / path.relative_to(plain)).read_bytes(), path
    with pytest.raises(InputError, match=r"plain has no states to draw: .*--no-states"):
        recordings.read(plain)


def test_what_is_not_there_is_said(folder, tmp_path):
    with pytest.raises(
        InputError, match=r"service 12 was not recorded: there are services 0 to 11"
    ):
        recordings.read(folder, [3, 12])
    with pytest.raises(InputError, match=r"holds no run"):
        recordings.read(tmp_path)
