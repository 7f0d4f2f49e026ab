"""What the fits take: levels of averaged repeats, on a time axis that starts at the step."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.errors import DataError
from eaid.findings import Finding, finding, merged, ranked, say, sentences, stops
from eaid.logs.run import Run
from eaid.shown import Shown, counted, span
from eaid.steps.step import SlipTest

if TYPE_CHECKING:
    import pandas


# An output that leaves its rest so many times, and rows, before its input does as the input was noted late
EARLY_PART, EARLY_ROWS = 2.0, 3
ROWS_OF_RISE = 1  # Of an idle time, the last ones, within which a rise may have begun between two rows
MOST_LEFT_OUT = 2 / 3  # Part of the runs of a set that may be left out; beyond, the fit must not be used


def as_late(one: Finding, late_s: float, row_s: float) -> bool:
    """Whether a finding is of an output that leaves its rest about as early as its input was noted late."""
    early_s = one.values.get("early_s")
    return isinstance(early_s, float) and 0 < early_s <= EARLY_PART * late_s + EARLY_ROWS * row_s


@dataclass(frozen=True, eq=False, repr=False)
class Level:
    """The repeats of one level on their common grid; baseline subtracted, inverted inputs made positive."""

    level: float
    """Input of the step, in the set's input unit."""
    time_s: Array
    """Time since the step [s], shape (n,), time_s[0] ≥ 0; the first sample at the level is t = 0."""
    runs: Array
    """Output of each repeat [N·m or `output_unit`], shape (R, n)."""
    names: tuple[str, ...]
    """Name of the run behind each row of `runs`."""

    @cached_property
    def ordered_runs(self) -> Array:
        """The runs in the order of their values, so that the order of the logs changes no rounding, shape (R, n)."""
        if len(self.runs) < 3:  # a + b is b + a
            return self.runs
        picks = np.linspace(self.runs.shape[1] - 1, 0, 16).astype(int)
        return self.runs[np.lexsort(self.runs[:, picks].T)]

    @cached_property
    def mean(self) -> Array:
        """Mean of the repeats, shape (n,): what is fitted."""
        return np.asarray(self.ordered_runs.mean(axis=0))

    def ended(self, early_s: float) -> "Level":
        """The level without its last so many seconds."""
        kept = self.time_s <= self.time_s[-1] - early_s
        return replace(self, time_s=self.time_s[kept], runs=self.runs[:, kept])

    @property
    def sd(self) -> Array:
        """Standard deviation of the repeats (n − 1), shape (n,); zeros for a single run."""
        if len(self.runs) == 1:
            return np.zeros_like(self.time_s)
        return np.asarray(self.ordered_runs.std(axis=0, ddof=1))


@dataclass(frozen=True, eq=False)
class LevelStep:
    """A change of input between two holds, from its instant on; the output keeps its sign and offset."""

    name: str
    source: str
    from_level: float
    """Input before the step, in the set's input unit, with its sign."""
    level: float
    """Input after it."""
    start: float
    """Output at rest just before the step, in the set's output unit."""
    time_s: Array
    """Time since the step [s], shape (n,), from 0; the first sample at the new input."""
    output: Array
    """Output as recorded, shape (n,)."""
    input: Array
    """Input as recorded, shape (n,); NaN where the log has none."""
    rest_s: float | None = None
    """Duration of the rest whose mean the start is [s]; None: not known, a sample or so."""
    rest_moved: float = 0.0
    """How far that rest still moved from its first half to its second, in the set's output unit."""
    at_s: float = 0.0
    """Step instant on the log's own clock [s]."""
    findings: tuple[Finding, ...] = ()

    @property
    def edge(self) -> str:
        """ "up" where the input rises, "down" where it falls."""
        return "up" if self.level > self.from_level else "down"

    @cached_property
    def change(self) -> float:
        """Output at the end of the hold (mean of its last tenth) less the start."""
        return float(self.output[-max(1, len(self.output) // 10) :].mean()) - self.start

    @property
    def gain(self) -> float:
        """Change of output over change of input, Δy/Δu."""
        return self.change / (self.level - self.from_level)


@dataclass(frozen=True)
class Creep:
    """A rate at which the output of all runs creeps beside their response, or in proportion to it."""

    rate: float  # [output/s]; in proportion, [1/s]
    error: float  # Its standard error
    half: float  # Half-width of its 95 % interval
    t0_s: float  # From the middle of the idle time, whose mean is taken off, to the step; of most runs
    of_levels: Mapping[float, float]  # The same in the mean of each level's runs
    in_proportion: bool = False


@dataclass(frozen=True)
class RunRecord:
    """One row of the run table: where a run came from and its warnings."""

    name: str
    source: str
    sha256: str
    level: float
    repeat: int
    baseline_nm: float
    """Value from which the step is counted, in the set's output unit."""
    step_s: float
    """Step instant on the log's own clock [s]."""
    samples: int
    """Samples in the active window."""
    rate_hz: float
    edge: str
    """"rising", or "falling" for a release."""
    findings: tuple[Finding, ...] = ()
    lost_pct: float | None = None
    """Torque lost while the input is held, peak to end [%] (Fig. 6); None for a release."""
    left_pct: float | None = None
    """Torque left at the end of a release [% of the held torque] (Fig. 6); None for a rising step."""
    from_level: float = 0.0
    """Input before a rising step, or where a falling one goes; 0: rest."""
    idle_density: float | None = None
    """Density of the output's noise while idle [output²·s]; None where the idle record is too short to tell."""
    idle_slope: float | None = None
    """How fast the output creeps while idle, with the sign of the rise [output/s]; None where too few samples tell."""
    slip: SlipTest | None = None
    """Where the output peaks and slips under a held input."""
    left_out: bool = False
    """Whether it stands in no level: a finding stops it, and other runs are sound."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """The findings as sentences."""
        return tuple(sentences(self.findings))


@dataclass(frozen=True, eq=False, repr=False)
class StepSet(Shown):
    """All steps of one experiment.

    Examples
    --------
    >>> import eaid
    >>> steps = eaid.synth(levels=(20.0, 60.0), repeats=2, rate_hz=50.0, seed=1)
    >>> steps
    <StepSet: clutch: 2 levels, 20 … 60 %, 8 runs>
    >>> steps.levels[0].runs.shape  # repeats, samples
    (2, 1000)
    """

    kind: str
    """clutch, friction-force or friction-speed."""
    input_unit: str
    output_unit: str
    apparatus: Apparatus | None
    levels: tuple[Level, ...]
    """Rising steps from rest, by level."""
    releases: tuple[Level, ...] = ()
    """Falling steps to rest, by the level they fall from; output still relative to the idle baseline."""
    runs: tuple[RunRecord, ...] = ()
    findings: tuple[Finding, ...] = ()
    """What is to be known of the set as a whole; each run has its own."""
    recorded: tuple[Run, ...] = ()
    """Logs whose input does more than step from rest: fitted as they were recorded."""
    synthetic: str | None = None
    """What made the data, where they are not recorded; None: a rig."""
    inputs: tuple[tuple[str, str], ...] = ()
    """(path, SHA-256) of the files that the user named."""
    reading: Mapping[str, str | float | bool] = field(default_factory=dict)
    """The options with which the logs were read, so that it can be done again."""
    logs: tuple[Run, ...] = ()
    """The logs behind the levels as they were read, before they were cut."""
    steps: tuple[Run, ...] = ()
    """The recorded runs behind the levels, cut at their steps, where the set was read from logs."""
    level_steps: tuple[LevelStep, ...] = ()
    """Every change of input between two holds, from rest and to rest too, in the order of levels."""
    creep: Creep | None = None
    """What was taken off its levels and releases."""
    swept: tuple[Run, ...] = ()
    """The logs behind its steps, where these hold several: to be fitted as recorded where tails are told wrongly."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """The findings of the set as sentences."""
        return tuple(sentences(self.findings))

    @property
    def all_findings(self) -> tuple[Finding, ...]:
        """Those of the set and of its runs, the worst run of each kind named, the gravest first.

        What stops a run that is left out stops nothing else: it is told as the reason.
        """
        kept = [one for run in self.runs if not run.left_out for one in run.findings]
        kept += [one for run in self.recorded for one in run.findings]
        stopped = {one.code for one in stops(kept)}
        reasons: dict[str, list[tuple[str, Finding]]] = {}
        for run in self.runs:
            for one in stops(run.findings) if run.left_out else ():
                if one.code not in stopped:
                    reasons.setdefault(one.code, []).append((run.name, one))
        out = [(tuple(name for name, _ in group), say(group[0][1])) for group in reasons.values()]
        told = [finding("runs-left-out", "data", runs=names, of=len(self.runs), why=why) for names, why in out]
        if sum(len(names) for names, _ in out) > MOST_LEFT_OUT * len(self.runs):  # what is left is no set of the rig's
            told = [msgspec.structs.replace(one, severity="stop") for one in told]
        return ranked((*merged((*self.findings, *kept)), *told))

    def noted_late(self, late_s: float) -> "StepSet":
        """The set of inputs that were noted so late: no run that left its rest about so early was off its rest, none
        crept, where its rise began in the idle time, and holds end as much before their noted end, as the output
        did."""
        if late_s <= 0:
            return self
        kept = [[one for one in run.findings if not as_late(one, late_s, 1 / run.rate_hz)] for run in self.runs]
        pairs = zip(self.runs, kept, strict=True)
        began = [late_s * run.rate_hz > ROWS_OF_RISE for run in self.runs]
        runs = tuple(
            replace(run, findings=tuple(own), idle_slope=None if early else run.idle_slope)
            for (run, own), early in zip(pairs, began, strict=True)
        )
        ended = ([one.ended(late_s) for one in part] for part in (self.levels, self.releases))
        levels, releases = (tuple(one for one in part if len(one.time_s) > 1) for part in ended)
        told = self._told_of_no_creep if any(began) else self.findings
        return replace(self, runs=runs, levels=levels, releases=releases, findings=told)

    def middles_s(self, level: Level, unknown_s: float = 0.0) -> Array:
        """From the middle of the rest that each run of a level is counted from to its step [s], (R,)."""
        rests = {(abs(one.level), one.name): one.rest_s for one in self.level_steps if one.from_level == 0}
        known = [rests.get((level.level, name)) for name in level.names]
        return np.array([unknown_s if one is None else 0.5 * one for one in known])

    def without_creep(self, rate: float, t0_s: float, in_proportion: bool = False) -> "StepSet":
        """The set without a creep of its output beside the response, from the middle of the rest that each run is
        counted from on, so long before its step where that is not known; or without one in proportion to it, from the
        step to the end of the hold."""
        ended_s = {level.level: float(level.time_s[-1]) for level in self.levels}  # where their releases begin

        def off(one: Level, since_s: Array | float, held_s: Array | float) -> Level:
            if in_proportion:
                return replace(one, runs=one.runs / (1 + rate * held_s))
            return replace(one, runs=one.runs - rate * (one.time_s + np.reshape(since_s, (-1, 1))))

        levels = tuple(off(one, self.middles_s(one, t0_s), one.time_s) for one in self.levels)
        after = ((one, ended_s.get(one.level, 0.0)) for one in self.releases)
        releases = tuple(off(one, t0_s + held_s, held_s) for one, held_s in after)
        return replace(self, levels=levels, releases=releases, findings=self._told_of_no_creep)

    @property
    def as_recorded(self) -> "StepSet":
        """The logs behind its steps, to be fitted as they were recorded."""
        return replace(self, recorded=self.swept, levels=(), releases=(), runs=(), logs=(), swept=())

    @property
    def _told_of_no_creep(self) -> tuple[Finding, ...]:
        return tuple(one for one in self.findings if one.code != "output-creeps")

    def without(self, why: Sequence[Finding]) -> "StepSet":
        """The set without the levels of some findings and their releases, with these as warnings."""
        levels = sorted(u for one in why for u in one.levels)
        parts = [[one for one in group if one.level not in levels] for group in (self.levels, self.releases)]
        names = {name for level in parts[0] + parts[1] for name in level.names}
        out = [run.left_out or (run.from_level == 0 and run.name not in names) for run in self.runs]
        runs = tuple(replace(run, left_out=left) for run, left in zip(self.runs, out, strict=True))
        told = finding("levels-left-out", "data", levels, unit=self.input_unit)
        findings = (*self.findings, *(msgspec.structs.replace(one, severity="caution") for one in why), told)
        return replace(self, levels=tuple(parts[0]), releases=tuple(parts[1]), runs=runs, findings=findings)

    def to_frame(self) -> "pandas.DataFrame":
        """One row a run: level, repeat, edge, step instant, baseline, samples, and the codes of its findings."""
        import pandas

        rows = [{**asdict(run), "findings": ", ".join(one.code for one in run.findings)} for run in self.runs]
        return pandas.DataFrame(rows).set_index("name") if rows else pandas.DataFrame()

    def summary(self) -> str:
        """The set in a few lines, and the gravest findings."""
        levels = span([one.level for one in self.levels], self.input_unit)
        head = f"{self.kind}: {levels}, {counted(len(self.runs), 'run')}"
        if self.recorded:
            head += f", {counted(len(self.recorded), 'log')} as recorded"
        return "\n".join([head, *sentences(self.all_findings[:3])])

    def save(self, path: str | os.PathLike[str], force: bool = False) -> None:
        """Write data.h5, whole or not at all; DataError for a set that was not read from logs."""
        from eaid.logs.dataset import write_dataset

        if not (runs := (*self.steps, *self.recorded)):
            raise DataError(f"{path}: this set holds averaged levels only; save the one that was read from logs")
        write_dataset(Path(path), runs, kind=self.kind, apparatus=self.apparatus, force=force)  # type: ignore[arg-type]
