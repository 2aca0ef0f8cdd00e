"""Tables of the comparison: numbers of a test, and what several seeds say together."""

import zlib
from collections.abc import Iterable, Mapping, Sequence
from math import nan
from typing import Any

import numpy as np

from evenhand.experiments.comparison import aggregate
from evenhand.experiments.comparison.aggregate import Estimate
from evenhand.experiments.comparison.settings import BLIND, NO_ALGORITHM, Cell, method_of, place
from evenhand.methods.paper import issues
from evenhand.methods.paper.scores import count
from evenhand.methods.scheme import Scheme
from evenhand.methods.services import Services
from evenhand.statistics import chance
from evenhand.training import evaluate

ISSUES = tuple(issue.name for issue in issues.PAPER_ISSUES)
METRICS = (
    "corrected_total", *(f"corrected_{name}" for name in ISSUES), "raw_total", "perfect_rate",
    "worst_group_rate", "per_imperfect", "biased_epochs",
)  # fmt: skip
GREATER_IS_BETTER = ("perfect_rate", "worst_group_rate")
ALL = "all"
"""All scenarios but ``even``, pooled."""
WORST = (-1.0, 0.0)
"""Reference point of the hypervolume, in units of ``scale_of``: as uneven as the worst arm, and no
perfect service."""
LEAST_SCALE = 0.05
"""Of a corrected total: where all arms are nearly even, chance must not be blown up."""
RESULTS = ("scenario", "algorithm", "arm", "seed", "metric", "value")
SUMMARY = (
    "scenario", "algorithm", "arm", "metric", "iqm", "low", "high", "seeds",
    *(f"{name}{end}" for name in ("share", "difference", "to_blind", "improvement")
      for end in ("", "_low", "_high")),
)  # fmt: skip
LEAST_IMPERFECT = 30
"""Services that were not perfect, before unevenness is divided by their share."""
FRONTS = (
    "scenario", "algorithm", "method", "hypervolume", "low", "high", "seeds", "arms", "front",
    "scale",
)  # fmt: skip
_SEED = 3_000_000
Row = dict[str, Any]
Results = Mapping[Cell, Mapping[str, float | None]]
"""Numbers of each test by metric, None where missing."""
Values = dict[tuple[str, str, str, str], dict[int, float]]
"""(scenario, algorithm, arm, metric) -> seed -> value; what is missing is left out."""


def metrics_of(numbers: Iterable[str]) -> list[str]:
    """Names of the metrics of a test: those of every comparison, and own issues of a world.

    Args:
        numbers: names that the test has; where issues are a world's own, the paper's that it has
            not are left out.
    """
    named = list(numbers)
    own = [name for name in named if name not in METRICS]
    paper = [f"corrected_{name}" for name in ISSUES]
    head, *rest = [name for name in METRICS if not own or name in named or name not in paper]
    return [head, *own, *rest]


def numbers(table: Services, scheme: Scheme) -> dict[str, float | None]:
    """The metrics of a test, but for the epochs of its training.

    Args:
        table: services, at least one full window.
        scheme: identities and issues of the world.

    Returns:
        corrected_total: total issue score of all services as one window less what chance alone
        gives (``chance.corrected_scores``): an even robot is about 0 and may be
        below; corrected_<issue>: its parts; raw_total: the printed score, mean over windows of 30;
        perfect_rate; worst_group_rate: the least among the groups with at least 30 services;
        per_imperfect: corrected_total over the share of services that were not perfect, where at
        least 30 were not. None where nothing is known.
    """
    named = [issue.name for issue in scheme.issues]
    x, inside = scheme.indicators(table), scheme.inside(scheme.codes(table))
    scores = chance.corrected_scores(count(x, inside), scheme.groups, named)
    good = evaluate.perfect(table)
    windows = evaluate.window_scores(table, scheme=scheme).total
    windows = windows[~np.isnan(windows)]
    found = {
        "corrected_total": scores.total,
        **{f"corrected_{name}": scores.overall[k] for k, name in enumerate(named)},
        "raw_total": windows.mean() if len(windows) else nan,
        "perfect_rate": good.mean(),
    }
    known = {name: None if np.isnan(value) else float(value) for name, value in found.items()}
    total, imperfect = known["corrected_total"], int((~good).sum())
    told = total is not None and imperfect >= LEAST_IMPERFECT
    return known | {
        "worst_group_rate": evaluate.worst_group_rate(good, inside),
        "per_imperfect": total * len(good) / imperfect if told and total is not None else None,
    }


def tidy(results: Results) -> list[Row]:
    """One row for each number: ``results.csv``."""
    return [
        {
            "scenario": cell.scenario,
            "algorithm": cell.algorithm,
            "arm": cell.arm,
            "seed": cell.seed,
            "metric": metric,
            "value": results[cell].get(metric),
        }
        for cell in sorted(results, key=place)
        for metric in metrics_of(results[cell])
    ]


def _values(results: Results) -> Values:
    found: Values = {}
    for cell in sorted(results, key=place):
        for metric in metrics_of(results[cell]):
            seeds = found.setdefault((cell.scenario, cell.algorithm, cell.arm, metric), {})
            value = results[cell].get(metric)
            if value is not None:
                seeds[cell.seed] = value
    return found


def summary(results: Results) -> list[Row]:
    """What the seeds say together: ``summary.csv``.

    Each row: interquartile mean over seeds with its 95 % interval. Against training on service
    alone, of the same algorithm and the same seeds: ``difference``, and ``improvement``, the
    probability of being better. Against a cost without groups likewise: ``to_blind``. For
    corrected_total ``share`` too: how much of the way from service alone to the reference robot.
    Rows of scenario ``all`` pool every scenario but even,
    for arms that were run in each, over the seeds that an arm has in each: so every scenario
    counts alike, however many seeds it has (as with Agarwal et al. 2021, where all tasks have
    equally many runs).
    """
    values = _values(results)
    heads = list(
        dict.fromkeys((scenario, algorithm, arm) for scenario, algorithm, arm, _ in values)
    )
    uneven = [name for name in dict.fromkeys(head[0] for head in heads) if name != "even"]
    rows = [_summary_row(values, [head[0]], *head) for head in values]
    if len(uneven) < 2:
        return rows
    everywhere = [
        (algorithm, arm)
        for algorithm, arm in dict.fromkeys(head[1:] for head in heads)
        if all((scenario, algorithm, arm) in heads for scenario in uneven)
    ]
    everywhere.sort(key=lambda head: place(Cell(ALL, *head, 0)))
    return rows + [
        _summary_row(values, uneven, ALL, algorithm, arm, metric)
        for algorithm, arm in everywhere
        for metric in metrics_of(dict.fromkeys(head[3] for head in values))
        if all((scenario, algorithm, arm, metric) in values for scenario in uneven)
    ]


def _summary_row(
    values: Values, scenarios: Sequence[str], name: str, algorithm: str, arm: str, metric: str
) -> Row:
    rng = _rng(name, algorithm, arm, metric)
    own = [values[scenario, algorithm, arm, metric] for scenario in scenarios]
    service = [values.get((scenario, algorithm, "service", metric), {}) for scenario in scenarios]
    blind = [values.get((scenario, algorithm, BLIND, metric), {}) for scenario in scenarios]
    best = [values.get((scenario, NO_ALGORITHM, "reference", metric), {}) for scenario in scenarios]
    row: Row = {"scenario": name, "algorithm": algorithm, "arm": arm, "metric": metric}
    middle = aggregate.mean_of(_together(own), rng)
    row |= {"iqm": middle.value, "low": middle.low, "high": middle.high}
    row["seeds"] = middle.n // len(scenarios)
    pairs = _together(own, service)
    sign = 1.0 if metric in GREATER_IS_BETTER else -1.0
    row |= _cells("difference", aggregate.difference(pairs, rng))
    row |= _cells("to_blind", aggregate.difference(_together(own, blind), rng))
    row |= _cells("improvement", aggregate.improvement([sign * pair for pair in pairs], rng))
    if metric == "corrected_total":
        row |= _cells("share", aggregate.share(_together(service, own, best), rng))
    return row


def _cells(name: str, estimate: Estimate) -> Row:
    return {name: estimate.value, f"{name}_low": estimate.low, f"{name}_high": estimate.high}


def _together(*columns: Sequence[Mapping[int, float]]) -> list[np.ndarray]:
    """Values of the seeds that all columns have in every stratum, for each stratum.

    A mean over unequally many seeds would be one over another mix of scenarios.

    Returns:
        [n] each for one column, [n, C] for several; none at all without such seeds.
    """
    strata = list(zip(*columns, strict=True))
    seeds = sorted(set.intersection(*(set(column) for stratum in strata for column in stratum)))
    if not seeds:
        return []
    found = [np.array([[column[s] for column in stratum] for s in seeds]) for stratum in strata]
    return [values[:, 0] for values in found] if len(columns) == 1 else found


def fronts(results: Results) -> list[Row]:
    """Evenness against service over the strengths of each method: ``fronts.csv``.

    Each seed's hypervolume of the points (−corrected_total, perfect_rate) of all strengths, the
    total in units of ``scale``: 0 is as uneven as the worst arm or without any perfect service, 1
    is even and perfect. Its interquartile mean over seeds with a 95 % interval; and the arms whose
    interquartile means no other strength of the method dominates. A method with more strengths has
    more chances, so compare methods with equally many.
    """
    values = _values(results)
    methods: dict[tuple[str, str, str], list[str]] = {}
    for scenario, algorithm, arm in dict.fromkeys(head[:3] for head in values):
        methods.setdefault((scenario, algorithm, method_of(arm)[0]), []).append(arm)
    rows: list[Row] = []
    for (scenario, algorithm, method), arms in methods.items():
        scale = scale_of(values, scenario)
        aims = [
            values[scenario, algorithm, arm, metric]
            for arm in arms
            for metric in ("corrected_total", "perfect_rate")
        ]
        found = _together(*([aim] for aim in aims))
        points = (found[0] if found else np.empty(0)).reshape(-1, len(arms), 2) * (-1.0, 1.0)
        areas = [aggregate.hypervolume(each / (scale, 1.0), WORST) for each in points]
        area = aggregate.mean_of(
            [np.array(areas)], _rng(scenario, algorithm, method, "hypervolume")
        )
        front = aggregate.pareto_front(aggregate.iqm(points, 0)) if areas else [False] * len(arms)
        rows.append(
            {
                "scenario": scenario,
                "algorithm": algorithm,
                "method": method,
                "hypervolume": area.value,
                "low": area.low,
                "high": area.high,
                "seeds": len(areas),
                "arms": " ".join(arms),
                "front": " ".join(arm for arm, on in zip(arms, front, strict=True) if on),
                "scale": scale,
            }
        )
    return rows


def scale_of(values: Values, scenario: str) -> float:
    """Corrected total of the worst arm that learns in a scenario, at least ``LEAST_SCALE``."""
    totals = [
        float(aggregate.iqm(np.array(list(seeds.values()))))
        for (where, algorithm, _, metric), seeds in values.items()
        if (where, metric) == (scenario, "corrected_total") and algorithm != NO_ALGORITHM and seeds
    ]
    return max([LEAST_SCALE, *totals])


def _rng(*labels: str) -> np.random.Generator:
    """A row's own stream: what is added to a folder later leaves the other rows as they were."""
    return np.random.default_rng([_SEED, zlib.crc32("/".join(labels).encode())])


def shown(rows: Iterable[Row]) -> list[Row]:
    """One row for each arm, its metrics side by side, for a terminal and a figure.

    Returns:
        scenario, algorithm, arm, seeds, and for each metric <metric>, <metric>_low, <metric>_high;
        share and to_blind with their limits.
    """
    found: dict[tuple[str, str, str], Row] = {}
    for row in rows:
        head = (row["scenario"], row["algorithm"], row["arm"])
        whole = found.setdefault(
            head, dict(zip(("scenario", "algorithm", "arm"), head, strict=True))
        )
        metric = row["metric"]
        whole |= _cells(metric, Estimate(row["iqm"], row["low"], row["high"], row["seeds"]))
        if metric == "corrected_total":
            whole["seeds"] = row["seeds"]
            whole |= {
                f"{name}{end}": row[f"{name}{end}"]
                for name in ("share", "to_blind")
                for end in ("", "_low", "_high")
            }
    return list(found.values())
