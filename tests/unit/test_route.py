"""Planned ways: around one disc by hand, and clear of everything for many set-ups."""

import numpy as np
import pytest

from evenhand.restaurant import floor_plan, people
from evenhand.restaurant.simulation import layout, route


def find(start: complex, person: complex, centre: list[complex], around: list[float], **seat):
    """The way of one robot to a person who stands, or who sits where ``seat`` says."""
    one = np.array([[0j]])
    return route.find(
        np.array([[start]]),
        np.array([person]),
        np.array([seat.get("seat", 0j)]),
        np.array([seat.get("access", person)]),
        np.array([seat.get("host", -1)]),
        np.array([centre]) if centre else one,
        np.array([around]) if around else np.zeros((1, 1)),
    )


class TestByHand:
    def test_nothing_in_between(self):
        way = find(-2 + 0j, 1 + 0j, [0 + 2j], [0.5])
        assert way.tried[0] == 0
        assert way.last[0] == 0
        assert way.points[0].tolist() == [1, 1, 1]
        assert way.length[0] == pytest.approx(3.0)

    @pytest.mark.parametrize("side", [1, -1])
    def test_around_one_disc_on_the_nearer_side(self, side):
        # a disc of 0.95 m, and 0.05 m to spare, with its middle a little beside the way: the
        # tangents from (∓2, 0) to a circle of radius 1 around (0, -0.1 side) meet on x = 0
        way = find(-2 + 0j, 2 + 0j, [-0.1j * side], [0.95])
        assert way.tried[0] == 0
        assert way.last[0] == 1
        corner = way.points[0, 0]
        assert corner.real == pytest.approx(0.0)
        # height h of the corner: a line from (-2, 0) to (0, h) is 1 m from (0, -0.1):
        # 2 |h + 0.1| / √(4 + h²) = 1, so 3h² + 0.8h - 3.96 = 0
        height = (-0.8 + np.sqrt(0.64 + 12 * 3.96)) / 6
        assert corner.imag * side == pytest.approx(height)
        assert way.length[0] == pytest.approx(2 * np.hypot(2, height))

    def test_through_the_room_and_not_the_wall(self):
        # the nearer side lies beyond the wall at y = 4.3
        way = find(-2 + 3.4j, 2 + 3.4j, [3.3j], [0.8])
        corner = way.points[0, 0]
        assert corner.imag < 3.3
        assert way.tried[0] == 0

    def test_two_discs_that_leave_no_way(self):
        # at most one corner: behind the first disc the way would enter the second
        assert find(-3 + 0j, 3 + 0j, [-1 + 0j, 1 + 0j], [0.8, 0.8]).tried[0] == -1

    def test_a_seat_is_approached_from_its_front(self):
        # the table at the origin, its guest below it; the robot comes from above, beside the table
        seat = {"seat": -1j, "access": -1.35j, "host": 0}
        way = find(-2 + 1.5j, -0.72j, [0j], [floor_plan.CLUSTER_RADIUS], **seat)
        assert way.tried[0] == 0
        assert way.last[0] == 2
        assert way.points[0, 1:].tolist() == [-1.35j, -0.72j]
        assert way.front[0] == -1j
        assert abs(way.points[0, 0]) > floor_plan.CLUSTER_RADIUS

    def test_who_is_in_front_of_the_seat_drives_straight(self):
        seat = {"seat": -1j, "access": -1.35j, "host": 0}
        way = find(0.5 - 3j, -0.72j, [0j], [floor_plan.CLUSTER_RADIUS], **seat)
        assert way.last[0] == 0
        assert way.points[0].tolist() == [-0.72j] * 3
        assert way.front[0] == 0

    @pytest.mark.parametrize(("angle", "front"), [(0, True), (54, True), (56, False), (180, False)])
    def test_the_front_of_a_seat_is_55_degrees_to_either_side(self, angle, front):
        for sign in (1, -1):
            position = 2.0 * np.exp(1j * np.deg2rad(sign * angle))
            assert route.in_front(position, 0j, 1 + 0j) == front

    def test_without_a_table_every_side_is_the_front(self):
        for around in np.exp(1j * np.linspace(0, 6, 7)):
            assert route.in_front(around, 0j, 0j)


@pytest.fixture(scope="module")
def setups() -> layout.Setups:
    return layout.draw(people.population("uniform"), 600, np.random.default_rng(17))


class TestDrawnWays:
    N = 60

    def trace(self, setups: layout.Setups) -> np.ndarray:
        """Points along every way, complex [n, 3 · N]."""
        start = layout.as_complex(setups.start)
        corners = np.concatenate([start[:, None], setups.way], axis=1)
        share = np.linspace(0.0, 1.0, self.N)
        legs = corners[:, :-1, None] + share * np.diff(corners, axis=1)[..., None]
        return legs.reshape(len(start), -1)

    def test_they_lead_from_the_start_to_the_person(self, setups):
        person = layout.as_complex(setups.position[:, 0])
        rows = np.arange(len(setups))
        np.testing.assert_array_equal(setups.way[rows, setups.last], person)
        np.testing.assert_array_equal(setups.way[:, -1], person)
        before = setups.last > 0
        assert (setups.way[rows, setups.last - 1] != person)[before].all()

    def test_they_do_not_touch_furniture_guests_or_walls(self, setups):
        trace = self.trace(setups)
        discs = [(layout.as_complex(c), 0.40) for c in floor_plan.TABLES]
        discs += [(layout.as_complex(c), 0.20) for c in floor_plan.CHAIRS]
        for centre, radius in discs:
            assert (np.abs(trace - centre) > radius + 0.20).all()
        for i in range(1, 12):
            other = layout.as_complex(setups.position[:, i])[:, None]
            assert (np.abs(trace - other) > setups.radius[:, i, None] + 0.20).all()
        assert (np.abs(np.real(trace)) < 7.0 - 0.20).all()
        assert (np.abs(np.imag(trace)) < 4.3 - 0.20).all()

    def test_all_sorts_of_ways_occur(self, setups):
        assert set(setups.last.tolist()) == {0, 1, 2}
        assert (setups.front != 0).any()
