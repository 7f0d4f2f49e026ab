"""plan.json as a type: what to record next, and the interval widths that it is simulated to give."""

from typing import ClassVar

from eaid.findings import ranked, sentences
from eaid.results import codec
from eaid.results.common import Count, Input, Made, Number, Result
from eaid.shown import Shown, counted, pandas, span


class PlannedRun(Result, frozen=True):
    """One run of the session: idle, hold at the level, release."""

    order: Count
    level: Number
    """In the input's unit."""
    repeat: Count
    idle_s: Number
    hold_s: Number
    release_s: Number


class Planned(Made, frozen=True, kw_only=True):
    """What every plan.json holds: what was wanted, and the interval widths that the plan gives."""

    FILE: ClassVar[str] = "plan"
    inputs: tuple[Input, ...] = ()
    wanted: dict[str, Number] = {}
    """Half-widths of 95 % intervals that are wanted at the worst level [%]."""
    met: bool = False
    """Whether every wanted width is reached."""
    time_on_rig_s: Number = 0.0
    half_width_pct: dict[str, Number | None] = {}
    """Predicted half-width at the worst level [%]; None: undetermined."""
    measured_half_width_pct: dict[str, Number | None] | None = None
    """What most simulated recordings keep at the worst level [%]: four of five, of one sequence 19 of 20; None where
    none was simulated."""
    input_unit: str = "%"


class Excitation(Planned, frozen=True):
    """One sequence for one recording: when which duty acts, and what it is to give."""

    engagements: Count = 0
    """Stretches under load, each after a rest."""
    classic_time_on_rig_s: Number | None = None
    """What steps from rest to levels, with repeats, take for the same widths [s]; None: they never reach them."""
    duty: tuple[tuple[Number, Number], ...] = ()
    """(from when [s], input in its unit), each held until the next; the last entry ends it."""


class Plan(Shown, Planned, frozen=True):
    """One experiment: levels, holds, repeats, order, and what it gives.

    Examples
    --------
    >>> run = PlannedRun(order=1, level=60.0, repeat=1, idle_s=2.0, hold_s=20.0, release_s=5.0)
    >>> plan = Plan(levels=(60.0,), hold_s=(20.0,), repeats=1, time_on_rig_s=27.0, runs=(run,))
    >>> plan.to_frame()[["level", "hold_s"]].values.tolist()
    [[60.0, 20.0]]
    """

    levels: tuple[Number, ...] = ()
    hold_s: tuple[Number, ...] = ()
    """Hold of each level [s]."""
    repeats: Count = 0
    runs: tuple[PlannedRun, ...] = ()

    def summary(self) -> str:
        """Levels, runs and time on the rig, the widths that it gives, and the gravest findings."""
        runs = f"{counted(len(self.runs), 'run')}, {self.time_on_rig_s / 60:.0f} min"
        head = f"{span(self.levels, self.input_unit)}; {runs}"
        given = self.measured_half_width_pct or self.half_width_pct
        rows = [
            f"{name}: ± {'undetermined' if width is None else f'{width:.3g} %'}"
            + (f", wanted ± {self.wanted[name]:g} %" if name in self.wanted else "")
            for name, width in given.items()
        ]
        return "\n".join([head, *rows, *sentences(ranked(self.findings)[:3])])

    def to_frame(self) -> "pandas.DataFrame":
        """One row a run, in the order of recording."""
        return codec.frame_of(self.runs)
