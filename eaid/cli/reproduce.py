"""`eaid reproduce`: the paper, number by number, computed anew."""

from dataclasses import dataclass
from pathlib import Path

from eaid.cli import console
from eaid.cli.form import Common, takes, written


@dataclass(frozen=True, kw_only=True)
class Arguments(Common):
    """What `eaid reproduce` is told."""

    output: Path = written("table.md")


@takes(Arguments)
def command(args: Arguments) -> None:
    """Compute every checkable number of the paper anew, from the shipped data and the reference plant.

    Writes a Markdown table: what is printed, ours beside it, the command that gives it, a verdict.

    Example: eaid reproduce -o table.md
    """
    from eaid.cli.printed import Reproduced
    from eaid.files import refuse_to_overwrite, written_whole

    refuse_to_overwrite(args.output, args.force)
    from eaid.report.paper.claims import claims, markdown
    from eaid.report.paper.evidence import PARTS, evidence

    with console.progress("eaid reproduce", len(PARTS)) as done:
        rows = claims(evidence(done))
    with written_whole(args.output, args.force) as part:
        part.write_text(markdown(rows), encoding="utf-8", newline="\n")
    if args.json:
        console.print_json(Reproduced(rows))
    console.done(args.output, f"{len(rows)} entries", "read it beside docs/paper.md")
