"""Checkpoints: bit-exact resumption, and one clear sentence for everything that cannot be read."""

import json
import os
import pickle
from dataclasses import dataclass

import jax
import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.training import checkpoint
from evenhand.training.checkpoint import State
from evenhand.training.policy import PolicySettings
from evenhand.training.update import Trajectories, UpdateSettings, make_learner, update
from support.refusals import refused

N, L, OBS = 8, 10, 3
SETTINGS = UpdateSettings(algorithm="ppo")
MADE_WITH = {"settings": "0123", "detector": "4567"}


def learner(hidden=(4,), seed=0):
    return make_learner(OBS, PolicySettings(hidden=hidden), SETTINGS, np.random.default_rng(seed))


def epochs(state, rng, count):
    """So many epochs of services that are drawn from the generator of the run."""
    reports = []
    for _ in range(count):
        mask = np.arange(L) < rng.integers(1, 6, N)[:, None]
        trajectories = Trajectories(
            obs=rng.normal(size=(N, L, OBS)), action=rng.integers(0, 2, (N, L)), mask=mask
        )
        advantage, target = rng.normal(size=(2, N, L))
        state, report = update(state, trajectories, advantage, target, SETTINGS, rng)
        reports.append(report)
    return state, reports


def assert_same_bits(a, b):
    assert jax.tree.structure(a) == jax.tree.structure(b)
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        assert x.dtype == y.dtype
        np.testing.assert_array_equal(x, y)


@pytest.fixture
def saved(tmp_path):
    """A checkpoint of a fresh learner."""
    path = tmp_path / "checkpoint.npz"
    checkpoint.save(path, State(learner()), fingerprints=MADE_WITH, extra={"epoch": 7})
    return path


# --- there and back ---


def test_a_resumed_run_is_the_undisturbed_run_bit_for_bit(tmp_path):
    rng = np.random.default_rng(3)
    undisturbed, all_reports = epochs(learner(), rng, 4)

    rng = np.random.default_rng(3)
    half, _ = epochs(learner(), rng, 2)
    extra = {"epoch": 2, "random": rng.bit_generator.state, "mean": 0.1, "none": None}
    checkpoint.save(tmp_path / "c.npz", State(half), fingerprints=MADE_WITH, extra=extra)

    # Another process would start from nothing but the file and fresh weights of the same shape.
    found = checkpoint.load(tmp_path / "c.npz", State(learner(seed=99)), MADE_WITH)
    assert_same_bits(found.state.learner, half)
    assert found.extra == extra
    rng = np.random.default_rng()
    rng.bit_generator.state = found.extra["random"]
    resumed, reports = epochs(found.state.learner, rng, 2)
    assert_same_bits(resumed, undisturbed)
    assert reports == all_reports[2:]
    assert int(resumed.step) == 4


def test_the_file_is_a_plain_archive_with_named_arrays(saved):
    with np.load(saved, allow_pickle=False) as archive:
        names = list(archive)
        header = json.loads(archive["header"].tobytes())
        np.testing.assert_array_equal(
            archive["learner.policy.actor.weights.0"], learner().policy.actor.weights[0]
        )
    assert names[:3] == [
        "header",
        "learner.policy.actor.weights.0",
        "learner.policy.actor.weights.1",
    ]
    assert names[-1] == "learner.step"
    assert header["fingerprints"] == MADE_WITH
    assert header["extra"] == {"epoch": 7}


def test_the_same_state_gives_the_same_file(saved, tmp_path):
    checkpoint.save(
        tmp_path / "b.npz", State(learner()), fingerprints=MADE_WITH, extra={"epoch": 7}
    )
    assert (tmp_path / "b.npz").read_bytes() == saved.read_bytes()


def test_only_what_is_expected_must_agree(saved):
    assert checkpoint.load(saved, State(learner()), {"detector": "4567"}).extra == {"epoch": 7}
    assert checkpoint.load(saved, State(learner()), {}).extra == {"epoch": 7}


# --- files that cannot be used ---


def refuse(path, message, like=None, expect=MADE_WITH):
    with pytest.raises(InputError, match=message) as caught:
        checkpoint.load(path, like if isinstance(like, State) else State(like or learner()), expect)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_cut_off_anywhere_is_refused(saved):
    whole = saved.read_bytes()
    near_the_end = range(len(whole) - 60, len(whole))
    for length in [*range(2, len(whole), 97), *near_the_end]:
        saved.write_bytes(whole[:length])
        refuse(saved, "is cut off or damaged")
    for length in (0, 1):
        saved.write_bytes(whole[:length])
        refuse(saved, "is not a checkpoint")


def test_a_changed_byte_is_noticed_or_harmless(saved):
    # Harmless are the archive's dates and the like: then everything must have come back.
    whole, state = saved.read_bytes(), State(learner())
    noticed = 0
    for position in range(0, len(whole), 41):
        changed = bytearray(whole)
        changed[position] ^= 0xFF
        saved.write_bytes(bytes(changed))
        try:
            found = checkpoint.load(saved, state, MADE_WITH)
        except InputError:
            noticed += 1
        else:
            assert_same_bits(found.state, state)
            assert found.extra == {"epoch": 7}
    assert noticed > 50


@pytest.mark.parametrize("content", [b"", b"hello", b'{"epoch": 1}', pickle.dumps({"a": 1})])
def test_a_file_of_another_kind_is_refused(tmp_path, content):
    path = tmp_path / "other.npz"
    path.write_bytes(content)
    refuse(path, "is not a checkpoint of Evenhand")


@pytest.mark.parametrize(
    "arrays",
    [
        {"weights": np.ones(3)},
        {"header": np.frombuffer(b"no json", np.uint8)},
        {"header": np.frombuffer(b"[1]", np.uint8)},
        {"header": np.frombuffer(b'{"format": "other"}', np.uint8)},
    ],
)
def test_an_archive_of_something_else_is_refused(tmp_path, arrays):
    np.savez(tmp_path / "other.npz", **arrays)
    refuse(tmp_path / "other.npz", "is not a checkpoint of Evenhand")


class Explosive:
    """Unpickling it would show."""

    def __reduce__(self):
        return os.mkdir, ("unpickled",)


def test_nothing_is_ever_unpickled(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "pickle.npz"
    np.savez(path, header=np.array([Explosive()], object))
    refuse(path, "is cut off or damaged")
    assert not (tmp_path / "unpickled").exists()


def test_a_missing_file_is_said_to_be_missing(tmp_path):
    refuse(tmp_path / "none.npz", "does not exist")


def test_a_folder_is_no_checkpoint(tmp_path):
    refuse(tmp_path, "cannot be read")


def test_other_settings_are_named(saved):
    refuse(saved, r"belongs to other settings \(detector\)", expect={**MADE_WITH, "detector": "x"})
    refuse(saved, r"belongs to other settings \(people\)", expect={**MADE_WITH, "people": "x"})


def test_another_size_of_layer_is_refused(saved):
    refuse(
        saved,
        r"weights\.0 of another shape: it is float32\[3, 4\] there and float32\[3, 5\] here",
        like=learner(hidden=(5,)),
    )


def test_another_number_of_layers_is_refused(saved):
    refuse(
        saved, "holds another policy, or the memory of another method", like=learner(hidden=(4, 4))
    )


def test_memory_comes_back_with_the_learner(tmp_path):
    memory = {"lam": 0.1 + 0.2, "pool": np.array([[1 / 3, np.nan]]), "filled": 3}
    path = tmp_path / "c.npz"
    checkpoint.save(path, State(learner(), memory), fingerprints=MADE_WITH, extra={})
    like = {"lam": 0.0, "pool": np.zeros((1, 2)), "filled": 0}
    found = checkpoint.load(path, State(learner(seed=9), like), MADE_WITH).state
    assert_same_bits(found.learner, learner())
    assert found.memory["lam"] == memory["lam"]
    assert found.memory["filled"] == 3
    np.testing.assert_array_equal(found.memory["pool"], memory["pool"])
    assert checkpoint.load(path, State(learner()), MADE_WITH).state.memory is None
    refuse(
        path, r"holds memory\.pool of another shape", State(learner(), like | {"pool": np.ones(2)})
    )
    refuse(path, r"memory of another method \(memory\.filled", State(learner(), {"lam": 0.0}))


def test_a_later_format_is_refused(saved, monkeypatch):
    monkeypatch.setattr(checkpoint, "_VERSION", 3)
    refuse(saved, "has format version 2, and this Evenhand reads version 3")


# --- writing ---


@pytest.mark.parametrize(
    "interruption", [OSError(28, "No space left on device"), KeyboardInterrupt]
)
def test_an_interrupted_save_keeps_the_earlier_file_and_leaves_nothing(
    saved, monkeypatch, interruption
):
    before = saved.read_bytes()

    def half_written(file, **arrays):
        file.write(b"half")
        raise interruption

    monkeypatch.setattr(np, "savez", half_written)
    expected = InputError if isinstance(interruption, OSError) else KeyboardInterrupt
    with pytest.raises(expected) as caught:
        checkpoint.save(saved, State(learner()), fingerprints={}, extra={})
    if expected is InputError:
        assert f"{saved} cannot be written: No space left on device" in str(caught.value)
    assert saved.read_bytes() == before
    assert list(saved.parent.iterdir()) == [saved]


def test_an_earlier_file_is_replaced_and_never_written_into(saved):
    # Whoever still reads the earlier file sees it whole.
    before = saved.read_bytes()
    with open(saved, "rb") as reader:
        checkpoint.save(saved, State(learner()), fingerprints=MADE_WITH, extra={"epoch": 8})
        assert reader.read() == before
    assert checkpoint.load(saved, State(learner()), MADE_WITH).extra == {"epoch": 8}


def test_a_folder_that_does_not_exist_is_said(tmp_path):
    path = tmp_path / "none" / "c.npz"
    with refused("unavailable checkpoint"):
        checkpoint.save(path, State(learner()), fingerprints={}, extra={})


def test_what_json_cannot_hold_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(TypeError):
        checkpoint.save(
            tmp_path / "c.npz", State(learner()), fingerprints={}, extra={"x": np.float32(1)}
        )
    assert list(tmp_path.iterdir()) == []


# --- fingerprints ---


@dataclass(frozen=True)
class Inner:
    rate: float = 0.5


@dataclass(frozen=True)
class Outer:
    inner: Inner = Inner()
    names: tuple[str, ...] = ("a", "b")


def test_fingerprints_tell_values_apart():
    values = [Outer(), Outer(Inner(0.25)), Outer(names=("b", "a")), {"x": 1}, [1, 2], "0.5", 0.5]
    assert len({checkpoint.fingerprint(value) for value in values}) == len(values)


def test_fingerprints_stay_the_same_between_runs():
    # First 16 digits of SHA-256 of: {"a": 1, "b": {"rate": 0.5}}
    found = checkpoint.fingerprint({"b": Inner(), "a": 1})
    assert found == checkpoint.fingerprint({"a": 1, "b": {"rate": 0.5}})
    assert found == "505b4ea327074f15"


def test_what_has_no_fingerprint_is_refused():
    with pytest.raises(TypeError, match="Generator"):
        checkpoint.fingerprint({"rng": np.random.default_rng()})
