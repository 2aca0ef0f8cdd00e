"""Windows, guidance and verdicts of a ledger, by hand."""

import numpy as np
import pytest

from evenhand.adapters import Fact, JudgeSettings, Ledger, Scheme, own_issue
from evenhand.core.errors import InputError
from evenhand.methods import registry
from evenhand.methods.paper import detector
from evenhand.statistics.verdicts import VerdictSettings
from support.ledgers import FIRST, LEFT, RIGHT, SCHEME, add, ended
from support.refusals import refused


def paid(kind, *later, tau=None, **changes):
    """What one service is paid after the first window: which side, late, loud."""
    if kind != "score":
        changes |= {"strength": 2.0, "windows": 1, "shrink": 0.0, "guarded": False}
        if kind == "levelup":
            changes |= {"cost": 0.0}
    chosen = registry.create("score@1" if kind == "score" else kind, **changes)
    ledger = Ledger(SCHEME, JudgeSettings(4, chosen, tau))
    assert add(ledger, *FIRST).tolist() == [0.0] * 4
    return add(ledger, *([value] for value in later))[0]


class TestWindows:
    def test_by_hand(self):
        ledger = Ledger(SCHEME, JudgeSettings(4))
        add(ledger, *FIRST)
        add(ledger, [LEFT, RIGHT, RIGHT, RIGHT, LEFT], [0, 1, 1, 0, 1], [0, 0, 0, 0, 0])
        found = ledger.windows()
        assert len(found) == 2
        # the second: late 0 of 1 against 2 of 3; the ninth service is in no window yet
        np.testing.assert_allclose(found.scores.gap[:, 0], [[1.0, 0.5], [2 / 3, 0.0]])
        np.testing.assert_allclose(found.scores.total, [1.5, 2 / 3])
        # an even robot with 2 of 4 late: |d| is 1 in 2 of 6 orders, else 0; with 1 of 4, 1/2
        np.testing.assert_allclose(found.excess.overall[0], [1 - 1 / 3, 0.5 - 0.5], atol=1e-12)
        assert found.biased is None
        assert ledger.services().fact("epoch").tolist() == [0] * 4 + [1] * 4 + [2]
        assert ledger.services().fact("service").tolist() == list(range(9))

    def test_no_window_is_over_yet(self):
        ledger = Ledger(SCHEME, JudgeSettings(4))
        assert len(ledger.windows()) == 0
        assert len(ledger.services()) == 0

    def test_the_same_as_scoring_the_table_afterwards(self):
        rng = np.random.default_rng(0)
        ledger = Ledger(SCHEME, JudgeSettings(10))
        for n in rng.integers(1, 30, 20):
            add(ledger, *rng.integers(0, 2, (3, n)))
        table, found = ledger.services(), ledger.windows()
        for window in range(len(found)):
            part = table.take(table.fact("epoch") == window)
            scores = SCHEME.score(part)
            np.testing.assert_array_equal(scores.gap, found.scores.gap[window])
            np.testing.assert_array_equal(scores.overall, found.scores.overall[window])

    def test_a_detector_judges_them(self):
        scores = np.random.default_rng(0).uniform(0, 1, (200, 2))
        fitted = detector.fit(
            scores, scores.sum(axis=1) > 1, source="simulated respondents", seed=0,
            issues=SCHEME.issue_names, identities=("side", "age"),
        )  # fmt: skip
        ledger = Ledger(SCHEME, JudgeSettings(4), fitted)
        add(ledger, *FIRST)
        add(ledger, [LEFT, LEFT, RIGHT, RIGHT], [0] * 4, [0] * 4)
        found = ledger.windows()
        assert np.array(found.biased).tolist() == [True, False]
        expected = fitted.probability([[[1.0, 0.5]], [[0.0, 0.0]]])
        np.testing.assert_array_equal(found.probability, expected)

    def test_verdicts_by_hand(self):
        ledger = Ledger(SCHEME)
        late = [1] * 40 + [0] * 40
        add(ledger, [LEFT] * 40 + [RIGHT] * 40, late, [0, 1] * 40)
        found = ledger.verdicts(np.random.default_rng(0), VerdictSettings(delta=0.5))
        np.testing.assert_allclose(found.gap, [[1.0, 0.0], [-1.0, 0.0]])
        assert found.verdict.tolist() == [["disparity", "no evidence"]] * 2


class TestGuidance:
    # level-up: μ times the gap, for the worse-off side only: 2·(1·late + 0.5·loud)
    @pytest.mark.parametrize(
        ("service", "pays"),
        [((LEFT, 1, 1), -3.0), ((LEFT, 0, 1), -1.0), ((LEFT, 0, 0), 0.0), ((RIGHT, 1, 1), 0.0)],
    )
    def test_levelup(self, service, pays):
        assert paid("levelup", *service) == pytest.approx(pays)

    def test_levelup_by_the_weight_of_each_issue(self):
        tau = {"loud": 1.0, "late": 0.5}
        assert paid("levelup", LEFT, 1, 1, tau=tau) == pytest.approx(-2.0)

    # influence: −μ n w with n = 4 and w = (x − p)/2 on the left, where both gaps push the same
    # way: late −8·(1 − 1)/2, loud −8·(1 − 1/2)/2; on the right an issue would make it more even,
    # and is not paid for
    @pytest.mark.parametrize(
        ("service", "pays"),
        [((LEFT, 1, 1), -2.0), ((LEFT, 0, 0), 4.0 + 2.0), ((RIGHT, 1, 1), 0.0)],
    )
    def test_influence(self, service, pays):
        assert paid("influence", *service) == pytest.approx(pays)

    def test_influence_of_two_windows_is_that_of_their_mean(self):
        chosen = registry.create("influence@2", windows=2, shrink=0.0, guarded=False)
        ledger = Ledger(SCHEME, JudgeSettings(4, chosen))
        add(ledger, *FIRST)
        add(ledger, *FIRST)
        assert add(ledger, [LEFT], [0], [0])[0] == pytest.approx(6.0)

    def test_equation_4_pays_by_the_window_before(self):
        # 1 − I is 0 and 0.5, of the greatest 2
        assert paid("score", RIGHT, 0, 0) == pytest.approx(0.25)
        tau = {"late": 1.0, "loud": 3.0}
        assert paid("score", RIGHT, 0, 0, tau=tau) == pytest.approx(1.5 / 4)

    def test_equation_5_asks_the_detector(self):
        scores = np.array([[0.0, 0.0], [0.1, 0.0], [0.9, 0.5], [1.0, 0.4]])
        fitted = detector.fit(
            scores, [False, False, True, True], source="simulated respondents", seed=0,
            issues=SCHEME.issue_names, identities=("side",),
        )  # fmt: skip
        for late, factor in (([1, 1, 0, 0], 0.5), ([1, 0, 1, 0], 1.0)):
            ledger = Ledger(SCHEME, JudgeSettings(4, "penalty"), fitted)
            add(ledger, FIRST[0], late, [0] * 4)
            biased = factor == 0.5
            assert np.array(ledger.windows().biased).tolist() == [biased]
            even = 0.5 if biased else 1.0  # 1 − I is 0 and 1, or 1 and 1, of 2
            assert add(ledger, [LEFT], [0], [0])[0] == pytest.approx(factor * even)

    def test_paid_afterwards_by_the_window_that_is_over(self):
        # as above, 1 − I is 0 and 0.5 of the greatest 2: of the first window, also for the fifth
        # service, whose own window is not over yet; then 1 and 1 of the second window
        ledger = Ledger(SCHEME, JudgeSettings(4, "score@1"))
        who, late, loud = (np.append(column, 0).tolist() for column in FIRST)
        assert add(ledger, who, late, loud, afterwards=True).tolist() == [0.25] * 5
        rest = add(ledger, [LEFT, RIGHT, RIGHT], [0] * 3, [0] * 3, afterwards=True)
        assert rest.tolist() == [1.0] * 3
        assert ledger.paid.tolist() == [0.25] * 5 + [1.0] * 3

    def test_a_batch_is_paid_as_its_services_one_by_one(self):
        rng = np.random.default_rng(1)
        rows = rng.integers(0, 2, (3, 60))
        chosen = JudgeSettings(7, "influence@1")
        one, whole = Ledger(SCHEME, chosen), Ledger(SCHEME, chosen)
        singly = [add(one, *(rows[:, [i]]))[0] for i in range(60)]
        together = add(whole, *rows)
        np.testing.assert_allclose(together, singly, atol=1e-12)
        assert np.abs(together).max() > 0
        np.testing.assert_array_equal(whole.paid, together)
        np.testing.assert_allclose(whole.windows().paid[3], together[21:28].mean())

    def test_the_guard_holds_evenness_back_where_nobody_is_served_well(self):
        chosen = registry.create("levelup@2", windows=1, shrink=0.0)
        ledger = Ledger(SCHEME, JudgeSettings(4, chosen))
        add(ledger, *FIRST)
        # 2 of 4 services had no issue, so evenness weighs half: of 3 for gaps, and of 0.5 an issue
        assert add(ledger, [LEFT], [1], [1])[0] == pytest.approx(-1.5 - 0.5)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: JudgeSettings(1), "services is 1: give a whole number from 2"),
        (lambda: JudgeSettings(method="surgery"), "'surgery' works on the grad"),
        (lambda: JudgeSettings(method="unaware"), "'unaware' hides people from the policy"),
        (lambda: JudgeSettings(method="levlup"), "unknown method 'levlup': did you mean"),
        (lambda: settings(tau={"late": 1.0}), "tau has no weight for issue 'loud'"),
        (lambda: settings(tau={"lat": 1.0}), "unknown issue in tau 'lat': did you mean 'late'"),
        (lambda: settings(tau={"late": 0.0, "loud": 0.0}), "tau is 0 for every issue"),
        (lambda: settings(tau={"late": 1.0, "loud": -1}), "give 2 finite numbers of at least 0"),
        (
            lambda: settings(method="penalty"),
            "method 'penalty' asks for a verdict: give a detector",
        ),
        (
            lambda: settings(method=registry.create("levelup", when="biased")),
            "method 'levelup' asks for a verdict: give a detector",
        ),
    ],
)
def test_settings_that_do_not_fit(make, said):
    with pytest.raises(InputError, match=said):
        make()


def settings(**changes):
    return Ledger(SCHEME, JudgeSettings(**changes))


def test_a_detector_of_something_else_is_refused():
    from evenhand.methods import detector_file

    shipped = detector_file.load(detector_file.SHIPPED)
    with refused("conflict detector"):
        Ledger(SCHEME, detector=shipped)
    scores = np.array([[0.0, 0.0], [1.0, 1.0]])
    other = detector.fit(
        scores, [False, True], source="respondents", seed=None,
        issues=SCHEME.issue_names, identities=("age",),
    )  # fmt: skip
    with refused("conflict detector"):
        Ledger(SCHEME, detector=other)


def test_nothing_to_judge():
    with refused("empty services"):
        Ledger(SCHEME).verdicts(np.random.default_rng(0))


def test_a_published_rival_takes_graded_issues():
    """Severities add up to 1.5 of 2 against 0.5 of 2: like 2 of 2 against 0 of 2, rounded."""
    scheme = Scheme(
        SCHEME.identities,
        (Fact("wait", float, least=0.0),),
        (own_issue("slow", ["wait"], lambda wait: wait / 10, graded=True),),
    )
    waits = {"graded": [10.0, 5.0, 0.0, 5.0], "whole": [10.0, 10.0, 0.0, 0.0]}
    multiplier = {}
    for name, wait in waits.items():
        chosen = registry.create("lagrangian@0.1")
        ledger = Ledger(scheme, JudgeSettings(4, chosen))
        ledger.add(ended([LEFT, LEFT, RIGHT, RIGHT]), {"wait": np.array(wait)}, afterwards=False)
        multiplier[name] = ledger.guide.past.memory.lam
    # squared gaps less chance: 1, and (3/4 - 1/4)² - 2 (3/16) / 1, which is below 0
    rate = registry.create("lagrangian@0.1").rate
    assert multiplier == {"graded": 0.0, "whole": pytest.approx(rate * (1.0 - 0.1))}
