"""Self-reflection beside learners with all answers: planted updates, and stated alarms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from evenhand.methods import registry
from evenhand.methods.beyond.influence import CreditSettings, influence, influence_of
from evenhand.methods.beyond.reflection import ReflectionSettings
from evenhand.training import train
from evenhand.training.settings import settings_of

PLANTED, EPOCHS = range(45, 50), 60
"""Adam remembers the gradients before, so that a single one hardly turns its step."""
RAW = CreditSettings(shrink=0.0)


def turning():
    """Service alone, but for some epochs in which whatever widens gaps is paid for."""

    @registry.method("turning")
    class Turning:
        def begin(self, scheme):
            return np.zeros(1)

        def teach(self, epoch, memory):
            rewards = epoch.reward
            if epoch.number in PLANTED:
                found = influence(epoch.x, epoch.inside, epoch.tau, settings=RAW)
                rewards = rewards + 20.0 * len(epoch) * found.total
            return rewards, memory + 1.0

        def worth(self, answers, memory):
            if answers.window.number not in PLANTED:
                return answers.reward
            window, flat = answers.window, answers.flat
            found = influence_of(flat.x, flat.inside, flat.tau, window.counts, window.counts, RAW)
            return answers.reward + 20.0 * len(window) * found.total.reshape(answers.reward.shape)

    return "turning"


@pytest.mark.slow
@pytest.mark.parametrize("learner", ["ppo-all", "reinforce-all"])
def test_planted_biased_updates_are_found(learner):
    base = settings_of("service", learner, turning(), seed=100, epochs=EPOCHS)
    settings = replace(
        base, scenario="everyday", reflection=ReflectionSettings(rate=0.05, history=40)
    )
    found = list(train.train(settings, None))
    alarms = [record.numbers["reflection_alarm"] for record in found]
    assert any(alarms[at] for at in PLANTED)
    assert min(found[at].numbers["reflection_p"] for at in PLANTED) == pytest.approx(1 / 41)
    # before it: so many looks as there was enough history for
    before = alarms[20 : PLANTED.start]
    assert sum(before) <= stats.binom.ppf(0.999, len(before), 0.05)
