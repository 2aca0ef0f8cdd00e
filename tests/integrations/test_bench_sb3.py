"""The bench beside Stable-Baselines3: that all sides do the same work, not how fast."""

import pytest

from support.extras import wanted
from support.refusals import refused

wanted("stable_baselines3", "the extra sb3")

from benchmarks import stable_baselines3  # noqa: E402


@pytest.mark.long
@pytest.mark.slow
def test_all_sides_do_the_same_work(capsys, monkeypatch):
    monkeypatch.setattr(stable_baselines3, "_ROUNDS", 1)
    found = stable_baselines3.measure(4)
    sides = found["sb3_sides"]
    ours = sides["evenhand"]
    assert set(sides) == {"evenhand", "adapter", "guided", "sync", "dummy"}
    assert ours["gradient_steps"] == 4 * 16
    for side in sides.values():
        assert side["decisions_per_service"] == pytest.approx(
            ours["decisions_per_service"], rel=0.5
        )
        assert side["gradient_steps"] == pytest.approx(ours["gradient_steps"], rel=0.5)
    assert 0 <= found["sb3_others"] <= 1
    stable_baselines3.show(found)
    out = " ".join(capsys.readouterr().out.split())
    assert f"(other work took {found['sb3_others']:.0%} of" in out
    assert f"Gymnasium's environments take {found['sb3_ratio']} times as long" in out


def test_no_epochs():
    with refused("range epochs", "0"):
        stable_baselines3.measure(0)
