"""What users see: results on stdout; messages, findings and progress on stderr.

Where a stream is no terminal there is no animation, no colour and no wrapping: one message, one line. What comes from
logs (names, units) is text: control and direction-changing characters are shown, never obeyed.
"""

import contextlib
import itertools
import os
import shlex
import shutil
import sys
import textwrap
import threading
import time
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextvars import ContextVar
from typing import TYPE_CHECKING, TextIO

from eaid.errors import on_command_line

if TYPE_CHECKING:
    from pathlib import Path

    from eaid.findings import Finding
    from eaid.report.tables import Table


def _letters(text: str) -> int:
    """Letters that a text takes on a line: combining marks take none."""
    return sum(not unicodedata.combining(letter) for letter in text)


def aligned(rows: Sequence[Sequence[str]], numeric: Sequence[bool], width: int | None) -> list[str]:
    """The lines of a table, its first row the heading; None: as wide as it is.

    On a narrower terminal cells are broken between words, and where no words are left each row becomes a sentence.
    """
    columns = list(zip(*rows, strict=True))
    widths = [max(map(_letters, column)) for column in columns]
    least = [max(_letters(word) for cell in column for word in cell.split(" ")) for column in columns]
    over = 0 if width is None else sum(widths) + 2 * (len(widths) - 1) - width
    if over > sum(widths) - sum(least):
        heads, *others = rows
        pairs = ([" ".join(pair).strip() for pair in zip(heads, row, strict=True) if pair[1] != "–"] for row in others)
        return [
            part
            for row in pairs
            for part in textwrap.wrap(" · ".join(row), width or 0, subsequent_indent="  ", break_on_hyphens=False)
        ]
    for _ in range(over):
        widest = max((k for k in range(len(widths)) if widths[k] > least[k]), key=lambda k: widths[k])
        widths[widest] -= 1
    lines = []
    for row in rows:
        sizes = (size + len(cell) - _letters(cell) for cell, size in zip(row, widths, strict=True))
        cells = [textwrap.wrap(cell, size, break_on_hyphens=False) for cell, size in zip(row, sizes, strict=True)]
        for parts in itertools.zip_longest(*cells, fillvalue=""):
            pads = [" " * (size - _letters(part)) for part, size in zip(parts, widths, strict=True)]
            padded = (p + s if right else s + p for s, p, right in zip(parts, pads, numeric, strict=True))
            lines.append("  ".join(padded).rstrip())
    return lines


COLOUR = {"error": "1;31", "stop": "1;31", "warning": "33", "note": "36"}
EVERY_S = 3.0  # Where there is no terminal, a line of progress comes this often [s]

# Whether messages, progress and tables are held back (`-q`); errors and `--json` are still told
QUIET: ContextVar[bool] = ContextVar("quiet", default=False)


@contextlib.contextmanager
def hushed(quiet: bool) -> Iterator[None]:
    """Quiet or not within a block; what is set there ends with it."""
    before = QUIET.set(quiet)
    try:
        yield
    finally:
        QUIET.reset(before)


def safe(text: str) -> str:
    """A text without power over the terminal: control, direction and line-breaking characters as `\\x1b`."""
    return "".join(
        c if unicodedata.category(c) not in ("Cc", "Cf", "Cs", "Zl", "Zp") else c.encode("unicode_escape").decode()
        for c in text
    )


def wrapped(text: str, stream: TextIO) -> str:
    """A text in lines as wide as its terminal, broken between words only; as it is where there is none."""
    line = safe(text)
    width = _width_of(stream)
    if width is None or len(line) <= width:
        return line
    return "\n".join(textwrap.wrap(line, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False))


def _width_of(stream: TextIO) -> int | None:
    return shutil.get_terminal_size().columns if stream.isatty() else None


def speak(message: str) -> None:
    """Tell the user something, on stderr."""
    if not QUIET.get():
        print(wrapped(message, sys.stderr), file=sys.stderr)


def warn(message: str) -> None:
    """Tell the user the warnings, on stderr."""
    if not QUIET.get():
        _mark("warning", message)


def fail(message: str) -> None:
    """Say why the command ends, on stderr, quiet or not."""
    _mark("error", message)


def tell(findings: "Iterable[Finding]", verbose: bool = False) -> None:
    """The findings as sentences, the gravest first and those of one code as one.

    Three of them unless `verbose`, and all that say how data were changed: nothing is mended in silence.
    """
    if QUIET.get():
        return
    from eaid.findings import merged, ranked
    from eaid.findings import say as sentence
    from eaid.findings.finding import MOST_TOLD, WORD
    from eaid.findings.sentences import SENTENCES

    ordered = ranked(merged(tuple(findings)))
    always = {code for code, row in SENTENCES.items() if row.always}
    shown = [one for k, one in enumerate(ordered) if verbose or k < MOST_TOLD or one.code in always]
    for one in shown:
        _mark(WORD[one.severity], on_command_line(sentence(one)))
    if len(ordered) > len(shown):
        speak(f"and {len(ordered) - len(shown)} more: --verbose shows all")


def _mark(kind: str, message: str) -> None:
    line = wrapped(f"{kind}: {message}", sys.stderr)
    if sys.stderr.isatty() and not os.environ.get("NO_COLOR"):
        line = f"\x1b[{COLOUR[kind]}m{kind}:\x1b[0m" + line.removeprefix(f"{kind}:")
    print(line, file=sys.stderr)


@contextlib.contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[], None]]:
    """Yield a function to call once per finished piece; a bar on a terminal, now and then a line elsewhere.

    A total of 0: nobody knows how many pieces there are, or how long a single one takes.
    """
    total = 0 if total == 1 else total
    if QUIET.get():
        yield lambda: None
    elif not sys.stderr.isatty():
        with _progress_lines(label, total) as advance:
            yield advance
    else:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        columns = TextColumn(label, markup=False), BarColumn(), MofNCompleteColumn() if total else TimeElapsedColumn()
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(label, total=total or None)
            yield lambda: bar.advance(task)


@contextlib.contextmanager
def _progress_lines(label: str, total: int) -> Iterator[Callable[[], None]]:
    """A line every few seconds, however long a piece takes; the time, where nobody knows how many there are."""
    done, over, began = 0, threading.Event(), time.monotonic()

    def advance() -> None:
        nonlocal done
        done += 1

    def tell() -> None:
        while not over.wait(EVERY_S):
            spent = f"{done} done, " * (done > 0) + f"{time.monotonic() - began:.0f} s"
            speak(f"{label}: {done} of {total}" if total else f"{label}: {spent}")

    if total:
        speak(f"{label}: {total} to do")
    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield advance
    finally:
        over.set()
        teller.join()


def show(*parts: "Table | str") -> None:
    """Print lines and tables on stdout, captions behind their headings; nothing of a table without rows."""
    for part in () if QUIET.get() else parts:
        if isinstance(part, str):
            print(wrapped(part, sys.stdout))
        elif part.rows:
            cells = [[safe(cell) for cell in row] for row in (part.heads, *part.texts)]
            title = wrapped(f"{part.heading}. {part.caption}".rstrip(), sys.stdout)
            print("\n".join([title, *aligned(cells, part.numeric, _width_of(sys.stdout))]))


def done(path: "Path", what: str, after: "str | Sequence[str | Path | None]") -> None:
    """The closing line: the file, what it holds, and what to do next, a text or the words of a command of eaid."""
    words = after if isinstance(after, str) else shlex.join(["eaid", *(str(word) for word in after if word)])
    speak(f"{path}: {what}; next: {words}")


def print_json(result: object, kind: str = "") -> None:
    """Print a result, machine-readable, on stdout: as its file, where it is of a kind that has one."""
    from eaid.results.codec import dumps

    sys.stdout.write(dumps(result, kind))
