"""Recordings: what was to be seen, small in a file and the same when it is read back."""

from dataclasses import replace

import numpy as np
import pytest

from evenhand.restaurant import floor_plan, robots, serve_people
from evenhand.restaurant.simulation import layout, recording, serve
from evenhand.restaurant.worlds import World
from support.refusals import refused

N = 24
GRID = 1 / 4000
WORLD, ROBOT = World(), robots.ScriptedRobot("racist", 1.0)


@pytest.fixture(scope="module")
def served() -> tuple[layout.Setups, serve.Trajectories]:
    engine = serve_people.engine(WORLD, 7)  # fewer lanes than services: they are served in turns
    ahead = serve_people.draw(WORLD, N, np.random.default_rng(3), engine, ROBOT)
    return ahead.drawn.setups, engine.run(ahead.drawn, ahead.robot, recorded=True)


@pytest.fixture(scope="module")
def seen(served) -> recording.Recording:
    assert served[1].seen is not None
    return served[1].seen


def test_it_holds_places_and_people_as_they_were(served, seen):
    setups, _ = served
    np.testing.assert_array_equal(seen.people, setups.people)
    np.testing.assert_array_equal(seen.table, setups.table)
    np.testing.assert_array_equal(seen.shape, setups.shape)
    np.testing.assert_allclose(seen.position, setups.position, atol=GRID / 2)
    np.testing.assert_allclose(seen.start, setups.start, atol=GRID / 2)
    turn = np.exp(1j * seen.facing) / np.exp(1j * setups.facing)
    np.testing.assert_allclose(turn, 1.0, atol=GRID)


def test_it_ends_where_the_facts_say(served, seen):
    facts = served[1].facts
    assert not facts.responded.all()  # both ways a service can end
    assert facts.responded.any()
    np.testing.assert_array_equal(seen.frames, facts.steps // 5 + 1)
    last = seen.distance[np.arange(N), seen.frames - 1]
    np.testing.assert_allclose(last, facts.distance, atol=2 * GRID)
    # a pose every fifth step sees the least distance, or one a little greater
    least = np.nanmin(seen.distance, axis=1)
    assert (least > facts.min_distance - 2 * GRID).all()
    assert (least < facts.min_distance + 0.1).all()


def test_the_robot_never_jumps(seen):
    """Between two poses lie 0.1 s: 0.1 m at 1 m/s, a bit more in a bend, and no turn of the yaw."""
    way = np.diff(seen.pose, axis=1)
    way = way[np.isfinite(way[..., 0])]
    assert np.hypot(way[:, 0], way[:, 1]).max() < 1.05 * 0.1 * floor_plan.TOP_SPEED
    assert np.abs(way[:, 2]).max() < np.pi / 2


def test_what_was_sensed_is_known_at_each_decision(served, seen):
    decisions = served[1].mask.sum(axis=1).astype(int)
    known = np.isfinite(seen.sensed)
    np.testing.assert_array_equal(known.sum(axis=1), decisions)
    wanted = served[1].observation[:, :, 22] * 5.0  # its unit, from the table of observations
    np.testing.assert_allclose(seen.sensed[:, :-1][known[:, :-1]],
                               wanted[known[:, :-1]], atol=GRID)  # fmt: skip


def test_recording_changes_nothing(served):
    plain = serve_people.serve_people(WORLD, ROBOT, N, np.random.default_rng(3))
    assert plain.seen is None
    for name, values in vars(plain.facts).items():
        np.testing.assert_array_equal(values, getattr(served[1].facts, name))


def test_a_file_gives_back_the_same_and_is_small(seen, tmp_path):
    path = tmp_path / "seen.npz"
    recording.write(seen, path)
    back = recording.read(path)
    assert back.interval == seen.interval == 5
    for name, values in vars(seen).items():
        np.testing.assert_array_equal(getattr(back, name), values, err_msg=name)
    assert path.stat().st_size < 500 * N + 3000
    again = tmp_path / "again.npz"
    recording.write(back, again)
    assert again.read_bytes() == path.read_bytes()


def test_yaw_goes_on_over_a_whole_turn(seen):
    """By hand: one that turns left without end, 0.4 rad a pose."""
    pose = seen.pose[:1].copy()
    pose[0, :, 2] = 3.0 + 0.4 * np.arange(pose.shape[1])
    pose[0, 30:] = np.nan
    setups = replace(seen[:1], pose=pose)
    made = recording.make(setups, pose, seen.sensed[:1, :-1], 5)  # type: ignore[arg-type]
    np.testing.assert_allclose(np.diff(made.pose[0, :30, 2]), 0.4, atol=2 * GRID)
    assert np.isnan(made.pose[0, 30:]).all()


def test_a_service_is_found_by_its_number(seen):
    later = recording.renumbered(seen, 100)
    assert later.row(107) == 7
    both = recording.concat([seen, later])
    assert len(both) == 2 * N
    assert both.row(107) == N + 7
    with refused("missing service", "99", "100"):
        later.row(99)


class TestDamaged:
    @pytest.fixture
    def path(self, seen, tmp_path):
        recording.write(seen, tmp_path / "seen.npz")
        return tmp_path / "seen.npz"

    def test_missing(self, tmp_path):
        with refused("missing file", "none.npz"):
            recording.read(tmp_path / "none.npz")

    @pytest.mark.parametrize("kept", [0, 10, 600, -1])
    def test_cut_off_anywhere(self, path, kept):
        path.write_bytes(path.read_bytes()[:kept])
        with refused("format file", "seen.npz"):
            recording.read(path)

    def test_a_changed_byte(self, path):
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 0xFF
        path.write_bytes(content)
        with refused("format file", "seen.npz"):
            recording.read(path)

    def test_another_kind_of_file(self, path):
        np.savez(path, number=np.arange(3))
        with refused("changed file"):
            recording.read(path)

    def test_arrays_of_different_services(self, path):
        with np.load(path) as kept:
            content = dict(kept)
        content["facing"] = content["facing"][:-1]
        np.savez(path, **content)
        with refused("changed file"):
            recording.read(path)

    def test_a_pickle_is_never_opened(self, path):
        np.savez(path, number=np.array([{"a": 1}], dtype=object), allow_pickle=True)
        with refused("format file"):
            recording.read(path)
