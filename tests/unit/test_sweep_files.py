"""Files of a run on their way to the folder of the sweep."""

from pathlib import Path

import pytest

from evenhand.experiments.sweep.files import Carrier, Keeper, listed
from support.refusals import refused

PATH = "variants/default/runs/x/seed-00"


def fill(folder: Path, **content: str) -> None:
    for name, text in content.items():
        path = folder / name.replace("__", "/").replace("_", ".")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


@pytest.fixture
def run(tmp_path) -> Path:
    """A run on its machine."""
    folder = tmp_path / "scratch" / "run"
    fill(folder, settings_json="s", epochs_jsonl="1\n", checkpoint_npz="c1", services__a="a1")
    fill(folder, _lock="", _x_part="half", services__b_part="half")
    return folder


@pytest.fixture
def out(tmp_path) -> Path:
    return tmp_path / "out"


def carrier(run: Path, keeper: Keeper, number: int) -> Carrier:
    return Carrier(run, lambda *what: keeper.keep(PATH, number, *what))


def test_the_checkpoint_comes_after_all_that_it_belongs_to(run):
    fill(run, done_json="d", clock_json="t", states__z="z", detector_json="x")
    assert listed(run) == [
        "settings.json", "detector.json", "services/a", "states/z", "epochs.jsonl",
        "checkpoint.npz", "clock.json", "done.json",
    ]  # fmt: skip


def test_what_is_new_is_sent_in_order_and_kept(run, out, content):
    keeper = Keeper(str(out))
    number, held = keeper.begin(PATH)
    assert held == {}
    sent: list[list[str]] = []

    def send(new, names):
        sent.append(list(new))
        keeper.keep(PATH, number, new, names)

    one = Carrier(run, send)
    one.unpack(held)
    one.send_after_checkpoint()
    assert sent == [["settings.json", "services/a", "epochs.jsonl", "checkpoint.npz"]]
    fill(run, epochs_jsonl="1\n2\n")
    one.send_after_checkpoint()
    assert len(sent) == 1  # nothing since the checkpoint that counts
    fill(run, checkpoint_npz="c2 longer", services__b="b1")
    one.send_after_checkpoint()
    assert sent[1:] == [["services/b", "epochs.jsonl", "checkpoint.npz"]]
    fill(run, done_json="d")
    one.send()
    assert sent[2:] == [["done.json"]]
    kept = content(out / PATH)
    assert kept == {name: (run / name).read_bytes() for name in listed(run)}


def test_another_machine_goes_on_from_what_was_sent(run, out, tmp_path):
    keeper = Keeper(str(out))
    number, _ = keeper.begin(PATH)
    carrier(run, keeper, number).send()
    again, held = keeper.begin(PATH)
    assert again == number + 1
    other = tmp_path / "other"
    second = carrier(other, keeper, again)
    second.unpack(held)
    assert listed(other) == listed(run)
    second.send_after_checkpoint()  # it is the one that it was given
    # the run drops what is of no use to it, and so does the folder of the sweep
    (other / "services" / "a").unlink()
    fill(other, services__c="c", checkpoint_npz="c2 longer")
    second.send_after_checkpoint()
    assert sorted(p.name for p in (out / PATH / "services").iterdir()) == ["c"]


def test_an_attempt_that_was_given_up_changes_nothing(run, out, content):
    keeper = Keeper(str(out))
    old, _ = keeper.begin(PATH)
    carrier(run, keeper, old).send()
    keeper.begin(PATH)
    before = content(out / PATH)
    fill(run, checkpoint_npz="c2 longer")
    with refused("changed file", "00"):
        carrier(run, keeper, old).send()
    assert content(out / PATH) == before


def test_what_was_half_written_is_swept_away(run, out):
    keeper = Keeper(str(out))
    number, _ = keeper.begin(PATH)
    fill(out / PATH, _settings_json_12_part="half")
    carrier(run, keeper, number).send()
    assert not list(out.rglob("*.part"))
