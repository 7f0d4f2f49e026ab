"""How often a nominal 95 % interval holds the truth: `python -m benchmarks.coverage [SETS] [ROW…]`.

Four kinds of rows, each printed as Markdown [%]: mean over the levels (least–largest of any one level).

`SETS_OF`: ten levels of the reference plant, 2,000 samples over 20 s, three runs a level. Per run a gain factor
1 + 0.03 N and exp(0.05 N) on τ1; white noise 0.01 N·m, AR(1) ripple of 1 % (0.05 s) and rotor ripple of 1 % (10 RPM,
its phase from run to run). The truth of the linear model, which is wrong by design, is its fit to the plant itself.
Where the C held is not the plant's, the levels' own aim is counted too: the fit, at that C, to the plant itself.

`RECORDED`: one log of the reference plant, white noise 0.006 N·m, coloured noise of 1 % (0.3 s), 200 Hz; curves at
ten duties. `STAIRCASES`: single steps of staircases held for 5 to 8 slow time constants, noise of 0.2 to 3 % of a
step that remembers 0 to 20 samples, each fitted as `eaid fit` does. Every interval that is quoted counts. `SWEEPS`: ten
levels from rest in one log, in a random order, whose rests are too short.
"""

import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas

import eaid
from benchmarks.stop_findings import log, rise, wander
from benchmarks.table import asked
from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.plant.dynamics import REFERENCE_PLANT, Step
from eaid.plant.steps import step_response
from eaid.results.common import Interval
from eaid.results.fit import Fit
from eaid.shapes.each_step import fit_single_steps
from eaid.steps.build import stepset_of
from eaid.steps.cut import cut
from eaid.steps.stepset import Level, RunRecord, StepSet

NAMES = ("Ts", "tau1", "tau2")
LEVELS = np.arange(10.0, 101.0, 10.0)
SAMPLES = 2000
COLOUR_S = 0.05
WIDE = 0.30
"""Half-width beyond which an interval of a level is flagged: coverage of τ2 is counted below it."""
ROTOR_HZ = 10 / 60


@dataclass(frozen=True)
class Variant:
    """How the sets of one row are made."""

    name: str
    runs: int = 3
    white_nm: float = 0.01
    sweeps: bool = False
    """One gain for all levels of a repeat."""
    doubled_below: float = 0.0
    """Scatter twice as large up to this duty [%]."""
    share: float = 0.85
    """C of the plant; the fit holds 0.85 unless the runs tell another."""
    creep_nm_s: float = 0.0
    """Rate at which the output creeps beside its response, while it idles for a second, too."""
    record_s: float = 20.0
    levels_off: float = 0.0
    """How far the levels' T_s lie off the curve, as a standard deviation of its logarithm."""


VARIANTS: dict[str, Variant] = {
    "base": Variant("three runs a level"),
    "single": Variant("one run a level", runs=1),
    "sweeps": Variant("three sweeps, one gain each", sweeps=True),
    "low": Variant("scatter doubled up to 30 % duty", doubled_below=30.0),
    "white": Variant("white noise × 5", white_nm=0.05),
    **{f"{s:g}s": Variant(f"three runs of {s:g} s a level", record_s=s) for s in (5.0, 8.0, 12.0)},
    "levels off": Variant("three runs a level, levels off the curve by 10 %", levels_off=0.1),
    **{f"{s:g}s single": Variant(f"one run of {s:g} s a level", runs=1, record_s=s) for s in (5.0, 8.0)},
    "share": Variant("C of the plant 0.88", share=0.88),
    "creep": Variant("the output creeps by 1 % of the highest in a hold", creep_nm_s=0.002),
}


def plant(duty_pct: float, variant: Variant) -> Step:
    """The true curve of one level."""
    return replace(REFERENCE_PLANT.at(duty_pct), C=variant.share)


def off_curve(seed: int, variant: Variant, levels: Array) -> Array:
    """Factor of each level's T_s to the curve's, (L,)."""
    return np.asarray(np.exp(variant.levels_off * np.random.default_rng([seed, 20261]).standard_normal(len(levels))))


def coloured(random: np.random.Generator, runs: int, n: int, dt_s: float) -> Array:
    """AR(1) noise of unit variance and memory `COLOUR_S`, shape (runs, n)."""
    keep = np.exp(-dt_s / COLOUR_S)
    white = random.standard_normal((runs, n))
    white[:, 1:] *= np.sqrt(1 - keep * keep)
    for k in range(1, n):
        white[:, k] += keep * white[:, k - 1]
    return white


def stepset(levels: tuple[Level, ...], slopes: Sequence[float] = ()) -> StepSet:
    """A set of levels; of their runs what is known is how the output creeps while it idles."""
    names = [(name, level) for level in levels for name in level.names]
    runs = tuple(
        RunRecord(name, "", "", of.level, 1, 0.0, 0.0, len(of.time_s), 1 / float(of.time_s[1]), "rising",
                  idle_slope=slope)
        for (name, of), slope in zip(names, slopes, strict=False)
    )  # fmt: skip
    return StepSet("clutch", "%", "N·m", Apparatus(), levels, runs=runs)


def one_set(
    seed: int, variant: Variant, samples: int = SAMPLES, levels: Array = LEVELS, record_s: float | None = None
) -> StepSet:
    """One simulated set; the same seed gives the same set."""
    record_s = variant.record_s if record_s is None else record_s
    random = np.random.default_rng([seed, 20260])
    t = np.arange(samples) * (record_s / samples)
    sweep = random.standard_normal(variant.runs)
    colour = coloured(random, variant.runs * len(levels), samples, record_s / samples).reshape(
        len(levels), variant.runs, -1
    )
    made, factors = [], off_curve(seed, variant, levels)
    for i, duty in enumerate(levels):
        size = 2.0 if duty <= variant.doubled_below else 1.0
        true = plant(float(duty), variant)
        true = replace(true, Ts=true.Ts * factors[i])
        runs = []
        for r in range(variant.runs):
            gain = 1 + 0.03 * (sweep[r] if variant.sweeps else size * random.standard_normal())
            own = replace(true, Ts=true.Ts * gain, tau1=true.tau1 * np.exp(0.05 * size * random.standard_normal()))
            rotor = np.sin(2 * np.pi * (ROTOR_HZ * t + random.random()))
            torque = step_response(own, t) * (1 + 0.01 * colour[i, r] + 0.01 * rotor)
            runs.append(torque + variant.creep_nm_s * t + variant.white_nm * random.standard_normal(samples))
        names = tuple(f"{duty:g}-{r}" for r in range(variant.runs))
        made.append(Level(float(duty), t, np.array(runs), names))
    error = variant.white_nm * np.sqrt(12 * record_s / samples)  # of a slope over a second
    slopes = variant.creep_nm_s + error * np.random.default_rng([seed, 20262]).normal(size=variant.runs * len(levels))
    return stepset(tuple(made), slopes.tolist())


def truth(variant: Variant, samples: int = SAMPLES, levels: Array = LEVELS) -> dict[str, Any]:
    """What the intervals should hold: the plant's own values, and the linear fit to the plant without noise."""
    curves = [plant(float(duty), variant) for duty in levels]
    t = np.arange(samples) * (variant.record_s / samples)
    clean = tuple(
        Level(u, t, step_response(one, t)[None], ("plant",)) for u, one in zip(levels.tolist(), curves, strict=True)
    )
    found = eaid.fit(stepset(clean), model=("friction", "linear"), ci="none")
    linear, friction_part = found.linear, found.friction
    assert linear is not None and friction_part is not None
    return {
        "Ts": np.array([curve.Ts for curve in curves]),
        "tau1": np.array([curve.tau1 for curve in curves]),
        "tau2": np.array([curve.tau2 for curve in curves]),
        **{name: getattr(linear.parameters, name) for name in ("a0", "b0", "c0")},
        "C": variant.share,
        "aim": {name: [getattr(row.curve, name) for row in friction_part.levels] for name in NAMES},
        "B": np.array([row.B for row in linear.per_level]),
        "B_m": linear.bounds.B_m,
        "B_M": linear.bounds.B_M,
    }


def inside(interval: Any, value: float) -> float:
    """1 or 0; NaN where no interval was given (flagged)."""
    if interval is None:
        return np.nan
    return float(interval[0] <= value <= interval[1])


def doubted(interval: Interval, name: str) -> bool:
    """Whether an interval is not quoted, or is one of τ2 and wide: of others all count, as the narrow ones alone are
    those whose scatter was seen too small."""
    if interval is None or interval[0] <= 0:
        return True
    return name == "tau2" and np.log(interval[1] / interval[0]) > 2 * np.log1p(WIDE)


def hits(found: Fit, true: dict[str, Any], off: Array | float = 1.0) -> dict[str, list[float]]:
    """Which intervals hold the truth: by group and parameter, one entry a level (one alone for the pooled ones).

    `off` are the factors of the levels' own T_s to the curve's.
    """
    result: dict[str, list[float]] = {}
    assert found.nonlinear is not None and found.linear is not None and found.uncertainty is not None
    share, linear = found.uncertainty.share, found.linear
    for name in NAMES:
        values = true[name] * off if name == "Ts" else true[name]
        if found.friction is not None:
            own = [getattr(row.ci95, name) for row in found.friction.levels]
            for label, aim in (("level", values), ("aim", true["aim"][name])):
                pairs = zip(own, aim, strict=True)
                result[f"{label} {name}"] = [np.nan if doubted(ci, name) else inside(ci, v) for ci, v in pairs]
        label = "joint" if found.nonlinear.estimator == "joint" else "curves"
        rows = [getattr(row.ci95, name) for row in found.nonlinear.curves]
        result[f"{label} {name}"] = [inside(ci, v) for ci, v in zip(rows, true[name], strict=True)]
    if share is not None and share.rejected is not None:
        result["asked C"] = [inside(share.ci95, true["C"])]
        result["asked rejected"] = [float(share.rejected)]
        result["asked told"] = [float(bool(share.matters))]
    for name in ("a0", "b0", "c0"):
        result[f"linear {name}"] = [inside(getattr(linear.ci95, name), true[name])]
    result["linear B"] = [
        inside(row.ci95.B if row.ci95 else None, b) for row, b in zip(linear.per_level, true["B"], strict=True)
    ]
    for name in ("B_m", "B_M"):
        assert linear.bounds is not None
        result[f"linear {name}"] = [inside(getattr(linear.bounds.ci95, name, None), true[name])]
    return result


def widths(found: Fit) -> dict[str, float]:
    """Mean half-widths [%] of the levels' own intervals and of the curves."""
    result = {}
    assert found.friction is not None and found.nonlinear is not None
    groups = {"level": found.friction.levels, "curves": found.nonlinear.curves}
    for label, rows in groups.items():
        for name in NAMES:
            own = [ends for row in rows if (ends := getattr(row.ci95, name)) is not None]
            result[f"{label} {name}"] = float(np.mean([50 * np.log(b / a) for a, b in own])) if own else np.nan
    return result


@dataclass(frozen=True)
class Coverage:
    """One row of the tables of sets [%]: coverage by group and parameter, one entry a level; mean half-widths."""

    ours: dict[str, Array]
    textbook: dict[str, Array]
    widths: dict[str, float]


def measure(variant: Variant, sets: int, first: int = 0) -> Coverage:
    """Coverage over `sets` simulated sets."""
    true = truth(variant)
    ours, textbook, reach = [], [], []
    for seed in range(first, first + sets):
        made = one_set(seed, variant)
        robust, white = eaid.fit(made), eaid.fit(made, ci="white", estimator="joint")
        off = off_curve(seed, variant, LEVELS)
        joint = hits(eaid.fit(made, model=("nonlinear", "linear"), estimator="joint"), true)
        ours.append(
            {**hits(robust, true, off), **{key: held for key, held in joint.items() if key.startswith("joint")}}
        )
        textbook.append(hits(white, true))
        reach.append(widths(robust))
    return Coverage(
        {key: _mean([one[key] for one in ours if key in one]) for key in ours[0]},
        {key: _mean([one[key] for one in textbook if key in one]) for key in textbook[0]},
        {key: float(np.nanmean([one[key] for one in reach])) for key in reach[0]},
    )


def _mean(rows: list[list[float]]) -> Array:
    values = np.array(rows)
    known = np.isfinite(values)
    counted = known.sum(axis=0)
    share = 100 * np.where(known, values, 0).sum(axis=0) / np.maximum(counted, 1)
    return np.asarray(np.where(counted >= 0.2 * len(values), share, np.nan))  # mostly flagged: nothing to count


RECORDED: dict[str, tuple[str, dict[str, Any]]] = {
    "random": ("random", {"duration_s": 240.0}),
    "staircase of 12 s": ("staircase", {"duration_s": 240.0, "hold_s": (0.5, 12.0)}),
    "staircase of 6 s": ("staircase", {"duration_s": 480.0, "hold_s": (0.5, 6.0)}),
    "rests": ("random", {"duration_s": 240.0, "hold_s": (0.5, 10.0), "rest_s": 8.0}),
    "closed loop": ("closed-loop", {"duration_s": 240.0, "hold_s": (0.5, 12.0)}),
    "chirp": ("chirp", {"duration_s": 240.0}),
}
"""Excitation and its shape."""


def recorded(name: str, sets: int) -> dict[str, tuple[Array, float, float]]:
    """Coverage [%] of T_s(u), τ1(u), τ2(u) of recorded logs, by duty; share quoted [%] and median half-width [%]."""
    excitation, shape = RECORDED[name]
    noise = {"white_nm": 0.006, "coloured": 0.01, "coloured_s": 0.3}
    rows, widths = defaultdict(list), defaultdict(list)
    for seed in range(1000, 1000 + sets):
        logs = eaid.synth(excitation=excitation, shape=shape, rate_hz=200.0, clean=True, seed=seed, **noise)
        found = eaid.fit(logs, model=("nonlinear",), duty=(10.0, 100.0)).nonlinear
        for name in NAMES:
            pairs = [(getattr(row.ci95, name), getattr(REFERENCE_PLANT.at(row.level), name)) for row in found.curves]
            rows[name].append([inside(ends, value) for ends, value in pairs])
            widths[name] += [50 * float(np.log(ends[1] / ends[0])) for ends, _ in pairs if ends]
    return {
        name: (_mean(held), 100 * float(np.isfinite(held).mean()), float(np.median(widths[name])))
        for name, held in rows.items()
    }


STAIRCASES = {
    **{kind: (kind, (5.0, 8.0)) for kind in ("two", "one", "dead time", "overshoot")},
    **{f"{kind}, {hold:g} τ2": (kind, (hold, hold)) for kind in ("two", "overshoot") for hold in (1.5, 3.5, 8.0)},
}
"""Shape, and the range of holds in slow time constants."""
HEIGHTS, GAINS, RATE_HZ = (20.0, 50.0, 80.0, 40.0), (0.03, 0.04, 0.02, 0.05), 100.0


def quoted(name: str, count: int) -> Iterator[tuple[str, float, Interval]]:
    """Name, truth and interval of every number of every step of so many staircases of a shape."""
    random = np.random.default_rng(5)
    kind, holds = STAIRCASES[name]
    for _ in range(count):
        tau1 = float(np.exp(random.uniform(np.log(0.1), np.log(0.6))))
        tau2 = tau1 * float(random.uniform(4, 10))
        share = {"one": 1.0, "overshoot": 1.3}.get(kind, 0.85)
        dead = float(random.uniform(0.2, 0.5)) if kind == "dead time" else 0.0
        hold = round(random.uniform(*holds) * tau2 * RATE_HZ)
        t = np.arange(hold * len(HEIGHTS)) / RATE_HZ
        changes = {(a, b): gain * (b - a) for a, b, gain in zip(HEIGHTS, HEIGHTS[1:], GAINS[1:], strict=False)}
        y = np.full(len(t), GAINS[0] * HEIGHTS[0])
        for k, change in enumerate(changes.values()):
            since = np.maximum(t - (k + 1) * hold / RATE_HZ - dead, 0.0)
            y += change * rise(since, tau1, tau2, share) * (since > 0)
        y += random.choice([0.002, 0.01, 0.03]) * wander(random, len(t), float(random.choice([0.1, 5, 20])))
        for step in fit_single_steps(stepset_of(cut(log(t, np.repeat(HEIGHTS, hold), y))), eaid.FitOptions()):
            found = step.ci95
            change = changes[step.from_, step.level]
            yield "change", change, found.change
            yield "gain", change / (step.level - step.from_), found.gain
            yield "tau1", tau1, found.tau1
            if kind != "one":
                yield "tau2", tau2, found.tau2
            if kind == "overshoot":
                yield "C", share, found.C
            if kind == "dead time":
                yield "dead_time_s", dead, found.dead_time_s


def steps_held(kind: str, count: int) -> dict[str, tuple[float, int, int]]:
    """Share of intervals that hold the truth, how many were quoted, and how many were not, by name."""
    held = defaultdict(list)
    for name, value, ends in quoted(kind, count):
        held[name].append(inside(ends, value))
    return {
        name: (float(np.nanmean(some)), int(np.isfinite(some).sum()), int(np.isnan(some).sum()))
        for name, some in held.items()
    }


SWEEPS = {f"{files} sweeps, rests of {rest_s:g} s": (files, rest_s) for files in (3, 1) for rest_s in (5.0, 20.0)}
"""Files, each with ten levels in a random order, held for 20 s, and the rest behind each."""


def sweep(random: np.random.Generator, rest_s: float) -> dict[str, Array]:
    """Columns of one file: gains scatter by 2 % and time constants by 3 %, falls have 0.3 and 7 s; noise 0.005 N·m."""
    parts, x, rate = [(0.0, np.zeros(250))], np.zeros(2), 50
    for duty in random.permutation(LEVELS):
        true = REFERENCE_PLANT.at(float(duty))
        taus = np.array([true.tau1, true.tau2]) * np.exp(0.03 * random.standard_normal(2))
        target = true.Ts * (1 + 0.02 * random.standard_normal()) * np.array([true.C, 1 - true.C])
        for u, lasts_s, to, tau in ((duty, 20.0, target, taus), (0.0, rest_s, 0 * target, np.array([0.3, 7.0]))):
            t = np.arange(round(lasts_s * rate) + 1) / rate
            states = to + (x - to) * np.exp(-t[:, None] / tau)
            x = states[-1]
            parts.append((float(u), states[:-1].sum(axis=1)))
    held, outputs = zip(*parts, strict=True)
    y = np.concatenate(outputs)
    duty = np.repeat(held, [len(one) for one in outputs])
    return {"time_s": np.arange(len(y)) / rate, "duty_pct": duty, "torque_nm": y + 0.005 * random.normal(size=len(y))}


def swept(name: str, sets: int) -> dict[str, tuple[Array, float, float]]:
    """Coverage [%] of T_s, τ1, τ2 of sweeps whose steps begin on the tails of those before, as of recorded logs."""
    files, rest_s = SWEEPS[name]
    rows, widths = defaultdict(list), defaultdict(list)
    for seed in range(sets):
        random = np.random.default_rng([seed, 20270])
        logs = {f"s{k}": pandas.DataFrame(sweep(random, rest_s)) for k in range(files)}
        found = eaid.fit(eaid.read(logs), model=("friction", "nonlinear"))
        for name in NAMES:
            pairs = [
                (getattr(row.ci95, name), getattr(REFERENCE_PLANT.at(row.level), name)) for row in found.friction_levels
            ]
            rows[name].append([inside(ends, value) for ends, value in pairs])
            widths[name] += [50 * float(np.log(ends[1] / ends[0])) for ends, _ in pairs if ends and ends[0] > 0]
    return {
        name: (_mean(held), 100 * float(np.isfinite(held).mean()), float(np.median(widths[name])))
        for name, held in rows.items()
    }


def cell(values: Array | None) -> str:
    """Mean, least and largest."""
    if values is None:
        return "–"
    v = values[np.isfinite(values)]
    if not len(v):
        return "flagged"
    return f"{v[0]:.0f}" if len(v) == 1 else f"{v.mean():.0f} ({v.min():.0f}–{v.max():.0f})"


def lines(name: str, sets: int) -> Iterator[str]:
    """The Markdown of one row, a line a quantity."""
    if name in VARIANTS:
        found = measure(VARIANTS[name], sets)
        yield f"\n| {VARIANTS[name].name}, {sets} sets | ours | textbook | half-width |\n|---|---|---|---|"
        for key, values in found.ours.items():
            width = f"{found.widths[key]:.1f}" if key in found.widths else ""
            yield f"| {key} | {cell(values)} | {cell(found.textbook.get(key))} | {width} |"
    elif name in RECORDED or name in SWEEPS:
        yield f"\n| {name}, {sets} sets | held | quoted | half-width |\n|---|---|---|---|"
        for key, (values, told, width) in (recorded if name in RECORDED else swept)(name, sets).items():
            yield f"| {key} | {cell(values)} | {told:.0f} | {width:.1f} |"
    else:
        yield f"\n| steps: {name}, {sets} staircases | held | quoted | not quoted |\n|---|---|---|---|"
        for key, (share, told, untold) in steps_held(name, sets).items():
            yield f"| {key} | {100 * share:.1f} | {told} | {untold} |"


def main(words: list[str]) -> None:
    sets, names = asked(words, 500, (*VARIANTS, *RECORDED, *SWEEPS, *STAIRCASES))
    for name in names:
        for line in lines(name, sets):
            print(line, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
