"""`eaid report`: results → one self-contained page and its figures."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import OUTPUT, Common, argument, takes, written
from eaid.declared import option
from eaid.files import refuse_to_overwrite
from eaid.options import ReportOptions
from eaid.shown import counted


@dataclass(frozen=True, kw_only=True)
class Shared(Common):
    """Options of every command, but that `--tables` is a folder here."""

    verbose: bool = option(False, "Tell all findings.", OUTPUT, "-v", "--verbose")


@takes
def report(
    args: Shared, how: ReportOptions,
    files: list[Path] = argument("FILE…", "Any of fit.json, gains.json, replay.h5, data.h5."),
    output: Path = written("report", "Folder that is written."),
) -> None:  # fmt: skip
    """Make one self-contained HTML page and its figures out of result files.

    Writes DIR/report.html, which opens without a network, and DIR/figures/*.png at 300 dpi, 3.5 or 7.16 inches wide.
    What was not given is left out.

    Example: eaid report fit.json gains.json multisine.h5 clutch.h5 -o report
    """
    from eaid.report.results import read_results
    from eaid.report.write import FILE, refuse_to_overwrite_report, write_report

    refuse_to_overwrite_report(output, args.force)
    if output.is_dir():
        refuse_to_overwrite(output / FILE, True, files)
    output.parent.mkdir(parents=True, exist_ok=True)
    results = read_results(files, console.warn, console.progress)
    page, figures = write_report(results, output, how, args.force, console.progress)
    console.done(page, counted(len(figures), "figure"), "open it in a browser")
    if args.json:
        console.print_json({"page": page, "figures": figures})
