"""Rates, with a clock of their own."""

import pytest

from evenhand.study.server.web.limits import Buckets, Gate, Limits, Rate, TooManyError
from support.studies import Clock


def test_a_bucket_empties_and_fills():
    clock = Clock()
    one = Buckets(Rate(3, 0.5), clock)
    assert [one.take("a") for _ in range(4)] == [0, 0, 0, 2]  # one every two seconds
    assert one.take("b") == 0  # another participant is not held up
    clock.now += 1
    assert one.take("a") == 1
    clock.now += 1
    assert one.take("a") == 0
    clock.now += 1000
    assert [one.take("a") for _ in range(4)] == [0, 0, 0, 2]  # never more than it holds


def test_nobody_is_remembered_longer_than_needed():
    clock = Clock()
    one = Buckets(Rate(60, 5), clock)
    for number in range(100):
        one.take(str(number))
    assert len(one) == 100
    clock.now += 12.1  # full again after 60 / 5 seconds
    one.take("new")
    assert len(one) == 1


def test_a_gate_tells_how_long_to_wait():
    gate = Gate(Limits(begin=Rate(1, 0.1)), Clock())
    gate(gate.begin)
    with pytest.raises(TooManyError) as error:
        gate(gate.begin)
    assert error.value.seconds == pytest.approx(10)
    gate(gate.everything)
