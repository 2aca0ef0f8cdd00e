"""Speed of an audit: ten million services from a Parquet file, and Fairlearn beside it.

The log is synthetic and no person is behind it: five identities, of which only age matters, and
that by construction (children are ignored more often). An audit is the command as people run it,
in a process of its own, from its start to its end, with the 2,000 permutations it has by default.

Fairlearn's ``MetricFrame`` is asked for less than the audit gives: the rates of one issue in the
groups of one identity with bootstrap intervals, from columns that are in memory already. Only a
few bootstrap samples are drawn; what 2,000 would take is reckoned from them.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from evenhand.core import errors
from evenhand.core import terminal as display

IDENTITIES: dict[str, tuple[str, ...]] = {
    "age_group": ("child", "teen", "adult", "older adult"),
    "gender": ("female", "male", "non-binary"),
    "ethnicity": ("amber", "birch", "cedar", "dune", "elm", "fern"),
    "mobility": ("walks", "wheelchair"),
    "language": ("de", "en", "es", "fr", "tr"),
}
"""Identities of the log and their groups, each as frequent as the others of its identity."""

INCOMPLETE = ("gender", "ethnicity")
"""Identities that some services say nothing of."""

UNSEEN, IGNORED, IGNORED_CHILD = 0.01, 0.10, 0.30
"""Shares: of services that say nothing of such an identity, without response, and of children's."""

BOOTSTRAPS = 2_000
"""Samples that Fairlearn's time is reckoned for, as many as an audit has permutations."""

_CHUNK = 500_000
_ROUNDS = 3
_AUDIT = """
import sys
from evenhand.cli import main
code = main(sys.argv[2:])
with open("/proc/self/status") as status, open(sys.argv[1], "w") as out:
    out.write(next(line.split()[1] for line in status if line.startswith("VmHWM")))
sys.exit(code)
"""


def write_log(path: Path, rows: int, rng: np.random.Generator, chunk: int = _CHUNK) -> None:
    """Write the synthetic log, a piece at a time, so that memory does not grow with it.

    Args:
        path: of the Parquet file.
        rows: services.
        rng: source of all randomness.
        chunk: services of a piece.
    """
    writer: pq.ParquetWriter | None = None
    try:
        for start in range(0, rows, chunk):
            piece = _services(min(chunk, rows - start), rng)
            writer = writer or pq.ParquetWriter(path, piece.schema)
            writer.write_table(piece)
    finally:
        if writer is not None:
            writer.close()


def _services(n: int, rng: np.random.Generator) -> pa.Table:
    columns: dict[str, Any] = {"source": _named(("synthetic",), np.zeros(n, np.int8))}
    codes = {}
    for name, groups in IDENTITIES.items():
        codes[name] = rng.integers(len(groups), size=n, dtype=np.int8)
        unseen = rng.random(n) < UNSEEN if name in INCOMPLETE else None
        columns[name] = _named(groups, codes[name], unseen)
    child = codes["age_group"] == IDENTITIES["age_group"].index("child")
    ignored = rng.random(n) < np.where(child, IGNORED_CHILD, IGNORED)
    least = rng.normal(0.9, 0.25, n).clip(0.05).round(2)
    distance = np.maximum(rng.normal(1.25, 0.15, n), least).round(2)
    columns["responded"] = ~ignored
    columns["response_time_s"] = pa.array(rng.gamma(4.0, 0.6, n).round(2), mask=ignored)
    columns["response_distance_m"] = pa.array(distance, mask=ignored)
    columns["min_distance_m"] = least
    return pa.table(columns)


def _named(groups: tuple[str, ...], codes: np.ndarray, unseen: np.ndarray | None = None) -> Any:
    return pa.DictionaryArray.from_arrays(pa.array(codes, mask=unseen), pa.array(groups))


def measure(
    rows: int = 10_000_000, fewer: int = 1_000_000, bootstraps: int = 2, rounds: int = _ROUNDS
) -> dict[str, Any]:
    """Time audits of many and of fewer services, and Fairlearn on the fewer ones.

    Args:
        rows: services of the great log.
        fewer: of the small one.
        bootstraps: samples that Fairlearn draws indeed.
        rounds: audits of each log.

    Returns:
        ``audit_10m_seconds`` and ``audit_1m_seconds``, medians of the rounds from the start of the
        process to its end; ``audit_10m_cpu_seconds`` and ``audit_1m_cpu_seconds``, processor time
        of both cores likewise; ``audit_10m_peak_mb``, the greatest memory of any round;
        ``fairlearn_1m_seconds_2000_bootstraps``, ``fairlearn_bootstraps_run`` and
        ``ratio_fairlearn``, None without Fairlearn; ``audit_rows``, services of both logs.

    Raises:
        InputError: for numbers below 1.
    """
    for name, value in (("rows", rows), ("fewer", fewer), ("bootstraps", bootstraps)):
        errors.whole(name, value, 1, 100_000_000)
    errors.whole("rounds", rounds, 1, 100)
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory(prefix="evenhand-") as folder:
        great, small = Path(folder, "great.parquet"), Path(folder, "small.parquet")
        write_log(great, rows, rng)
        write_log(small, fewer, rng)
        runs = [(audit(small, fewer), audit(great, rows)) for _ in range(rounds)]
        frame = fairlearn_seconds(small, bootstraps)
    (seconds, cpu, _), (great_seconds, great_cpu, _) = np.median(runs, axis=0)
    return {
        "audit_10m_seconds": round(great_seconds, 2),
        "audit_10m_cpu_seconds": round(great_cpu, 2),
        "audit_10m_peak_mb": round(max(run[1][2] for run in runs)),
        "audit_1m_seconds": round(seconds, 2),
        "audit_1m_cpu_seconds": round(cpu, 2),
        "fairlearn_1m_seconds_2000_bootstraps": None if frame is None else round(frame, 1),
        "fairlearn_bootstraps_run": None if frame is None else bootstraps,
        "ratio_fairlearn": None if frame is None else round(frame / seconds, 1),
        "audit_rows": (rows, fewer),
    }


def audit(log: Path, services: int) -> tuple[float, float, float]:
    """Run ``evenhand audit`` on a log.

    Args:
        log: of this room.
        services: that it has.

    Returns:
        Seconds, processor seconds, and the greatest memory in MB (of 10^6 bytes).

    Raises:
        RuntimeError: when the audit fails, or does not find the services: no speed of that counts.
    """
    peak, out = log.with_suffix(".peak"), log.with_suffix(".json")
    words = ["audit", str(log), "--identities", *IDENTITIES, "--out", str(out)]
    before, began = os.times(), perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", _AUDIT, str(peak), *words],
        capture_output=True,
        text=True,
        check=False,
    )
    seconds, after = perf_counter() - began, os.times()
    if done.returncode:
        raise RuntimeError(f"the audit of {log} ended with {done.returncode}: {done.stderr}")
    found = json.loads(out.read_text(encoding="utf-8"))["services"]
    if found != services:
        raise RuntimeError(f"the audit of {log} found {found} services, not {services}")
    cpu = after.children_user + after.children_system
    cpu -= before.children_user + before.children_system
    return seconds, cpu, int(peak.read_text()) * 1024 / 1e6


def fairlearn_seconds(log: Path, bootstraps: int) -> float | None:
    """Seconds that Fairlearn takes for one identity and issue with ``BOOTSTRAPS`` samples.

    Args:
        log: of this room.
        bootstraps: samples that are drawn indeed.

    Returns:
        The seconds, reckoned; None where Fairlearn is not installed.
    """
    if importlib.util.find_spec("fairlearn") is None:
        return None
    from fairlearn.metrics import MetricFrame

    table = pq.read_table(log, columns=["age_group", "responded"])
    ignored = ~table["responded"].to_numpy()
    given = {
        "metrics": lambda truth, said: np.mean(said),
        "y_true": ignored,
        "y_pred": ignored,
        "sensitive_features": table["age_group"].cast(pa.string()).to_pandas(),
    }
    began = perf_counter()
    MetricFrame(**given)
    once = perf_counter() - began
    began = perf_counter()
    MetricFrame(**given, n_boot=bootstraps, ci_quantiles=[0.025, 0.975], random_state=0)
    sampled = perf_counter() - began
    return once + max(sampled - once, 0.0) / bootstraps * BOOTSTRAPS


def show(found: dict[str, Any]) -> None:
    """Print the measurements."""
    great, small = (f"{rows:,} services" for rows in found["audit_rows"])
    display.table(
        f"Audit of a Parquet file, {len(IDENTITIES)} identities, {BOOTSTRAPS:,} permutations",
        ("log", "seconds", "processor seconds", "peak MB"),
        [
            (great, found["audit_10m_seconds"], found["audit_10m_cpu_seconds"],
             found["audit_10m_peak_mb"]),
            (small, found["audit_1m_seconds"], found["audit_1m_cpu_seconds"], None),
        ],
    )  # fmt: skip
    if found["ratio_fairlearn"] is None:
        print("Fairlearn is not installed: nothing to compare with")
        return
    display.table(
        f"Fairlearn's MetricFrame, {small}, one identity and one issue, intervals from "
        f"{BOOTSTRAPS:,} bootstrap samples reckoned from {found['fairlearn_bootstraps_run']}",
        ("seconds", "times the audit"),
        [(found["fairlearn_1m_seconds_2000_bootstraps"], found["ratio_fairlearn"])],
    )
