"""The model card of a detector: what its file says, and how good it is where that was measured."""

from evenhand.methods.paper.detector import Detector
from evenhand.methods.vocabulary import IDENTITIES, ISSUES, SIMULATED
from evenhand.report.model_cards import markdown, sections
from evenhand.report.model_cards.markdown import NOT_MEASURED, number, percent, words
from evenhand.report.model_cards.sections import Said
from evenhand.statistics.detector_accuracy import Evaluation, wilson


def render(said: Said, detector: Detector, evaluation: Evaluation | None) -> str:
    """The card.

    Args:
        said: what only its maker can say.
        detector: whose card it is.
        evaluation: on the judgements that it was fitted to, out of fold; None if not measured.
    """
    front = sections.front(
        said,
        "tabular-classification",
        [
            *(["simulated-respondents"] if detector.source == SIMULATED else []),
            "tabular-classification",
            "bias-detection",
            "logistic-regression",
        ],
        [] if evaluation is None else [_result(evaluation)],
    )
    parts = [
        sections.head(said, _what(detector)),
        _USES,
        _training(detector),
        _evaluation(evaluation),
        _kinds(detector, evaluation),
        _inside(detector),
        _limits(detector),
        _LOADING,
        _repeating(detector),
        sections.versions({}),
        sections.citation(),
    ]
    return markdown.front_matter(front) + "\n" + "\n\n".join(parts) + "\n"


def _result(found: Evaluation) -> dict[str, object]:
    metrics = [
        ("accuracy", "Accuracy, out of fold", found.accuracy.value),
        ("brier_score", "Brier score, out of fold", found.brier),
        ("agreement", "Agreement with the manual threshold 0.5", found.agreement.value),
    ]
    return {
        "task": {"type": "tabular-classification", "name": "Is a window of services biased?"},
        "dataset": {
            "type": "judgements",
            "name": f"{found.n} judgements by {found.source}",
        },
        "metrics": [
            {"type": kind, "name": name, "value": round(value, 6), "verified": False}
            for kind, name, value in metrics
        ],
    }


def _what(detector: Detector) -> str:
    issues = ", ".join(words(name) for name in detector.issues)
    return (
        f"A detector that says whether a window of services by a robot looks biased. It takes "
        f"{len(detector.issues)} issue scores of one identity ({issues}; Eq. 2 of the paper), "
        f"reduces them to {len(detector.components)} components and weighs these in a logistic "
        "regression (Eq. 3). It was fitted to "
        f"{detector.rows} judgements by {words(detector.source)}."
    )


_USES = """\
## Intended use

To judge services of a robot, window by window, in research and during training; and to point at
logs that deserve an audit with tests and intervals (`evenhand audit`).

## Uses it is not for

- Judging people, or a single service. It sees rates of groups and nothing else.
- A verdict for a court, an authority or a label. It repeats what its respondents found biased,
  and knows no chance: small windows look uneven by chance alone.
- Other issues, other thresholds or other windows than those that were judged."""


def _training(detector: Detector) -> str:
    rows = [
        ["judgements", str(detector.rows)],
        ["by", words(detector.source)],
        ["identities judged", ", ".join(words(name) for name in detector.identities)],
        ["issues", ", ".join(words(name) for name in detector.issues)],
        ["seed", "none" if detector.seed is None else str(detector.seed)],
    ]
    simulated = (
        "\n\nThe respondents are simulated: their answers are an assumption about people, written "
        "as a program, and no finding about them."
        if detector.source == SIMULATED
        else "\n\nWho the respondents were, and how they were asked, belongs in the notes."
    )
    return f"## Training data\n\n{markdown.table(['what', 'value'], rows)}{simulated}"


def _evaluation(found: Evaluation | None) -> str:
    if found is None:
        return f"## Evaluation\n\nAccuracy on judgements that it had not seen: {NOT_MEASURED}."
    rows = [
        ["accuracy", percent(found.accuracy)],
        ["always the more frequent answer", f"{100 * found.baseline:.1f} %"],
        ["accuracy of the manual threshold 0.5", percent(found.manual_accuracy)],
        ["agreement with the manual threshold", percent(found.agreement)],
        ["Brier score", number(found.brier)],
    ]
    bins = [
        [f"{one.start:.1f} to {one.stop:.1f}", number(one.predicted), percent(one.observed)]
        for one in found.calibration
    ]
    return (
        f"## Evaluation\n\n{found.n} judgements by {words(found.source)}, {found.folds} folds; "
        "each was judged by a detector that had not seen it. Intervals are 95 % (Wilson); they "
        "take judgements as independent and are somewhat too narrow.\n\n"
        f"{markdown.table(['measure', 'value (95 % interval)'], rows)}\n\n"
        "Calibration:\n\n"
        f"{markdown.table(['predicted', 'mean', 'judged biased (95 % interval)'], bins)}"
    )


def _kinds(detector: Detector, found: Evaluation | None) -> str:
    title = "## Groups: which discrimination it looks like\n\n"
    if not detector.kinds:
        return f"{title}The respondents named no discrimination, so it names none."
    if found is None or not found.kind_names:
        names = ", ".join(words(name) for name in detector.kinds)
        return f"{title}It tells {names} apart. How well, by discrimination: {NOT_MEASURED}."
    rows = [
        [words(name), percent(wilson(int(found.confusion[k, k]), int(found.confusion[k].sum())))]
        for k, name in enumerate(found.kind_names)
    ]
    return (
        f"{title}How often the discrimination that people named is the likeliest to it, out of "
        f"fold.\n\n{markdown.table(['named', 'found (95 % interval)'], rows)}"
    )


def _inside(detector: Detector) -> str:
    rows = [
        [words(name), number(detector.mean[i]), number(detector.scale[i])]
        for i, name in enumerate(detector.issues)
    ]
    weights = ", ".join(number(weight) for weight in detector.weights)
    return (
        "## What is inside\n\nPlain numbers, no pickle.\n\n"
        f"{markdown.table(['issue', 'mean', 'standard deviation'], rows)}\n\n"
        f"Logistic weights of the components: {weights}; intercept {number(detector.bias)}. A "
        f"probability above {number(detector.threshold, places=2)} is called biased."
    )


def _limits(detector: Detector) -> str:
    whose = "simulated respondents" if detector.source == SIMULATED else "its respondents"
    return f"""\
## Limits and ethics

- It holds the opinion of {whose}. Others, elsewhere, may find other things biased.
- It cannot tell chance from unevenness. Read it beside the score that chance alone gives.
- It judges gaps between groups, whichever group is worse off; it says nothing of causes.
- Identities of people in a log are sensitive data: collect them with consent, or not at all."""


_LOADING = "## How to load it\n\n" + markdown.code(
    "import evenhand\n\n"
    'detector = evenhand.load_detector("DETECTOR.json")\n'
    "scores = [0.5] * len(detector.issues)  # of one identity, in the order of detector.issues\n"
    "detector.judge(scores), detector.probability(scores), detector.looks_like(scores)",
    "python",
)


def _repeating(detector: Detector) -> str:
    papers = detector.issues == ISSUES and detector.identities == IDENTITIES
    block = _command(detector) if papers else _python(detector)
    return f"## How to repeat it\n\nThe same answers give the same detector.\n\n{block}"


def _command(detector: Detector) -> str:
    seed = "" if detector.seed is None else f" --seed {detector.seed}"
    source = ' --source "simulated respondents"' if detector.source == SIMULATED else ""
    line = f"evenhand detect fit --answers ANSWERS.csv --out DETECTOR.json{source}{seed}"
    return markdown.code(line, "sh")


def _python(detector: Detector) -> str:
    """For issues or identities of one's own, which the command line cannot name."""
    kinds = f", discriminations={detector.kinds!r}" if detector.kinds else ""
    return markdown.code(
        "from evenhand.methods import detector_file\n"
        "from evenhand.methods.paper import detector\n\n"
        f"issues = {detector.issues!r}\n"
        f'answers = detector_file.read_answers("ANSWERS.csv", issues=issues{kinds})\n'
        "found = detector.fit(\n"
        "    answers.issue_scores, answers.biased, answers.kinds,\n"
        f"    source={detector.source!r}, seed={detector.seed},\n"
        f"    issues=issues, identities={detector.identities!r},\n"
        ")\n"
        'detector_file.save(found, "DETECTOR.json")',
        "python",
    )
