"""A method of your own: every error of a group costs more, the more often it met one so far.

python examples/own_method.py    # or: evenhand compare --plugin examples/own_method.py --arms mine
"""

import sys

import numpy as np

import evenhand as ev


@ev.method("mine", strength=0.3, label="dearer errors", colour="teal")
class Mine:
    """Services of a group with a high error rate lose up to ``strength`` for each error."""

    strength: float = 0.3

    def begin(self, scheme):
        """Nobody has been served yet: services and errors of each group."""
        return np.zeros((2, len(scheme.groups)))

    def teach(self, epoch, memory):
        """Rewards of the services [n], and the counts from now on."""
        errors = np.nansum(epoch.x, axis=1)
        inside = np.nan_to_num(epoch.inside)
        memory = memory + np.stack([inside.sum(axis=0), inside.T @ errors])
        rate = memory[1] / np.maximum(memory[0], 1.0)
        worst = (inside * rate).max(axis=1)
        return epoch.reward - self.strength * worst * errors, memory


def main(epochs=300, seeds=3, services=5000):
    """Compare it with service alone and level-up."""
    arms = ["service", "levelup", "mine", "mine@0.1"]
    return ev.compare(arms, scenarios=["tips"], seeds=seeds, epochs=epochs, services=services)


if __name__ == "__main__":
    print(main(*map(int, sys.argv[1:])))
