"""What an export is asked for."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from eaid.errors import UsageError
from eaid.export.numbers import Precision
from eaid.limits import check_all
from eaid.results.common import Input

Law = Literal["pi", "rc", "inverse", "plant"]
LAWS: tuple[Law, ...] = ("pi", "rc", "inverse", "plant")


@dataclass(frozen=True)
class ExportOptions:
    """Target, laws and timing of an export."""

    target: str = "c"
    """A row of `eaid.export.targets.TARGETS`."""
    folder: Path = Path("export")
    """Where the export is written."""
    force: bool = False
    """Replace an earlier export in that folder."""
    laws: tuple[str, ...] | None = None
    """pi, rc, inverse, plant; None: all that gains and fit hold."""
    precision: Precision = "double"
    rate_hz: float | None = None
    """Control rate [Hz]; None: that of the gains."""
    rate_filter_hz: float | None = None
    """Corner of the reference's filtered derivative [Hz]; None: 25, or a tenth of the control rate where that is
    less."""
    duty_on_fault: float = 0.0
    """Duty while an input is no number, in the rig's input unit."""
    stuck_s: float = 0.5
    """The status tells of a reading that has not changed for so long [s]."""
    anyway: bool = False
    """Export what would be refused, marked."""
    command: str = ""
    """What made it, for the heads of the files."""
    inputs: tuple[Input, ...] = ()
    """The files that gains and fit were read from, for the heads."""

    def __post_init__(self) -> None:
        check_all(
            rate_hz=self.rate_hz, rate_filter_hz=self.rate_filter_hz, stuck_s=self.stuck_s,
            duty_on_fault=self.duty_on_fault,
        )  # fmt: skip
        if self.precision not in ("double", "single"):
            raise UsageError(f"«precision» is {self.precision!r}; there are double and single")
        if self.laws is not None:
            unknown = [law for law in self.laws if law not in LAWS]
            if unknown or not self.laws or len(set(self.laws)) < len(self.laws):
                wrong = f"holds {unknown[0]!r}" if unknown else "must name each law once"
                raise UsageError(f"«law» {wrong}; there are {', '.join(LAWS)}")
