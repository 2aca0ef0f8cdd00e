"""The rivals that weigh groups, unawareness, and the one form of calling them all."""

import json
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from evenhand.training.rivals import base, formulas, methods
from evenhand.training.rivals.base import EpochOutcome

from evenhand.core.errors import InputError
from support.rivals import NAN, TWO_GROUPS, two_groups


class TestGroupDRO:
    def test_by_hand(self):
        # means 3/4 and 1/4; exp(η/2) = 3, so the shares are 1/4 and 3/4;
        # weights 4 · 1/4 / 2 and 4 · 3/4 / 2
        method = methods.GroupDRO(rate=2 * np.log(3.0))
        advantage, state = method.shape(two_groups(), method.begin(2, 1))
        np.testing.assert_allclose(np.exp(state.log_q), [0.25, 0.75])
        np.testing.assert_allclose(advantage[:, 0], [0.5 * 2, 0.0, 0.5 * 1, 1.5 * 4])

    def test_the_adjustment_by_hand(self):
        # C / √n = 2/1 and 2/2 with the same loss: a ratio of exp(η) = 2
        log_q = formulas.dro_step(
            np.log([0.5, 0.5]), np.zeros(2), np.array([1.0, 4.0]), np.log(2.0), 2.0
        )
        np.testing.assert_allclose(np.exp(log_q), [2 / 3, 1 / 3])

    def test_an_empty_group_keeps_its_mean_and_counts_all_services(self):
        method = methods.GroupDRO(rate=2 * np.log(3.0), adjustment=0.0)
        _, state = method.shape(two_groups(), method.begin(2, 1))
        only_b = np.tile([0.0, 1.0], (4, 1))
        advantage, state = method.shape(two_groups(inside=only_b), state)
        # b now earns 1/2, a still 3/4: exp(η/4) = √3 to shares of 1 : 3
        np.testing.assert_array_equal(state.mean, [0.75, 0.5])
        np.testing.assert_array_equal(state.seen, [2.0, 6.0])
        q = 3 * np.sqrt(3.0) / (1 + 3 * np.sqrt(3.0))
        np.testing.assert_allclose(np.exp(state.log_q), [1 - q, q])
        np.testing.assert_allclose(advantage[:, 0], q * two_groups().advantage[:, 0])

    def test_a_group_never_seen_keeps_its_share(self):
        # of the other two, 2/3 in all, the worse gets exp(ln 3) = 3 times as much
        log_q = formulas.dro_step(
            np.full(3, -np.log(3.0)), np.array([0.0, 1.0, 7.0]), np.array([5.0, 5.0, 0.0]),
            np.log(3.0), 0.0,
        )  # fmt: skip
        np.testing.assert_allclose(np.exp(log_q), [1 / 6, 1 / 2, 1 / 3])

    def test_nobody_known_changes_nothing(self):
        method = methods.GroupDRO()
        nobody = two_groups(inside=np.full((4, 2), NAN))
        advantage, state = method.shape(nobody, method.begin(2, 1))
        np.testing.assert_allclose(np.exp(state.log_q), [0.5, 0.5])
        np.testing.assert_array_equal(advantage, 0.0)

    def test_equal_shares_of_equal_groups_weigh_everybody_alike(self):
        weight = formulas.service_weights(np.array([0.5, 0.5]), TWO_GROUPS)
        np.testing.assert_allclose(weight, 1.0)

    def test_weights_of_two_identities_add_up(self):
        # groups a (2 people), b (1) of one identity, c (3) of another
        inside = np.array([[1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
        weight = formulas.service_weights(np.array([0.2, 0.3, 0.5]), inside)
        # 3 (0.2/2 + 0.5/3), the same, 3 (0.3/1 + 0.5/3)
        np.testing.assert_allclose(weight, [0.8, 0.8, 1.4])


class TestGGF:
    def test_weights_go_by_rank(self):
        # 1 : 1/2 : 1/4 for 0.2, 0.5, 0.8; an order that is not its own inverse
        weight = formulas.gini_weights(np.array([0.5, 0.8, 0.2]), np.ones(3, bool), 0.5)
        np.testing.assert_allclose(weight, [2 / 7, 1 / 7, 4 / 7])

    def test_equals_share(self):
        weight = formulas.gini_weights(np.array([0.3, 0.9, 0.3]), np.ones(3, bool), 0.5)
        np.testing.assert_allclose(weight, [3 / 7, 1 / 7, 3 / 7])

    def test_unknown_groups_are_left_out(self):
        known = np.array([True, False, True])
        weight = formulas.gini_weights(np.array([0.9, 0.0, 0.1]), known, 0.5)
        np.testing.assert_allclose(weight, [1 / 3, 0.0, 2 / 3])
        np.testing.assert_array_equal(formulas.gini_weights(np.zeros(3), ~known & known, 0.5), 0.0)

    def test_by_hand(self):
        # means 3/4 and 1/4: weights 1/3 and 2/3; services 4 · 1/3 / 2 and 4 · 2/3 / 2
        method = methods.GGF()
        advantage, state = method.shape(two_groups(), method.begin(2, 1))
        np.testing.assert_allclose(state.mean, [0.75, 0.25])
        np.testing.assert_allclose(
            advantage[:, 0], np.array([2 / 3, 4 / 3, 2 / 3, 4 / 3]) * [2.0, 0.0, 1.0, 4.0]
        )

    def test_the_mean_is_remembered(self):
        method = methods.GGF(memory=0.5)
        _, state = method.shape(two_groups(), method.begin(2, 1))
        # then a earns 0 and b 1/2: (3/4 + 0)/2 and (1/4 + 1/2)/2
        later = two_groups(reward=np.array([0.0, 0.5, 0.0, 0.5]))
        _, state = method.shape(later, state)
        np.testing.assert_allclose(state.mean, [0.375, 0.375])
        # and only b is served: a keeps its mean
        only_b = np.tile([0.0, 1.0], (4, 1))
        _, state = method.shape(two_groups(inside=only_b, reward=np.zeros(4)), state)
        np.testing.assert_allclose(state.mean, [0.375, 0.1875])

    def test_the_first_mean_counts_whole_even_later(self):
        method = methods.GGF(memory=0.5)
        only_b = np.tile([0.0, 1.0], (4, 1))
        _, state = method.shape(two_groups(inside=only_b), method.begin(2, 1))
        np.testing.assert_array_equal(state.seen, [0.0, 1.0])
        _, state = method.shape(two_groups(), state)
        # b: 1/2 before, 1/4 now
        np.testing.assert_allclose(state.mean, [0.75, 0.375])


class TestUnaware:
    def test_only_identities_are_hidden(self):
        seen = np.arange(1.0, 13.0, dtype=np.float32).reshape(2, 1, 6)
        blind = formulas.unaware(seen, 4)
        np.testing.assert_array_equal(blind[:, 0], [[0, 0, 0, 0, 5, 6], [0, 0, 0, 0, 11, 12]])
        assert blind.dtype == np.float32
        assert seen[0, 0, 0] == 1.0

    @pytest.mark.parametrize("groups", [-1, 26])
    def test_more_groups_than_columns(self, groups):
        with pytest.raises(InputError, match=r"25 numbers has no -?\d+ columns of identities"):
            formulas.unaware(np.zeros(25), groups)


def restaurant(rng: np.random.Generator, n: int = 12, **changes: Any) -> EpochOutcome:
    """A made-up epoch of the restaurant's size, in which some groups are empty."""
    sizes = (6, 3, 5, 2, 6)
    inside = np.concatenate([np.eye(k)[rng.integers(0, k, n)] for k in sizes], axis=1)
    x = (rng.random((n, 4)) < 0.3).astype(float)
    x[x[:, 0] == 1, 1:3] = NAN
    mask = (np.arange(7) < rng.integers(1, 8, n)[:, None]).astype(float)
    advantage = np.where(mask > 0, rng.normal(size=(n, 7)), NAN)
    outcome = EpochOutcome(
        reward=rng.uniform(-0.5, 1.0, n),
        x=x,
        inside=inside,
        identity=np.repeat(np.arange(5), sizes),
        advantage=advantage,
        mask=mask,
        score=float(rng.random()),
        cost=rng.normal(size=n),
    )
    return replace(outcome, **changes)


EDGES: dict[str, Callable[[EpochOutcome], dict[str, Any]]] = {
    "as_it_comes": lambda _: {},
    "no_responses": lambda o: {"x": np.tile([1.0, NAN, NAN, 0.0], (len(o.x), 1))},
    "all_responses": lambda o: {"x": np.nan_to_num(o.x) * [0.0, 1.0, 1.0, 1.0]},
    "one_group": lambda o: {"inside": np.tile(o.inside[:1], (len(o.x), 1))},
    "nobody_known": lambda o: {"inside": np.full(o.inside.shape, NAN)},
    "score_unknown": lambda _: {"score": NAN},
    "all_alike": lambda o: {"advantage": np.zeros(o.mask.shape), "cost": np.zeros(len(o.x))},
}


class TestEveryRival:
    @pytest.mark.parametrize("name", methods.RIVALS)
    @pytest.mark.parametrize("edge", EDGES)
    def test_advantages_are_numbers_whatever_happens(self, name, edge):
        rng = np.random.default_rng(3)
        method = methods.rival(name)
        state = method.begin(22, 4)
        for _ in range(3):
            outcome = restaurant(rng)
            outcome = replace(outcome, **EDGES[edge](outcome))
            advantage, state = method.shape(outcome, state)
            assert advantage.shape == outcome.mask.shape
            assert np.isfinite(advantage).all()
            assert (advantage[outcome.mask == 0] == 0).all()
            assert all(np.isfinite(a).all() for a in base.to_arrays(state).values())

    @pytest.mark.parametrize("name", methods.RIVALS)
    def test_what_it_remembers_survives_json(self, name):
        rng = np.random.default_rng(4)
        method = methods.rival(name)
        first = method.begin(22, 4)
        _, state = method.shape(restaurant(rng), first)
        text = json.dumps({k: a.tolist() for k, a in base.to_arrays(state).items()})
        back = base.from_arrays(first, json.loads(text))
        assert type(back) is type(state)
        following = restaurant(rng)
        went_on, _ = method.shape(following, state)
        resumed, _ = method.shape(following, back)
        np.testing.assert_array_equal(went_on, resumed)

    @pytest.mark.parametrize("name", methods.RIVALS)
    def test_what_it_remembers_has_one_shape(self, name):
        method = methods.rival(name)
        state = method.begin(22, 4)
        before = {k: a.shape for k, a in base.to_arrays(state).items()}
        _, state = method.shape(restaurant(np.random.default_rng(2)), state)
        assert {k: a.shape for k, a in base.to_arrays(state).items()} == before

    def test_one_window_survives_json_too(self):
        method = methods.Elbert(windows=1)
        first = method.begin(22, 4)
        saved = {k: a.tolist() for k, a in base.to_arrays(first).items()}
        back = base.from_arrays(first, saved)
        assert back.counts.shape == (0, 4, 22, 4)

    def test_no_two_have_settings_of_the_same_names(self):
        # A fingerprint of settings holds names and values, not the class.
        kinds: list[Any] = list(methods.RIVALS.values())
        names = [frozenset(field.name for field in fields(kind)) for kind in kinds]
        assert len(set(names)) == len(names)

    @pytest.mark.parametrize("other", [methods.Elbert(windows=3), methods.GGF()])
    def test_what_another_remembered_is_refused(self, other):
        saved = base.to_arrays(other.begin(22, 4))
        with pytest.raises(InputError, match="belongs to other settings: resume with the settings"):
            base.from_arrays(methods.Elbert(windows=4).begin(22, 4), saved)


class TestWrongInput:
    @pytest.mark.parametrize(
        ("name", "settings", "said"),
        [
            ("lagrangian", {"limit": -0.1}, "limit is -0.1: give a number from 0"),
            ("lagrangian", {"rate": NAN}, "rate is nan"),
            ("lagrangian", {"start": np.inf}, "start is inf"),
            ("a_ppo", {"beta": (1.0, 2.0)}, "beta is .*: give three numbers"),
            ("a_ppo", {"beta": (1.0, 2.0, -1.0)}, "beta is -1.0"),
            ("a_ppo", {"omega": -1.0}, "omega is -1.0"),
            ("a_ppo", {"windows": 0}, "windows is 0: give a whole number from 1"),
            ("r_ppo", {"zeta": -1.0}, "zeta is -1.0"),
            ("r_ppo", {"omega": NAN}, "omega is nan"),
            ("r_ppo", {"windows": 0}, "windows is 0"),
            ("elbert", {"alpha": -1.0}, "alpha is -1.0"),
            ("elbert", {"sharpness": 0.0}, "sharpness is 0.0: give a number from 0.001"),
            ("elbert", {"windows": 0}, "windows is 0"),
            ("group_dro", {"rate": -1.0}, "rate is -1.0"),
            ("group_dro", {"adjustment": np.inf}, "adjustment is inf"),
            ("ggf", {"decay": 0.0}, "decay is 0.0: give a number from 0.001 to 1"),
            ("ggf", {"decay": 1.1}, "decay is 1.1"),
            ("ggf", {"memory": 1.1}, "memory is 1.1"),
            ("elbret", {}, "unknown rival 'elbret': did you mean 'elbert'"),
            ("elbert", {"sharpnes": 1.0}, "unknown setting of elbert 'sharpnes': did you mean"),
        ],
    )
    def test_settings(self, name, settings, said):
        with pytest.raises(InputError, match=said):
            methods.rival(name, **settings)

    @pytest.mark.parametrize(
        ("changes", "said"),
        [
            ({"reward": np.zeros(3)}, "reward of the epoch has shape .3,.: give .4,."),
            ({"x": np.zeros((3, 1))}, "x of the epoch has shape"),
            ({"identity": np.zeros(3)}, "identity of the epoch has shape"),
            ({"advantage": np.zeros((4, 2))}, "advantage of the epoch has shape"),
            ({"mask": np.ones((3, 1)), "advantage": np.ones((3, 1))}, "mask of the epoch has"),
            ({"cost": np.zeros(1)}, "cost of the epoch has shape"),
            ({"reward": np.array([0.0, NAN, 0.0, 0.0])}, "reward of the epoch is not finite"),
            ({"cost": np.array([0.0, np.inf, 0.0, 0.0])}, "cost of the epoch is not finite"),
            ({"advantage": np.full((4, 1), NAN)}, "advantage of the epoch is not finite"),
        ],
    )
    def test_epochs(self, changes, said):
        with pytest.raises(InputError, match=said):
            two_groups(**changes)
