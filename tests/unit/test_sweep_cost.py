"""What a sweep costs, calculated by hand from made-up samples."""

import pytest

from evenhand.experiments.comparison.settings import Cell
from evenhand.experiments.sweep.cost import Kind, Sample, calculate, measure
from evenhand.experiments.sweep.settings import Job, Sweep, Variant

SMALL, LARGE = Variant(epochs=100, services=1000), Variant(epochs=200, people=60, services=500)


def job(variant: Variant, arm: str, seed: int, algorithm: str = "ppo") -> Job:
    return Job(variant, Cell("tips", algorithm, arm, seed))


PLAN = Sweep(
    (
        job(SMALL, "levelup@1", 0),
        job(SMALL, "levelup@2", 0),
        job(LARGE, "levelup", 0),
        job(SMALL, "penalty", 0, "reinforce"),
        job(SMALL, "reference", 0, "none"),
    ),
    "",
)
PPO = Sample(begin=2.0, epoch=0.1, service=0.001, fixed=1000.0, bytes=10.0)
NONE = Sample(begin=0.0, epoch=0.0, service=0.002, fixed=50.0, bytes=0.0)


def test_by_hand():
    found = calculate(PLAN, {Kind("ppo", "levelup", 30): PPO, Kind("none", "reference", 30): NONE})
    by_kind = {cost.kind: cost for cost in found}
    two = by_kind[Kind("ppo", "levelup", 30)]
    assert (two.runs, two.measured) == (2, True)
    assert two.seconds == pytest.approx(2 * (100 * 0.1 + 1000 * 0.001))
    assert two.compiling == 2.0  # one variant
    assert two.bytes == 2 * (1000 + 100 * 10)
    # twice the people: twice the seconds and bytes of an epoch
    large = by_kind[Kind("ppo", "levelup", 60)]
    assert (large.runs, large.measured) == (1, False)
    assert large.seconds == pytest.approx(200 * 0.2 + 500 * 0.001)
    assert large.bytes == 1000 + 200 * 20
    reference = by_kind[Kind("none", "reference", 30)]
    assert reference.seconds == pytest.approx(1000 * 0.002)
    assert reference.bytes == 50
    # nothing of its algorithm was measured: the mean of all
    other = by_kind[Kind("reinforce", "penalty", 30)]
    assert other.seconds == pytest.approx(100 * 0.05 + 1000 * 0.0015)
    assert [cost.seconds for cost in found] == sorted((c.seconds for c in found), reverse=True)


@pytest.mark.slow
def test_a_sample_is_measured():
    learning = measure(job(Variant(people=4), "service", 0, "reinforce"))
    assert min(learning.begin, learning.epoch, learning.service) > 0
    assert min(learning.fixed, learning.bytes) > 0
    assert learning.begin > learning.epoch  # compiling
    alone = measure(job(SMALL, "reference", 0, "none"))
    assert (alone.begin, alone.epoch, alone.bytes) == (0.0, 0.0, 0.0)
    assert min(alone.service, alone.fixed) > 0
