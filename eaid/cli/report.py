"""`eaid report`: results → one self-contained page and its figures."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eaid.cli import console
from eaid.cli.options import Force, Json, Output, Quiet
from eaid.errors import DataError

if TYPE_CHECKING:
    from eaid.report.options import ReportOptions
    from eaid.report.write import Report

FIGURES = "Figures"


def command(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Any of fit.json, gains.json, replay.h5, data.h5; two fits of one kind are compared.",
            show_default=False,
        ),
    ],
    output: Output = None,
    figures: Annotated[
        str | None,
        typer.Option(help="Only these figures: fig07,fig12 or the beginning of a name.", rich_help_panel=FIGURES),
    ] = None,
    format: Annotated[
        str | None, typer.Option(help="Figures as pdf and svg too: pdf,svg. PNG always.", rich_help_panel=FIGURES)
    ] = None,
    width: Annotated[
        str, typer.Option(help="Widths of one and of two columns [in].", rich_help_panel=FIGURES)
    ] = "3.5,7.16",
    font: Annotated[str, typer.Option(help="Letters of the figures.", rich_help_panel=FIGURES)] = "DejaVu Sans",
    paper: Annotated[
        bool | None,
        typer.Option(
            "--paper/--no-paper", help="Published values beside yours; default: where the units are the paper's."
        ),
    ] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Make the page again when a result changes, until Ctrl-C.")
    ] = False,
    json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Make one self-contained HTML page and its figures out of result files.

    Writes DIR/report.html, which opens without a network, and DIR/figures/*.png at 300 dpi, 3.5 or 7.16 inches wide.
    What was not given is left out, with a line that names the command that makes it.

    Example: eaid report fit.json gains.json multisine.h5 clutch.h5 -o report
    """
    console.be_quiet(quiet)
    folder = output or Path("report")
    from eaid.report.options import ReportOptions, refuse_to_overwrite_report, widths_of

    column_in, page_in = widths_of(width)
    options = ReportOptions(_parts(format), _parts(figures), column_in, page_in, font, paper, force)
    refuse_to_overwrite_report(folder, force)
    folder.parent.mkdir(parents=True, exist_ok=True)
    made = _made(files, folder, options)
    if watch:
        from eaid.report.watch import changes

        console.say(f"watching {len(files)} file{'s' if len(files) > 1 else ''}; Ctrl-C ends it")
        for _ in changes(files):
            try:
                made = _made(files, folder, replace(options, force=True))
            except DataError as fault:  # a file that is being written: it will change again
                console.warn(str(fault))
    if json:
        console.print_json(
            {"page": str(made.page), "figures": list(made.figures), "missing": [list(pair) for pair in made.missing]}
        )


def _parts(text: str | None) -> tuple[str, ...]:
    """The parts of a list with commas."""
    return tuple(part.strip() for part in (text or "").split(",") if part.strip())


def _made(files: list[Path], folder: Path, options: "ReportOptions") -> "Report":
    from eaid.report.draw import ready_figures
    from eaid.report.results import read_results
    from eaid.report.write import write_report

    results = read_results(files, console.warn)
    ready, _missing = ready_figures(results, options.paper, options.figures)
    with console.progress("drawing figures", len(ready)) as done:
        made = write_report(results, folder, options, done)
    if made.missing and not options.figures:
        console.say(f"{len(made.missing)} figures want more results; the page's appendix names the commands")
    console.say(f"{made.page}: {len(made.figures)} figures; open it in a browser")
    return made
