"""Simulated respondents, in place of the paper's 24 volunteers.

A simulated respondent is an assumption, not evidence. Each one weighs the four issues, adds
noise, and compares the sum with a threshold of its own; thresholds are centred on the paper's
manual threshold. A detector fitted to such answers therefore agrees with the manual threshold
partly by construction, and says nothing about how real people judge.

No answers of the paper's volunteers are public but two shares: 35.7 % name race in the
willingness scenario, and 21.4 % name disability in scenario 4. The salience of the identities
in ``SCENARIOS`` is fitted to these two numbers and is otherwise assumed. Neither number is a
multiple of 1/24 (the simplest fractions that round to them are 5/14 and 3/14), so they are not
shares of 24 volunteers giving one answer each; the paper does not say what they are shares of.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenhand.core.errors import InputError
from evenhand.methods.judgements import checked_scores
from evenhand.methods.vocabulary import DISCRIMINATIONS, IDENTITIES, ISSUES

NAMEABLE = (*IDENTITIES, "none")
"""What can be named in the questionnaire."""


@dataclass(frozen=True)
class RespondentModel:
    """How simulated respondents differ and err. All of it is assumed.

    Attributes:
        n: number of respondents; the paper had 24.
        threshold: mean of the evidence (sum of the four weighted scores) above which one says
            "biased"; the paper's manual threshold.
        threshold_spread: standard deviation of the respondents' thresholds, cut at two.
        weight_spread: spread (log scale) of the issue weights; the weights of one respondent
            have mean 1, so that equal weights give the paper's total score.
        noise: mean standard deviation of the noise on the evidence of one window; a
            respondent's own lies between half and one and a half of it.
        lapse: mean share of answers given at random; a respondent's own lies between none
            and twice that.
        names_shown: probability of naming the identity that the window was shown about;
            otherwise each identity is named by its evidence.
        naming_temperature: softness of naming by evidence; small means the strongest wins.
        issue_noise: standard deviation of the noise on each weighted score when the worst
            issue is named.
        scene_temperature: softness of naming an identity in a questionnaire scenario.
        scene_issue_temperature: softness of naming the worst issue in a scenario.
    """

    n: int = 24
    threshold: float = 0.5
    threshold_spread: float = 0.06
    weight_spread: float = 0.1
    noise: float = 0.04
    lapse: float = 0.02
    names_shown: float = 0.9
    naming_temperature: float = 0.2
    issue_noise: float = 0.05
    scene_temperature: float = 0.5
    scene_issue_temperature: float = 0.4

    def __post_init__(self) -> None:
        if self.n < 1:
            raise InputError("range n", f"{self.n} respondents cannot judge: recruit at least 1")
        for name in ("threshold_spread", "weight_spread", "noise", "issue_noise"):
            if not 0 <= getattr(self, name) < np.inf:
                raise InputError(
                    f"range {name}", f"{name} is {getattr(self, name)}: it must be 0 or more"
                )
        for name in ("naming_temperature", "scene_temperature", "scene_issue_temperature"):
            if not 0 < getattr(self, name) < np.inf:
                raise InputError(
                    f"range {name}", f"{name} is {getattr(self, name)}: it must be more than 0"
                )
        if not 0 <= self.lapse <= 0.5:
            raise InputError("range lapse", f"lapse is {self.lapse}: it must lie between 0 and 0.5")
        if not 0 <= self.names_shown <= 1:
            raise InputError(
                "range names_shown",
                f"names_shown is {self.names_shown}: it must lie between 0 and 1",
            )


@dataclass(frozen=True, eq=False)
class Respondents:
    """Simulated respondents, one entry each.

    Attributes:
        thresholds: float64 [n], evidence above which one says "biased".
        weights: float64 [n, 4], weight of each issue, mean 1 over the issues.
        noise: float64 [n], standard deviation of the noise on the evidence.
        lapses: float64 [n], share of answers given at random.
        model: the settings they were drawn from.
    """

    thresholds: NDArray[np.float64]
    weights: NDArray[np.float64]
    noise: NDArray[np.float64]
    lapses: NDArray[np.float64]
    model: RespondentModel

    @property
    def n(self) -> int:
        """Number of respondents."""
        return len(self.thresholds)


@dataclass(frozen=True, eq=False)
class Judgements:
    """What simulated respondents said about n windows.

    Attributes:
        biased: bool [n].
        identity: int64 [n], position in ``IDENTITIES`` of what was named; -1 when not biased.
        issue: int64 [n], position in ``ISSUES`` of the worst; -1 when not biased.
    """

    biased: NDArray[np.bool_]
    identity: NDArray[np.int64]
    issue: NDArray[np.int64]

    @property
    def kinds(self) -> tuple[str | None, ...]:
        """The discrimination named in each judgement, None when not biased."""
        return tuple(None if i < 0 else DISCRIMINATIONS[i] for i in self.identity)


@dataclass(frozen=True)
class Scenario:
    """One scenario of the questionnaire: a single badly served person is seen.

    Attributes:
        number: 1 to 4, as in the paper.
        title: what is seen.
        seen: how much of each issue is seen, in the order of ``ISSUES``, 0 to 1.
        salience: how much each of ``NAMEABLE`` comes to mind, 0 to 1.
    """

    number: int
    title: str
    seen: tuple[float, float, float, float]
    salience: tuple[float, float, float, float, float]


# One person shows an identity of every kind at once, so none is obvious. 0.41 gives the
# published 35.7 % for race in scenario 1 and is assumed for the robots' own identities in
# scenarios 2 and 3; 0.06 gives the published 21.4 % for disability in scenario 4.
SCENARIOS = (
    Scenario(1, "a racist robot does not respond", (1, 0, 0, 0), (0.41, 0, 0, 0, 0)),
    Scenario(2, "an ableist robot responds from afar", (0, 1, 0, 0), (0, 0, 0, 0.41, 0)),
    Scenario(3, "an ageist robot responds late", (0, 0, 1, 0), (0, 0, 0.41, 0, 0)),
    Scenario(
        4, "an ableist and racist robot comes too close", (0, 0.4, 0, 1), (0.06, 0, 0, 0.06, 0)
    ),
)


@dataclass(frozen=True, eq=False)
class Questionnaire:
    """Answers to the questionnaire, one row an answer, by scenario and then respondent.

    Attributes:
        scenario: int64 [m], number of the scenario.
        respondent: int64 [m], position of the respondent.
        identity: m names out of ``NAMEABLE``: what the treatment was about.
        issue: m names out of ``ISSUES``: the most serious one.
    """

    scenario: NDArray[np.int64]
    respondent: NDArray[np.int64]
    identity: tuple[str, ...]
    issue: tuple[str, ...]


def recruit(rng: np.random.Generator, model: RespondentModel | None = None) -> Respondents:
    """Draw simulated respondents.

    Args:
        rng: random numbers.
        model: how they differ; the default settings when None.

    Returns:
        The respondents.
    """
    model = model or RespondentModel()
    offset = np.clip(rng.standard_normal(model.n), -2, 2)
    weights = np.exp(model.weight_spread * rng.standard_normal((model.n, len(ISSUES))))
    return Respondents(
        thresholds=model.threshold + model.threshold_spread * offset,
        weights=weights / weights.mean(axis=1, keepdims=True),
        noise=model.noise * rng.uniform(0.5, 1.5, model.n),
        lapses=model.lapse * rng.uniform(0, 2, model.n),
        model=model,
    )


def judge(
    respondents: Respondents,
    who: ArrayLike,
    by_identity: ArrayLike,
    shown: ArrayLike,
    rng: np.random.Generator,
) -> Judgements:
    """Let respondents judge windows, each shown about one identity.

    The evidence is the weighted sum of the four scores of the shown identity, plus noise; it
    is "biased" above the respondent's threshold. A respondent who lapses answers at random.

    Args:
        respondents: who can be asked.
        who: int [n], position of the respondent who judges each window.
        by_identity: float [n, 4, 4], I (Eq. 2) for each of ``IDENTITIES``, scores in the order
            of ``ISSUES``. A missing score (NaN) is no evidence: nothing was seen.
        shown: int [n], position of the identity that each window is shown about.
        rng: random numbers.

    Returns:
        The judgements.

    Raises:
        InputError: shapes that do not match, a score outside [-1, 1], or a position that does
            not exist.
    """
    scores = checked_scores(by_identity, ISSUES)
    n = len(scores)
    if scores.shape != (n, len(IDENTITIES), len(ISSUES)):
        raise InputError(
            "shape by_identity",
            f"by_identity has shape {scores.shape}: it must be [n, {len(IDENTITIES)}, "
            f"{len(ISSUES)}], the identities {', '.join(IDENTITIES)}",
        )
    asked = _positions("who", who, n, respondents.n)
    about = _positions("shown", shown, n, len(IDENTITIES))
    model, rows = respondents.model, np.arange(n)

    weighted = respondents.weights[asked][:, None, :] * np.where(np.isnan(scores), 0, scores)
    evidence = weighted.sum(axis=-1)
    noise = respondents.noise[asked] * rng.standard_normal(n)
    biased = evidence[rows, about] + noise > respondents.thresholds[asked]
    by_evidence = _draw(evidence / model.naming_temperature, rng)
    identity = np.where(rng.random(n) < model.names_shown, about, by_evidence)
    seen = weighted[rows, about] + model.issue_noise * rng.standard_normal((n, len(ISSUES)))
    issue = seen.argmax(axis=-1)

    lapsed = rng.random(n) < respondents.lapses[asked]
    biased = np.where(lapsed, rng.random(n) < 0.5, biased)
    identity = np.where(lapsed, rng.integers(len(IDENTITIES), size=n), identity)
    issue = np.where(lapsed, rng.integers(len(ISSUES), size=n), issue)
    return Judgements(
        biased=biased,
        identity=np.where(biased, identity, -1),
        issue=np.where(biased, issue, -1),
    )


def questionnaire(
    respondents: Respondents,
    rng: np.random.Generator,
    scenarios: tuple[Scenario, ...] = SCENARIOS,
) -> Questionnaire:
    """Every respondent answers every scenario: which identity, which issue is worst.

    Both answers are drawn by softmax, the identity over the scenario's salience, the issue over
    what is seen times the respondent's weights. A respondent who lapses answers at random. The
    expected shares match the two published ones by the choice of the saliences; 24 answers vary
    around them by some 10 points.

    Returns:
        The answers, scenarios times respondents rows.
    """
    model, n = respondents.model, respondents.n
    identity: list[str] = []
    issue: list[str] = []
    for scenario in scenarios:
        salience = np.tile(scenario.salience, (n, 1)) / model.scene_temperature
        seen = respondents.weights * np.array(scenario.seen) / model.scene_issue_temperature
        named, worst = _draw(salience, rng), _draw(seen, rng)
        lapsed = rng.random(n) < respondents.lapses
        named = np.where(lapsed, rng.integers(len(NAMEABLE), size=n), named)
        worst = np.where(lapsed, rng.integers(len(ISSUES), size=n), worst)
        identity += [NAMEABLE[i] for i in named]
        issue += [ISSUES[i] for i in worst]
    return Questionnaire(
        scenario=np.repeat([scenario.number for scenario in scenarios], n),
        respondent=np.tile(np.arange(n), len(scenarios)),
        identity=tuple(identity),
        issue=tuple(issue),
    )


def _draw(logits: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.int64]:
    """One choice a row by softmax; the largest logit plus Gumbel noise is such a draw."""
    return (logits + rng.gumbel(size=logits.shape)).argmax(axis=-1)


def _positions(name: str, given: ArrayLike, n: int, limit: int) -> NDArray[np.int64]:
    positions = np.asarray(given)
    if positions.shape != (n,) or positions.dtype.kind not in "iu":
        raise InputError(f"type {name}", f"{name} must be {n} whole numbers, one a window")
    if n and (positions.min() < 0 or positions.max() >= limit):
        raise InputError(
            f"range {name}", f"{name} holds a position that does not exist: use 0 to {limit - 1}"
        )
    return positions.astype(np.int64)
