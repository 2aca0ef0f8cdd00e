"""An environment of your own with own people, errors and guidance: a robot holds a door.

python examples/own_environment.py   # people are made up
"""

import gymnasium as gym
import numpy as np

from evenhand.adapters import Fact, Identity, JudgeServices, JudgeSettings, Scheme, own_issue

LONGEST = 6
SCHEME = Scheme(
    identities=(Identity("pace", ("brisk", "slow")),),
    facts=(Fact("held", int, least=0), Fact("needed", int, least=1)),
    issues=(own_issue("shut too early", ["held", "needed"], lambda held, need: held < need),),
)


class Door(gym.Env):
    """Choose how many seconds to hold the door. One in five people is slow; waiting costs."""

    observation_space = gym.spaces.Box(0.0, 1.0, (1,), np.float32)
    action_space = gym.spaces.Discrete(LONGEST)

    def reset(self, *, seed=None, options=None):
        """Somebody comes; the robot does not see who."""
        super().reset(seed=seed)
        self.slow = int(self.np_random.random() < 0.2)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        """One decision is a service."""
        needed = (2, 5)[self.slow]
        info = {"pace": self.slow, "held": int(action), "needed": needed}
        return np.zeros(1, np.float32), (action >= needed) - 0.12 * action, True, False, info


def facts_of(ended):
    """Who was served, and what happened."""
    return {name: ended.info(name) for name in ("pace", "held", "needed")}


def main(method="levelup", services=1500, seed=0):
    """Learn how long to hold the door; returns the judged environment and the odds learned."""
    env = JudgeServices(Door(), SCHEME, facts_of, settings=JudgeSettings(method=method))
    rng, logits, mean = np.random.default_rng(seed), np.zeros(LONGEST), 0.0
    env.reset(seed=seed)
    for _ in range(services):
        odds = np.exp(logits - logits.max())
        odds /= odds.sum()
        action = rng.choice(LONGEST, p=odds)
        reward = float(env.step(action)[1])  # with what the method adds for evenness
        logits += 0.2 * (reward - mean) * (np.eye(LONGEST)[action] - odds)
        mean += 0.05 * (reward - mean)
        env.reset()
    return env, odds


if __name__ == "__main__":
    print("odds of 0 to 5 s:", *(main(one)[1].round(2) for one in ("service", "levelup")))
