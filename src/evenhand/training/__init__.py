"""Learning: the robot's policy, the losses of the paper, updates and checkpoints.

Nothing in here knows of restaurants, people or issues: rooms get observations, actions and
numbers that say how good each decision was, and change the policy.
"""
