"""What users see while a command works: messages and progress on stderr, results on stdout.

Where stderr is no terminal there is no animation, no colour and no wrapping: one message, one line.
"""

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import Any

_quiet = False


def be_quiet(quiet: bool) -> None:
    """Hold back messages, progress and tables (`-q`); errors and `--json` are still told."""
    global _quiet
    _quiet = quiet


def say(message: str) -> None:
    """Tell the user something, on stderr."""
    if not _quiet:
        print(message, file=sys.stderr)


def warn(message: str) -> None:
    """Tell the user what to doubt, on stderr."""
    say(f"warning: {message}")


def fail(message: str) -> None:
    """Say why the command ends, on stderr, quiet or not."""
    print(f"error: {message}", file=sys.stderr)


@contextlib.contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[], None]]:
    """Yield a function to call once per finished piece; a bar on a terminal, one line elsewhere."""
    if _quiet or total <= 1:
        yield lambda: None
        return
    if not sys.stderr.isatty():
        say(f"{label}: {total} to do")
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=total)
        yield lambda: bar.advance(task)


def table(title: str, columns: list[str], rows: list[list[str]]) -> None:
    """Print a table on stdout: boxed on a terminal, plain and unwrapped elsewhere."""
    if _quiet:
        return
    if sys.stdout.isatty():
        from rich.console import Console
        from rich.table import Table
        from rich.text import Text

        grid = Table(title=title)
        for column in columns:
            grid.add_column(column, overflow="fold")  # a name that is cut off names nothing
        for row in rows:
            grid.add_row(*(Text(cell) for cell in row))
        Console().print(grid)
        return
    widths = [max(len(row[i]) for row in [columns, *rows]) for i in range(len(columns))]
    print(title)
    for row in [columns, *rows]:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def line(text: str) -> None:
    """Print one line of a result on stdout, under its table."""
    if not _quiet:
        print(text)


def print_json(result: dict[str, Any]) -> None:
    """Print a result, machine-readable, on stdout."""
    from eaid.store import dumps

    sys.stdout.write(dumps(result))
