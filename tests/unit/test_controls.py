"""Controls by hand: a cost without groups, and a method's spending over everybody."""

from dataclasses import replace

import numpy as np
import pytest

from evenhand.core.errors import InputError
from evenhand.methods import guidance, registry
from evenhand.methods.controls.blind_spend import BlindSpend
from support.lessons import CALM, EPOCH, LEVELUP, evenness, learn, settings
from support.refusals import refused
from support.rivals import scheme, two_groups


def free(method: str, **changes):
    """Settings with a method that no guard holds back."""
    return replace(settings(), method=registry.create(method, **changes))


class TestBlind:
    def test_an_issue_costs_the_same_whoever_has_it(self):
        # the first lacks two issues for want of a response, which count as had: 4; the second 1
        chosen = free("blind", cost=0.25, guarded=False)
        np.testing.assert_allclose(evenness(chosen, EPOCH), [-1.0, -0.25, 0.0, 0.0, 0.0])

    def test_weights_of_the_issues_count(self):
        chosen = replace(free("blind", guarded=False), tau=(2.0, 0.0, 1.0, 4.0))
        np.testing.assert_allclose(evenness(chosen, EPOCH), [-3.5, 0.0, 0.0, 0.0, 0.0])

    def test_the_guard_holds_it_back(self):
        # after one calm epoch, and this: 8 of 10 services were perfect
        found = evenness(free("blind"), CALM, EPOCH)
        np.testing.assert_allclose(found, 0.8 * np.array([-2.0, -0.5, 0.0, 0.0, 0.0]))

    def test_levelup_without_gaps_is_blind(self):
        chosen = free("levelup", strength=0.0, cost=0.25, guarded=False)
        np.testing.assert_allclose(
            evenness(chosen, EPOCH), evenness(free("blind", cost=0.25, guarded=False), EPOCH)
        )

    @pytest.mark.parametrize("cost", [-0.1, np.inf, np.nan])
    def test_odd_costs_are_refused(self, cost):
        with refused("range cost"):
            registry.create("blind", cost=cost)
        with refused("range cost"):
            registry.create("levelup", cost=cost)


class TestBlindSpend:
    def test_it_spends_what_the_method_spends_issue_by_issue(self):
        chosen = replace(settings("levelup"), method=BlindSpend(strength=1.0))
        # whatever the guard leaves, and with c₀
        theirs = evenness(replace(chosen, method=registry.create("levelup@1")), EPOCH, EPOCH)
        ours = evenness(chosen, EPOCH, EPOCH)
        assert theirs.sum() < 0
        assert ours.sum() == pytest.approx(theirs.sum(), rel=1e-12)

    def test_everybody_who_had_an_issue_pays_alike(self):
        # two groups of two; group a has the issue twice, b once: gap 1/2 charges a at strength 2
        # 2 · 1/2 for each of two, which three people share
        method = BlindSpend(strength=2.0)
        base = replace(registry.create("levelup"), cost=0.0, guarded=False, shrink=0.0)
        x = np.array([[1.0], [1.0], [1.0], [0.0]])
        inside = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
        epoch = two_groups(x=x, inside=inside)
        plain = replace(base, strength=2.0)
        _, memory = plain.teach(epoch, plain.begin(scheme(2, 1)))
        np.testing.assert_allclose(plain.pay(epoch, epoch, memory), [-1.0, -1.0, 0.0, 0.0])
        price = _Spread(plain).price(epoch, memory)
        np.testing.assert_allclose(price, [2.0 / 3.0])
        assert method.of == "levelup"

    @pytest.mark.parametrize("of", ["surgery", "lagrangian", "service"])
    def test_what_pays_no_single_service_is_refused(self, of):
        with refused("unsupported of"):
            BlindSpend(of=of)

    def test_an_unknown_method_is_refused(self):
        with pytest.raises(InputError) as wrong:
            BlindSpend(of="leveldown")
        assert wrong.value.kind == "unknown"


class _Spread(BlindSpend):
    """With a method that is given, not named."""

    def __init__(self, chosen) -> None:
        object.__setattr__(self, "_chosen", chosen)

    @property
    def _method(self):
        return vars(self)["_chosen"]


@pytest.mark.parametrize("name", ["service", "levelup", "blind", "blind_spend"])
def test_they_pay_the_same_after_an_epoch_as_before_the_next(name):
    """``pay`` by what is known now is what ``teach`` gave: worth of the given answers follows."""
    method = registry.create(name)
    if not hasattr(method, "pay"):
        return
    chosen = replace(settings("levelup"), method=method)
    epoch = two_groups()
    given, memory = guidance.teach(method, epoch, method.begin(scheme(2, 1)))
    np.testing.assert_allclose(given.added(epoch.reward), method.pay(epoch, epoch, memory))
    assert chosen.method == method


def test_the_first_of_the_lesson_is_as_before():
    np.testing.assert_allclose(evenness(settings("levelup"), EPOCH), LEVELUP)
    learn(settings("levelup"), EPOCH)
