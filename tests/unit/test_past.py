"""What is remembered from epoch to epoch survives a checkpoint to the last bit."""

import numpy as np
import pytest

from evenhand.core import tree
from evenhand.methods import detector_file, registry
from evenhand.methods.beyond.reflection import ReflectionSettings
from evenhand.training import checkpoint, train
from evenhand.training.checkpoint import State
from evenhand.training.memory import Memory
from evenhand.training.settings import TrainSettings
from evenhand.training.update import UpdateSettings

EMPTY = ("service", "score", "penalty", "unaware", "blind", "counterfactual")
"""Methods that remember nothing."""


def settings(name: str) -> TrainSettings:
    return TrainSettings(
        preset="service",
        epochs=4,
        people=8,
        method=name,
        update=UpdateSettings(algorithm="reinforce"),
        reflection=ReflectionSettings(rate=0.25, history=5),
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", registry.BUILT_IN)
def test_through_a_checkpoint_after_some_epochs(name, tmp_path):
    chosen = settings(name)
    detector = detector_file.load(detector_file.SHIPPED)
    record = list(train.train(chosen, detector))[-1]
    assert record.memory.guard.recent.windows.any()
    assert 1 <= record.memory.reflection.filled <= 4
    before, after = tree.leaves(Memory.begin(chosen).method), tree.leaves(record.memory.method)
    assert (before == {}) == (name in EMPTY)
    assert after.keys() == before.keys()
    if after:
        assert any((after[path] != before[path]).any() for path in after)
    state = State(record.state, record.memory)
    checkpoint.save(tmp_path / "c.npz", state, fingerprints={}, extra={})
    like = State(train.untrained(chosen), Memory.begin(chosen))
    back = checkpoint.load(tmp_path / "c.npz", like, {}).state.memory
    assert type(back.method) is type(record.memory.method)
    found = tree.leaves(back)
    for path, leaf in tree.leaves(record.memory).items():
        assert found[path].dtype == leaf.dtype, path
        np.testing.assert_array_equal(found[path], leaf, err_msg=path)  # NaN equals NaN


def test_the_size_of_each_memory_is_that_of_the_settings():
    empty = Memory.begin(settings("elbert"))
    assert empty.guard.reference.shape == (23, 1, 2)  # the 22 groups and everybody
    assert empty.reflection.cosines.shape == (5, 6, 5)
    assert empty.method.ratio.shape == (22, 4)
    assert Memory.begin(settings("levelup")).method.windows.shape == (8, 22, 4, 4)
    assert Memory.begin(settings("service")).method is None
