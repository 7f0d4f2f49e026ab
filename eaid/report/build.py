"""Result files → a folder with the page and its figures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from eaid.files import written_whole
from eaid.report.draw import draw_all, ready_figures
from eaid.report.mark import mark_of
from eaid.report.page import page
from eaid.report.results import Results

PAGE = "report.html"


@dataclass(frozen=True)
class Report:
    """What was written."""

    page: Path
    figures: tuple[str, ...]
    missing: tuple[tuple[str, str], ...]
    """Figures left out, and the command that makes what they need."""


def build(
    results: Results, folder: Path, formats: Sequence[str] = ("png",), done: Callable[[], None] = lambda: None
) -> Report:
    """Write `folder`/report.html and `folder`/figures; both folders are made where they are not there."""
    ready, missing = ready_figures(results)
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    mark = mark_of(results)
    drawn = draw_all(ready, folder / "figures", formats, done, mark[0] if mark else None)
    text = page(results, drawn, missing)
    with written_whole(folder / PAGE, force=True) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    named = tuple((row.name, row.made_by) for row in missing if row.made_by and row.section != "compare")
    return Report(folder / PAGE, tuple(one.row.name for one in drawn), named)
