"""All claims as Markdown: docs/paper.md's table."""

from collections import Counter
from collections.abc import Sequence

from eaid.report.paper.claim import VERDICTS, Claim
from eaid.report.paper.control_statements import control, rehabilitation
from eaid.report.paper.evidence import Evidence
from eaid.report.paper.printed_tables import tables
from eaid.report.paper.statements import statements

BEGIN, END = "<!-- eaid reproduce: begin -->", "<!-- eaid reproduce: end -->"
"""Between these lines docs/paper.md holds what the command writes."""


def claims(found: Evidence) -> list[Claim]:
    """Every checkable number of the paper: the tables, then the text and the figures."""
    return [*tables(found), *statements(found), *control(found), *rehabilitation(found)]


def markdown(rows: Sequence[Claim]) -> str:
    """The table, with a count of the verdicts before it."""
    counts = Counter(row.verdict for row in rows)
    lines = [
        f"{len(rows)} entries: " + ", ".join(f"{counts[verdict]} × {verdict}" for verdict in VERDICTS) + ".",
        "",
        "| where | the paper | ours | verdict | command |",
        "|---|---|---|---|---|",
    ]
    for row in rows:
        verdict = f"{row.verdict}: {row.why}" if row.why else row.verdict
        cells = (row.where, row.printed, row.ours, verdict, f"`{row.command}`")
        lines.append("| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |")
    return "\n".join(lines) + "\n"
