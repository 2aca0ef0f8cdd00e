"""The bench of the environment measures what it says."""

import numpy as np
import pytest

from benchmarks import environment
from evenhand.core.processors import CORES


@pytest.fixture(scope="module")
def found():
    return environment.measure(0.25)


def test_every_number_is_there_and_a_rate(found):
    rates = [name for name in found if "_per_s" in name]
    assert {
        "bare_steps_per_s",
        "env_steps_per_s_30",
        "env_steps_per_s_240",
        "sync_steps_per_s",
    } <= {*rates}
    for name in rates:
        assert 0 < found[name] < np.inf, name
    assert found["threads"] == CORES


def test_ratios_are_those_of_the_rates(found):
    # one round, so the medians are its numbers
    assert found["rounds"] == 1
    for n in (30, 240):
        expected = found[f"env_steps_per_s_{n}"] / found["bare_steps_per_s"]
        assert found[f"ratio_{n}"] == pytest.approx(expected, abs=2e-3)
    expected = found["env_steps_per_s_30"] / found["sync_steps_per_s"]
    assert found["ratio_sync"] == pytest.approx(expected, abs=2e-3)
    for what in ("30", "240", "sync"):
        assert found[f"ratio_{what}_one_thread"] > 0


def test_shares_of_an_epoch_add_up(found):
    assert sum(found["epoch_share"].values()) == pytest.approx(1.0, abs=3e-3)
    assert min(found["epoch_share"].values()) > 0
    assert 0 < found["reflection_ratio"] < np.inf


def test_the_table_has_both_numbers_of_threads(found, capsys):
    environment.show(found)
    out = capsys.readouterr().out
    assert f"{found['ratio_30']:.3f}" in out
    assert f"{found['ratio_30_one_thread']:.3f}" in out
