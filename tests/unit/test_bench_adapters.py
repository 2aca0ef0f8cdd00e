"""The bench of the wrapper: every ratio is there, and both sides do the same."""

from benchmarks import adapters as bench
from support.refusals import refused


def test_every_ratio_is_measured(monkeypatch, capsys):
    monkeypatch.setattr(bench, "_STEPS", 30)
    found = bench.measure(turns=2)
    names = ["adapter_bare_us", "adapter_ratio", "adapter_ratio_short", "adapter_ratio_guided"]
    assert list(found) == names
    for values in found.values():
        assert list(values) == list(bench.LANES)
        assert all(value > 0 for value in values.values())
    bench.show(found)
    assert "wrapped step" in capsys.readouterr().out


def test_no_turns_cannot_be_measured():
    with refused("range turns", "0"):
        bench.measure(0)
