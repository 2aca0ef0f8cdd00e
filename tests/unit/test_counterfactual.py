"""Counterfactual preprocessing: nothing that the policy sees depends on whom it serves."""

import numpy as np
import pytest

from evenhand.methods.rivals.counterfactual import without_identity
from evenhand.restaurant import serve_people
from evenhand.restaurant.simulation import task
from evenhand.training.observation import affine, identity_effects, view
from evenhand.training.settings import TrainSettings
from evenhand.training.train import acting, untrained


def test_by_hand():
    # two identities of two groups; the second person's own effect is 0.3 - 0.1 at step 1
    identity = np.array([[1.0, 0, 1, 0], [0, 1, 0, 1]])
    effect = np.array([[9.0, 9, 9, 9], [0.1, 0.3, 0.2, -0.1]])
    found = without_identity(np.array([1.0, 2.0]), identity, effect, np.array([1, 1]))
    np.testing.assert_allclose(found, [1.0 - 0.3, 2.0 - 0.2])


@pytest.mark.slow
def test_effects_are_those_of_the_world():
    """Half of the people are in a wheelchair; the sensor stretches their distance by 1.33."""
    assert np.abs(identity_effects("even", None)[0]).max() * task.DISTANCE_UNIT < 0.1
    effect = identity_effects("perception", None)[0] * task.DISTANCE_UNIT
    names = TrainSettings(scenario="perception").world.groups
    wheelchair, none = (names.index(("disability", one)) for one in ("Yes", "No"))
    # at about 3.2 m a stretch of 1 or 1.33, if no child: not the whole, for children are stretched
    # already; half of the people have it, so half of it to either side
    assert effect[wheelchair] == pytest.approx(-effect[none], abs=0.02)
    assert 0.2 < effect[wheelchair] < 0.53


@pytest.mark.slow
def test_the_policy_sees_the_same_of_everybody_on_average():
    settings = TrainSettings(scenario="perception", method="counterfactual")
    world = settings.world
    done = serve_people.serve_people(world, serve_people.nobody, 3000, np.random.default_rng(5))
    seen = view(settings, done.observation)
    assert not seen[..., : task.DISTANCE].any()
    plain = view(TrainSettings(scenario="perception", method="service"), done.observation)
    chair = done.codes[:, 3] == 0
    for step in (0, 10, 20):
        gap = seen[chair, step, task.DISTANCE].mean() - seen[~chair, step, task.DISTANCE].mean()
        raw = plain[chair, step, task.DISTANCE].mean() - plain[~chair, step, task.DISTANCE].mean()
        assert abs(gap) < 0.1 * abs(raw), step
    np.testing.assert_array_equal(seen[..., task.STEPS], plain[..., task.STEPS])


def test_it_is_no_scaling_so_no_network_of_machine_code_serves():
    settings = TrainSettings(scenario="perception", method="counterfactual")
    assert not affine(settings)
    assert not hasattr(acting(settings, untrained(settings).policy), "weights")
    assert affine(TrainSettings(method="service"))
