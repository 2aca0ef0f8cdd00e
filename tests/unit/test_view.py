"""What the policy gets to see, by hand."""

import numpy as np
import pytest

from evenhand.training.observation import view
from evenhand.training.settings import TrainSettings

SEEN, UNAWARE = TrainSettings(), TrainSettings("service", method="unaware")


def observation(*lead: int) -> np.ndarray:
    """22 groups, distance 1 m, 180 of 300 steps, a reading 0.4 s old."""
    out = np.zeros((*lead, 25), np.float32)
    out[..., [0, 7, 11, 15, 21]] = 1.0
    out[..., 22:] = 0.2, 0.6, 0.4
    return out


def test_distance_and_time_by_hand():
    found = view(SEEN, observation(3))
    np.testing.assert_array_equal(found[:, :22], observation(3)[:, :22])
    # 6 (0.2 - 0.3), 3 (0.6 - 0.3), and the age as it is
    expected = np.broadcast_to([-0.6, 0.9, 0.4], (3, 3))
    np.testing.assert_allclose(found[:, 22:], expected, rtol=1e-6)


def test_the_middle_of_the_scale_is_nothing():
    middle = observation()
    middle[22:] = 0.3, 0.3, 0.0
    np.testing.assert_allclose(view(SEEN, middle)[22:], 0.0, atol=1e-6)


def test_the_unaware_see_exactly_the_22_groups_less():
    aware, unaware = view(SEEN, observation(4, 2)), view(UNAWARE, observation(4, 2))
    assert (unaware[..., :22] == 0.0).all()
    np.testing.assert_array_equal(unaware[..., 22:], aware[..., 22:])


@pytest.mark.parametrize("settings", [SEEN, UNAWARE])
@pytest.mark.parametrize("lead", [(), (3,), (4, 2)])
def test_the_observation_itself_stays(settings, lead):
    given = observation(*lead)
    found = view(settings, given)
    np.testing.assert_array_equal(given, observation(*lead))
    assert (found.shape, found.dtype) == (given.shape, np.float32)
    assert not np.shares_memory(found, given)
