"""The bench of the analysis: as many participants as were asked for, and every part timed."""

import pytest

from benchmarks import study as bench
from support.answered import protocol
from support.refusals import refused


def test_a_crowd_has_as_many_participants_as_were_asked_for(monkeypatch):
    monkeypatch.setattr(bench, "_MADE", 4)
    found = bench.crowd(protocol(), 10)
    assert found.simulated
    # who leaves before the first answer has no row: four are simulated, at most four answered
    assert len(set(found.participants)) == len(found.participants) == 10


def test_every_part_is_timed():
    study = protocol(sets=protocol().sets[2:5], pairs=())
    found = bench.measure(3, ".parquet", study)
    assert found["study_participants"] == 3
    assert found["study_rows"] > 3
    parts = [found[f"study_{name}_seconds"] for name in ("read", "analyse", "report")]
    assert all(part >= 0 for part in parts)
    assert found["study_cpu_seconds"] == pytest.approx(sum(parts), abs=0.02)


def test_no_participants_cannot_be_measured():
    with refused("range participants", "0"):
        bench.measure(0)
