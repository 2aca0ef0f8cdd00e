"""Eq. 4 and 5 by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from evenhand.core.errors import InputError
from evenhand.methods.epoch import Epoch
from evenhand.methods.paper import scores
from evenhand.methods.paper.detector import WindowVerdict
from evenhand.methods.paper.rewards import TAU, check_tau, evenness_reward
from evenhand.methods.printed import CREDITS, Penalty, Score
from support.refusals import refused

NAN = np.nan
RACISM = np.array([0.49, 0.25, 0.38, 0.43])

# Two groups of one identity and one of another; the third has no gap in quality and priority.
GAP = np.array([[0.2, 0.4, 0.0, 0.1], [0.6, 0.4, 1.0, 0.3], [0.5, NAN, NAN, 0.2]])
SCORES = scores.Scores(
    issues=("willingness", "quality", "priority", "risk"),
    groups=(("a", "x"), ("a", "y"), ("b", "z")),
    gap=GAP,
    overall=np.array([0.1, 0.2, 0.3, 0.4]),
    by_identity={},
    missing=np.array([0, 1, 1, 0]),
)
INSIDE = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [NAN, NAN, 1.0]])


class TestEquation4:
    # 1 - I is 0.51, 0.75, 0.62, 0.57
    @pytest.mark.parametrize(
        ("preset", "reward"),
        [
            ("equal", 2.45),
            ("risk_first", 0.51 + 0.75 + 0.62 + 2 * 0.57),
            ("willingness_first", 2 * 0.51 + 0.75 + 0.62 + 0.57),
            ("risk_then_willingness", 1.5 * 0.51 + 0.75 + 0.62 + 2 * 0.57),
        ],
    )
    def test_by_hand(self, preset, reward):
        assert evenness_reward(RACISM, TAU[preset]) == pytest.approx(reward)

    def test_all_presets_are_tested(self):
        assert set(TAU) == {"equal", "risk_first", "willingness_first", "risk_then_willingness"}

    @pytest.mark.parametrize("tau", list(TAU.values()))
    def test_from_nothing_to_all(self, tau):
        np.testing.assert_allclose(
            evenness_reward(np.array([[0.0] * 4, [1.0] * 4]), tau), [sum(tau), 0.0]
        )

    def test_a_missing_component_neither_pays_nor_costs(self):
        score = np.array([0.5, NAN, NAN, 0.2])
        # (0.5 + 0.8)/2 of the greatest 4; (0.5 + 2·0.8)/3 of the greatest 5
        assert evenness_reward(score, TAU["equal"]) == pytest.approx(2.6)
        assert evenness_reward(score, TAU["risk_first"]) == pytest.approx(3.5)

    def test_nothing_known_is_half(self):
        unknown = np.full((2, 4), NAN)
        np.testing.assert_array_equal(evenness_reward(unknown, TAU["equal"]), [2.0, 2.0])
        np.testing.assert_array_equal(evenness_reward(unknown, TAU["risk_first"]), [2.5, 2.5])

    def test_only_what_has_no_weight_is_known(self):
        assert evenness_reward(np.array([0.9, NAN, NAN, NAN]), (0.0, 1.0, 1.0, 2.0)) == 2.0

    def test_leading_axes_are_carried_along(self):
        score = np.stack([[RACISM, 0 * RACISM], [RACISM, RACISM]])
        np.testing.assert_allclose(
            evenness_reward(score, TAU["equal"]), [[2.45, 4.0], [2.45, 2.45]]
        )

    @given(
        hnp.arrays(float, 4, elements=st.floats(0, 1) | st.just(NAN)),
        st.sampled_from(list(TAU.values())),
        st.integers(0, 3),
        st.floats(0, 1),
    )
    def test_more_evenness_never_pays_less(self, score, tau, issue, better):
        before = evenness_reward(score, tau)
        assert 0 <= before <= sum(tau) + 1e-12
        if not np.isnan(score[issue]):
            after = score.copy()
            after[issue] *= better
            assert evenness_reward(after, tau) >= before - 1e-12


def paid(biased: bool = False, method: Score | None = None, tau=TAU["equal"]) -> np.ndarray:
    """What services of these people earn where evenness is all that pays."""
    none = np.zeros(0)
    said = WindowVerdict(np.array(biased), none, none.astype(bool), none.astype(np.int64))
    epoch = Epoch(
        x=np.zeros((3, 4)), inside=INSIDE, reward=np.zeros(3), mask=np.ones((3, 1)),
        groups=SCORES.groups, issues=SCORES.issues, tau=np.array(tau),
        advantages_of=lambda rewards: rewards[:, None], corrected_of=lambda counts: 0.0,
        judge=lambda scores: said,
    )  # fmt: skip
    vars(epoch)["scores"] = SCORES
    return (method or Penalty()).alone(epoch)


class TestPersonRewards:
    def test_own_groups_by_hand(self):
        # the first is in one group; the second in two: means 0.55, 0.4, 1.0, 0.25; of the third
        # one group is known, and of that two components: (0.5 + 0.8)/2 of 4
        np.testing.assert_allclose(paid(), [0.8 + 0.6 + 1.0 + 0.9, 0.45 + 0.6 + 0.0 + 0.75, 2.6])

    def test_an_epoch_pays_everybody_alike(self):
        np.testing.assert_allclose(paid(method=Penalty(credit="epoch")), [3.0, 3.0, 3.0])

    @pytest.mark.parametrize("credit", CREDITS)
    def test_equation_5_multiplies_when_biased(self, credit):
        method = Penalty(credit=credit, lam=0.25)
        fair = paid(method=method)
        np.testing.assert_allclose(paid(True, method), 0.25 * fair)
        assert (fair > 0).all()

    def test_the_papers_lambda(self):
        assert Penalty().lam == 0.5
        np.testing.assert_allclose(paid(True, Penalty(credit="epoch")), [1.5, 1.5, 1.5])

    def test_score_alone_has_no_penalty(self):
        np.testing.assert_allclose(paid(True, Score(credit="epoch")), [3.0, 3.0, 3.0])

    def test_tau_of_the_settings_counts(self):
        found = paid(method=Score(credit="epoch"), tau=TAU["risk_first"])
        np.testing.assert_allclose(found, [3.6, 3.6, 3.6])


class TestWrongSettings:
    @pytest.mark.parametrize(
        ("tau", "said"),
        [
            ((1.0, 1.0, 1.0), "tau is .*: give four finite numbers"),
            ((1.0, 1.0, 1.0, -0.1), "tau is .*: give four finite numbers of at least 0"),
            ((1.0, NAN, 1.0, 1.0), "tau is .*: give four finite numbers"),
            ((1.0, np.inf, 1.0, 1.0), "tau is .*: give four finite numbers"),
            ((0.0, 0.0, 0.0, 0.0), "tau is 0 for every issue"),
        ],
    )
    def test_tau(self, tau, said):
        with pytest.raises(InputError, match=said):
            check_tau(tau)
        with pytest.raises(InputError, match=said):
            evenness_reward(RACISM, tau)

    @pytest.mark.parametrize("penalty", [-0.1, 1.1, NAN])
    def test_penalty(self, penalty):
        with refused("range lam"):
            Penalty(lam=penalty)

    @pytest.mark.parametrize("penalty", [0.0, 1.0])
    def test_the_ends_of_penalty_are_allowed(self, penalty):
        assert Penalty(lam=penalty).lam == penalty

    def test_unknown_names_offer_the_nearest(self):
        wrong = {"credit": "epochs"}
        with refused("unknown credit", "'epochs'", "'epoch'"):
            Score(credit=wrong["credit"])  # type: ignore[arg-type]
