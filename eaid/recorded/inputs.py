"""What recorded logs excite: held levels, or the range over which their inputs move; logs that no model is fitted to,
and what is to be told of the inputs of the others."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.errors import DataError, UsageError
from eaid.estimate.recorded_log import RecordedLog
from eaid.findings import Finding, finding
from eaid.options import FitOptions
from eaid.plant.drive import fall_alone
from eaid.steps.noise import sample_noise
from eaid.steps.stepset import Level, StepSet

WIDEST_LEVEL = 10.0  # Of inputs that are one level the last is not further from the first than this many such parts
LEVELS_ALIKE = 1e-3  # Inputs that differ by less than this part of the largest are one level
MANY_LEVELS = 60  # Levels beyond which inputs count as moving
FEW_LEVELS = 20  # Levels that are shown each by itself, at most
TAIL = 0.01  # Part of the acting time that a moving input may spend below the identified range
NEXT_TO_REST = 0.02  # Part of the largest input below which one that moves is at rest
BEYOND_INPUTS = 0.02  # Part of the largest input by which inputs lie beyond others at least
LEAST_TIME_BEYOND = 0.01  # Part of the time under load, beyond a range that was asked for, from which it goes on
LEAST_OUTPUTS, LEAST_OF_ALL = 10, 50  # Rows of one log, and of all: a plant has up to nine unknowns
FEW_VALUES = 5  # Different outputs up to which an input that moves all the time is taken for the output
INPUT_JUMP = 0.1  # A jump, as a part of the largest input
FOLLOWS_SURELY = 0.5  # Correlation of output and input from which its sign is that of the rig
FAST_PCT = 20.0
SATURATED_PCT = 20.0


@dataclass(frozen=True, eq=False)
class Excited:
    """What the logs excite."""

    levels: Array  # Held levels, or the ends of the range where the inputs move
    low: float
    high: float
    stepwise: bool
    ends: tuple[float, float]  # Least and largest input by size, where one acts: those of moving inputs lie beyond

    @property
    def basis(self) -> Array:
        """Levels over which the models are laid out."""
        if self.stepwise:
            return np.unique([*self.levels, self.low, self.high]) if len(self.levels) > 1 else self.levels
        return np.unique(np.linspace(self.low, self.high, 11))

    @property
    def shown(self) -> Array:
        """Inputs at which curves are given: the levels where they are few, else eleven over the range."""
        few = self.stepwise and 0 < len(self.basis) <= FEW_LEVELS
        return self.basis if few else np.unique(np.linspace(self.low, self.high, 11))

    def over(self, low: float, high: float) -> "Excited":
        """The same over another range."""
        return replace(self, low=low, high=high, levels=self.levels if self.stepwise else np.array([low, high]))


@dataclass(frozen=True, eq=False)
class Experiment:
    """What a fit of logs is made from."""

    logs: Sequence[RecordedLog]
    inputs: Excited
    options: FitOptions
    repeats: Sequence[Level] = ()  # Levels whose means the logs are; their runs tell how they scatter
    falls: bool = True  # Whether falls may have numbers of their own
    steps: StepSet | None = None
    synthetic: str | None = None  # What made the logs, where no rig did
    dead_time_s: float = 0.0  # That single steps show; taken where the logs are fitted better with it

    @property
    def rests(self) -> bool:
        """Whether some log shows the output at rest."""
        return any(log.starts_idle or bool((log.input == 0).any()) or log.baseline is not None for log in self.logs)

    @property
    def signed(self) -> bool:
        """Whether some input is below rest."""
        return any(float(log.input.min()) < 0 for log in self.logs)

    @property
    def falls_alone(self) -> bool:
        """Whether no log shows a rise."""
        return fall_alone([log.drive for log in self.logs])

    @property
    def of_loops(self) -> bool:
        """Whether some log is a loop's, whose input answers the output."""
        return any(log.reference is not None for log in self.logs)


def find_inputs(logs: Sequence[RecordedLog], wanted: tuple[float, float] | None, goes_on: bool = False) -> Excited:
    """Levels and range that the logs excite, or the range asked for, which ends there or `goes_on` with them."""
    levels = np.unique(np.abs(np.concatenate([log.input[log.changes] for log in logs])))
    levels = levels[levels > 0]
    ends, alike = (float(levels[0]), float(levels[-1])), LEVELS_ALIKE * levels[-1]
    begins = np.append(True, np.diff(levels) > alike)  # those all but alike are one
    width = float((levels - levels[begins][np.cumsum(begins) - 1]).max())  # but not a row of many, as a ramp has them
    levels = levels[begins]
    stepwise = all(log.stepwise for log in logs) and len(levels) <= MANY_LEVELS and width <= WIDEST_LEVEL * alike
    if wanted is not None:
        inside = levels[(levels >= wanted[0]) & (levels <= wanted[1])]
        if stepwise and not len(inside):
            held = ", ".join(f"{level:g}" for level in levels)
            raise UsageError(f"«duty» {wanted[0]:g}:{wanted[1]:g}: no level of the logs lies in it; they hold {held}")
        if goes_on and (top := _highest_acting(logs, wanted[1])) > wanted[1]:
            return find_inputs(logs, (wanted[0], top))
        return Excited(inside if stepwise else np.array(wanted), *wanted, stepwise, wanted)
    if stepwise:
        return Excited(levels, float(levels[0]), float(levels[-1]), True, (float(levels[0]), float(levels[-1])))
    sized = ((np.abs(log.input), log.dt_s) for log in logs)
    values, weights = [np.concatenate(part) for part in zip(*sized, strict=True)]
    acts = values > NEXT_TO_REST * values.max()  # below, a loop answers noise
    low, high = np.quantile(values, [TAIL, 1.0], weights=weights * acts, method="inverted_cdf").tolist()
    return Excited(np.array([low, high]) if high > low else np.array([low]), low, high, False, ends)


def _highest_acting(logs: Sequence[RecordedLog], high: float) -> float:
    """`high`, or the largest input of the logs where they lie beyond that for a part of their time under load: with a
    curve that ends there what it gives would be taken for something else of the plant."""
    loaded = np.concatenate([log.dt_s[log.input != 0] for log in logs])
    sizes = np.concatenate([np.abs(log.input[log.input != 0]) for log in logs])
    beyond = sizes > high + BEYOND_INPUTS * sizes.max(initial=0.0)
    return float(sizes.max()) if loaded[beyond].sum() > LEAST_TIME_BEYOND * loaded.sum() else high


def refuse(logs: Sequence[RecordedLog]) -> None:
    """Raise `DataError` with a sentence for every log that no model can be fitted to."""
    faults = []
    for log in logs:
        where = log.source or log.name
        top = float(np.nanmax(np.abs(log.input), initial=0.0))
        known = int(np.isfinite(log.output).sum())
        if not np.isfinite(log.input).all():
            faults.append(f"{where}: the input is not known at every row; a fit needs it whole")
        elif top == 0.0:
            faults.append(f"{where}: its input never leaves rest; there is nothing to fit")
        elif known < LEAST_OUTPUTS:
            faults.append(f"{where}: holds {known} rows with an output; a fit needs {LEAST_OUTPUTS}")
        elif np.ptp(log.output[np.isfinite(log.output)]) == 0:
            faults.append(f"{where}: its output never changes; look at the sensor")
        elif not log.stepwise and len(np.unique(log.output[np.isfinite(log.output)])) <= FEW_VALUES:
            faults.append(
                f"{where}: its output takes {FEW_VALUES} values or fewer while its input moves all the time, as if "
                "they were swapped; name both with «columns» input=NAME,output=NAME"
            )
        elif log.stepwise and (values := values_below_inputs(log)):
            faults.append(
                f"{where}: its output takes only {values} values at more inputs than that: too coarse to tell gains or "
                "time constants; use a finer range of the sensor"
            )
    follow = [follows(log) for log in logs] if not faults else []
    if len(follow) > 1 and min(map(abs, follow)) > FOLLOWS_SURELY and min(follow) < 0 < max(follow):
        most = 1 if sum(r > 0 for r in follow) * 2 >= len(follow) else -1
        faults += [
            f"{log.source or log.name}: its output goes the other way than that of the other logs; write it with the "
            "other sign, or leave it out"
            for log, r in zip(logs, follow, strict=True)
            if r * most < 0
        ]
    if not faults and (rows := sum(int(np.isfinite(log.output).sum()) for log in logs)) < LEAST_OF_ALL:
        faults.append(
            f"{logs[0].source or logs[0].name}: holds {rows} rows, and a fit of recorded logs needs {LEAST_OF_ALL}; "
            "record it longer, or sample it faster"
        )
    if faults:
        raise DataError(*faults)


def values_below_inputs(log: RecordedLog) -> int:
    """How many values an output takes that are fewer than the held inputs; 0 where they are not, or its rows differ."""
    y = log.output[np.isfinite(log.output)]
    if sample_noise(y) > 0:
        return 0
    values = len(np.unique(y))
    return values if values < len(np.unique(log.input[log.changes])) else 0


def follows(log: RecordedLog) -> float:
    """Correlation of the output with the input."""
    known = np.isfinite(log.output)
    u, y = (one - one.mean() for one in (log.input[known], log.output[known]))
    return float(u @ y) / max(float(np.linalg.norm(u) * np.linalg.norm(y)), 1e-300)


def input_findings(experiment: Experiment) -> list[Finding]:
    """Warnings in the inputs, log by log and together, and of a range that was asked for."""
    logs, inputs, wanted = experiment.logs, experiment.inputs, experiment.options.duty
    findings = list[Finding]()
    if wanted is not None and inputs.high > wanted[1]:
        findings.append(finding("range-goes-on", "data", wanted=wanted[1], high=inputs.high))
    for log in logs:
        top = float(np.abs(log.input).max())
        step = np.abs(np.diff(log.input)) > INPUT_JUMP * top
        alone = int((step[1:] & step[:-1]).sum())  # rows that differ much from both neighbours
        share = 100.0 * alone / max(int((log.input != 0).sum()), 1)
        if share > FAST_PCT:
            findings.append(finding("input-faster-than-sampled", log.name, share_pct=share))
        share, moves = 100.0 * log.saturated, not log.stepwise and len(inputs.levels) > 1
        if (moves or log.reference is not None) and share > SATURATED_PCT:
            findings.append(finding("input-saturates", log.name, share_pct=share, limit=top))
        if log.limit is not None:
            findings.append(finding("output-saturates", log.name, share_pct=log.at_limit_pct, limit=log.limit))
    findings += [
        finding("input-never-moves", log.name, level=float(log.input[0]))
        for log in logs
        if np.ptp(log.input) == 0 and log.idle_start is not True
    ]
    if len(inputs.levels) == 1:
        findings.append(finding("one-input-only", "data", inputs.levels))
    return findings
