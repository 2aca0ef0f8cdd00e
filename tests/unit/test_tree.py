"""Trees as named arrays and back."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pytest

from evenhand.core import tree
from evenhand.core.errors import InputError
from support.refusals import refused


@dataclass(frozen=True)
class Inner:
    strength: float
    counts: np.ndarray


class Pair(NamedTuple):
    first: Any
    second: Any


TREE = {
    "inner": Inner(0.1 + 0.2, np.array([[1 / 3, 5e-324], [np.nan, 1e300]])),
    "pair": Pair(3, (True, None)),
    "list": [np.zeros((0, 2)), np.arange(3, dtype=np.int32)],
    "none": None,
}


def test_every_leaf_has_its_path():
    assert list(tree.leaves(TREE)) == [
        "inner.strength", "inner.counts", "pair.0", "pair.1.0", "list.0", "list.1",
    ]  # fmt: skip
    assert next(iter(tree.leaves(TREE, "memory"))) == "memory.inner.strength"
    assert tree.leaves(None) == {}
    assert list(tree.leaves(2.0, "it")) == ["it"]


def test_there_and_back_to_the_bit(tmp_path):
    np.savez(tmp_path / "a.npz", allow_pickle=False, **tree.leaves(TREE, "t"))
    with np.load(tmp_path / "a.npz", allow_pickle=False) as saved:
        back = tree.fill(TREE, saved, "t")
    assert back["inner"].strength == 0.1 + 0.2 != 0.3
    np.testing.assert_array_equal(back["inner"].counts, TREE["inner"].counts)
    assert back["pair"] == TREE["pair"]
    assert type(back["pair"].first) is int
    assert back["pair"].second[0] is True
    assert back["list"][0].shape == (0, 2)
    assert back["list"][1].dtype == np.int32
    assert back["none"] is None


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"a": "text"}, "a is of type str"),
        ({"a": {3: 1.0}}, "3 is no name"),
        ([object()], "0 is of type object"),
    ],
)
def test_what_cannot_be_kept(wrong, said):
    with pytest.raises(InputError, match=said):
        tree.leaves(wrong)


def test_what_does_not_fit():
    with refused("shape state"):
        tree.fill({"a": 1.0, "b": 2.0}, {"a": np.array(1.0)})
    with refused("shape state", "2"):
        tree.fill({"a": np.zeros(2)}, {"a": np.zeros(3)})
