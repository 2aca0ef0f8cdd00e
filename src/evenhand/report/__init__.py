"""The report: from the tables of an experiment to figures and one HTML file.

Takes: a folder with ``data/*.csv``, ``claims.json``, ``results.csv`` and ``manifest.json``.
Gives: ``figures/<name>.svg``, ``.pdf``, ``.csv`` and ``report.html`` in the same folder. The page
needs no network, no script and no other file. Nothing here simulates or learns.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from evenhand.errors import InputError

__all__ = ["build"]


def build(folder: Path | str, workers: int = 1) -> Path:
    """Draw every figure and write the report of an experiment.

    The same tables give the same bytes. Each file is written aside and renamed, so that a
    report which stands is whole.

    Args:
        folder: the folder of the experiment.
        workers: processes that draw figures; with 1 everything is drawn in this one.

    Returns:
        The path of ``report.html``.

    Raises:
        InputError: a table is missing or malformed (file, row and column are named), or the
            folder cannot be written.
    """
    # Imported here: who only asks for help should not wait for matplotlib.
    from evenhand.report import figures, html, inputs

    folder = Path(folder)
    results = inputs.read(folder)
    target = folder / "report.html"
    try:
        (folder / "figures").mkdir(exist_ok=True)  # before drawing: what cannot be kept is not made
        drawn = figures.draw_all(results, workers)
        page = html.render(results, drawn)
        for figure in drawn:
            base = folder / "figures" / figure.plate.name
            _write(base.with_suffix(".svg"), figure.svg.encode())
            _write(base.with_suffix(".pdf"), figure.pdf)
            _write(base.with_suffix(".csv"), figure.csv.encode())
        _write(target, page.encode())
    except OSError as error:
        raise InputError(
            f"{folder} cannot be written ({error.strerror}): free it or choose another folder"
        ) from None
    return target


def _write(path: Path, content: bytes) -> None:
    """Write a file aside and rename it."""
    handle, aside = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.chmod(aside, 0o644)
        os.replace(aside, path)
    except BaseException:
        os.unlink(aside)
        raise
