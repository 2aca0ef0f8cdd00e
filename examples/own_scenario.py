"""A scenario of your own: some guests speak another language, and the robot hears them worse.

evenhand train --plugin examples/own_scenario.py --scenario noisy --guidance levelup --out out/x
"""

import evenhand as ev


def make_world() -> ev.World:
    """Invented shares and rates: none is measured."""
    return ev.World(
        identities=(*ev.IDENTITIES, ev.Identity("language", ("local", "foreign"))),
        shares={"language": (0.8, 0.2)},
        missed={"language=foreign": 0.3, "disability=Yes": 0.3},
        noise=0.05,
        facts={ev.Fact("seconds", float, least=0.0): lambda done: done.facts.steps * 0.02},
        issues=(
            *ev.paper_issues(),
            ev.own_issue("waiting", ["seconds"], lambda s: (s / 6).clip(0, 1), graded=True),
        ),
    )


ev.register_scenario("noisy", world=make_world, reference=ev.ScriptedRobot("even"))
