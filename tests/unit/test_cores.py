"""How much of the processors others take, as the system counts it."""

import os
import subprocess
import sys
from time import perf_counter
from types import SimpleNamespace

import pytest

from evenhand.core import processors

CHILDREN = "children_user", "children_system"
BUSY = "import time; until = time.process_time() + 1\nwhile time.process_time() < until: pass"


def test_another_process_counts():
    others, began = processors.Others(), perf_counter()
    with subprocess.Popen([sys.executable, "-c", BUSY]) as process:
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        share = others.share()
        spent = (os.cpu_count() or 1) * (perf_counter() - began)
    assert share is not None
    # a second of its work, less what is lost by rounding
    assert 0.8 / spent < share <= 1
    ended = others.share()  # now it is one's own
    assert ended is not None
    assert ended < share - 0.5 / spent


@pytest.mark.parametrize("content", ["", "cpu 1 2 three 4 5 6 7 8", "cpu 1 2"])
def test_where_the_system_tells_nothing(tmp_path, monkeypatch, content):
    monkeypatch.setattr(processors, "_STAT", tmp_path / "none")
    assert processors.Others().share() is None
    (tmp_path / "none").write_text(content)
    assert processors.Others().share() is None


def test_by_hand(tmp_path, monkeypatch):
    stat = tmp_path / "stat"
    monkeypatch.setattr(processors, "_STAT", stat)
    monkeypatch.setattr(processors, "process_time", lambda: 5.0)
    ended = iter([(2.0, 3.0), (2.25, 3.25)])
    monkeypatch.setattr(
        os, "times", lambda: SimpleNamespace(**dict(zip(CHILDREN, next(ended), strict=True)))
    )
    clock = iter([10.0, 12.0])
    monkeypatch.setattr(processors, "perf_counter", lambda: next(clock))
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    monkeypatch.setattr(os, "sysconf", lambda name: 100)
    # user, nice, system, idle, waiting, irq, softirq, steal
    stat.write_text("cpu 100 0 0 700 50 0 0 0 0 0\ncpu0 1 2 3\n")
    others = processors.Others()
    stat.write_text("cpu 150 50 40 900 90 20 20 20 7 0\ncpu0 1 2 3\n")
    # (50 + 50 + 40 + 20 + 20 + 20) / 100 - 0.5 of 4 times 2 seconds
    assert others.share() == pytest.approx(1.5 / 8.0)
