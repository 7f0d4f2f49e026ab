"""`eaid reproduce`: the paper, number by number, computed anew."""

from dataclasses import asdict
from pathlib import Path

from eaid.cli import console
from eaid.cli.options import Force, Json, Output, Quiet


def command(output: Output = None, json: Json = False, quiet: Quiet = False, force: Force = False) -> None:
    """Compute every checkable number of the paper anew, from the shipped data and the reference plant.

    Writes a Markdown table (default table.md): what is printed, ours beside it, the command that gives it, a verdict.
    """
    console.be_quiet(quiet)
    from eaid.files import refuse_to_overwrite, written_whole

    path = output or Path("table.md")
    refuse_to_overwrite(path, force)
    from eaid.report.paper.evidence import PARTS, evidence
    from eaid.report.paper.table import claims, markdown

    with console.progress("eaid reproduce", PARTS) as done:
        rows = claims(evidence(done))
    with written_whole(path, force) as part:
        part.write_text(markdown(rows), encoding="utf-8", newline="\n")
    if json:
        console.print_json({"claims": [asdict(row) for row in rows]})
    console.say(f"{path}: {len(rows)} entries")
