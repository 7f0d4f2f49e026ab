"""Results → a folder with the page and its figures: the one entry of command line and Python."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from eaid.errors import UsageError
from eaid.files import all_written_whole
from eaid.options import ReportOptions
from eaid.report.catalogue import FIGURES
from eaid.report.draw import chosen, draw_all, formats_of, mark_of
from eaid.report.page.render import page
from eaid.report.pictures import summary_pictures
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
    missing: tuple[tuple[str, str], ...]
    """Figures left out, and the command that makes what they need."""


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
    given = replace(results if isinstance(results, Results) else gathered(results), paper=options.paper)
    folder = Path(output_dir)
    formats, rows = formats_of(options.format), chosen(options.figures)
    refuse_to_overwrite_report(folder, force)
    mark = mark_of(given)
    drawn = draw_all(given, rows, formats, done, mark[0] if mark else None)
    missing = [row for row in rows if row.made_by and row.name not in {one.name for one in drawn}]
    pictures = summary_pictures(given, mark[0] if mark else None)
    text = page(given, drawn, pictures, missing if not options.figures else ())
    contents = {f"{FOLDER}/{one.name}.{kind}": held for one in drawn for kind, held in one.files}
    contents[FILE] = text.encode("utf-8", errors="replace")
    for one in (folder, folder / FOLDER):
        one.mkdir(exist_ok=True)
    paths = [folder / name for name in contents]
    with all_written_whole(paths, force) as parts:
        for part, content in zip(parts, contents.values(), strict=True):
            part.write_bytes(content)
    for old in figures_in(folder):
        if old not in paths:
            old.unlink()
    return Report(folder / FILE, tuple(one.name for one in drawn), tuple((row.name, row.made_by) for row in missing))


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
