"""The page of a sweep, from made-up tables."""

import json
import re
from pathlib import Path

import pytest

from evenhand.experiments.comparison.read import SCHEMAS
from evenhand.experiments.sweep import page as sweep_page
from support.compared import write_csv
from support.refusals import refused

RUNS = (
    "variant", "scenario", "algorithm", "arm", "seed", "state", "attempts", "seconds", "reason",
    "folder",
)  # fmt: skip
METRICS = {
    "corrected_total": 0.25, "raw_total": 1.5, "perfect_rate": 0.875, "worst_group_rate": 0.5,
    "biased_epochs": 12.0,
}  # fmt: skip


def run(seed: int, state: str = "done", **more: object) -> dict[str, object]:
    head = {"variant": "clip=0.3", "scenario": "tips", "algorithm": "ppo", "arm": "levelup@2"}
    return (
        head | {"seed": seed, "state": state, "attempts": 1, "seconds": 2.5, "folder": "x"} | more
    )


@pytest.fixture
def folder(tmp_path) -> Path:
    lost = {"attempts": 3, "seconds": "", "reason": "<gone> & lost"}
    runs = [run(0), run(1, attempts=2), run(2, "failed", **lost)]
    write_csv(tmp_path / "runs.csv", RUNS, runs)
    summary = [
        {"variant": "clip=0.3", "scenario": place, "algorithm": "ppo", "arm": "levelup@2",
         "metric": metric, "iqm": value, "low": value, "high": value, "seeds": 2}
        for place in ("tips", "all")
        for metric, value in METRICS.items()
    ]  # fmt: skip
    write_csv(tmp_path / "summary.csv", ("variant", *SCHEMAS["summary"]), summary)
    (tmp_path / "manifest.json").write_text(
        json.dumps(
            {
                "version": "0.1.0", "created": "2026-01-02T03:04:05+00:00", "commit": None,
                "command": "evenhand sweep x.toml", "versions": {"jax": "1"}, "runs": 3,
                "failed": 1, "variants": {"clip=0.3": {"epochs": 40, "clip": 0.3}},
                "workers": 2, "run_seconds": 65.0, "elapsed_s": 4.0,
            }
        )
    )  # fmt: skip
    return tmp_path


def text_of(page: Path) -> str:
    return " ".join(re.sub(r"<[^>]+>", " ", page.read_text()).split())


def test_failed_runs_stand_first_with_their_reasons(folder):
    page = sweep_page.build(folder)
    assert page == folder / "report.html"
    text = text_of(page)
    assert "Runs 3 Done 2 Failed 1 Variants 1 Computing 1 min 5 s" in text
    assert "clip=0.3 tips, ppo, levelup@2, seed 2 3 &lt;gone&gt; &amp; lost" in text
    assert "1 run lost a process" in text


def test_every_arm_of_a_variant_with_its_numbers(folder):
    text = text_of(sweep_page.build(folder))
    assert "epochs 40, clip 0.3" in text
    line = text[text.index("level-up, strength 2, PPO") :][:150]
    assert re.findall(r"[\d.]+(?: %)?", line)[:4] == ["2", "2", "0.250", "0.250"]
    assert "87.5 %" in line
    assert "12.00 of 40 [" in line  # biased epochs, of how many
    assert text.count("level-up, strength 2, PPO") == 1  # the pooled rows are of its own report
    assert 'href="variants/clip%3D0.3/report.html"' in (folder / "report.html").read_text()


def test_what_one_variant_changes_is_said_of_all(folder):
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["variants"] |= {"default": {"epochs": 40}, "gamma=0.9": {"epochs": 40, "gamma": 0.9}}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    text = text_of(sweep_page.build(folder))
    assert "epochs 40, clip 0.3, gamma by default." in text
    assert "epochs 40, clip by default, gamma by default." in text
    assert "epochs 40, clip by default, gamma 0.9." in text


def test_without_failures_none_are_spoken_of(folder):
    write_csv(folder / "runs.csv", RUNS, [run(0), run(1)])
    manifest = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps(manifest | {"failed": 0}))
    text = text_of(sweep_page.build(folder))
    assert "Failed runs" not in text
    assert "lost a process" not in text


def test_without_any_result(folder):
    write_csv(folder / "summary.csv", ("variant", *SCHEMAS["summary"]), [])
    manifest = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps(manifest | {"variants": {}}))
    assert "No run has ended, so there is nothing to show." in text_of(sweep_page.build(folder))


def test_what_is_damaged_is_named(folder):
    (folder / "runs.csv").write_text("variant,seed\nx,1\n")
    with refused("missing scenario", "runs.csv", "'scenario'"):
        sweep_page.build(folder)
