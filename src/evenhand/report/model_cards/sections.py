"""What the cards of robots and of detectors have in common."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from evenhand import __version__
from evenhand.core.errors import InputError
from evenhand.report.model_cards import markdown

LIBRARY = "evenhand"
NO_LICENCE = "unknown"
"""What Hugging Face calls a licence that nobody has stated."""

NOT_KNOWN = "not known"
_LICENCE = re.compile(r"[a-z0-9][a-z0-9.-]*")

CITATION = """\
@inproceedings{zhu2024fairness,
  title     = {Fairness-Sensitive Policy-Gradient Reinforcement Learning for Reducing Bias in
               Robotic Assistance},
  author    = {Zhu, Jie and Hu, Mengsha and Liang, Xueyao and Zhang, Amy and Jin, Ruoming and
               Liu, Rui},
  booktitle = {33rd IEEE International Conference on Robot and Human Interactive Communication
               (RO-MAN)},
  year      = {2024},
  doi       = {10.1109/RO-MAN60168.2024.10731257}
}"""


@dataclass(frozen=True)
class Said:
    """What only its maker can say; all of it is shown as text, never as markup.

    Attributes:
        name: what the model is called.
        licence: identifier of its licence, as Hugging Face spells it; None if it is not stated.
        notes: anything else.
    """

    name: str
    licence: str | None = None
    notes: str = ""

    def __post_init__(self) -> None:
        if not markdown.plain(self.name):
            raise InputError("empty name", "the name of the card is empty: give the model a name")
        if self.licence is not None and not _LICENCE.fullmatch(self.licence):
            raise InputError(
                "unknown licence",
                f"licence is {self.licence!r}: give its identifier as Hugging Face spells it, such "
                "as apache-2.0",
            )


def front(
    said: Said, pipeline: str, tags: list[str], results: list[dict[str, object]]
) -> dict[str, object]:
    """Front matter; a model index only where something was measured, as Hugging Face wants it."""
    name = markdown.plain(said.name)
    return {
        "license": said.licence or NO_LICENCE,
        "library_name": LIBRARY,
        "pipeline_tag": pipeline,
        "tags": [LIBRARY, "fairness", "human-robot-interaction", *tags],
        "model-index": [{"name": name, "results": results}] if results else None,
    }


def head(said: Said, what: str) -> str:
    """Title, what it is, and the notes of its maker."""
    parts = [f"# {markdown.words(said.name)}", what]
    if markdown.plain(said.notes):
        parts.append(f"Notes of its maker: {markdown.words(said.notes)}")
    if said.licence is None:
        parts.append("Licence: not stated. Ask its maker before you use it.")
    return "\n\n".join(parts)


def versions(found: Mapping[str, str]) -> str:
    """Versions that it was made with, and that wrote the card."""
    rows = [[markdown.words(name), markdown.words(number)] for name, number in found.items()]
    made = markdown.table(["package", "version"], rows) if rows else f"Made with: {NOT_KNOWN}."
    return f"## Versions\n\n{made}\n\nThe card was written by Evenhand {__version__}."


def citation() -> str:
    """Whose method it is."""
    return (
        "## Citation\n\nThe method is that of the paper below, as Evenhand implements it.\n\n"
        f"{markdown.code(CITATION, 'bibtex')}"
    )
