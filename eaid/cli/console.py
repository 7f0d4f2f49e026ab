"""What users see: results on stdout; messages, findings and progress on stderr.

Where a stream is no terminal there is no animation, no colour and no wrapping: one message, one line. What comes from
logs (names, units) is text: control and direction-changing characters are shown, never obeyed.
"""

import contextlib
import os
import shutil
import sys
import time
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from eaid.errors import on_command_line

if TYPE_CHECKING:
    from pathlib import Path

    from eaid.findings import Finding
    from eaid.report.tables.table import Table

MOST_FINDINGS = 3
"""Findings that are told by default; `--verbose` tells all."""
PREFIX = {"stop": "stop", "caution": "warning", "note": "note"}
COLOUR = {"error": "1;31", "stop": "1;31", "warning": "33", "note": "36"}
EVERY_S = 5.0
"""Where there is no terminal, a line of progress comes at most this often [s]."""

_quiet = False


def be_quiet(quiet: bool) -> None:
    """Hold back messages, progress and tables (`-q`); errors and `--json` are still told."""
    global _quiet
    _quiet = quiet


def safe(text: str) -> str:
    """A text without power over the terminal: control, direction and line-breaking characters as `\\x1b`."""
    return "".join(
        c if unicodedata.category(c) not in ("Cc", "Cf", "Cs", "Zl", "Zp") else c.encode("unicode_escape").decode()
        for c in text
    )


def say(message: str) -> None:
    """Tell the user something, on stderr."""
    if not _quiet:
        print(safe(message), file=sys.stderr)


def warn(message: str) -> None:
    """Tell the user what to doubt, on stderr."""
    if not _quiet:
        _mark("warning", message)


def fail(message: str) -> None:
    """Say why the command ends, on stderr, quiet or not."""
    _mark("error", message)


def tell(findings: "Iterable[Finding]", verbose: bool = False) -> None:
    """The findings as sentences, the gravest first and those of one code as one.

    Three of them unless `verbose`, and all that say how data were changed: nothing is mended in silence.
    """
    if _quiet:
        return
    from eaid.findings import merged, ranked
    from eaid.findings import say as sentence
    from eaid.findings.sentences import SENTENCES

    found = ranked(merged(tuple(findings)))
    always = {code for code, row in SENTENCES.items() if row.always}
    shown = [one for k, one in enumerate(found) if verbose or k < MOST_FINDINGS or one.code in always]
    for one in shown:
        _mark(PREFIX[one.severity], on_command_line(sentence(one)))
    if len(found) > len(shown):
        say(f"and {len(found) - len(shown)} more: --verbose shows all")


def _mark(kind: str, message: str) -> None:
    colour = COLOUR[kind] if sys.stderr.isatty() and not os.environ.get("NO_COLOR") else ""
    head = f"\x1b[{colour}m{kind}:\x1b[0m" if colour else f"{kind}:"
    print(head, safe(message), file=sys.stderr)


@contextlib.contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[], None]]:
    """Yield a function to call once per finished piece; a bar on a terminal, now and then a line elsewhere."""
    if _quiet or total <= 1:
        yield lambda: None
    elif not sys.stderr.isatty():
        yield _lines(label, total)
    else:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn(label, markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(label, total=total)
            yield lambda: bar.advance(task)


def _lines(label: str, total: int) -> Callable[[], None]:
    done, told = 0, time.monotonic()
    say(f"{label}: {total} to do")

    def advance() -> None:
        nonlocal done, told
        done += 1
        if time.monotonic() - told >= EVERY_S:
            told = time.monotonic()
            say(f"{label}: {done} of {total}")

    return advance


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table on stdout, numbers to the right.

    On a terminal too narrow for it the columns follow one another in blocks, each headed by the first column, and a
    long text in the last column is wrapped between words.
    """
    if not _quiet:
        width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
        print("\n".join([safe(title), *aligned([[safe(cell) for cell in row] for row in [columns, *rows]], width)]))


def show(made: "Table") -> None:
    """Print a table of the report, its caption behind the heading."""
    table(f"{made.heading}. {made.caption}".rstrip(), made.heads, made.texts)


def aligned(rows: Sequence[Sequence[str]], width: int | None = None) -> list[str]:
    """The lines of a table, its first row the heading; None: as wide as it is."""
    right = [all(_is_number(row[i]) for row in rows[1:]) and i > 0 for i in range(len(rows[0]))]
    lines: list[str] = []
    for block in _blocks(rows, width):
        own = [[row[i] for i in block] for row in rows]
        lines += _block(own, [right[i] for i in block], width)
    return lines


def _blocks(rows: Sequence[Sequence[str]], width: int | None) -> list[list[int]]:
    """Which columns stand together, the first in every block."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    blocks: list[list[int]] = [[0]]
    for i in range(1, len(widths)):
        least = min(widths[i], 24) if i == len(widths) - 1 else widths[i]  # the last one may be wrapped
        if width is not None and len(blocks[-1]) > 1 and sum(widths[k] + 2 for k in blocks[-1]) + least > width:
            blocks.append([0])
        blocks[-1].append(i)
    return blocks


def _block(rows: list[list[str]], right: list[bool], width: int | None) -> list[str]:
    import textwrap

    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    before = sum(w + 2 for w in widths[:-1])
    room = None if width is None or len(widths) == 1 else max(width - before, 16)
    lines: list[str] = []
    for row in rows:
        cells = [
            cell.rjust(w) if to_right else cell.ljust(w) for cell, w, to_right in zip(row, widths, right, strict=True)
        ]
        last = (
            [cells[-1]] if room is None or right[-1] else textwrap.wrap(row[-1], room, break_long_words=False) or [""]
        )
        lines.append("  ".join([*cells[:-1], last[0]]).rstrip())
        lines += [" " * before + more for more in last[1:]]
    return lines


def _is_number(text: str) -> bool:
    """Whether a cell counts as a number for its column: a number, with a unit or % behind it, an interval or a dash."""
    head = text.split(" ")[0].rstrip("%").replace("−", "-")
    if head in ("", "-", "–", "…"):
        return True
    try:
        float(head)
    except ValueError:
        return False
    return True


def done(path: "Path", what: str, after: str) -> None:
    """The closing line: the file, what it holds, and what to do next."""
    say(f"{path}: {what}; next: {after}")


def number(value: float | None, digits: int = 4) -> str:
    """A number for a table; a dash where there is none."""
    return "–" if value is None else f"{value:.{digits}g}".replace("-", "−")


def line(text: str) -> None:
    """Print one line of a result on stdout, under its table."""
    if not _quiet:
        print(safe(text))


def print_json(result: dict[str, object]) -> None:
    """Print a result, machine-readable, on stdout."""
    from eaid.results.codec import text_of

    sys.stdout.write(text_of(result))
