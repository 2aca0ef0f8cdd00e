"""The report: from the tables of an experiment to figures and one HTML file.

Takes: a folder with ``data/*.csv``, ``claims.json``, ``results.csv`` and ``manifest.json``.
Gives: ``figures/<name>.svg``, ``.pdf``, ``.csv`` and ``report.html`` in the same folder. The page
needs no network, no script and no other file. Nothing here simulates or learns.
"""

from pathlib import Path

from evenhand.core import files


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
    from evenhand.experiments.paper.report import figures
    from evenhand.experiments.paper.report import page as html
    from evenhand.experiments.paper.report import results as tables

    folder = Path(folder)
    results = tables.read(folder)
    where = files.make_folder(folder / "figures")  # what cannot be kept is not drawn
    drawn = figures.draw_all(results, workers)
    page = html.render(results, drawn)
    for figure in drawn:
        base = where / figure.plate.name
        files.write_text(base.with_suffix(".svg"), figure.svg)
        files.write_bytes(base.with_suffix(".pdf"), figure.pdf)
        files.write_text(base.with_suffix(".csv"), figure.csv)
    target = folder / "report.html"
    files.write_text(target, page)
    return target
