"""What `eaid fit` prints: the answer in eight lines, the tables of the rest, and what to do next."""

from pathlib import Path

from eaid.cli import console
from eaid.report.tables.fits import judging_tables, model_tables
from eaid.results.fit import Fit
from eaid.results.summary import answer, runs, verdict_line, warned

PARTS = ("friction", "nonlinear", "linear", "release", "steps")


def show(fit: Fit, file: Path, tables: bool, verbose: bool) -> None:
    """The answer, the gravest warnings and what to do next; and all tables; with `verbose` those that judge it too."""
    usable = fit.verdict.usable
    after = "tune-rc" if fit.linear is not None and usable else "report"
    label = "warned " if usable else "stop   "
    warnings = label + (", ".join(warned(fit)) or "none")
    for line in (*verdict_line(fit), *answer(fit), warnings, f"next   eaid {after} {file}"):
        console.line(line)
    shown = model_tables(fit, asked=False) if tables else []
    for table in [*shown, *(judging_tables(fit) if tables and verbose else ())]:
        console.show(table)


def closing(fit: Fit, file: Path) -> str:
    """The last line: the file, what it holds, and of which data."""
    parts = ", ".join(name for name in PARTS if getattr(fit, name)) or "no model"
    return f"{file}: {parts} of {runs(fit, f'{fit.data.kind} run')}"
