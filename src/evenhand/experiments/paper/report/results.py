"""The results of the paper's experiment, read from its folder and checked."""

from pathlib import Path
from typing import Any

from evenhand.core.errors import InputError
from evenhand.methods.vocabulary import ISSUES
from evenhand.report.read_tables import Results, read_json, read_table


def _schema(text: str) -> dict[str, str]:
    """``"name:kind name:kind"`` as a mapping; ``{scores}`` and ``{interval}`` stand for columns."""
    scores = " ".join(f"{name}:number?" for name in ("total", *ISSUES))
    text = text.format(scores=scores, interval="ci_low:number? ci_high:number?")
    return {name: kind for name, _, kind in (pair.partition(":") for pair in text.split())}


REPRODUCED, CALIBRATED, CONTRADICTED, EQUIVALENT, OPEN, UNTESTED = STATUSES = (
    "reproduced",
    "reproduced by calibration",
    "contradicted",
    "no effect",
    "open",
    "not testable",
)


SCHEMAS: dict[str, dict[str, str]] = {
    "questionnaire": _schema(
        "scenario:text scenario_name:text identity:text share:share count:int respondents:int "
        "paper_share:share?"
    ),
    "questionnaire_issue": _schema(
        "scenario:text scenario_name:text issue:text share:share count:int"
    ),
    "judgements": _schema(
        "window:text robot:text strength:number respondent:text shown:text? biased:flag "
        "identity:text? issue:text? {scores}"
    ),
    "signatures": _schema(
        "discrimination:text issue:text paper:number? ours:number? {interval} windows:int "
        "ceiling:number?"
    ),
    "calibration": _schema("bin:text predicted:share? observed:share? {interval} n:int"),
    "confusion": _schema("judged:text predicted:text count:int"),
    "detector": _schema("metric:text value:number? {interval} n:int"),
    "epochs": _schema(
        "preset:text algorithm:text guided:flag arm:text seed:int epoch:int {scores} "
        "biased_detector:flag? biased_threshold:flag? probability:share? perfect_rate:share? "
        "response_rate:share? mean_response_distance:number? mean_response_step:number?"
    ),
    "test": _schema(
        "preset:text arm:text seed:int services:int {scores} perfect_rate:share? "
        "response_rate:share? mean_response_distance:number? mean_response_time:number? "
        "worst_group_rate:share? floor:number?"
    ),
    "behaviour": _schema(
        "robot:text measure:text value:number? {interval} paper:number? unit:text? services:int"
    ),
    "judges": _schema(
        "judge:text measure:text bin:text? predicted:share? value:share? {interval} n:int"
    ),
    "reflection": _schema(
        "preset:text arm:text seed:int epoch:int projection:number? cosine:number? z:number? "
        "p_value:share alarm:flag identity:text? issue:text? favoured:text? earlier:int rate:share"
    ),
    "tsne": _schema("window:text kind:text biased:flag x:number y:number z:number"),
}


RESULTS = _schema("preset:text? arm:text? seed:text? metric:text value:number?")


KEYS: dict[str, tuple[str, ...]] = {
    "questionnaire": ("scenario", "identity"),
    "questionnaire_issue": ("scenario", "issue"),
    "signatures": ("discrimination", "issue"),
    "calibration": ("bin",),
    "confusion": ("judged", "predicted"),
    "detector": ("metric",),
    "epochs": ("preset", "arm", "seed", "epoch"),
    "test": ("preset", "arm", "seed"),
    "behaviour": ("robot", "measure"),
    "judges": ("judge", "measure", "bin"),
    "reflection": ("preset", "arm", "seed", "epoch"),
}


MAY_BE_EMPTY = ("reflection",)
"""Tables of what only some arms do."""


def read(folder: Path) -> Results:
    """Read and check everything that a report needs.

    Raises:
        InputError: a file is missing or malformed; the sentence names file, row and column.
            Rows are counted as an editor shows them: the header is row 1.
    """
    if not folder.is_dir():
        raise InputError(
            "missing folder", f"{folder} is not a folder: give the folder of an experiment"
        )
    manifest = _manifest(folder / "manifest.json")
    claims = _claims(folder / "claims.json")
    read_table(folder / "results.csv", RESULTS)
    tables = {
        name: read_table(
            folder / "data" / f"{name}.csv", schema, KEYS.get(name, ()), name in MAY_BE_EMPTY
        )
        for name, schema in SCHEMAS.items()
    }
    return Results(tables, manifest, claims)


_MANIFEST: dict[str, type | tuple[type, ...]] = {
    **dict.fromkeys(("version", "created", "command", "population"), str),
    **dict.fromkeys(("settings", "versions", "stages"), dict),
    **dict.fromkeys(("eval_services", "epochs", "people"), int),
    "seeds": list,
    "elapsed_s": (int, float),
}


def _manifest(path: Path) -> dict[str, Any]:
    manifest = read_json(path)
    if not isinstance(manifest, dict):
        raise InputError(
            "type file", f"{path} must hold one JSON object with {', '.join(_MANIFEST)}"
        )
    for field, kind in _MANIFEST.items():
        if field not in manifest:
            raise InputError(
                f"missing {field}", f"{path}: field {field!r} is missing; run the experiment again"
            )
        if not isinstance(manifest[field], kind):
            raise InputError(
                f"type {field}",
                f"{path}: field {field!r} is {manifest[field]!r}, of a wrong type",
            )
    return manifest


_CLAIM = ("id", "claim", "paper", "ours", "ci95", "seeds", "status", "evidence")


def _claims(path: Path) -> list[dict[str, Any]]:
    claims = read_json(path)
    if not isinstance(claims, list) or not claims:
        raise InputError("type file", f"{path} must hold a JSON list with at least one claim")
    for number, claim in enumerate(claims, start=1):
        where = f"{path}: claim {number}"
        if not isinstance(claim, dict):
            raise InputError("type file", f"{where} is not an object with {', '.join(_CLAIM)}")
        for field in _CLAIM:
            if field not in claim:
                raise InputError(
                    f"missing {field}",
                    f"{where}: field {field!r} is missing; write it, null if unknown",
                )
        for field in ("id", "claim", "evidence"):
            if not isinstance(claim[field], str):
                raise InputError(
                    f"type {field}", f"{where}: field {field!r} is {claim[field]!r}; write a text"
                )
        if claim["status"] not in STATUSES:
            raise InputError(
                "unknown status",
                f"{where}: status is {claim['status']!r}; choose one of {', '.join(STATUSES)}",
            )
        seeds = claim["seeds"]
        if isinstance(seeds, bool) or not isinstance(seeds, int | list | None):
            raise InputError(
                "type seeds", f"{where}: seeds is {seeds!r}; write a count, a list or null"
            )
        interval = claim["ci95"]
        if interval is not None and not (isinstance(interval, list) and len(interval) == 2):
            raise InputError(
                "type ci95", f"{where}: ci95 is {interval!r}; write [low, high] or null"
            )
    return claims
