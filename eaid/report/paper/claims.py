"""The paper's table: what is printed, what we get, the command that gives it, and a plain verdict.

A row of `claims.md.j2` is one claim; `numbers.py` gives its numbers. docs/paper.md holds the table.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from jinja2 import Environment, PackageLoader, StrictUndefined

from eaid.report.paper.evidence import Evidence
from eaid.report.paper.numbers import numbers
from eaid.report.tables import number

VERDICTS = (
    "holds", "holds on the reference plant", "circular", "not decided", "cannot be checked without the rig",
    "does not hold",
)  # fmt: skip
"""Circular: what it is computed from was made of it; that it comes back says nothing about the paper."""
BEGIN, END = "<!-- eaid reproduce: begin -->", "<!-- eaid reproduce: end -->"
"""Between these lines docs/paper.md holds what the command writes."""


@dataclass(frozen=True)
class Claim:
    """A printed number or statement, and ours."""

    where: str
    """Table, figure or section."""
    printed: str
    ours: str
    command: str
    verdict: str
    why: str = ""

    def __post_init__(self) -> None:
        assert self.verdict in VERDICTS, self.verdict
        assert self.verdict in VERDICTS[:2] or self.why, self.printed

    @classmethod
    def of_row(cls, row: str) -> "Claim":
        """A claim from its row of a Markdown table: where, printed, ours, verdict and reason, command."""
        where, printed, ours, judged, command = (cell.strip() for cell in row.strip().strip("|").split(" | "))
        verdict, _, why = judged.partition(": ")
        return cls(where, printed, ours, command.strip("`"), verdict, why)

    def row(self) -> str:
        """The claim as such a row."""
        verdict = f"{self.verdict}: {self.why}" if self.why else self.verdict
        cells = (self.where, self.printed, self.ours, verdict, f"`{self.command}`")
        return "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"


def claims(found: Evidence) -> list[Claim]:
    """Every checkable number of the paper: Tables I to IV, then §II to §VII."""
    made = Environment(loader=PackageLoader("eaid.report.paper", "."), undefined=StrictUndefined, trim_blocks=True)
    made.filters["n"] = number
    rows = made.get_template("claims.md.j2").render(**numbers(found))
    return [Claim.of_row(row) for row in rows.splitlines() if row.strip()]


def markdown(rows: Sequence[Claim]) -> str:
    """The table, with a count of the verdicts before it."""
    counts = Counter(row.verdict for row in rows)
    head = f"{len(rows)} entries: " + ", ".join(f"{counts[verdict]} × {verdict}" for verdict in VERDICTS) + "."
    lines = [head, "", "| where | the paper | ours | verdict | command |", "|---|---|---|---|---|"]
    return "\n".join([*lines, *(row.row() for row in rows)]) + "\n"
