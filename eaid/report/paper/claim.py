"""One line of the paper's table: what is printed, what we get, the command that gives it, and a plain verdict."""

from dataclasses import dataclass

HOLDS = "holds"
ON_PLANT = "holds on the reference plant"
CIRCULAR = "circular"
"""What it is computed from was made of it: that it comes back says nothing about the paper."""
UNDECIDED = "not decided"
NO_RIG = "cannot be checked without the rig"
FAILS = "does not hold"
VERDICTS = (HOLDS, ON_PLANT, CIRCULAR, UNDECIDED, NO_RIG, FAILS)

FIT = "eaid fit {}.h5"
HERE = "eaid reproduce"
"""Published gains on the reference plant, or arithmetic on printed numbers: this command itself."""


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
        assert self.verdict in (HOLDS, ON_PLANT) or self.why, self.printed

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


def near(ours: float, printed: float, share: float) -> bool:
    """Whether two numbers agree within a share of the printed one."""
    return abs(ours - printed) <= share * abs(printed)
