"""A figure of a report: what is drawn and its words; SVG, PDF and CSV of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from matplotlib.figure import Figure

from evenhand.core import files
from evenhand.report import style
from evenhand.report.read_tables import Results
from evenhand.report.table import Table, csv_text


@dataclass(frozen=True)
class Plate:
    """One figure: what is drawn, how, and its words.

    Attributes:
        name: of the files, and the anchor in the page.
        title: heading.
        paper: the figure of the paper that it corresponds to, or nothing.
        section: where it stands in the page.
        alt: what a reader who does not see it is told.
        data: the table drawn, from the results.
        draw: the figure, from that table alone; the flag asks for the wide layout.
        caption: the words under it: n, seeds, intervals.
        half: whether it needs only half the width of a laptop page.
    """

    name: str
    title: str
    paper: str
    section: Literal["learning", "detector", "study", "robots"]
    alt: str
    data: Callable[[Results], Table]
    draw: Callable[[Table, bool], Figure]
    caption: Callable[[Results, Table], str]
    half: bool = False


@dataclass(frozen=True)
class Drawn:
    """A figure that was drawn.

    Attributes:
        plate: which one.
        data: the table drawn.
        caption: the words under it.
        svg: the wide layout as a file.
        narrow_svg: the layout for a phone; None where one layout serves both.
        pdf: the wide layout as a file.
        csv: the table drawn as a file.
    """

    plate: Plate
    data: Table
    caption: str
    svg: str
    narrow_svg: str | None
    pdf: bytes
    csv: str


def draw(plate: Plate, results: Results) -> Drawn:
    """Draw one figure in both layouts; the same results give the same bytes."""
    data = plate.data(results)
    with style.drawing():
        wide = plate.draw(data, True)
        svg, pdf = style.svg_text(wide, plate.name), style.pdf_bytes(wide)
        narrow = None
        if not plate.half:
            narrow = style.svg_text(plate.draw(data, False), f"{plate.name}-narrow")
    return Drawn(plate, data, plate.caption(results, data), svg, narrow, pdf, csv_text(data))


def write(folder: Path, drawn: Sequence[Drawn]) -> list[Path]:
    """Write figures as SVG (wide and for a phone), PDF and CSV.

    Returns:
        The files.
    """
    written = []
    for figure in drawn:
        base = folder / figure.plate.name
        contents = {
            base.with_suffix(".svg"): figure.svg.encode(),
            base.with_suffix(".pdf"): figure.pdf,
            base.with_suffix(".csv"): figure.csv.encode(),
        }
        if figure.narrow_svg is not None:
            contents[base.with_name(f"{base.name}-narrow.svg")] = figure.narrow_svg.encode()
        for path, content in contents.items():
            files.write_bytes(path, content)
        written += list(contents)
    return written
