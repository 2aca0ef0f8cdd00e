"""Invented people: their shares, and who is next in a lane."""

import numpy as np

from evenhand.adapters import invented, sampler
from evenhand.adapters.sampler import Queue
from support.toys import SCHEME


def test_shares_by_count():
    draw = invented(SCHEME, {"side": (0.8, 0.2), "who": (0.0, 1.0, 0.0)})
    codes = draw(20_000, np.random.default_rng(0))
    assert codes.shape == (20_000, 2)
    assert set(codes[:, 0]) == {1}
    # five standard errors of a share of 0.2
    assert abs(codes[:, 1].mean() - 0.2) < 5 * np.sqrt(0.16 / 20_000)


def test_groups_are_as_frequent_where_nothing_is_said():
    codes = invented(SCHEME)(30_000, np.random.default_rng(0))
    shares = np.bincount(codes[:, 0]) / 30_000
    assert (np.abs(shares - 1 / 3) < 5 * np.sqrt(2 / 9 / 30_000)).all()


def test_every_lane_serves_its_own_stream_in_order(monkeypatch):
    monkeypatch.setattr(sampler, "BLOCK", 4)
    draw = invented(SCHEME)
    streams = np.random.default_rng(7).spawn(2)
    expected = [np.concatenate([draw(4, one) for _ in range(6)]) for one in streams]
    queue = Queue(draw, np.random.default_rng(7), 2, SCHEME)
    served = [[], []]
    for lanes in ([0, 0, 1], [0, 0, 0], [1, 0], [0, 0, 0, 1, 1], [1, 1, 0, 0, 0], [0]):
        lane = np.array(lanes)
        rank = np.array([lanes[:i].count(one) for i, one in enumerate(lanes)])
        for one in (0, 1):
            ahead = np.array([lanes.count(0), lanes.count(1)])
            place = len(served[one])
            assert queue.now()[one].tolist() == expected[one][place].tolist()
            after = expected[one][place + ahead[one]]
            assert queue.now(ahead)[one].tolist() == after.tolist()
        for one, codes in zip(lanes, queue.serve(lane, rank), strict=True):
            served[one].append(codes.tolist())
    for one in (0, 1):
        assert served[one] == expected[one][: len(served[one])].tolist()
    assert len(served[0]) > 12  # more than are drawn at first


def test_more_at_once_than_are_drawn_at_a_time(monkeypatch):
    monkeypatch.setattr(sampler, "BLOCK", 4)
    draw = invented(SCHEME)
    streams = np.random.default_rng(7).spawn(2)
    expected = [np.concatenate([draw(4, one) for _ in range(8)]) for one in streams]
    queue = Queue(draw, np.random.default_rng(7), 2, SCHEME)
    served = [[], []]
    for lanes in ([0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0], [1, 0, 1], [1] * 9 + [0] * 9):
        rank = np.array([lanes[:i].count(one) for i, one in enumerate(lanes)])
        for one, codes in zip(lanes, queue.serve(np.array(lanes), rank), strict=True):
            served[one].append(codes.tolist())
    for one in (0, 1):
        assert served[one] == expected[one][: len(served[one])].tolist()
        assert queue.now()[one].tolist() == expected[one][len(served[one])].tolist()
