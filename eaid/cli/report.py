"""`eaid report`: results → one self-contained page and its figures."""

from pathlib import Path
from typing import Annotated

import typer

from eaid.cli import console
from eaid.cli.options import Force, Json, Output, Quiet


def command(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Any of fit.json, gains.json, replay.h5, data.h5; two fits of one kind are compared.",
            show_default=False,
        ),
    ],
    output: Output = None,
    format: Annotated[
        str | None, typer.Option("--format", help="Figures as pdf and svg too: pdf,svg. PNG is always written.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    force: Force = False,
) -> None:
    """Make one self-contained HTML page and its figures out of result files.

    Writes DIR/report.html, which opens without a network, and DIR/figures/*.png at 300 dpi, 3.5 or 7.16 inches wide.
    What was not given is left out, with a line that names the command that makes it.
    """
    console.be_quiet(quiet)
    folder = output or Path("report")
    from eaid.files import refuse_to_overwrite

    folder.parent.mkdir(parents=True, exist_ok=True)
    refuse_to_overwrite(folder / "report.html" if folder.is_dir() else folder, force)
    from eaid.report.build import build
    from eaid.report.draw import formats_of, ready_figures
    from eaid.report.results import read_results

    formats = formats_of(format)
    results = read_results(files, console.warn)
    ready, _missing = ready_figures(results)
    with console.progress("drawing figures", len(ready)) as done:
        made = build(results, folder, formats, done)
    for name, made_by in made.missing:
        console.say(f"left out {name}: {made_by}")
    console.say(f"{made.page}: {len(made.figures)} figures")
    if json:
        console.print_json(
            {"page": str(made.page), "figures": list(made.figures), "missing": [list(pair) for pair in made.missing]}
        )
