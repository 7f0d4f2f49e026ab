"""Runs → the step set that is fitted: cut, sorted by level, repeats averaged, with findings on warnings."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from eaid.apparatus import rig_of
from eaid.arrays import median
from eaid.errors import DataError
from eaid.findings import Finding, finding, stops
from eaid.logs.read import PLAIN
from eaid.logs.run import Run
from eaid.options import ExperimentKind, ReadOptions, typed
from eaid.steps.checks import CHECKS, OF_RESTS, broken_off, coarse, creeping, disagreements, idle_at_limit, idle_slope
from eaid.steps.cut import level_steps
from eaid.steps.levels import common, grouped, same_level, wanted_levels
from eaid.steps.noise import STANDARD_ERRORS, block_error, idle_density
from eaid.steps.sittings import sittings
from eaid.steps.step import Cut, hold_of, left_pct, slip_of
from eaid.steps.stepset import Level, RunRecord, StepSet

SMALL_STEP = 0.2  # Share of the usual change below which a sign of its own is not held against a step


def signs_of(runs: Sequence[Run]) -> tuple[dict[str, float], list[Finding]]:
    """The sign of each cut run, by its name, one for all steps from rest of a sign of input; and findings of them."""
    findings: list[Finding] = []
    turned = {False: 1.0, True: 1.0}
    for negative in turned:
        rising = [r for r in runs if r.edge == "rising" and r.from_level == 0 and ((r.level or 0.0) < 0) is negative]
        clear = []  # those whose mean stands out of the noise
        for run in rising:
            change = float((rise := Cut(run).rise).mean())
            if abs(change) > STANDARD_ERRORS * block_error(rise) / np.sqrt(20):
                clear.append((run, change))
        if not clear:
            continue
        sizes = np.array([change for _, change in clear])
        usual = median(np.abs(sizes))
        # a vote a run: one run in another unit does not outweigh all others; a tie goes to the larger changes
        votes = np.sign(sizes[np.abs(sizes) > SMALL_STEP * usual]).sum() or sizes.sum()
        sign = -1.0 if votes < 0 else 1.0
        odd = [run for run, change in clear if change * sign < -SMALL_STEP * usual]
        others = len(clear) - len(odd)
        findings += [finding("sign-differs", run.name, (abs(run.level or 0.0),), siblings=others) for run in odd]
        if sign < 0:
            turned[negative] = sign
            findings.append(finding("signs-turned", "data", runs=len(rising)))
    signs = {run.name: turned[(run.level or 0.0) < 0] for run in runs}
    for run in runs:
        if run.from_level != 0.0:
            signs[run.name] = -1.0 if float(Cut(run).rise.mean()) < 0 else 1.0
    return signs, findings


def _record(step: Cut, findings: tuple[Finding, ...], left_out: bool) -> RunRecord:
    run = step.run
    from_rest = run.edge == "rising" and run.from_level == 0
    return RunRecord(
        name=run.name, source=run.source, sha256=run.sha256, level=abs(run.level or 0.0), repeat=run.repeat or 1,
        baseline_nm=run.baseline or 0.0, step_s=run.start_s + (run.step_s or 0.0), samples=len(step.time_s),
        rate_hz=1.0 / step.usual_s, edge=run.edge, findings=findings, from_level=run.from_level,
        lost_pct=hold_of(step.rise[None]).lost_pct if run.edge == "rising" else None,
        left_pct=left_pct(step) if run.edge == "falling" else None,
        idle_density=idle_density(run.time_s[: step.start], step.idle) if from_rest else None,
        idle_slope=idle_slope(step) if from_rest else None, slip=slip_of(step), left_out=left_out,
    )  # fmt: skip


def _single(values: set[str], what: str, remedy: str) -> str:
    if len(values) > 1:
        raise DataError(f"the logs have different {what} ({', '.join(sorted(v or 'none' for v in values))}); {remedy}")
    return next(iter(values))


def stepset_of(cut_steps: Sequence[Run], options: ReadOptions = PLAIN, recorded: Sequence[Run] = ()) -> StepSet:
    """Step set of runs that are cut already (`cut_runs`); without any, that of logs which are fitted as recorded."""
    every = cut_steps or recorded[:1]
    if not every:
        raise DataError("no log holds a step; give logs with one")
    kinds: set[ExperimentKind] = {run.kind for run in every if run.kind is not None}
    if options.kind is None and len(kinds) > 1:
        raise DataError(f"the logs are of different experiments ({', '.join(sorted(kinds))}); give one, or say «kind»")
    kind: ExperimentKind = options.kind or next(iter(kinds), None) or "clutch"
    input_unit = _single({run.input_unit for run in every}, "input units", "say one with «units» input=UNIT")
    output_unit = _single({run.output_unit for run in every}, "output units", "say one with «units» output=UNIT")
    rigs = {run.apparatus for run in every if run.apparatus is not None}
    if options.apparatus is None and len(rigs) > 1:
        raise DataError("the datasets are of different rigs; fit them apart")
    apparatus = options.apparatus or next(iter(rigs), None) or rig_of(kind, input_unit, output_unit)
    fraction = (finding("duty-may-be-fraction", "data"),) if input_unit == "%" and "input" not in options.units else ()
    if not cut_steps:
        small = all(float(np.abs(run.input).max()) <= 1 for run in recorded)
        return StepSet(kind, input_unit, output_unit, apparatus, (), findings=fraction if small else ())

    runs = sorted(cut_steps, key=lambda run: (abs(run.level or 0.0), run.repeat or 0, run.name))
    rising = grouped([run for run in runs if run.edge == "rising" and run.from_level == 0])
    falling = grouped([run for run in runs if run.edge == "falling" and run.from_level == 0])
    if options.levels is not None:
        there = sorted({level for level, _ in rising} or {abs(run.level or 0) for run in runs})
        wanted = wanted_levels(options.levels, there)
        rising, falling = ([pair for pair in group if _among(pair[0], wanted)] for group in (rising, falling))
        runs = [run for run in runs if _among(abs(run.level or 0.0), wanted)]

    signs, of_signs = signs_of(runs)
    steps = {run.name: Cut(run, signs[run.name]) for run in runs}
    of_runs = {
        name: [
            *step.run.findings, *_of_subject(of_signs, name),
            *filter(None, (one(step) for one in CHECKS[step.run.edge] if not (step.run.swept and one in OF_RESTS))),
        ]
        for name, step in steps.items()
    }  # fmt: skip
    up, down = ([[steps[run.name] for run in members] for _, members in group] for group in (rising, falling))
    rises = [step for level in up for step in level]
    for one in (*(told for level in up for told in broken_off(level)), *coarse(rises)):
        of_runs[one.subject].append(one)
    out = _stopped(runs, of_runs)
    levels = _averaged(up, out)
    odd = [] if any(run.swept for run in runs) else disagreements(levels, input_unit)
    for name in of_runs:
        of_runs[name] += _of_subject(odd, name)
    findings = [*_of_subject([*of_signs, *odd], "data"), *creeping(rises)]
    findings += idle_at_limit(rises, itertools.chain.from_iterable(of_runs.values()))
    findings += fraction if levels and levels[-1].level <= 1 else ()
    if stairs := sum(run.from_level != 0 for run in runs):
        findings.append(finding("level-to-level", "data", steps=stairs, of=len(runs)))
        findings += rests_elsewhere(runs, input_unit)
    records = [_record(steps[run.name], tuple(of_runs[run.name]), run.name in out) for run in runs]
    usual = median([np.abs(level.mean).max() for level in levels]) if levels else 0.0
    read_so = None if any(run.dataset for run in runs) else typed(options.stated())  # which a dataset does not say
    findings += sittings(records, usual, input_unit, read_so)
    records.sort(key=lambda record: (record.level, record.repeat, record.edge != "rising", record.name))
    return StepSet(
        kind, input_unit, output_unit, apparatus, tuple(levels), tuple(_averaged(down, out)), tuple(records),
        tuple(findings), synthetic="; ".join(sorted({run.synthetic for run in runs if run.synthetic})) or None,
        level_steps=level_steps([run for run in runs if run.name not in out], of_runs),
    )  # fmt: skip


ALIKE_RESTS, FEWEST_RESTS = 0.1, 3  # Part by which inputs at rest may differ, and so many steps that begin at them


def rests_elsewhere(runs: Sequence[Run], unit: str) -> list[Finding]:
    """Said where the steps that do not begin at rest all begin at one input, below every level, and no other is at 0
    before it: the rig may rest there, and what is counted from 0 parts its steps in two."""
    rises = [run for run in runs if run.edge == "rising" and run.has_input]
    begun = [run.from_level for run in rises if run.from_level != 0]
    if len(begun) < FEWEST_RESTS or min(begun) <= 0:
        return []
    rest, lowest = median(begun), min(abs(run.level or 0.0) for run in rises)
    before = [abs(float(run.input[0]) - rest) for run in rises]
    if max(*before, *(abs(one - rest) for one in begun)) > ALIKE_RESTS * rest or rest > lowest:
        return []
    return [finding("rests-elsewhere", "data", rest=rest, unit=unit, steps=len(begun), of=len(rises))]


def _of_subject(findings: Sequence[Finding], subject: str) -> list[Finding]:
    return [one for one in findings if one.subject == subject]


def _stopped(runs: Sequence[Run], findings: Mapping[str, Sequence[Finding]]) -> set[str]:
    """Runs that a finding stops which does not stop all rises, to be left out; none where no rise would be left. What
    doubts a unit, or the clock of most rises' inputs, doubts that of all runs, and leaves none of them out."""
    rises = [run.name for run in runs if run.edge == "rising" and run.from_level == 0] or [run.name for run in runs]
    early = sum(any(one.values.get("early_s", 0) for one in findings[name]) for name in rises)
    doubted = {"torque-too-large", "not-at-rest"} if 2 * early > len(rises) else {"torque-too-large"}
    codes = {run.name: {one.code for one in stops(findings[run.name])} - doubted for run in runs}
    of_all = set.intersection(*(codes[name] for name in rises))
    out = {name for name, own in codes.items() if own - of_all}
    return set() if out.issuperset(rises) else out


def _averaged(levels: Sequence[Sequence[Cut]], out: set[str]) -> list[Level]:
    """The repeats of each level as one, but for runs that are left out."""
    sound = ([step for step in members if step.run.name not in out] for members in levels)
    return [common(members) for members in sound if members]


def _among(level: float, wanted: Sequence[float]) -> bool:
    return any(same_level(level, one, 0.0) for one in wanted)
