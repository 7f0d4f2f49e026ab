"""Results → a folder with the page and its figures: the one entry of command line and Python."""

import base64
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from eaid.errors import UsageError
from eaid.files import written_whole
from eaid.options import ReportOptions
from eaid.report import paper
from eaid.report.figures import FIGURES, Row
from eaid.report.live import live_of
from eaid.report.page import Drawn, page
from eaid.report.page.summary import mark_of, pictures
from eaid.report.panels import Sheet
from eaid.report.results import Given, Results, gathered
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay
from eaid.steps.stepset import StepSet

FILE, FOLDER = "report.html", "figures"


@dataclass(frozen=True)
class Report:
    """What was written."""

    page: Path
    figures: tuple[str, ...]


def write_report(
    results: "Results | Sequence[Fit | Gains | Replay | StepSet | Coupling | Given[object]]",
    output_dir: str | os.PathLike[str],
    options: ReportOptions | None = None,
    force: bool = False,
    done: Callable[[], None] = lambda: None,
) -> Report:
    """Write `output_dir`/report.html and `output_dir`/figures, all of it or nothing.

    Parameters
    ----------
    results
        Fits, gains, replays and step sets, from files (`read_results`) or from memory.
    output_dir
        Folder that is made where it is not there; its parent has to be.
    options
        Which figures, their formats, and whether published values stand beside them.
    force
        Write over a report.
    done
        Called after each figure.

    Raises
    ------
    UsageError
        Where the folder holds a report and `force` is not given, or an option names what is not there.
    """
    options = options or ReportOptions()
    given = results if isinstance(results, Results) else gathered(results)
    folder = Path(output_dir)
    rows = chosen(options.figures)
    refuse_to_overwrite_report(folder, force)
    mark = mark_of(given)
    contents: dict[str, bytes] = {}
    drawn: list[Drawn] = []
    for row in rows:
        if (sheet := row.sheet(given)) is not None:
            files, address, size = _drawn(sheet, mark[0] if mark and row.of_the_fit else None, options.format)
            contents |= {f"{FOLDER}/{row.name}.{kind}": content for kind, content in files.items()}
            title = row.title if given.of_paper else row.title.split(" · ")[-1]
            drawn.append(Drawn(row.name, title, row.sees, address, size, live_of(sheet)))
        done()
    shown = []
    for title, section, sheet in islice(pictures(given), 2):
        _files, address, size = _drawn(sheet, mark[0] if mark else None, dpi=200)
        shown.append(Drawn(section, title, f"More of it in the part {section}", address, size))
    text = page(given, drawn, shown)
    contents[FILE] = text.encode("utf-8", errors="replace")
    for one in (folder, folder / FOLDER):
        one.mkdir(exist_ok=True)
    paths = [folder / name for name in contents]
    with written_whole(*paths, force=force) as parts:
        for part, content in zip(parts, contents.values(), strict=True):
            part.write_bytes(content)
    for old in figures_in(folder):
        if old not in paths:
            old.unlink()
    return Report(folder / FILE, tuple(one.name for one in drawn))


def _drawn(
    sheet: Sheet, mark: str | None, formats: Sequence[str] = (), dpi: float = paper.DPI
) -> tuple[dict[str, bytes], str, tuple[int, int]]:
    """A figure in each format, as an address that holds it as PNG, and its size on the page [px]."""
    with paper.look():
        figure = paper.figure_of(sheet, mark or "")
        files = {"png": paper.png_of(figure, dpi)}
        files |= {kind: paper.vector_of(figure, kind) for kind in formats if kind != "png"}
        width, height = (round(96 * float(side)) for side in figure.get_size_inches())
    return files, "data:image/png;base64," + base64.b64encode(files["png"]).decode("ascii"), (width, height)


def chosen(names: Sequence[str]) -> tuple[Row, ...]:
    """The figures whose names begin with one of `names`; all without any; a name that fits none is refused."""
    if unknown := [name for name in names if not any(row.name.startswith(name) for row in FIGURES)]:
        known = ", ".join(row.name for row in FIGURES)
        raise UsageError(f"«figures» {','.join(unknown)}: no such figure; there are {known}")
    return tuple(row for row in FIGURES if not names or any(row.name.startswith(name) for name in names))


def refuse_to_overwrite_report(folder: Path, force: bool) -> None:
    """Leave an existing report alone, its figures too, unless the user says otherwise."""
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: is a file; give the report a folder with «output»")
    held = [folder / FILE] * (folder / FILE).exists() + figures_in(folder)
    if held and not force:
        raise UsageError(f"{held[0]}: exists already; give «force» to overwrite the report, or another «output»")


def figures_in(folder: Path) -> list[Path]:
    """Figures of a report that a folder holds."""
    names = {row.name for row in FIGURES}
    held = sorted((folder / FOLDER).glob("*")) if (folder / FOLDER).is_dir() else []
    return [path for path in held if path.suffix in (".png", ".pdf", ".svg") and path.stem in names]
