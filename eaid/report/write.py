"""Results → a folder with the page and its figures: the one entry of command line and Python."""

import base64
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path

from eaid.errors import UsageError
from eaid.files import written_whole
from eaid.options import ReportOptions
from eaid.progress import Progress, no_progress
from eaid.report import paper
from eaid.report.figures import CATALOGUE
from eaid.report.live import live_of
from eaid.report.page import Block, PageFigure, page, parts
from eaid.report.page.summary import mark_of, pictures
from eaid.report.panels import Sheet
from eaid.report.results import Results
from eaid.report.tables import Table
from eaid.shown import pandas

FILE, FOLDER = "report.html", "figures"


def write_report(
    given: Results, folder: Path, options: ReportOptions, force: bool = False, progress: Progress = no_progress
) -> tuple[Path, tuple[str, ...]]:
    """Write `folder`/report.html and `folder`/figures, all of it or nothing; the page, and the figures by name."""
    rows = tuple(row for row in CATALOGUE if not options.figures or row.name.startswith(options.figures))
    if unknown := [name for name in options.figures if not any(row.name.startswith(name) for row in rows)]:
        known = ", ".join(row.name for row in CATALOGUE)
        raise UsageError(f"«figures» {','.join(unknown)}: no such figure; there are {known}")
    refuse_to_overwrite_report(folder, force)
    mark = mark_of(given)
    contents: dict[str, bytes] = {}
    drawn: list[PageFigure] = []
    with progress("drawing figures", len(rows)) as done:
        for row in rows:
            if (sheet := row.sheet(given)) is not None:
                files, address, size = _drawn(sheet, mark[0] if mark and row.of_the_fit else "", options.format)
                contents |= {f"{FOLDER}/{row.name}.{kind}": content for kind, content in files.items()}
                title = row.title if given.of_paper else row.title.split(" · ")[-1]
                drawn.append(PageFigure(row.name, title, row.sees, address, size, live_of(sheet)))
            done()
    shown = []
    for title, section, sheet in islice(pictures(given), 2):
        _files, address, size = _drawn(sheet, mark[0] if mark else "", dpi=200)
        shown.append(PageFigure(section, title, f"More of it in the part {section}", address, size))
    if options.tables is not None:
        write_tables(options.tables, given, force)
    contents[FILE] = page(given, drawn, shown).encode("utf-8", errors="replace")
    for one in (folder, folder / FOLDER):
        one.mkdir(exist_ok=True)
    paths = [folder / name for name in contents]
    with written_whole(*paths, force=force) as parts:
        for part, content in zip(parts, contents.values(), strict=True):
            part.write_bytes(content)
    for old in files_in(folder):
        if old not in paths:
            old.unlink()
    return folder / FILE, tuple(one.name for one in drawn)


def write_tables(folder: Path, given: Results, force: bool) -> None:
    """Every table of the page as CSV, numbers whole, and as LaTeX, as the page shows it."""
    texts: dict[Path, str] = {}
    for table in tables_of_blocks(parts(given, {})):
        name = re.sub(r"[^a-z0-9]+", "-", table.heading.lower()).strip("-")
        again = sum(path.suffix == ".csv" and re.fullmatch(rf"{name}(-\d+)?", path.stem) is not None for path in texts)
        stem = f"{name}-{again + 1}" if again else name
        heads, rows = table.plain()
        texts[folder / f"{stem}.csv"] = pandas.DataFrame(rows, columns=heads).to_csv(index=False, lineterminator="\n")
        shown = pandas.DataFrame(list(table.texts), columns=list(table.heads))
        texts[folder / f"{stem}.tex"] = shown.to_latex(index=False, escape=True, caption=table.heading)
    folder.mkdir(exist_ok=True, parents=True)
    with written_whole(*texts, force=force) as paths:
        for path, text in zip(paths, texts.values(), strict=True):
            path.write_text(text, encoding="utf-8", errors="replace")


def tables_of_blocks(blocks: Iterable[Block]) -> Iterator[Table]:
    """The tables of some parts of the page and of what stands folded in them."""
    for block in blocks:
        yield from block.tables
        yield from tables_of_blocks(block.folds)


def _drawn(
    sheet: Sheet, mark: str, formats: Sequence[str] = (), dpi: float = paper.DPI
) -> tuple[dict[str, bytes], str, tuple[int, int]]:
    """A figure in each format, as an address that holds it as PNG, and its size on the page [px]."""
    with paper.look():
        figure = paper.figure_of(sheet, mark)
        files = {kind: paper.saved(figure, kind, dpi) for kind in ("png", *formats)}
        width, height = (round(96 * float(side)) for side in figure.get_size_inches())
    return files, "data:image/png;base64," + base64.b64encode(files["png"]).decode("ascii"), (width, height)


def refuse_to_overwrite_report(folder: Path, force: bool) -> None:
    """Leave an existing report alone, its figures too, unless the user says otherwise."""
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder}: is a file; give the report a folder with «output»")
    if (held := files_in(folder)) and not force:
        raise UsageError(f"{held[0]}: exists already; give «force» to overwrite the report, or another «output»")


def files_in(folder: Path) -> list[Path]:
    """The page and the figures of a report that a folder holds."""
    names = {f"{row.name}.{kind}" for row in CATALOGUE for kind in ("png", "pdf", "svg")}
    return [*folder.glob(FILE), *(path for path in sorted(folder.glob(f"{FOLDER}/*")) if path.name in names)]
