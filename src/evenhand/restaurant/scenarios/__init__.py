"""Where unevenness comes from: each mechanism in one place, with its sources and ranges.

| scenario | what is uneven | mechanism |
|---|---|---|
| ``even`` | nothing | |
| ``prejudiced`` | the policy first imitates biased robots | ``training.imitation`` |
| ``perception`` | children are missed, and height misleads | ``scenarios.sensing`` |
| ``minority`` | few elders and wheelchair users (``us``) with other needs | ``scenarios.needs`` |
| ``tips`` | the operator's reward pays by age | ``scenarios.tips`` |
| ``everyday`` | the last three at half strength | all of them |

``restaurant.worlds`` makes worlds of them, and of scenarios that a user registers. Scenarios
combine with a plus, ``perception+tips``.

Each has a scripted reference robot that makes up for the mechanism by what it observes. What it
attains can be attained, and results are shares of that; where mechanisms combine, a robot may do
better (with ``perception+minority`` it leaves 8 % of services imperfect).
"""
