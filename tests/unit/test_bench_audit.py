"""The bench of audits with tiny logs: what is measured and whether it is true, never how fast."""

import importlib.util
import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from benchmarks import audit
from evenhand.core.errors import InputError

KEYS = {
    "audit_10m_seconds",
    "audit_10m_cpu_seconds",
    "audit_10m_peak_mb",
    "audit_1m_seconds",
    "audit_1m_cpu_seconds",
    "fairlearn_1m_seconds_2000_bootstraps",
    "fairlearn_bootstraps_run",
    "ratio_fairlearn",
    "audit_rows",
}


def test_the_log_is_what_it_is_said_to_be(tmp_path):
    path = tmp_path / "log.parquet"
    audit.write_log(path, 40_001, np.random.default_rng(0), chunk=15_000)
    assert pq.ParquetFile(path).metadata.num_rows == 40_001
    log = pq.read_table(path)
    assert set(log["source"].to_pylist()) == {"synthetic"}
    for name, groups in audit.IDENTITIES.items():
        incomplete = name in audit.INCOMPLETE
        values = np.array(log[name].to_pylist(), object)
        assert {one for one in values if one is not None} == set(groups)
        missing = np.mean([one is None for one in values])
        assert missing == pytest.approx(0.01 if incomplete else 0.0, abs=0.003)
    ignored = ~log["responded"].to_numpy()
    child = np.array(log["age_group"].to_pylist()) == "child"
    assert child.mean() == pytest.approx(0.25, abs=0.01)
    assert ignored[child].mean() == pytest.approx(0.30, abs=0.02)
    assert ignored[~child].mean() == pytest.approx(0.10, abs=0.01)
    women = np.array(log["gender"].to_pylist(), object) == "female"
    assert ignored[women].mean() == pytest.approx(ignored[~women].mean(), abs=0.02)
    for name in ("response_time_s", "response_distance_m"):
        np.testing.assert_array_equal(log[name].is_null().to_numpy(), ignored)
    assert log["min_distance_m"].null_count == 0


def test_an_audit_of_the_log_in_a_process_of_its_own(tmp_path):
    path = tmp_path / "log.parquet"
    audit.write_log(path, 30_000, np.random.default_rng(1))
    seconds, cpu, peak = audit.audit(path, 30_000)
    assert cpu > 0
    assert seconds > 0
    # what Python with NumPy, Arrow and DuckDB needs at least
    assert 50 < peak < 2_000
    found = json.loads(path.with_suffix(".json").read_text())
    assert found["services"] == 30_000
    assert found["synthetic"] is True
    assert found["settings"]["verdict"]["permutations"] == audit.BOOTSTRAPS
    assert {one["identity"] for one in found["findings"]} == set(audit.IDENTITIES)
    uneven = {
        (one["identity"], one["issue"])
        for one in found["findings"]
        if one["verdict"] == "disparity"
    }
    assert uneven == {("age_group", "willingness")}
    with pytest.raises(RuntimeError, match="found 30000 services, not 30001"):
        audit.audit(path, 30_001)
    with pytest.raises(RuntimeError, match=r"ended with 2.*does not exist"):
        audit.audit(tmp_path / "no.parquet", 1)


def faked(monkeypatch, seconds):
    """Audits that take so long, small and great in turn, without running any."""
    taken = iter(seconds)
    monkeypatch.setattr(audit, "audit", lambda log, services: next(taken))


def test_medians_of_the_rounds_and_the_greatest_memory(monkeypatch, capsys):
    faked(
        monkeypatch,
        [(2.0, 1.5, 90.0), (9.0, 15.0, 800.0), (4.0, 3.5, 99.0), (7.0, 11.0, 700.0),
         (3.0, 2.5, 80.0), (8.0, 13.0, 600.0)],
    )  # fmt: skip
    monkeypatch.setattr(audit, "fairlearn_seconds", lambda log, bootstraps: 1200.0)
    found = audit.measure(400, 200, bootstraps=3, rounds=3)
    assert set(found) == KEYS
    assert (found["audit_10m_seconds"], found["audit_10m_cpu_seconds"]) == (8.0, 13.0)
    assert (found["audit_1m_seconds"], found["audit_1m_cpu_seconds"]) == (3.0, 2.5)
    assert found["audit_10m_peak_mb"] == 800
    assert found["ratio_fairlearn"] == 400.0
    assert found["fairlearn_bootstraps_run"] == 3
    assert found["audit_rows"] == (400, 200)
    audit.show(found)
    said = capsys.readouterr().out
    assert "reckoned from 3" in said
    assert "400 services" in said


def test_without_fairlearn_nothing_is_made_up(monkeypatch, capsys):
    faked(monkeypatch, [(2.0, 1.5, 90.0), (9.0, 15.0, 800.0)])
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    found = audit.measure(100, 50, rounds=1)
    assert set(found) == KEYS
    for key in (
        "fairlearn_1m_seconds_2000_bootstraps",
        "fairlearn_bootstraps_run",
        "ratio_fairlearn",
    ):
        assert found[key] is None
    audit.show(found)
    assert "Fairlearn is not installed" in capsys.readouterr().out


def test_fairlearn_sees_the_rates_of_the_log(tmp_path, monkeypatch):
    metrics = pytest.importorskip("fairlearn.metrics")
    frames = []

    class Kept(metrics.MetricFrame):
        def __init__(self, **given):
            super().__init__(**given)
            frames.append((self, given))

    monkeypatch.setattr(metrics, "MetricFrame", Kept)
    path = tmp_path / "log.parquet"
    audit.write_log(path, 2_000, np.random.default_rng(2))
    seconds = audit.fairlearn_seconds(path, 2)
    assert seconds is not None
    assert seconds > 0
    log = pq.read_table(path)
    child = np.array(log["age_group"].to_pylist()) == "child"
    ignored = ~log["responded"].to_numpy()
    (once, _), (sampled, given) = frames
    assert once.by_group["child"] == pytest.approx(ignored[child].mean())
    assert given["n_boot"] == 2
    low, high = sampled.by_group_ci
    assert (low <= high).all()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"rows": 0}, "rows is 0"),
        ({"fewer": 0}, "fewer is 0"),
        ({"bootstraps": 0}, "bootstraps is 0"),
        ({"rounds": 0}, "rounds is 0"),
    ],
)
def test_wrong_input(given, said):
    with pytest.raises(InputError, match=said):
        audit.measure(**given)
