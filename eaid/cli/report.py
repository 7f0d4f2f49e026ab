"""`eaid report`: results → one self-contained page and its figures."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from eaid.cli import console
from eaid.cli.form import Common, argument, takes, written
from eaid.declared import option, part
from eaid.errors import DataError
from eaid.options import PAGE, ReportOptions
from eaid.shown import counted

if TYPE_CHECKING:
    from eaid.report.write import Report


@dataclass(frozen=True, kw_only=True)
class Arguments(Common, ReportOptions):
    """What `eaid report` takes."""

    files: list[Path] = argument(
        "FILE…", "Any of fit.json, gains.json, replay.h5, data.h5; two fits of one kind are compared."
    )
    watch: bool = option(False, "Make the page again when a result changes, until Ctrl-C.", PAGE)
    output: Path = written("report", "Folder that is written.")


@takes(Arguments)
def command(args: Arguments) -> None:
    """Make one self-contained HTML page and its figures out of result files.

    Writes DIR/report.html, which opens without a network, and DIR/figures/*.png at 300 dpi, 3.5 or 7.16 inches wide.
    What was not given is left out, with a line that names the command that makes it.

    Example: eaid report fit.json gains.json multisine.h5 clutch.h5 -o report
    """
    from eaid.files import refuse_to_overwrite
    from eaid.report.watch import changes
    from eaid.report.write import FILE, refuse_to_overwrite_report

    options = part(ReportOptions, args)
    refuse_to_overwrite_report(args.output, args.force)
    if args.output.is_dir():
        refuse_to_overwrite(args.output / FILE, True, args.files)
    args.output.parent.mkdir(parents=True, exist_ok=True)
    changed = changes(args.files)  # from here on: what changes while the first page is made counts too
    made = _made(args.files, args.output, options, args.force)
    if args.watch:
        console.say(f"watching {counted(len(args.files), 'file')}; Ctrl-C ends it")
        for _ in changed:
            try:
                made = _made(args.files, args.output, options, True)
            except DataError as fault:  # a file that is being written: it will change again
                console.warn(str(fault))
    if args.json:
        console.print_json(made)


def _made(files: list[Path], folder: Path, options: ReportOptions, force: bool) -> "Report":
    from eaid.report.draw import ready_figures
    from eaid.report.read import read_results
    from eaid.report.write import write_report

    results = read_results(files, console.warn)
    ready, _missing = ready_figures(replace(results, paper=options.paper), options.figures)
    with console.progress("drawing figures", len(ready)) as done:
        made = write_report(results, folder, options, force, done)
    if made.missing and not options.figures:
        console.say(f"{len(made.missing)} figures want more results; the page's appendix names the commands")
    console.done(made.page, f"{len(made.figures)} figures", "open it in a browser")
    return made
