"""Windows, perfect services and the numbers of a test, by hand."""

from typing import Any

import numpy as np
import pytest

from evenhand.methods.paper import scores as paper_scores
from evenhand.methods.services import Services
from evenhand.restaurant import people
from evenhand.restaurant.robots import ScriptedRobot
from evenhand.restaurant.worlds import World
from evenhand.training import evaluate, train
from evenhand.training.settings import TrainSettings


def services(
    disabled: Any, responded: Any, distance: Any = 1.25, step: Any = 100, least: Any = 1.25
) -> Services:
    """Services of people who differ in disability alone."""
    n = len(disabled)
    codes = np.zeros((n, 5), int)
    codes[:, 3] = np.where(disabled, 0, 1)
    responded = np.broadcast_to(responded, n)
    return Services.build(
        {one.name: (codes[:, i], one.groups) for i, one in enumerate(people.IDENTITIES)},
        {
            "responded": responded,
            "response_step": np.ma.array(np.broadcast_to(step, n), mask=~responded),
            "response_distance": np.ma.array(np.broadcast_to(distance, n), mask=~responded),
            "min_distance": np.broadcast_to(least, n),
            "steps": np.where(responded, step, 300),
        },
    )


def test_a_window_is_the_thirty_services_of_an_epoch():
    assert evaluate.WINDOW == 30
    assert TrainSettings().people == 30


class TestWindows:
    def test_every_full_window_is_scored_alone(self):
        rng = np.random.default_rng(3)
        table = services(rng.random(100) < 0.5, rng.random(100) < 0.7, rng.uniform(0.8, 1.8, 100))
        windows = evaluate.window_scores(table)
        assert windows.total.shape == (3,)  # the last ten services fill no window
        for w in range(3):
            alone = paper_scores.score(table.take(np.arange(30 * w, 30 * w + 30)))
            np.testing.assert_array_equal(windows.gap[w], alone.gap)
            np.testing.assert_array_equal(windows.total[w], alone.total)
            for name, score in alone.by_identity.items():
                np.testing.assert_array_equal(windows.by_identity[name][w], score)

    def test_identities_in_another_order(self):
        disabled = np.arange(30) < 15
        table = services(disabled, ~disabled)
        assert evaluate.window_scores(table).by_identity["disability"][0, 0] == 1.0
        # hand the first ten people's services to the last ten, and the other way round
        order = np.arange(30)
        order[:10], order[20:] = np.arange(20, 30), np.arange(10)
        # then 5 of 15 disabled people and 10 of 15 others are not responded to
        swapped = evaluate.window_scores(table, order)
        assert swapped.by_identity["disability"][0, 0] == pytest.approx(1 / 3)


def test_perfect_by_hand():
    table = services(
        np.zeros(7, bool),
        np.array([True, True, True, True, True, False, True]),
        distance=np.array([1.0, 1.5, 1.6, 1.25, 1.25, 1.25, 0.9]),
        step=np.array([200, 0, 10, 201, 10, 300, 10]),
        least=np.array([1.0, 1.5, 1.6, 1.25, 0.4, 1.25, 0.9]),
    )
    assert evaluate.perfect(table).tolist() == [True, True, False, False, False, False, False]


class TestSummary:
    def test_by_hand(self):
        # two windows, half of the people disabled; in the first nobody disabled is responded to
        window = np.repeat([0, 1], 30)
        disabled = np.tile(np.arange(30) < 15, 2)
        table = services(
            disabled, ~(disabled & (window == 0)), distance=np.where(window, 1.25, 1.5)
        )
        found = evaluate.summary(table, seed=0)
        assert found["services"] == 60
        assert found["willingness"] == 0.5  # 1 in the first, 0 in the second
        assert found["quality"] == found["risk"] == 0.0
        assert found["total"] == 0.5
        assert found["pooled_total"] == 0.5  # 15 of 30 against 0 of 30
        assert found["perfect_rate"] == found["response_rate"] == 0.75
        assert found["worst_group_rate"] == 0.5
        assert found["mean_response_distance"] == pytest.approx((15 * 1.5 + 30 * 1.25) / 45)
        assert found["mean_response_time"] == 100
        assert found["mean_service_seconds"] == pytest.approx(0.02 * (45 * 100 + 15 * 300) / 60)

    def test_a_small_group_is_not_the_worst(self):
        # a handful of people, none of them responded to, says nothing of a group
        for few, worst in ((29, 91 / 120), (30, 0.0)):
            disabled = np.arange(120) < few
            assert evaluate.summary(services(disabled, ~disabled), 0)["worst_group_rate"] == worst
        half = np.arange(50) < 25
        table = services(half, True)
        codes = np.arange(50)[:, None] // 25 == np.arange(2)
        assert evaluate.worst_group_rate(evaluate.perfect(table), codes.astype(float)) is None

    def test_where_nothing_is_known_it_says_nothing(self):
        found = evaluate.summary(services(np.arange(30) < 15, np.zeros(30, bool)), seed=0)
        for name in ("quality", "priority", "mean_response_distance", "mean_response_time"):
            assert found[name] is None
        assert found["total"] == 0.0
        assert found["response_rate"] == 0.0

    def test_the_floor_of_services_that_are_all_alike_is_nothing(self):
        assert evaluate.summary(services(np.arange(60) % 2 == 0, True), seed=0)["floor"] == 0.0

    def test_what_is_even_lies_at_its_floor_and_what_is_not_above(self):
        rng = np.random.default_rng(5)
        disabled = rng.random(6000) < 0.5
        even = evaluate.summary(services(disabled, rng.random(6000) < 0.5), seed=1)
        uneven = evaluate.summary(
            services(disabled, rng.random(6000) < 0.2 + 0.6 * disabled), seed=1
        )
        assert even["floor"] > 0.1  # chance alone, in windows of 30
        assert even["total"] == pytest.approx(even["floor"], rel=0.1)
        assert even["pooled_total"] < 0.05
        assert uneven["floor"] == pytest.approx(even["floor"], rel=0.1)
        assert uneven["total"] == pytest.approx(0.6, abs=0.03)

    def test_the_floor_follows_its_seed_and_nothing_else(self):
        rng = np.random.default_rng(5)
        table = services(rng.random(300) < 0.5, rng.random(300) < 0.5)
        first, again, other = (evaluate.summary(table, seed=seed) for seed in (1, 1, 2))
        assert first == again
        assert first["floor"] != other["floor"]
        assert {**first, "floor": 0} == {**other, "floor": 0}


class TestServing:
    def test_scripted(self):
        table = evaluate.serve_scripted(ScriptedRobot("ableist"), World(), 70, seed=4)
        assert len(table) == 70
        np.testing.assert_array_equal(table.fact("service"), np.arange(70))
        np.testing.assert_array_equal(table.fact("epoch"), np.arange(70) // 30)
        assert set(table.fact("robot")) == {"ableist"}
        assert table == evaluate.serve_scripted(ScriptedRobot("ableist"), World(), 70, seed=4)
        assert table != evaluate.serve_scripted(ScriptedRobot("ableist"), World(), 70, seed=5)

    def test_a_policy(self):
        settings = TrainSettings(seed=3)
        state = train.begin(settings)
        table = evaluate.serve_policy(state, settings, 60, seed=4)
        assert table == evaluate.serve_policy(state, settings, 60, seed=4)
        assert len(table) == 60
        # by chance, not greedily: one policy, and services of many lengths
        assert len(set(table.fact("steps"))) > 5

    def test_a_policy_before_other_people(self):
        settings = TrainSettings(seed=3, population="uniform")
        state = train.begin(settings)
        world = settings.elsewhere(None, "fairface")
        table = evaluate.serve_policy(state, settings, 90, seed=4, world=world)
        # of whom the published numbers hold no American Indian and no Native Hawaiian
        codes, categories = table.identity("race")
        assert {categories[code] for code in codes} <= {"White", "Black", "Asian", "Other"}
