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

FIT_FORCE = "eaid fit friction-force.h5"
FIT_SPEED = "eaid fit friction-speed.h5"
FIT_CLUTCH = "eaid fit clutch.h5"
TUNE = "eaid tune-rc fit.json"
SYNTH = "eaid synth --plant reference"
SIMULATE = "eaid simulate fit.json --gains gains.json --scenario"
HERE = "eaid reproduce"
"""Published gains on the reference plant, or arithmetic on printed numbers: this command itself."""
INGEST = "eaid ingest LOGS"
REPORT = "eaid report fit.json"


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


def near(ours: float, printed: float, share: float) -> bool:
    """Whether two numbers agree within a share of the printed one."""
    return abs(ours - printed) <= share * abs(printed)
