"""A scenario of your own: some guests speak another language, and the robot hears them worse.

evenhand train --plugin examples/own_scenario.py --scenario noisy --guidance levelup --out out/x
"""

import evenhand as ev

WORLD = ev.World(  # shares and rates are invented
    identities=(*ev.IDENTITIES, ev.Identity("language", ("local", "foreign"))),
    shares={"language": (0.8, 0.2)},
    missed={"language=foreign": 0.3, "disability=Yes": 0.3},
    facts={ev.Fact("seconds", float, least=0.0): lambda done: done.facts.steps * 0.02},
    issues=(
        *ev.paper_issues(),
        ev.own_issue("waiting", ["seconds"], lambda s: (s / 6).clip(0, 1), graded=True),
    ),
)


def robot(seen, rows):
    """Respond at 1.3 m: the last reading less what was driven since, at 1 m/s."""
    return 1.0 * (5.0 * seen[:, -3] - seen[:, -1] <= 1.3)


ev.register_scenario("noisy", world=WORLD, reference=robot)
