"""All claims as Markdown: docs/paper.md's table."""

from collections import Counter
from collections.abc import Sequence

from eaid.report.paper.claim import VERDICTS, Claim
from eaid.report.paper.evidence import Evidence
from eaid.report.paper.printed_tables import tables
from eaid.report.paper.statements import statements

BEGIN, END = "<!-- eaid reproduce: begin -->", "<!-- eaid reproduce: end -->"
"""Between these lines docs/paper.md holds what the command writes."""


def claims(found: Evidence) -> list[Claim]:
    """Every checkable number of the paper: the tables, then the text and the figures."""
    return [*tables(found), *statements(found)]


def markdown(rows: Sequence[Claim]) -> str:
    """The table, with a count of the verdicts before it."""
    counts = Counter(row.verdict for row in rows)
    head = f"{len(rows)} entries: " + ", ".join(f"{counts[verdict]} × {verdict}" for verdict in VERDICTS) + "."
    lines = [head, "", "| where | the paper | ours | verdict | command |", "|---|---|---|---|---|"]
    return "\n".join([*lines, *(row.row() for row in rows)]) + "\n"
