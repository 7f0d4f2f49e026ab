"""Which steps are of one level, as closely as the input column tells them apart; their average; and which are one run.

Repeats are averaged sample by sample where they share a time axis, else interpolated to the finest. Runs are one run
where their values agree to their digits, whatever their clocks, digits, rates and lengths are.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError, UsageError
from eaid.findings import finding
from eaid.logs.run import Run
from eaid.steps.noise import sample_noise
from eaid.steps.step import Step, usual_step
from eaid.steps.stepset import Level

CLOSE = 1e-3  # Share within which commanded inputs are one level: rounding of what was written
WITHIN = 1e-2  # Share within which measured inputs may be one level, where their noise does not tell them apart
TOLD_APART = 10.0  # Standard deviations of the input's noise beyond which two holds are two levels


def same_level(a: float, b: float, noise: float = math.inf) -> bool:
    """True where two inputs are one level: within 1 % of the larger, and closer than their noise tells apart."""
    size = max(abs(a), abs(b))
    return abs(a - b) <= max(min(WITHIN * size, TOLD_APART * noise), CLOSE * size, 1e-12)


def grouped(runs: Sequence[Run]) -> list[tuple[float, list[Run]]]:
    """Steps by level, rising: the first input of each level and its runs, in the order given."""
    groups: list[tuple[float, float, list[Run]]] = []
    for run in sorted(runs, key=lambda one: abs(one.level or 0.0)):
        level, hold = abs(run.level or 0.0), run.input[Step(run).start :]
        noise = sample_noise(hold) if len(hold) and not np.isnan(hold[0]) else 0.0  # of one that is commanded: 0
        if groups and same_level(groups[-1][0], level, max(noise, groups[-1][1])):
            groups[-1][2].append(run)
        else:
            groups.append((level, noise, [run]))
    return [(level, members) for level, _, members in groups]


def wanted_levels(text: str, levels: Sequence[float], option: str = "levels") -> list[float]:
    """Those of `levels` that a text as `30:100` or `30,40` keeps; raises DataError where it names one not there."""
    chosen: set[float] = set()
    for part in text.split(","):
        bounds = part.split(":")
        try:
            numbers = [float(bound) for bound in bounds]
        except ValueError:
            numbers = []
        if len(numbers) == 2 and numbers[0] <= numbers[1]:
            meant = [level for level in levels if numbers[0] - 1e-9 <= level <= numbers[1] + 1e-9]
        elif len(numbers) == 1:
            near = sorted(
                (level for level in levels if same_level(level, numbers[0])), key=lambda u: abs(u - numbers[0])
            )
            meant = [level for level in near if same_level(level, near[0], 0.0)]
        else:
            raise UsageError(f"«{option}» {text}: write 30:100 or 30,40,90")
        if not meant:
            known = ", ".join(f"{level:g}" for level in levels)
            raise DataError(f"«{option}» {text}: no log holds {part.strip()}; levels found: {known}")
        chosen.update(meant)
    return sorted(chosen)


def common(members: Sequence[Step]) -> Level:
    """The repeats of one level, on their common window, the shortest; its level is their mean where inputs differ.

    Uniform repeats of one rate are taken as they are; any other set is interpolated linearly onto the finest (median)
    sample time. A single run keeps its own axis.
    """
    inputs = [member.levels[0] for member in members]
    level = inputs[0] if len(set(inputs)) == 1 else float(np.mean(inputs))
    times = [member.time_s for member in members]
    outputs = [member.rise for member in members]
    steps = [member.uniform_s for member in members]
    known = [step for step in steps if step is not None]
    shortest = min(len(time) for time in times)
    # the shortest sample time, not that of the first run: the order of the logs decides nothing
    if len(known) == len(steps) and max(known) - min(known) <= 1e-6 * min(known):
        axis = np.arange(shortest) * min(known)
    elif len(members) == 1 or all(np.array_equal(time[:shortest], times[0][:shortest]) for time in times):
        axis = times[0][:shortest]
    else:
        dt = min(usual_step(time) if step is None else step for step, time in zip(steps, times, strict=True))
        end = min(float(time[-1]) for time in times)
        axis = np.arange(np.floor(end / dt * (1 + 1e-12)) + 1) * dt
        outputs = [np.interp(axis, time, output) for time, output in zip(times, outputs, strict=True)]
    runs = np.stack([output[: len(axis)] for output in outputs])
    return Level(level, read_only(axis), read_only(runs), tuple(member.run.name for member in members))


ALL_PAIRS = 60  # Runs of a level of which each is compared with each; of more, those next to each other by their means
NEIGHBOURS = 3
PROBES = (0.9, 0.6, 0.4, 0.75, 0.3)  # Places in what two runs have in common that are compared before all of it
# Samples before and behind a step that are compared: long logs take no more time and memory than that
BEFORE, BEHIND = 2_000, 20_000
SHORTEST = 20  # Samples in common below which nothing is compared
TURNS = -0.3  # Correlation of a second difference with the next below which it is of noise: white noise has -0.67
SINGLE = 1e-7  # Rounding of a single-precision float
ALIKE = 0.5  # Correlation of the noise of two runs from which they are hardly two: that of others is 0 ± 0.1


@dataclass(frozen=True)
class _Values:
    """A run's output around its step."""

    run: Run
    output: Array
    at: int  # Sample at which its input steps

    @cached_property
    def usual_s(self) -> float:
        return float(np.median(np.diff(self.run.time_s[:10_000]))) if len(self.run.time_s) > 1 else 1.0

    @cached_property
    def largest(self) -> float:
        return float(np.abs(self.output).max(initial=0.0))

    @cached_property
    def turns(self) -> Array:
        """Second differences."""
        return np.diff(self.output, 2)

    @cached_property
    def noisy(self) -> bool:
        """Whether they are of noise, in the later half: these turn from sample to sample; those of a curve do not."""
        late = self.turns[len(self.turns) // 2 :]
        return bool(late[1:] @ late[:-1] < TURNS * (late @ late))

    @cached_property
    def quantum(self) -> Array:
        """The unit of the last digit of each value, shape (n,): of its decimals, or of its significant digits."""
        values = self.output
        probes = values[:: max(1, len(values) // 50)]
        texts = [f"{abs(one):.10e}".split("e") for one in probes.tolist() if one]
        digits = max((len(mantissa.rstrip("0")) - 1 for mantissa, _ in texts), default=1)
        last = min((int(power) - len(mantissa.rstrip("0").split(".")[1]) for mantissa, power in texts), default=0)
        size = np.floor(np.log10(np.maximum(np.abs(values), 10.0 ** (last + digits - 1)))) - (digits - 1)
        return np.maximum(10.0**size, 10.0**last)


def counted_once(runs: Sequence[Run]) -> list[Run]:
    """Runs without those whose values another run has, of another log; the one that stays says so.

    Runs are those of one rig, cut (their steps are laid on each other) or not (the first change of their inputs is).
    """
    groups: list[tuple[Run, list[_Values]]] = []
    for run in sorted(runs, key=lambda run: (*_what(run), abs(run.level or 0.0))):
        first = groups[-1][0] if groups else run
        if not groups or _what(run) != _what(first) or not same_level(run.level or 0.0, first.level or 0.0, 0.0):
            groups.append((run, []))
        if run.step_s is not None:
            at = int(np.searchsorted(run.time_s, run.step_s - 1e-9))
        else:
            at = int((np.abs(run.input - run.input[:1]) > 0.1 * np.ptp(run.input)).argmax()) if len(run.input) else 0
        begin = max(0, at - BEFORE)
        groups[-1][1].append(_Values(run, run.output[begin : at + BEHIND], at - begin))
    longest: dict[int, Run] = {}
    for _, members in groups:
        many = len(members) > ALL_PAIRS
        alone: list[_Values] = []
        for one in sorted(members, key=lambda one: float(one.output.mean())) if many else members:
            for k in range(len(alone) - 1, -1 if not many else max(-1, len(alone) - 1 - NEIGHBOURS), -1):
                other = alone[k]
                code = _compared(one, other) if _log_of(one.run) != _log_of(other.run) else None
                if code is None:
                    continue
                longer, shorter = (one, other) if len(one.run.output) > len(other.run.output) else (other, one)
                of_longer = longest.get(id(longer.run), longer.run)
                note = finding(code, of_longer.name, (of_longer.level or 0.0,), other=shorter.run.where)
                longest[id(longer.run)] = replace(of_longer, findings=(*of_longer.findings, note))
                if code == "run-given-twice":
                    longest.pop(id(shorter.run), None)
                    alone[k] = longer
                    break
            else:
                alone.append(one)
                longest.setdefault(id(one.run), one.run)
    return [longest[id(run)] for run in runs if id(run) in longest]


def _log_of(run: Run) -> tuple[str, str]:
    return run.dataset, run.source


def _what(run: Run) -> tuple[str, str, str, str]:
    return run.edge, run.kind or "", run.input_unit, run.output_unit


def _compared(one: _Values, other: _Values) -> str | None:
    """What two runs are: one and the same, hardly two, or two (None)."""
    fine, coarse = (one, other) if one.usual_s <= other.usual_s else (other, one)
    if not (fine.largest and coarse.largest):
        return None
    suspicious = False
    slower = coarse.usual_s / fine.usual_s
    for stride in {1, round(slower) if slower * SHORTEST < len(fine.output) else 1}:
        for shift in range(-stride, stride + 1):
            first = max(-coarse.at, -((fine.at + shift) // stride))
            stop = min(len(coarse.output) - coarse.at, (len(fine.output) - fine.at - shift - 1) // stride + 1)
            if stop - first < SHORTEST:
                continue
            of_coarse = slice(coarse.at + first, coarse.at + stop)
            begin = fine.at + shift + first * stride
            of_fine = slice(begin, begin + (stop - first - 1) * stride + 1, stride)
            if _agree(fine, of_fine, coarse, of_coarse):
                return "run-given-twice"
            suspicious = suspicious or (stride == 1 and _same_noise(fine, of_fine, coarse, of_coarse))
    return "repeats-too-alike" if suspicious else None


def _agree(fine: _Values, of_fine: slice, coarse: _Values, of_coarse: slice) -> bool:
    """Whether values agree to their digits, in units that are a power of ten apart; a few of them before all."""
    tens = 10.0 ** round(math.log10(coarse.largest / fine.largest))
    slack = SINGLE * tens * fine.largest
    a, b, of_a, of_b = fine.output, coarse.output, fine.quantum, coarse.quantum
    count = of_coarse.stop - of_coarse.start
    for k in PROBES:
        j, i = of_coarse.start + int(k * count), of_fine.start + int(k * count) * of_fine.step
        if abs(tens * a[i] - b[j]) > 0.505 * max(tens * of_a[i], of_b[j]) + slack:
            return False
    allowed = 0.505 * np.maximum(tens * of_a[of_fine], of_b[of_coarse]) + slack
    return bool((np.abs(tens * a[of_fine] - b[of_coarse]) <= allowed).all() and np.ptp(a[of_fine]) > 0)


def _same_noise(one: _Values, of_one: slice, other: _Values, of_other: slice) -> bool:
    """Whether the noise of two outputs is one, in their later halves: second differences that go together."""
    if not (one.noisy and other.noisy):
        return False
    count = of_other.stop - of_other.start
    a = one.turns[of_one.start + count // 2 : of_one.stop - 2]
    b = other.turns[of_other.start + count // 2 : of_other.stop - 2]
    return len(a) >= 2 * SHORTEST and float(a @ b) > ALIKE * math.sqrt(float(a @ a) * float(b @ b)) > 0
