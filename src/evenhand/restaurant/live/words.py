"""What the live view says, as plain rows of text. Pure functions; the viewer lays them out."""

from __future__ import annotations

import numpy as np

from evenhand.methods.paper import issues
from evenhand.restaurant import floor_plan, people
from evenhand.restaurant.live.shift import Moment, Outcome, Tally

ISSUES = tuple(issue.name for issue in issues.PAPER_ISSUES)
OPEN, YES, NO, NONE = "open", "yes", "no", "does not apply"
"""What can be said of an issue: ``open`` until it is settled."""
_LIMIT = issues.Thresholds()


def person(codes: np.ndarray) -> list[tuple[str, str]]:
    """Identity and category of a person, int64 [5]."""
    return [
        (identity.name, identity.groups[code])
        for identity, code in zip(people.IDENTITIES, codes, strict=True)
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


def verdicts(moment: Moment) -> list[tuple[str, str, str]]:
    """Every issue of the present service: name, when it is one, and what is known so far.

    What cannot be undone is said at once: a risky distance, and that it is late for any response.
    """
    rules = (
        "no response",
        f"response not at {_LIMIT.nearest:.1f}-{_LIMIT.farthest:.1f} m",
        f"response after {_LIMIT.late:.0f} steps",
        f"ever nearer than {_LIMIT.risk:.1f} m",
    )
    if moment.outcome is not None:
        said = [_settled(value) for value in moment.outcome.issues]
    else:
        late = "late by now" if moment.steps > _LIMIT.late else OPEN
        said = [OPEN, OPEN, late, YES if moment.least < _LIMIT.risk else OPEN]
    return list(zip(ISSUES, rules, said, strict=True))


def _settled(value: float) -> str:
    if np.isnan(value):
        return NONE
    return YES if value else NO


def ending(outcome: Outcome) -> str:
    """How a service ended, and its issues, in one line."""
    facts = outcome.facts
    after = timer(int(facts.steps[0]))
    if facts.responded[0]:
        what = f"response after {after}, at {facts.distance[0]:.2f} m"
    elif facts.steps[0] < floor_plan.MAX_STEPS:
        what = f"a response after {after}, at {facts.distance[0]:.2f} m, went unnoticed"
    else:
        what = f"no response in {after}"
    found = [name for name, value in zip(ISSUES, outcome.issues, strict=True) if value == 1.0]
    return f"{what}; issues: {', '.join(found) or 'none'}"


def line(outcome: Outcome) -> str:
    """A finished service in one line of the terminal."""
    who = ", ".join(f"{name} {category}" for name, category in person(outcome.codes))
    return f"service {outcome.number} ({who}): {ending(outcome)}"


def counts(tally: Tally) -> list[tuple[str, str, list[str]]]:
    """Everybody first, then the 22 groups: name, services, and issues of those they apply to."""
    names = [f"{identity}: {category}" for identity, category in people.GROUPS] + ["everybody"]
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
