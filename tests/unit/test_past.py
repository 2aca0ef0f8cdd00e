"""What is remembered from epoch to epoch survives a checkpoint to the last bit."""

import json
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest
from evenhand.training.rivals import methods

from evenhand.core.errors import InputError
from evenhand.methods import detector_file
from evenhand.methods.beyond.reflection import ReflectionSettings
from evenhand.methods.guidance import GuidanceSettings
from evenhand.training import train
from evenhand.training.memory import Past
from evenhand.training.settings import TrainSettings
from evenhand.training.update import UpdateSettings

ALL = ("none", *methods.RIVALS)


def settings(rival: str) -> TrainSettings:
    return TrainSettings(
        preset="service",
        epochs=4,
        people=8,
        guidance=GuidanceSettings(kind="none"),
        rival=rival,
        update=UpdateSettings(algorithm="reinforce"),
        reflection=ReflectionSettings(rate=0.25, history=5),
    )


def arrays(part: Any, name: str = "past") -> dict[str, np.ndarray]:
    """Everything in it by its path, also in parts of parts."""
    if isinstance(part, dict):
        return {k: v for key, sub in part.items() for k, v in arrays(sub, f"{name}.{key}").items()}
    return {name: np.asarray(part)}


def through_text(past: Past, chosen: TrainSettings) -> Past:
    return Past.of(json.loads(json.dumps(past.plain(), allow_nan=False)), chosen)


def assert_same(a: Past, b: Past) -> None:
    one, other = arrays(asdict(a)), arrays(asdict(b))
    assert one.keys() == other.keys()
    for name, values in one.items():
        found = other[name]
        assert found.shape == values.shape, name
        np.testing.assert_array_equal(found, values, err_msg=name)  # NaN equals NaN
    assert type(a.rival) is type(b.rival)


@pytest.mark.parametrize("rival", ALL)
def test_an_empty_past(rival):
    chosen = settings(rival)
    assert_same(through_text(Past.empty(chosen), chosen), Past.empty(chosen))


@pytest.mark.slow
@pytest.mark.parametrize("rival", ALL)
def test_after_some_epochs(rival):
    chosen = settings(rival)
    detector = detector_file.load(detector_file.SHIPPED)
    past = [record.past for record in train.train(chosen, detector)][-1]
    assert past.memory.filled == 4
    assert past.memory.windows.any()
    assert past.guard.recent.windows.any()
    assert 1 <= past.reflection.filled <= 4
    if rival not in ("none", "lagrangian"):
        empty = arrays(asdict(Past.empty(chosen))["rival"])
        kept = arrays(asdict(past)["rival"])
        assert any((empty[name] != kept[name]).any() for name in kept)
    assert_same(through_text(past, chosen), past)


@pytest.mark.parametrize("rival", ALL)
def test_numbers_that_no_short_text_holds(rival):
    """Thirds, the least numbers there are, and a guard that gave way."""
    chosen = settings(rival)
    empty = Past.empty(chosen)
    odd = np.array([1 / 3, 5e-324, 1e300, -0.1, 2.0**53 + 2.0])

    def filled(like: np.ndarray) -> np.ndarray:
        return np.resize(odd, like.shape) if like.shape else np.asarray(1 / 3)

    past = replace(
        empty,
        memory=replace(empty.memory, windows=filled(empty.memory.windows), filled=3),
        guard=replace(empty.guard, reference=filled(empty.guard.reference), strength=0.1 + 0.2),
    )
    if past.rival is not None:
        state = {name: filled(np.asarray(x)) for name, x in asdict(past.rival).items()}
        past = replace(past, rival=type(past.rival)(**state))
    assert_same(through_text(past, chosen), past)
    assert float(past.guard.strength) != 0.3


def test_the_size_of_each_memory_is_that_of_the_settings():
    empty = Past.empty(settings("elbert"))
    assert empty.memory.windows.shape == (8, 22, 4, 4)
    assert empty.guard.reference.shape == (23, 1, 2)  # the 22 groups and everybody
    assert empty.reflection.cosines.shape == (5, 6, 5)
    assert empty.rival.ratio.shape == (22, 4)
    assert Past.empty(settings("none")).rival is None


@pytest.mark.parametrize(
    ("saved", "wanted"), [("none", "elbert"), ("ggf", "group_dro"), ("a_ppo", "elbert")]
)
def test_the_past_of_another_rival_is_refused(saved, wanted):
    plain = Past.empty(settings(saved)).plain()
    with pytest.raises(InputError, match="belongs to other settings: resume with the settings"):
        Past.of(plain, settings(wanted))
