"""The bench of a sweep: what it reports, not how fast it is."""

import pytest

from benchmarks import sweep
from evenhand.experiments.sweep.settings import Variant


@pytest.mark.slow
def test_a_small_one(capsys):
    found = sweep.measure(2, Variant(epochs=3, services=300))
    assert (found["sweep_runs"], found["sweep_failed"]) == (2, 0)
    assert found["sweep_ratio"] == pytest.approx(
        found["sweep_s"] / (found["sweep_runs_s"] / 2), rel=0.1
    )
    assert 0 < found["sweep_report_s"] < found["sweep_s"]
    sweep.show(found)
    assert "A sweep of 2 runs, 2 at a time" in capsys.readouterr().out


def test_the_bench_is_of_sixteen_runs_of_the_usual_settings_on_two_cores():
    assert (sweep.RUNS, sweep.WORKERS) == (16, 2)
    assert Variant() == sweep.USUAL
