"""The published methods that weigh groups, and unawareness."""

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.methods import registry
from evenhand.methods.controls import unaware
from evenhand.methods.rivals import ggf, group_dro, shared
from support.refusals import refused
from support.rivals import NAN, TWO_GROUPS, scheme, two_groups


class TestGroupDRO:
    def test_by_hand(self):
        # means 3/4 and 1/4; exp(η/2) = 3, so the shares are 1/4 and 3/4;
        # weights 4 · 1/4 / 2 and 4 · 3/4 / 2
        method = group_dro.GroupDRO(rate=2 * np.log(3.0))
        advantage, state = method.teach(two_groups(), method.begin(scheme(2, 1)))
        np.testing.assert_allclose(np.exp(state.log_q), [0.25, 0.75])
        np.testing.assert_allclose(advantage[:, 0], [0.5 * 2, 0.0, 0.5 * 1, 1.5 * 4])

    def test_the_adjustment_by_hand(self):
        # C / √n = 2/1 and 2/2 with the same loss: a ratio of exp(η) = 2
        log_q = group_dro.dro_step(
            np.log([0.5, 0.5]), np.zeros(2), np.array([1.0, 4.0]), np.log(2.0), 2.0
        )
        np.testing.assert_allclose(np.exp(log_q), [2 / 3, 1 / 3])

    def test_an_empty_group_keeps_its_mean_and_counts_all_services(self):
        method = group_dro.GroupDRO(rate=2 * np.log(3.0), adjustment=0.0)
        _, state = method.teach(two_groups(), method.begin(scheme(2, 1)))
        only_b = np.tile([0.0, 1.0], (4, 1))
        advantage, state = method.teach(two_groups(inside=only_b), state)
        # b now earns 1/2, a still 3/4: exp(η/4) = √3 to shares of 1 : 3
        np.testing.assert_array_equal(state.mean, [0.75, 0.5])
        np.testing.assert_array_equal(state.seen, [2.0, 6.0])
        q = 3 * np.sqrt(3.0) / (1 + 3 * np.sqrt(3.0))
        np.testing.assert_allclose(np.exp(state.log_q), [1 - q, q])
        np.testing.assert_allclose(advantage[:, 0], q * two_groups().advantage[:, 0])

    def test_a_group_never_seen_keeps_its_share(self):
        # of the other two, 2/3 in all, the worse gets exp(ln 3) = 3 times as much
        log_q = group_dro.dro_step(
            np.full(3, -np.log(3.0)), np.array([0.0, 1.0, 7.0]), np.array([5.0, 5.0, 0.0]),
            np.log(3.0), 0.0,
        )  # fmt: skip
        np.testing.assert_allclose(np.exp(log_q), [1 / 6, 1 / 2, 1 / 3])

    def test_nobody_known_changes_nothing(self):
        method = group_dro.GroupDRO()
        nobody = two_groups(inside=np.full((4, 2), NAN))
        advantage, state = method.teach(nobody, method.begin(scheme(2, 1)))
        np.testing.assert_allclose(np.exp(state.log_q), [0.5, 0.5])
        np.testing.assert_array_equal(advantage, 0.0)

    def test_equal_shares_of_equal_groups_weigh_everybody_alike(self):
        weight = shared.service_weights(np.array([0.5, 0.5]), TWO_GROUPS)
        np.testing.assert_allclose(weight, 1.0)

    def test_weights_of_two_identities_add_up(self):
        # groups a (2 people), b (1) of one identity, c (3) of another
        inside = np.array([[1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
        weight = shared.service_weights(np.array([0.2, 0.3, 0.5]), inside)
        # 3 (0.2/2 + 0.5/3), the same, 3 (0.3/1 + 0.5/3)
        np.testing.assert_allclose(weight, [0.8, 0.8, 1.4])


class TestGGF:
    def test_weights_go_by_rank(self):
        # 1 : 1/2 : 1/4 for 0.2, 0.5, 0.8; an order that is not its own inverse
        weight = ggf.gini_weights(np.array([0.5, 0.8, 0.2]), np.ones(3, bool), 0.5)
        np.testing.assert_allclose(weight, [2 / 7, 1 / 7, 4 / 7])

    def test_equals_share(self):
        weight = ggf.gini_weights(np.array([0.3, 0.9, 0.3]), np.ones(3, bool), 0.5)
        np.testing.assert_allclose(weight, [3 / 7, 1 / 7, 3 / 7])

    def test_unknown_groups_are_left_out(self):
        known = np.array([True, False, True])
        weight = ggf.gini_weights(np.array([0.9, 0.0, 0.1]), known, 0.5)
        np.testing.assert_allclose(weight, [1 / 3, 0.0, 2 / 3])
        np.testing.assert_array_equal(ggf.gini_weights(np.zeros(3), ~known & known, 0.5), 0.0)

    def test_by_hand(self):
        # means 3/4 and 1/4: weights 1/3 and 2/3; services 4 · 1/3 / 2 and 4 · 2/3 / 2
        method = ggf.GGF(decay=0.5)
        advantage, state = method.teach(two_groups(), method.begin(scheme(2, 1)))
        np.testing.assert_allclose(state.mean, [0.75, 0.25])
        np.testing.assert_allclose(
            advantage[:, 0], np.array([2 / 3, 4 / 3, 2 / 3, 4 / 3]) * [2.0, 0.0, 1.0, 4.0]
        )

    def test_the_mean_is_remembered(self):
        method = ggf.GGF(decay=0.5, memory=0.5)
        _, state = method.teach(two_groups(), method.begin(scheme(2, 1)))
        # then a earns 0 and b 1/2: (3/4 + 0)/2 and (1/4 + 1/2)/2
        later = two_groups(reward=np.array([0.0, 0.5, 0.0, 0.5]))
        _, state = method.teach(later, state)
        np.testing.assert_allclose(state.mean, [0.375, 0.375])
        # and only b is served: a keeps its mean
        only_b = np.tile([0.0, 1.0], (4, 1))
        _, state = method.teach(two_groups(inside=only_b, reward=np.zeros(4)), state)
        np.testing.assert_allclose(state.mean, [0.375, 0.1875])

    def test_the_first_mean_counts_whole_even_later(self):
        method = ggf.GGF(decay=0.5, memory=0.5)
        only_b = np.tile([0.0, 1.0], (4, 1))
        _, state = method.teach(two_groups(inside=only_b), method.begin(scheme(2, 1)))
        np.testing.assert_array_equal(state.seen, [0.0, 1.0])
        _, state = method.teach(two_groups(), state)
        # b: 1/2 before, 1/4 now
        np.testing.assert_allclose(state.mean, [0.75, 0.375])


class TestUnaware:
    def test_only_identities_are_hidden(self):
        seen = np.arange(1.0, 13.0, dtype=np.float32).reshape(2, 1, 6)
        blind = unaware.unaware(seen, 4)
        np.testing.assert_array_equal(blind[:, 0], [[0, 0, 0, 0, 5, 6], [0, 0, 0, 0, 11, 12]])
        assert blind.dtype == np.float32
        assert seen[0, 0, 0] == 1.0

    @pytest.mark.parametrize("groups", [-1, 26])
    def test_more_groups_than_columns(self, groups):
        with refused("shape observation", "25"):
            unaware.unaware(np.zeros(25), groups)


WRONG = [
    ("lagrangian", {"limit": -0.1}, "limit is -0.1: give a number from 0"),
    ("lagrangian", {"rate": NAN}, "rate is nan"),
    ("lagrangian", {"start": np.inf}, "start is inf"),
    ("lagrangian", {"windows": 0}, "windows is 0: give a whole number from 1"),
    ("a_ppo", {"strength": -1.0}, "strength is -1.0"),
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
    ("elbret", {}, "unknown method 'elbret': did you mean 'elbert'"),
    ("elbert", {"sharpnes": 1.0}, "unknown setting of elbert 'sharpnes': did you mean"),
]


@pytest.mark.parametrize(("name", "settings", "said"), WRONG)
def test_settings_that_cannot_be(name, settings, said):
    with pytest.raises(InputError, match=said):
        registry.create(name, **settings)
