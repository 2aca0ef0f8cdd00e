"""Tables of the experiment: from demonstrations, study and runs to what the report draws."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evenhand.core.processes import Task, Tell
from evenhand.experiments.paper import corrected_detector, demonstrations
from evenhand.experiments.paper.calibrate import SIGNATURES
from evenhand.experiments.paper.corrected_detector import Record
from evenhand.experiments.paper.demonstrations import KINDS, Demos, Study
from evenhand.methods.paper.detector import complete
from evenhand.methods.vocabulary import IDENTITIES, ISSUES
from evenhand.report.table import Row, write
from evenhand.restaurant import people
from evenhand.restaurant.robots import BIASES
from evenhand.statistics.detector_accuracy import CalibrationBin
from evenhand.statistics.means import SCORE, SHARE, mean_interval
from evenhand.study.simulated.respondents import NAMEABLE, SCENARIOS

PAPER_SHARES = {(1, "race"): 0.357, (4, "disability"): 0.214}
"""What the paper quotes from its questionnaire, by scenario and identity."""
PAPER_BEHAVIOUR = {
    ("ableist", "mean_response_distance"): 1.89,
    ("ageist", "mean_response_time"): 124.93,
    ("racist", "ignore_rate"): 4.36,
}
BEHAVIOUR_UNITS = {
    "mean_response_distance": "m",
    "mean_response_time": "steps",
    "ignore_rate": "people in 30",
}
JUDGES_COLUMNS = ("judge", "measure", "bin", "predicted", "value", "ci_low", "ci_high", "n")
REFLECTION_COLUMNS = (
    "preset", "arm", "seed", "epoch", "projection", "cosine", "z", "p_value", "alarm", "identity",
    "issue", "favoured", "earlier", "rate",
)  # fmt: skip
_REFLECTED = ("projection", "cosine", "z", "alarm", "identity", "issue", "favoured")


def questionnaire(study: Study) -> tuple[list[Row], list[Row]]:
    """Answers to the four scenarios: which identity was named, and which issue is worst."""
    answers = study.questionnaire
    identity, issue = np.array(answers.identity), np.array(answers.issue)
    named: list[Row] = []
    worst: list[Row] = []
    for scenario in SCENARIOS:
        rows = answers.scenario == scenario.number
        head = {"scenario": str(scenario.number), "scenario_name": scenario.title}
        for name in NAMEABLE:
            count = int((identity[rows] == name).sum())
            named.append(
                head
                | {
                    "identity": name,
                    "share": count / int(rows.sum()),
                    "count": count,
                    "respondents": int(rows.sum()),
                    "paper_share": PAPER_SHARES.get((scenario.number, name)),
                }
            )
        for name in ISSUES:
            count = int((issue[rows] == name).sum())
            worst.append(head | {"issue": name, "share": count / int(rows.sum()), "count": count})
    return named, worst


def judgements(demos: Demos, study: Study) -> list[Row]:
    """Every simulated judgement with the scores that were judged; ``detect fit`` reads them."""
    seen = study.seen
    return [
        {
            "window": str(w),
            "robot": KINDS[demos.robot[w]],
            "strength": float(demos.strength[w]),
            "respondent": f"simulated-{study.who[w]:02d}",
            "shown": IDENTITIES[study.shown[w]],
            "biased": bool(study.said.biased[w]),
            "identity": IDENTITIES[study.said.identity[w]] if study.said.biased[w] else "",
            "discrimination": study.said.kinds[w],
            "issue": ISSUES[study.said.issue[w]] if study.said.biased[w] else "",
            **dict(zip(ISSUES, seen[w], strict=True)),
            "total": float(np.nansum(seen[w])),
        }
        for w in range(len(seen))
    ]


def ceiling(categories: int) -> float:
    """Highest I that rates of 0 and 1 reach when the categories of an identity are equally common.

    With m of k categories at rate 1, d is 1-(m-1)/(k-1) for these and m/(k-1) for the others.
    """
    k = categories
    return max((m * (1 - (m - 1) / (k - 1)) + (k - m) * m / (k - 1)) / k for m in range(1, k))


def signatures(demos: Demos) -> list[Row]:
    """Mean I of each biased robot's own identity at full strength, beside the paper's."""
    sizes = {identity.name: len(identity.groups) for identity in people.IDENTITIES}
    rows: list[Row] = []
    for kind in KINDS[1:]:
        identity = BIASES[kind].identity
        score = demonstrations.signature(demos, kind)
        for k, name in enumerate(ISSUES):
            mean = mean_interval(score[:, k], within=SHARE, errors=1.96)
            rows.append(
                {
                    "discrimination": people.DISCRIMINATION[identity],
                    "issue": name,
                    "paper": SIGNATURES[kind][k],
                    "ours": mean.mean,
                    "ci_low": mean.low,
                    "ci_high": mean.high,
                    "windows": len(score),
                    # quality and priority are said of responses, whose people are no even mix
                    "ceiling": ceiling(sizes[identity])
                    if name in ("willingness", "risk")
                    else None,
                }
            )
    return rows


def behaviour(demos: Demos) -> list[Row]:
    """How far, how late and how seldom each biased robot responds, at full strength."""
    rows: list[Row] = []
    for kind in KINDS[1:]:
        for measure, values in demonstrations.behaviour(demos, kind).items():
            mean = mean_interval(values, within=SCORE, errors=1.96)
            rows.append(
                {
                    "robot": kind,
                    "measure": measure,
                    "value": mean.mean,
                    "ci_low": mean.low,
                    "ci_high": mean.high,
                    "paper": PAPER_BEHAVIOUR.get((kind, measure)),
                    "unit": BEHAVIOUR_UNITS[measure],
                    "services": len(values) * demonstrations.WINDOW,
                }
            )
    return rows


def detector(study: Study) -> tuple[list[Row], list[Row], list[Row]]:
    """Held-out performance, calibration and confusion of the detector."""
    found = study.evaluation
    performance = [
        {"metric": name, "value": share.value, "ci_low": share.low, "ci_high": share.high,
         "n": share.n}
        for name, share in (
            ("accuracy", found.accuracy),
            ("threshold_agreement", found.agreement),
            ("threshold_accuracy", found.manual_accuracy),
        )
    ]  # fmt: skip
    performance.append({"metric": "brier", "value": found.brier, "n": found.n})
    calibration = [_bin(part) for part in found.calibration]
    confusion = [
        {"judged": judged, "predicted": predicted, "count": int(found.confusion[i, j])}
        for i, judged in enumerate(found.kind_names)
        for j, predicted in enumerate(found.kind_names)
    ]
    return performance, calibration, confusion


def _bin(part: CalibrationBin) -> Row:
    some = part.observed.n > 0
    return {
        "bin": f"{part.start:.1f}-{part.stop:.1f}",
        "predicted": part.predicted if some else None,
        "observed": part.observed.value if some else None,
        "ci_low": part.observed.low if some else None,
        "ci_high": part.observed.high if some else None,
        "n": part.observed.n,
    }


def judges(records: Sequence[Record]) -> list[Row]:
    """Measures and calibration of each judge, raw and corrected scores beside each other.

    A bin of calibration has its mean predicted probability in ``predicted`` and the share that
    respondents called biased in ``value``.
    """
    rows: list[Row] = []
    for record in records:
        head = {"judge": record.judge, "bin": ""}
        for name in ("accuracy", "agreement", "false_alarms"):
            share = getattr(record, name)
            if share is not None:
                rows.append(
                    head
                    | {"measure": name, "value": share.value, "ci_low": share.low}
                    | {"ci_high": share.high, "n": share.n}
                )
        if record.brier is not None and record.accuracy is not None:
            rows.append(head | {"measure": "brier", "value": record.brier, "n": record.accuracy.n})
        for part in record.calibration:
            row = _bin(part)
            rows.append(head | {"measure": "calibration", "value": row.pop("observed")} | row)
    return rows


def reflection(
    head: Row, lines: Sequence[Mapping[str, Any]], settings: Mapping[str, Any]
) -> list[Row]:
    """What self-reflection found at every update of a run; nothing for a run without it."""
    return [
        head
        | {"epoch": line["epoch"]}
        | {name: line[f"reflection_{name}"] for name in _REFLECTED}
        | {
            "p_value": line["reflection_p"],
            # the past holds every update since the first, at most `history`
            "earlier": min(line["epoch"], settings["history"]),
            "rate": settings["rate"],
        }
        for line in lines
        if "reflection_alarm" in line
    ]


def tsne(demos: Demos, study: Study, seed: int) -> list[Row]:
    """t-SNE of the judged scores in three dimensions."""
    from sklearn.manifold import TSNE

    rows = np.flatnonzero(complete(study.seen))
    seen = study.seen[rows]
    perplexity = min(30.0, (len(seen) - 1) / 3)
    placed = TSNE(
        3, perplexity=perplexity, random_state=seed, init="pca", max_iter=500
    ).fit_transform(seen.astype(np.float32))
    own = {kind: people.DISCRIMINATION[BIASES[kind].identity] for kind in KINDS[1:]}
    return [
        {
            "window": str(w),
            "kind": own.get(KINDS[demos.robot[w]], "even"),
            "biased": bool(study.said.biased[w]),
            **{axis: float(value) for axis, value in zip("xyz", place, strict=True)},
        }
        for w, place in zip(rows, placed, strict=True)
    ]


def study_task(data: Path, windows: int, seed: int) -> Task:
    """The task that writes the tables of the study into ``data``.

    They need the demonstrations there and nothing of training, so they are made beside it.
    """
    return Task(
        "tables of the study", write_study, {"data": data, "windows": windows, "seed": seed}
    )


def write_study(*, tell: Tell, data: Path, windows: int, seed: int) -> None:
    """Write every table of the study."""
    shown = demonstrations.load(windows, seed, data / "demonstrations")
    study = demonstrations.study(shown, seed)
    named, worst = questionnaire(study)
    performance, calibration, confusion = detector(study)
    for name, rows in (
        ("questionnaire", named),
        ("questionnaire_issue", worst),
        ("judgements", judgements(shown, study)),
        ("signatures", signatures(shown)),
        ("behaviour", behaviour(shown)),
        ("detector", performance),
        ("calibration", calibration),
        ("confusion", confusion),
        ("tsne", tsne(shown, study, seed)),
    ):
        write(data / f"{name}.csv", rows)
    compared = corrected_detector.side_by_side(shown, study, seed)
    write(data / "judges.csv", judges(compared), JUDGES_COLUMNS)
    tell(0, {})
