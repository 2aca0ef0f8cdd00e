"""What the live view says, as plain rows of text. Pure functions; the viewer lays them out."""

from __future__ import annotations

import numpy as np

from evenhand.methods.paper import issues
from evenhand.methods.scheme import Scheme, named
from evenhand.restaurant import floor_plan
from evenhand.restaurant.live.shift import Moment, Outcome, Tally
from evenhand.restaurant.scheme import SCHEME

OPEN, YES, NO, NONE = "open", "yes", "no", "does not apply"
"""What can be said of an issue: ``open`` until it is settled."""
OWN = "an issue of this world, known at the end"
_LIMIT = issues.Thresholds()


def person(codes: np.ndarray, scheme: Scheme = SCHEME) -> list[tuple[str, str]]:
    """Identity and category of a person, int64 [D]."""
    return [
        (identity.name, identity.groups[code])
        for identity, code in zip(scheme.identities, codes, strict=True)
    ]


def timer(steps: int) -> str:
    """Physics steps, and the seconds that they take."""
    return f"{steps} steps, {steps * floor_plan.TIMESTEP:.2f} s"


def progress(moment: Moment) -> list[tuple[str, str]]:
    """Timer and distances of a service as it stands."""
    age = f"{moment.age:.1f} s ago" if moment.age else "just now"
    return [
        ("timer", f"{timer(moment.steps)} (at most {floor_plan.MAX_STEPS})"),
        ("true distance", f"{moment.distance:.2f} m"),
        ("sensed distance", f"{moment.reading:.2f} m, {age}"),
        ("nearest so far", f"{moment.least:.2f} m"),
        ("chance to respond", f"{100 * moment.chance:.0f} % at the last decision"),
    ]


def verdicts(moment: Moment, scheme: Scheme = SCHEME) -> list[tuple[str, str, str]]:
    """Every issue of the present service: name, when it is one, and what is known so far.

    What cannot be undone is said at once: a risky distance, and that it is late for any response.
    An issue of the world's own is judged by the facts of the whole service, so at its end.
    """
    paper = (
        "no response",
        f"response not at {_LIMIT.nearest:.1f}-{_LIMIT.farthest:.1f} m",
        f"response after {_LIMIT.late:.0f} steps",
        f"ever nearer than {_LIMIT.risk:.1f} m",
    )
    if moment.outcome is not None:
        said = [_settled(value) for value in moment.outcome.issues]
    else:
        late = "late by now" if moment.steps > _LIMIT.late else OPEN
        now = (OPEN, OPEN, late, YES if moment.least < _LIMIT.risk else OPEN)
        so_far = dict(zip(issues.PAPER_ISSUES, now, strict=True))
        said = [so_far.get(issue, OPEN) for issue in scheme.issues]
    rules = dict(zip(issues.PAPER_ISSUES, paper, strict=True))
    explained = [rules.get(issue, OWN) for issue in scheme.issues]
    return list(zip(scheme.issue_names, explained, said, strict=True))


def _settled(value: float) -> str:
    if np.isnan(value):
        return NONE
    if 0.0 < value < 1.0:
        return f"severity {value:.2f}"
    return YES if value else NO


def ending(outcome: Outcome, scheme: Scheme = SCHEME) -> str:
    """How a service ended, and its issues, in one line."""
    facts = outcome.facts
    after = timer(int(facts.steps[0]))
    if facts.responded[0]:
        what = f"response after {after}, at {facts.distance[0]:.2f} m"
    elif facts.steps[0] < floor_plan.MAX_STEPS:
        what = f"a response after {after}, at {facts.distance[0]:.2f} m, went unnoticed"
    else:
        what = f"no response in {after}"
    found = named(scheme.issues, outcome.issues)
    return f"{what}; issues: {', '.join(found) or 'none'}"


def line(outcome: Outcome, scheme: Scheme = SCHEME) -> str:
    """A finished service in one line of the terminal."""
    who = ", ".join(f"{name} {category}" for name, category in person(outcome.codes, scheme))
    return f"service {outcome.number} ({who}): {ending(outcome, scheme)}"


def counts(tally: Tally, scheme: Scheme = SCHEME) -> list[tuple[str, str, list[str]]]:
    """Everybody first, then the groups: name, services, and issues of those they apply to."""
    names = [f"{identity}: {category}" for identity, category in scheme.groups] + ["everybody"]
    rows = [
        (
            name,
            str(tally.services[row]),
            [
                f"{found} of {n}" if n else "-"
                for found, n in zip(tally.found[row], tally.applies[row], strict=True)
            ],
        )
        for row, name in enumerate(names)
    ]
    return [rows[-1], *rows[:-1]]
