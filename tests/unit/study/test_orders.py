"""Orders of sets: by hand, by the laws of the design, and what pages tell."""

import json
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenhand.study.design import orders
from evenhand.study.design.protocol import ClipSet
from support.studies import STUDY


def study(n: int, **changes):
    sets = tuple(ClipSet(f"s{i}", (f"{i}.mp4",)) for i in range(n))
    return replace(STUDY, sets=sets, pairs=(), checks=(), **changes)


def test_the_square_of_four_is_williams():
    # the published 4 x 4 design, rows 0 1 3 2 shifted; relabelled by the seed
    rows = [orders.sets(study(4), k) for k in range(4)]
    name = dict(zip([0, 1, 3, 2], rows[0], strict=True))
    assert rows == [[name[(i + k) % 4] for i in (0, 1, 3, 2)] for k in range(4)]


@given(n=st.integers(1, 14), seed=st.integers(0, 99), start=st.integers(0, 3))
def test_every_set_is_at_every_position_equally_often(n, seed, start):
    one = study(n, seed=seed)
    rows = [orders.sets(one, start * n + k) for k in range(n)]
    for column in zip(*rows, strict=True):
        assert sorted(column) == list(range(n))


@given(n=st.integers(2, 12), seed=st.integers(0, 99))
def test_every_set_follows_every_other_equally_often(n, seed):
    one = study(n, seed=seed)
    count = orders.count(one)
    assert count == (n if n % 2 == 0 else 2 * n)
    follows: dict[tuple[int, int], int] = {}
    for k in range(count or 0):
        for pair in pairwise(orders.sets(one, k)):
            follows[pair] = follows.get(pair, 0) + 1
    assert len(follows) == n * (n - 1)
    assert set(follows.values()) == {1 if n % 2 == 0 else 2}


@pytest.mark.parametrize("order", ["latin", "random", "fixed"])
@given(n=st.integers(1, 9), k=st.integers(0, 500), data=st.data())
def test_orders_are_permutations_and_do_not_change(order, n, k, data):
    length = data.draw(st.integers(0, n))
    one = study(n, order=order, length=length)
    row = orders.sets(one, k)
    assert row == orders.sets(one, k)
    assert len(set(row)) == len(row) == (length or n)
    assert set(row) <= set(range(n))
    if order == "fixed":
        assert row == list(range(length or n))


def test_random_orders_differ_and_have_no_end():
    one = study(6, order="random")
    assert orders.count(one) is None
    assert len({tuple(orders.sets(one, k)) for k in range(20)}) > 15
    assert orders.sets(one, 3) != orders.sets(replace(one, seed=1), 3)


def test_pages_come_in_the_order_that_was_promised():
    # order 0 and 1 of two sets are each other's reverse
    first, second = (orders.sets(STUDY, k) for k in (0, 1))
    assert first == second[::-1]
    names = [f"set:s{i + 1}" for i in first]
    assert [page["id"] for page in orders.pages(STUDY, 0)] == [
        "consent", "about", names[0], "check:look", names[1], "pair:p1", "end", "finished",
    ]  # fmt: skip


def test_pages_tell_what_is_shown_and_nothing_else():
    pages = {page["id"]: page for page in orders.pages(STUDY, 0)}
    assert pages["about"]["questions"][0]["options"][-1]["value"] == "Prefer not to say"
    assert pages["set:s1"]["clips"] == ["s1a.mp4", "s1b.mp4"]
    assert pages["set:s1"]["captions"] == ["A child asks.", "An adult asks."]
    assert [one["id"] for one in pages["set:s2"]["questions"]] == ["fair", "issue", "whom"]
    assert pages["pair:p1"]["second"] == {"clips": ["s2a.mp4"], "captions": []}
    fair = pages["set:s1"]["questions"][0]
    assert (fair["points"], fair["low"], fair["high"]) == (5, "uneven", "even")
    keys = {key for page in pages.values() for one in page.get("questions", []) for key in one}
    assert keys == {"id", "ask", "type", "required", "options", "points", "low", "high", "longest"}
    told = json.dumps(list(pages.values()))
    assert "control" not in told
    assert '"right"' not in told


def test_pages_without_what_is_optional():
    bare = replace(study(1), demographics=(), questions=STUDY.questions[:1])
    assert [page["id"] for page in orders.pages(bare, 0)] == ["consent", "set:s0", "finished"]
