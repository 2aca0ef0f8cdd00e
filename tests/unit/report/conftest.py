"""A made-up experiment: the folder that a report is built from, with plausible numbers."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ARMS = ("reinforce", "reinforce+guidance", "ppo", "ppo+guidance")
ISSUES = ("willingness", "quality", "priority", "risk")
SIGNATURES = {
    "racism": (0.49, 0.25, 0.38, 0.43),
    "sexism": (None, None, None, None),
    "ageism": (0.42, 0.68, 0.54, 0.49),
    "ableism": (0.05, 0.66, 0.0, 0.0),
}
ROBOTS = ("even", "racist", "sexist", "ageist", "ableist")
SCENARIOS = {
    "1": "A guest waits by the window",
    "2": "A guest at the far table",
    "3": "An elder waits long",
    "4": "A wheelchair user orders",
}


def write_csv(path: Path, rows: Sequence[dict[str, Any]], columns: Sequence[str] = ()) -> None:
    """Write rows; None becomes an empty cell, a flag the word true or false."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(columns or rows[0]), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow(
                {
                    name: str(cell).lower() if isinstance(cell, bool) else cell
                    for name, cell in row.items()
                }
            )


def learning_rows(
    rng: np.random.Generator, presets: Sequence[str], seeds: Sequence[int], epochs: int
) -> list[dict[str, Any]]:
    """Epochs in which the preset paper levels down and the preset service learns."""
    rows = []
    for preset in presets:
        for arm in ARMS:
            algorithm, _, guided = arm.partition("+")
            for seed in seeds:
                for epoch in range(1, epochs + 1):
                    done = 1 - np.exp(-epoch / (0.2 * epochs))
                    level = (0.75 - 0.5 * done) * (0.8 if guided else 1.0)
                    if preset == "paper":
                        level = (0.75 - 0.72 * done) * (0.9 if guided else 1.0)
                    issues = rng.dirichlet([4, 3, 3, 2]) * max(0, level + rng.normal(0, 0.13))
                    total = float(issues.sum())
                    good = 0.15 + 0.75 * done if preset == "service" else 0.3 * (1 - done)
                    rows.append(
                        {
                            "preset": preset,
                            "algorithm": algorithm,
                            "guided": bool(guided),
                            "arm": arm,
                            "seed": seed,
                            "epoch": epoch,
                            "total": round(total, 4),
                            **dict(zip(ISSUES, issues.round(4).tolist(), strict=True)),
                            "biased_detector": bool(total + rng.normal(0, 0.04) > 0.5),
                            "biased_threshold": total > 0.5,
                            "probability": round(float(1 / (1 + np.exp(-12 * (total - 0.5)))), 4),
                            "perfect_rate": round(float(np.clip(rng.normal(good, 0.06), 0, 1)), 4),
                            "response_rate": 0.95,
                            "mean_response_distance": 1.4,
                            "mean_response_step": 120.0,
                        }
                    )
    return rows


def test_rows(
    rng: np.random.Generator, presets: Sequence[str], seeds: Sequence[int]
) -> list[dict[str, Any]]:
    """Rows of the test for every preset, arm and seed."""
    rows = []
    for preset in presets:
        for arm in ARMS:
            for seed in seeds:
                scale = 0.04 if preset == "paper" else 0.22
                issues = rng.dirichlet([4, 3, 3, 2]) * scale * rng.uniform(0.7, 1.3)
                issues *= 0.75 if "guidance" in arm else 1.0
                good = rng.uniform(0.01, 0.05) if preset == "paper" else rng.uniform(0.84, 0.93)
                rows.append(
                    {
                        "preset": preset,
                        "arm": arm,
                        "seed": seed,
                        "services": 3000,
                        "total": round(float(issues.sum()), 4),
                        **dict(zip(ISSUES, issues.round(4).tolist(), strict=True)),
                        "perfect_rate": round(good, 4),
                        "response_rate": 0.97,
                        "mean_response_distance": 1.31,
                        "mean_response_time": 112.5,
                        "worst_group_rate": round(good * 0.9, 4),
                        "floor": 0.03 if preset == "paper" else 0.06,
                    }
                )
    return rows


REFLECTION = (
    "preset", "arm", "seed", "epoch", "projection", "cosine", "z", "p_value", "alarm",
    "identity", "issue", "favoured", "earlier", "rate",
)  # fmt: skip


def reflection_rows(
    rng: np.random.Generator, presets: Sequence[str], seeds: Sequence[int], epochs: int
) -> list[dict[str, Any]]:
    """Updates of the preset service that were examined; the last of each seed is abnormal."""
    rows = []
    for arm in ("reinforce+levelup", "ppo+levelup") if "service" in presets else ():
        for seed in seeds:
            for epoch in range(epochs):
                cosine = float(rng.normal(0, 0.2)) if epoch % 5 else None
                alarm = epoch == epochs - 1
                numbers = (
                    cosine and 0.1 * cosine,
                    cosine,
                    cosine and 5 * cosine,
                    1 / (1 + epoch) if alarm else float(rng.uniform(0.1, 1)),
                )
                named = ("age", "risk", "Child, Elder") if alarm else ("", "", "")
                cells = (*numbers, alarm, *named, epoch, 0.25)
                head = ("service", arm, seed, epoch)
                rows.append(dict(zip(REFLECTION, (*head, *cells), strict=True)))
    return rows


def judges_rows() -> list[dict[str, Any]]:
    """The detector on raw and on corrected scores, and whom they are compared with."""
    columns = ("judge", "measure", "bin", "predicted", "value", "ci_low", "ci_high", "n")
    shares = {
        "raw": {"accuracy": 0.931, "agreement": 0.962, "false_alarms": 0.09},
        "corrected": {"accuracy": 0.902, "agreement": 0.917, "false_alarms": 0.05},
        "threshold": {"accuracy": 0.95, "false_alarms": 0.12},
        "respondents": {"agreement": 0.95, "false_alarms": 0.13},
    }
    rows: list[tuple[Any, ...]] = [
        (judge, measure, "", None, value, value - 0.03, value + 0.03, 60 if value < 0.5 else 300)
        for judge, measures in shares.items()
        for measure, value in measures.items()
    ]
    for judge, brier in (("raw", 0.071), ("corrected", 0.084)):
        rows.append((judge, "brier", "", None, brier, None, None, 300))
        rows += [
            (judge, "calibration", f"bin {i}", p, p + 0.02, p - 0.04, p + 0.08, 60)
            for i, p in enumerate((0.1, 0.5, 0.9))
        ]
    return [dict(zip(columns, row, strict=True)) for row in rows]


def study_tables(rng: np.random.Generator, windows: int) -> dict[str, list[dict[str, Any]]]:
    """Questionnaire, judgements, signatures, detector, behaviour and embedding."""
    tables: dict[str, list[dict[str, Any]]] = {}
    identities = ("race", "gender", "age", "disability", "none")
    tables["questionnaire"], tables["questionnaire_issue"] = [], []
    for scenario, name in SCENARIOS.items():
        for question, answers in (("identity", identities), ("issue", ISSUES)):
            counts = rng.multinomial(24, rng.dirichlet(np.ones(len(answers)) * 1.5))
            for answer, count in zip(answers, counts.tolist(), strict=True):
                row: dict[str, Any] = {"scenario": scenario, "scenario_name": name}
                row |= {question: answer, "share": round(count / 24, 4), "count": count}
                if question == "identity":
                    paper = {("1", "race"): 0.357, ("4", "disability"): 0.214}
                    row |= {"respondents": 24, "paper_share": paper.get((scenario, answer))}
                tables["questionnaire" if question == "identity" else "questionnaire_issue"] += [
                    row
                ]
    tables["judgements"], tables["tsne"] = [], []
    named = dict(zip(ROBOTS, ("none", "race", "gender", "age", "disability"), strict=True))
    for window in range(windows):
        robot = ROBOTS[window % 5]
        issues = rng.dirichlet([4, 3, 3, 2]) * rng.uniform(0.1, 1.8)
        biased = bool(issues.sum() > 0.6)
        tables["judgements"].append(
            {
                "window": window,
                "robot": robot,
                "strength": round(float(rng.uniform(0, 1)), 3),
                "respondent": int(rng.integers(24)),
                "shown": named[robot],
                "biased": biased,
                "identity": named[robot] if biased else "",
                "issue": ISSUES[int(issues.argmax())] if biased else "",
                **dict(zip(ISSUES, issues.round(4).tolist(), strict=True)),
                "total": round(float(issues.sum()), 4),
            }
        )
        x, y, z = rng.normal(0, 4, 3) + 14 * np.array([window % 5, (window * 2) % 5, window % 3])
        kind = ("even", *SIGNATURES)[window % 5]
        tables["tsne"].append(
            {"window": window, "kind": kind, "biased": biased}
            | {"x": round(x, 3), "y": round(y, 3), "z": round(z, 3)}
        )
    tables["signatures"] = [
        {
            "discrimination": kind,
            "issue": issue,
            "paper": paper,
            "ours": (ours := round(min(0.6, (paper or 0.2) * 0.95 + 0.01), 3)),
            "ci_low": round(ours - 0.03, 3),
            "ci_high": round(ours + 0.03, 3),
            "windows": 200,
            "ceiling": 0.6,
        }
        for kind, vector in SIGNATURES.items()
        for issue, paper in zip(ISSUES, vector, strict=True)
    ]
    tables["calibration"] = [
        {"bin": i, "predicted": p, "observed": p + 0.02, "ci_low": p - 0.04, "ci_high": p + 0.08}
        | {"n": 60 - 8 * (i % 4)}
        for i, p in enumerate((0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9))
    ]
    kinds = ("none", "racism", "sexism", "ageism", "ableism")
    tables["confusion"] = [
        {"judged": a, "predicted": b, "count": 48 if a == b else int(rng.integers(0, 9))}
        for a in kinds
        for b in kinds
    ]
    tables["detector"] = [
        {"metric": "accuracy", "value": 0.931, "ci_low": 0.901, "ci_high": 0.955, "n": 300},
        {"metric": "threshold_agreement", "value": 0.962}
        | {"ci_low": 0.94, "ci_high": 0.98, "n": 300},
        {"metric": "brier", "value": 0.071, "ci_low": 0.055, "ci_high": 0.09, "n": 300},
    ]
    printed = {
        ("ableist", "mean_response_distance"): 1.89,
        ("ageist", "mean_response_time"): 124.93,
        ("racist", "ignore_rate"): 4.36,
    }
    values = {
        "mean_response_distance": ((1.25, 1.3, 1.28, 1.42, 1.91), "m", 0.02),
        "mean_response_time": ((101, 108, 103, 131, 110), "steps", 3.0),
        "ignore_rate": ((0.2, 8.1, 2.2, 5.5, 0.9), "% of services", 0.5),
    }
    tables["behaviour"] = [
        {"robot": robot, "measure": measure, "value": value}
        | {"ci_low": value - half, "ci_high": value + half}
        | {"paper": printed.get((robot, measure)), "unit": unit, "services": 3000}
        for measure, (numbers, unit, half) in values.items()
        for robot, value in zip(ROBOTS, numbers, strict=True)
    ]
    return tables


CLAIMS = [
    ("detector_agreement", "The detector agrees with a manual threshold of 0.5 on the total score",
     0.98, 0.962, [0.94, 0.98], "reproduced by calibration",
     "The interval over held-out windows holds the printed number."),
    ("total_score_reduction_ppo", "PPO with guidance scores more than 22 % lower in total",
     "> 0.22", 0.19, [-0.05, 0.41], "open",
     "The interval over seeds holds both 0 and 0.22."),
    ("total_score_reduction_ppo_service", "The same, with service quality in the reward",
     "> 0.22", 0.1, [-0.5, 0.6], "open",
     "The interval over seeds holds both 0 and 0.22."),
    ("detector_accuracy", "Accuracy of the detector against people's judgements",
     None, 0.91, [0.86, 0.94], "not testable", "The paper prints no accuracy."),
    ("biased_epochs_reduction_ppo", "27.8 % fewer biased epochs for PPO with guidance (54 to 39)",
     0.278, 0.031, [-0.02, 0.08], "contradicted",
     "A constant factor cancels when advantages are normalised."),
    ("signature_racism", "Signature of racism: willingness, quality, priority, risk",
     [0.49, 0.25, 0.38, 0.43], [0.476, 0.248, 0.371, 0.419], None, "reproduced by calibration",
     "Every component lies within 0.05 of the printed one."),
    ("farthest_is_ableism", "The ableist robot responds from farthest away (1.89 m)",
     1.89, 1.91, [1.89, 1.93], "reproduced", "Largest mean of the five robots."),
]  # fmt: skip


def write_results(
    folder: Path,
    *,
    seeds: Sequence[int] = (0, 1, 2),
    epochs: int = 60,
    presets: Sequence[str] = ("paper", "service"),
    windows: int = 60,
) -> Path:
    """Write a whole made-up experiment into a folder and give the folder."""
    rng = np.random.default_rng(7)
    tables = study_tables(rng, windows)
    tables["epochs"] = learning_rows(rng, presets, seeds, epochs)
    tables["test"] = test_rows(rng, presets, seeds)
    tables["judges"] = judges_rows()
    for name, rows in tables.items():
        write_csv(folder / "data" / f"{name}.csv", rows)
    reflected = reflection_rows(rng, presets, seeds, epochs)
    write_csv(folder / "data" / "reflection.csv", reflected, REFLECTION)
    write_csv(
        folder / "results.csv",
        [
            {"preset": row["preset"], "arm": row["arm"], "seed": row["seed"]}
            | {"metric": "total", "value": row["total"]}
            for row in tables["test"]
        ],
    )
    names = ("id", "claim", "paper", "ours", "ci95", "status", "evidence")
    claims = [
        dict(zip(names, claim, strict=True)) | {"seeds": len(seeds)} for claim in CLAIMS
    ]  # fmt: skip
    (folder / "claims.json").write_text(json.dumps(claims), encoding="utf-8")
    manifest = {
        "version": "0.1.0",
        "created": "2026-11-20T12:00:00Z",
        "command": "evenhand reproduce --out out/reproduce",
        "settings": {"tau": [1, 1, 1, 1], "lambda": 0.5, "learning": {"gamma": 0.99}},
        "versions": {"python": "3.11.7", "mujoco": "4.0.0", "jax": "0.10.1"},
        "seeds": list(seeds),
        "eval_services": 3000,
        "epochs": epochs,
        "people": 30,
        "elapsed_s": 312.4,
        "population": "uniform",
        "stages": {"study": 41.2, "learning": 240.0, "test": 31.2},
    }
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    return folder


@pytest.fixture
def experiment(tmp_path: Path) -> Callable[..., Path]:
    """A function that writes a made-up experiment and gives its folder."""
    return lambda **options: write_results(tmp_path / "experiment", **options)


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a made-up experiment with its report; tests only read it."""
    from evenhand.experiments.paper.report.build import build

    folder = write_results(
        tmp_path_factory.mktemp("built") / "experiment", seeds=(0, 1), epochs=12, windows=20
    )
    assert build(folder) == folder / "report.html"
    return folder
