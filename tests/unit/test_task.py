"""The task by hand: where the robot drives, what it sees, what a service is worth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenhand.core.errors import InputError
from evenhand.restaurant import floor_plan
from evenhand.restaurant.simulation import driving, task
from evenhand.restaurant.simulation.task import TaskSettings


class TestTimes:
    def test_a_step_is_a_fiftieth_of_a_second(self):
        seconds = np.array([1, 200, floor_plan.MAX_STEPS]) * floor_plan.TIMESTEP
        assert seconds == pytest.approx([0.02, 4.0, 6.0])

    @pytest.mark.parametrize(("interval", "decisions"), [(1, 300), (5, 60), (10, 30), (60, 5)])
    def test_decisions_of_a_service(self, interval, decisions):
        assert TaskSettings(interval).decisions == decisions

    def test_ten_decisions_a_second_by_default(self):
        assert TaskSettings().interval == 5
        assert TaskSettings().decisions == 60

    @pytest.mark.parametrize("interval", [0, -5, 7, 8, 61, 75, 300])
    def test_intervals_that_do_not_fit(self, interval):
        with pytest.raises(InputError, match=f"interval is {interval}: .* must divide 300"):
            TaskSettings(interval)


def steer(robot: complex, heading: float, target: complex, gap: float) -> np.ndarray:
    command = driving.steer(
        robot, heading, target, gap, floor_plan.TOP_SPEED, floor_plan.MAX_ACCELERATION
    )
    return np.array(command)


class TestSteering:
    def test_straight_to_the_target_at_top_speed(self):
        # a way of (3, 4) is 5 m long
        assert steer(1 + 1j, np.arctan2(4, 3), 4 + 5j, 3.0) == pytest.approx([0.6, 0.8, 0.0])

    @pytest.mark.parametrize(
        ("gap", "speed"),
        [
            (3.0, 1.0),
            (0.25, 0.7905694),  # √(2·1.25·0.25), slower than 4·0.25
            (0.1, 0.4),  # 4·0.1, slower than √(2·1.25·0.1) = 0.5
            (0.01, 0.04),
            (0.0, 0.0),
            (-0.1, 0.0),
        ],
    )
    def test_it_slows_down_as_the_gap_closes(self, gap, speed):
        assert steer(0j, 0.0, 2 + 0j, gap) == pytest.approx([speed, 0.0, 0.0])

    @pytest.mark.parametrize(
        ("heading", "turn"),
        [
            (0.0, 0.0),
            (0.1, -0.6),
            (-0.1, 0.6),
            (2.0, -3.0),  # at most 3 rad/s
            (-2.0, 3.0),
            (2 * np.pi + 0.1, -0.6),  # whole turns do not count
        ],
    )
    def test_it_turns_to_where_it_drives_the_short_way_round(self, heading, turn):
        assert steer(0j, heading, 1 + 0j, 1.0)[2] == pytest.approx(turn)

    def test_behind_it_may_turn_either_way(self):
        assert abs(steer(0j, np.pi, 1 + 0j, 1.0)[2]) == pytest.approx(3.0)

    def test_at_the_target_it_stands(self):
        assert np.isfinite(steer(1 + 1j, 0.3, 1 + 1j, 1.0)).all()

    @given(
        st.complex_numbers(max_magnitude=10, allow_nan=False),
        st.complex_numbers(max_magnitude=10, allow_nan=False),
        st.floats(-10, 10),
        st.floats(-1, 10),
    )
    def test_never_faster_than_the_top_speed(self, robot, target, heading, gap):
        command = steer(robot, heading, target, gap)
        assert np.hypot(command[0], command[1]) <= floor_plan.TOP_SPEED + 1e-9
        assert abs(command[2]) <= 3.0


class TestObservation:
    def test_by_hand(self):
        one_hot = np.zeros((2, 22), np.float32)
        one_hot[0, [0, 7, 13, 15, 20]] = 1.0
        known = np.array([2.5, 12.0]), np.array([60, 300]), np.array([0, 3.0])
        seen = task.observe(np.arange(2), one_hot, *known)
        assert seen.shape == (2, 25)
        assert seen.dtype == np.float32
        np.testing.assert_array_equal(seen[:, :22], one_hot)
        # 2.5 m of 5 m; 60 of 300 steps; a fresh reading. 12 m are cut off at 10 m, 3 s at 1 s.
        np.testing.assert_allclose(seen[:, 22:], [[0.5, 0.2, 0.0], [2.0, 1.0, 1.0]])


def terms(responded: bool, step: int, distance: float, least: float) -> list[float]:
    service = (np.array([value]) for value in (responded, step, distance, least))
    return task.quality(*service)[0][0].tolist()


class TestReward:
    @pytest.mark.parametrize(
        ("service", "expected"),
        [
            ((True, 100, 1.25, 1.25), [0.2, 0.5, 0.3, 0.0]),  # perfect: 1
            ((True, 200, 1.0, 1.0), [0.2, 0.5, 0.3, 0.0]),  # on all limits
            ((True, 200, 1.5, 0.5), [0.2, 0.5, 0.3, 0.0]),
            ((True, 250, 1.25, 1.25), [0.2, 0.5, 0.15, 0.0]),  # halfway to 300
            ((True, 300, 1.25, 1.25), [0.2, 0.5, 0.0, 0.0]),
            ((True, 0, 0.75, 0.75), [0.2, 0.25, 0.3, 0.0]),  # halfway to 0.5 m
            ((True, 0, 2.25, 2.25), [0.2, 0.25, 0.3, 0.0]),  # halfway to 3 m
            ((True, 0, 4.5, 4.5), [0.2, 0.0, 0.3, 0.0]),
            ((True, 150, 0.45, 0.45), [0.2, 0.0, 0.3, -0.5]),
            ((True, 150, 1.25, 0.499), [0.2, 0.5, 0.3, -0.5]),  # close once, then at a distance
            ((False, 300, 0.42, 0.42), [0.0, 0.0, 0.0, -0.5]),
            ((False, 300, 1.25, 1.25), [0.0, 0.0, 0.0, 0.0]),
        ],
    )
    def test_by_hand(self, service, expected):
        assert terms(*service) == pytest.approx(expected)

    @given(st.booleans(), st.integers(0, 300), st.floats(0, 10), st.floats(0, 10))
    def test_between_minus_a_half_and_one(self, responded, step, distance, least):
        assert -0.5 <= sum(terms(responded, step, distance, least)) <= 1.0 + 1e-12

    @given(st.integers(0, 299), st.floats(0.5, 10))
    def test_sooner_is_never_worth_less(self, step, distance):
        assert sum(terms(True, step, distance, distance)) >= sum(
            terms(True, step + 1, distance, distance)
        )
