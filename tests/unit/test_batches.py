"""Packing the decisions that happened, and dealing them into minibatches."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenhand.training.batches import Trajectories, deal, pack


def two_services(lengths=(1, 2), places=3):
    """Observation, action, advantage and target all tell service and decision."""
    mask = (np.arange(places) < np.array(lengths)[:, None]).astype(np.float32)
    number = np.array([[0], [10]]) + np.arange(places)
    obs = np.stack([number, -number], axis=-1).astype(np.float32)
    return Trajectories(obs, number % 2, mask), number + 0.5, number + 0.25


def test_what_happened_comes_first_service_by_service():
    decisions, count = pack(*two_services())
    # Decision 0 of the first service, 0 and 1 of the second; three fit into half of six places.
    assert count == 3
    np.testing.assert_array_equal(decisions.obs, [[0, 0], [10, -10], [11, -11]])
    np.testing.assert_array_equal(decisions.action, [0, 0, 1])
    np.testing.assert_array_equal(decisions.advantage, [0.5, 10.5, 11.5])
    np.testing.assert_array_equal(decisions.target, [0.25, 10.25, 11.25])
    np.testing.assert_array_equal(decisions.mask, [1, 1, 1])


def test_more_than_half_takes_all_places():
    decisions, count = pack(*two_services(lengths=(1, 3)))
    assert count == 4
    np.testing.assert_array_equal(decisions.mask, [1, 1, 1, 1, 0, 0])
    np.testing.assert_array_equal(decisions.target, [0.25, 10.25, 11.25, 12.25, 0, 0])


def test_types_are_the_same_whatever_comes_in():
    trajectories, advantage, target = two_services()
    mixed = Trajectories(
        trajectories.obs.astype(float),
        trajectories.action.astype(np.int64),
        trajectories.mask.astype(bool),
    )
    decisions, _ = pack(mixed, advantage.astype(np.float16), target.astype(float))
    types = [x.dtype for x in decisions]
    assert types == [np.float32, np.int32, *[np.float32] * 4]


def test_rubbish_behind_the_end_of_a_service_is_left_out():
    trajectories, advantage, target = two_services()
    after = trajectories.mask == 0
    trajectories.obs[after] = np.nan
    trajectories.action[after] = 7
    advantage[after] = np.inf
    decisions, _ = pack(trajectories, advantage, target)
    for soiled, clean in zip(decisions, pack(*two_services())[0], strict=True):
        np.testing.assert_array_equal(soiled, clean)


def broken(what):
    trajectories, advantage, target = two_services()
    if what == "obs":
        trajectories.obs[1, 1, 0] = np.nan
    elif what == "action":
        trajectories.action[1, 1] = 2
    elif what == "advantage":
        advantage[0, 0] = np.inf
    elif what == "shape":
        target = target[:, :2]
    elif what == "rewards of people":
        advantage = advantage[:, 0]
    else:
        trajectories = trajectories._replace(mask=np.zeros((2, 3)))
    return trajectories, advantage, target


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("obs", "obs is not finite"),
        ("action", "neither 0"),
        ("advantage", "advantage is not finite"),
        ("shape", r"target has shape \(2, 2\)"),
        ("rewards of people", r"advantage has shape \(2,\)"),
        ("nothing", "no decision happened"),
    ],
)
def test_arrays_that_cannot_be_learned_from_are_refused(what, message):
    with pytest.raises(ValueError, match=message):
        pack(*broken(what))


@given(
    st.integers(1, 40),
    st.integers(0, 40),
    st.integers(1, 4),
    st.integers(1, 9),
    st.integers(0, 2**32),
)
def test_every_pass_deals_every_decision_once_and_evenly(count, spare, passes, minibatches, seed):
    capacity = count + spare
    order = deal(count, capacity, passes, minibatches, np.random.default_rng(seed))
    assert order.dtype == np.int32
    assert order.shape == (passes * minibatches, -(-capacity // minibatches))
    for hands in order.reshape(passes, minibatches, -1):
        real = hands < count
        assert np.all(real | (hands == capacity))
        sizes = real.sum(axis=1)
        assert sizes.max() - sizes.min() <= 1
        times = np.bincount(hands[real], minlength=count)
        if count >= minibatches:
            assert np.all(times == 1)
        else:  # an empty step would still move the weights
            assert np.all(sizes == 1)
            assert np.all(times >= 1)


def test_passes_are_shuffled_anew_by_the_generator():
    order = deal(40, 40, 2, 1, np.random.default_rng(0))
    assert not np.array_equal(order[0], order[1])
    np.testing.assert_array_equal(order, deal(40, 40, 2, 1, np.random.default_rng(0)))
    assert not np.array_equal(order, deal(40, 40, 2, 1, np.random.default_rng(1)))
