"""The model card of a trained robot: what its run folder says, and how it served new people."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from evenhand.core.wording import MINUS
from evenhand.methods import registry
from evenhand.methods.vocabulary import LEAST
from evenhand.report.model_cards import markdown, sections
from evenhand.report.model_cards.markdown import NOT_MEASURED, between, number, percent, words
from evenhand.report.model_cards.sections import Said
from evenhand.statistics.detector_accuracy import Share
from evenhand.statistics.means import Estimate
from evenhand.statistics.verdicts import DISPARITY, INSUFFICIENT, Verdicts

ISSUE_WORDS = {
    "willingness": "no response",
    "quality": "improper distance",
    "priority": "late",
    "risk": "too close",
}


@dataclass(frozen=True, eq=False)
class Trial:
    """How the robot served people whom training never saw.

    Attributes:
        services: how many people.
        seed: of people, places and chances.
        population: where they were drawn from.
        scores: total and the four issues, means over windows of 30.
        floor: the total that chance alone gives, or None.
        perfect: services without any issue.
        responded: services with a response.
        groups: (identity, category) of the G groups.
        perfect_of: services of each group without any issue.
        verdicts: on every group and issue, arrays [G, K].
        issues: names of the K issues.
    """

    services: int
    seed: int
    population: str
    scores: Mapping[str, Estimate]
    floor: float | None
    perfect: Share
    responded: Share
    groups: tuple[tuple[str, str], ...]
    perfect_of: tuple[Share, ...]
    verdicts: Verdicts
    issues: tuple[str, ...]

    @property
    def worst(self) -> int | None:
        """Row of the group of 30 or more with the fewest services without an issue, if any."""
        known = [g for g, share in enumerate(self.perfect_of) if share.n >= LEAST]
        return min(known, key=lambda g: self.perfect_of[g].value, default=None)


@dataclass(frozen=True)
class Robot:
    """What a run folder says of its robot.

    Attributes:
        settings: of the run, as ``settings.json`` holds them.
        versions: package -> version that it was trained with.
        epochs: that have run.
        population: where people of training were drawn from.
        judge: whose judgements its detector learned from.
        command: trains it again; None if its settings cannot be given as options.
        last: numbers of the last epoch, as ``epochs.jsonl`` holds them.
    """

    settings: Mapping[str, Any]
    versions: Mapping[str, str]
    epochs: int
    population: str
    judge: str
    command: str | None
    last: Mapping[str, Any]


def render(said: Said, robot: Robot, trial: Trial | None) -> str:
    """The card.

    Args:
        said: what only its maker can say.
        robot: what the run folder says.
        trial: on new people, or None if there was none.
    """
    algorithm = str(robot.settings["update"]["algorithm"])
    front = sections.front(
        said,
        "reinforcement-learning",
        ["synthetic-data", "reinforcement-learning", "robotics", algorithm],
        [] if trial is None else [_result(trial)],
    )
    parts = [
        sections.head(said, _what(robot)),
        _USES,
        _training(robot),
        _evaluation(trial),
        _groups(trial),
        _LIMITS,
        _loading(),
        _repeating(robot, trial),
        sections.versions(robot.versions),
        sections.citation(),
    ]
    return markdown.front_matter(front) + "\n" + "\n\n".join(parts) + "\n"


def _result(trial: Trial) -> dict[str, object]:
    metrics = [
        (
            "total_issue_score",
            "Total issue score (mean of windows of 30)",
            trial.scores["total"].mean,
        ),
        *(
            (f"{name}_issue_score", f"Issue score: {name}", trial.scores[name].mean)
            for name in trial.issues
        ),
        ("perfect_rate", "Services without any issue", trial.perfect.value),
        ("response_rate", "Services with a response", trial.responded.value),
    ]
    if trial.worst is not None:
        metrics.append(
            (
                "worst_group_rate",
                f"Services without any issue, worst served group of {LEAST} or more",
                trial.perfect_of[trial.worst].value,
            )
        )
    return {
        "task": {"type": "reinforcement-learning", "name": "Serving people in a restaurant"},
        "dataset": {
            "type": "evenhand/Restaurant-v0",
            "name": f"Simulated restaurant, {trial.services} synthetic people, seed {trial.seed}",
        },
        "metrics": [
            {"type": kind, "name": name, "value": round(value, 6), "verified": False}
            for kind, name, value in metrics
            if math.isfinite(value)
        ],
    }


def _what(robot: Robot) -> str:
    settings = robot.settings
    method = f"guidance {settings['method']['name']}"
    return (
        f"A policy that decides when a service robot responds to a person who asks for service: "
        f"walk on, or respond now. It was trained with {settings['update']['algorithm']} in the "
        f"simulated restaurant of Evenhand (preset {settings['preset']}, {method}, scenario "
        f"{settings['scenario']}). It has never driven a real robot and never served a real person."
    )


_USES = """\
## Intended use

Research on how evenly a robot serves groups of people, and on how training can mitigate
unevenness; teaching; a baseline to compare with.

## Uses it is not for

- Driving a robot among people. It knows one simulated room and people who do not move.
- Guessing who somebody is. It takes five identities as given and recognises none of them.
- A claim that a product is fair, or lawful. A gap in a simulation is neither proof nor absence of
  discrimination, and scores of groups say nothing about a single person.
- Ranking or sorting people. A group is compared here so that it is not served worse."""


def _training(robot: Robot) -> str:
    settings = robot.settings
    served = robot.epochs * settings["people"]
    rows = [
        ["people served in training", f"{served}, all of them synthetic"],
        ["drawn from", words(robot.population)],
        ["epochs", f"{robot.epochs} of {settings['epochs']}, {settings['people']} services each"],
        ["seed", str(settings["seed"])],
        ["judge of every epoch", f"a detector fitted to {words(robot.judge)}"],
        ["identities hidden from the policy", "yes" if _blind(settings) else "no"],
        ["total issue score of the last epoch", number(robot.last.get("total"))],
        ["services without any issue, last epoch", number(robot.last.get("perfect_rate"))],
    ]
    return (
        "## Training data\n\nNo data of real people. Identities (race, gender, age, disability, "
        "skin type) are drawn by chance from a table of shares, places and sensor readings are "
        "simulated. Where the judge was fitted to simulated respondents, its judgements are an "
        "assumption about people, not a finding.\n\n" + markdown.table(["what", "value"], rows)
    )


def _evaluation(trial: Trial | None) -> str:
    if trial is None:
        return f"## Evaluation\n\nOn people whom training never saw: {NOT_MEASURED}."
    rows = [
        [name, between(mean.mean, mean.low, mean.high), f"{mean.n} windows"]
        for name, mean in trial.scores.items()
    ]
    rows.append(["total that chance alone gives", number(trial.floor), "identities shuffled"])
    rows.append(["services without any issue", percent(trial.perfect), "services"])
    rows.append(["services with a response", percent(trial.responded), "services"])
    return (
        f"## Evaluation\n\n{trial.services} synthetic people whom training never saw, seed "
        f"{trial.seed}, drawn from {words(trial.population)}. One trained policy, one seed of "
        "training: how another seed would have turned out is "
        f"{NOT_MEASURED}. Issue scores are means over windows of 30 services (0 is even), with a "
        "95 % interval over the windows; a part of them is chance, which a line of its own says. "
        "Shares have a 95 % interval (Wilson).\n\n"
        + markdown.table(["measure", "value (95 % interval)", "of"], rows)
    )


def _groups(trial: Trial | None) -> str:
    if trial is None:
        return f"## Groups\n\nResults of groups: {NOT_MEASURED}."
    titles = [f"{ISSUE_WORDS.get(name, name)}, points" for name in trial.issues]
    rows = [
        [
            words(f"{identity}: {category}"),
            percent(trial.perfect_of[g]),
            *(_gap(trial.verdicts, g, k) for k in range(len(trial.issues))),
        ]
        for g, (identity, category) in enumerate(trial.groups)
    ]
    found = int((trial.verdicts.verdict == DISPARITY).sum())
    comparisons = trial.verdicts.verdict.size
    return (
        f"## Groups\n\nFor each group, services without any issue, and how much more (+) or less "
        "(−) often than everybody else its members met each issue, in percentage points. The "
        f"intervals of all {comparisons} gaps hold together with 95 %; {found} of them are a "
        "disparity (permutation test, adjusted for all of them, level 5 %). "
        f"“{INSUFFICIENT}” means that a gap of 10 points could have been missed, and no mark does "
        "not mean even: smaller gaps may be there.\n\n"
        + markdown.table(["group", "without any issue (95 % interval)", *titles], rows)
    )


def _gap(verdicts: Verdicts, group: int, issue: int) -> str:
    gap, low, high = (
        100 * float(values[group, issue]) for values in (verdicts.gap, verdicts.low, verdicts.high)
    )
    if not math.isfinite(gap):
        return NOT_MEASURED
    verdict = verdicts.verdict[group, issue]
    mark = {DISPARITY: f" **{DISPARITY}**", INSUFFICIENT: f" {INSUFFICIENT}"}.get(verdict, "")
    return f"{gap:+.1f} ({low:+.1f} to {high:+.1f}){mark}".replace("-", MINUS)


def _blind(settings: Mapping[str, Any]) -> bool:
    return registry.BLINDNESS in registry.needs_of(registry.restored(settings["method"]))


_LIMITS = """\
## Limits and ethics

- The world is a simulation: one room, one person who asks at a time, distances and times of an
  idealised robot. Nothing here was compared with a real robot.
- Identities are coarse categories of five kinds, taken from census forms and a skin scale. People
  are more than these, and combinations of them are not shown here.
- The policy sees who it serves, unless the table above says that this is hidden from it. On a
  real robot these would be sensitive data: they need consent and a lawful basis, and
  guessing them from pictures harms people.
- Evenness is not goodness. A robot that serves all groups badly has small gaps; read the gaps
  beside the share of services without any issue.
- Audit whatever is built from this on its own logs: `evenhand audit LOG`."""


def _loading() -> str:
    python = (
        "from evenhand.training import run_folder, train\n\n"
        'settings, learner = run_folder.load_policy("RUN")  # the run folder\n'
        "robot = train.robot(settings, learner.policy)\n"
        "# robot(observations [n, 25], range(n)) -> probability of responding now, [n]"
    )
    return f"## How to load it\n\n{markdown.code(python, 'python')}"


def _repeating(robot: Robot, trial: Trial | None) -> str:
    lines = ["# settings.json of the run folder says how it was trained"]
    if robot.command is not None:
        lines = [robot.command]
    if trial is not None:
        lines.append(f"evenhand evaluate RUN --services {trial.services} --seed {trial.seed}")
    return (
        "## How to repeat it\n\nThe same versions and the same seed give the same policy, bit for "
        f"bit.\n\n{markdown.code(chr(10).join(lines), 'sh')}"
    )
