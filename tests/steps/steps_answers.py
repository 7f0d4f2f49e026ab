"""Several hundred made inputs and what `eaid.steps` answers to each, so that no limit moves unseen.

Each family of inputs is drawn so that its limits lie inside the range. `python tests/steps/steps_answers.py` writes
answers.json anew: only after a change that is meant, with a look at what differs.
"""

import json
import sys
from collections.abc import Callable
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.findings import Finding
from eaid.logs.run import Run
from eaid.steps.baseline import BaselineRule, first_samples, last_rest
from eaid.steps.build import build_stepset
from eaid.steps.checks import coarse, flat_top, isolated_spikes, saturated, sharpness, slow_constant, stuck
from eaid.steps.cut import StepOptions, onset, rises_at_once, settled_steps, turns_of
from eaid.steps.edges import edges, looks_like, moving, turns
from eaid.steps.noise import block_error, block_means, idle_density, sample_noise, spikes
from eaid.steps.plateaus import bridge, plateaus, stands_still
from eaid.steps.slip import slip_of
from eaid.steps.step import Step, clock_of, uniform_step
from eaid.steps.stepset import LevelStep, StepSet

FILE = Path(__file__).parent / "answers.json"
Random = np.random.Generator


def plain(value: Any) -> Any:
    """Numbers to five digits, findings as code and values, everything else as JSON has it."""
    if isinstance(value, Finding):
        return [
            value.code,
            plain(value.levels),
            *plain([item for item in value.values.values() if not isinstance(item, str)]),
        ]
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, bool | np.bool_ | int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.4e}") + 0.0 if abs(value) > 1e-9 else 0.0
    return value


def rising(random: Random, t: Array, tau: float) -> Array:
    """A response to a step at 0, in one of the shapes that rigs give; 0 before it."""
    since, shape = np.maximum(t, 0.0), int(random.integers(0, 6))
    rise = 0.85 * -np.expm1(-since / tau) + 0.15 * -np.expm1(-since / (tau * random.uniform(2, 12)))
    if shape == 1:
        rise = rise * (1 + random.uniform(0, 0.6) * np.exp(-since / (4 * tau)))
    elif shape == 2:
        rise = np.where(t > 0, -np.expm1(-since / tau) - 0.4 * np.exp(-since / (3 * tau)) * np.sin(since / tau), 0.0)
    elif shape == 3:
        rise = np.minimum(since / (2 * tau), 1.0)
    elif shape == 4:
        rise = rise * (1 - random.uniform(0, 0.1) * since / max(float(since[-1]), 1e-9))
    return np.asarray(rise)


def hurt(random: Random, y: Array, start: int, swing: float) -> Array:
    """An output with one of the faults that sensors have, often none."""
    y, count, fault = y.copy(), len(y), int(random.integers(0, 14))
    at = int(random.integers(start, count - 12))
    if fault == 0:
        y = np.minimum(y, y.min() + random.uniform(0.4, 1.0) * np.ptp(y))
    elif fault == 1:
        y[at : at + int(count * random.uniform(0.005, 0.2))] = y[at]
    elif fault == 2:
        finest = swing / random.uniform(10, 40)
        y = np.round(y / finest) * finest
    elif fault == 3:
        y[at] += swing * random.uniform(0.5, 3)
    elif fault == 4 and start > 20:
        y[int(random.integers(5, start - 5))] += swing * random.uniform(0.02, 1)
    elif fault == 5:
        y += swing * random.uniform(0, 0.2) * np.arange(count) / count
    elif fault == 6 and start > 40:
        y[start - int(random.integers(1, 20)) : start] += swing * random.uniform(0.005, 0.1)
    elif fault == 7 and start > 40:
        y[:start] += swing * random.uniform(0, 0.1) * np.linspace(-1, 0, start)
    elif fault == 8:
        y[-int(count * random.uniform(0.01, 0.3)) :] *= random.uniform(0, 1)
    return y


def a_log(random: Random) -> Run:
    """A log of one to six holds, or of what is no steps at all."""
    rate = float(random.choice([50.0, 100.0, 250.0]))
    unit = str(random.choice(["%", "V", "N"]))
    tau = float(np.exp(random.uniform(np.log(3 / rate), np.log(1.0))))
    holds = [0.0] if random.uniform() < 0.85 else []
    while len(holds) < int(random.integers(2, 5)):
        holds.append(float(random.choice([0.0, 20.0, 30.0, 50.0, 80.0, -40.0 if unit == "V" else 90.0])))
    lengths = [random.uniform(0.3, 6.0) for _ in holds]
    counts = [max(2, round(one * rate)) for one in lengths]
    t = np.arange(sum(counts)) / rate
    u, y, at, before = np.concatenate([np.full(n, h) for n, h in zip(counts, holds, strict=True)]), 0.0 * t, 0, 0.0
    way = -0.04 if random.uniform() < 0.2 else 0.04
    for count, hold in zip(counts, holds, strict=True):
        if at:
            y += way * (hold - before) * rising(random, t - t[at] + 1e-12, tau)
        before, at = hold, at + count
    swing = max(float(np.ptp(y)), 0.1)
    y = hurt(random, y + random.uniform(-1, 1), min(counts[0], len(y) - 30), swing) if len(y) > 60 else y
    y = y + float(random.choice([0.0, 0.0, 0.002, 0.02])) * swing * random.normal(size=len(y))
    odd = int(random.integers(0, 16))
    if odd == 0:
        width = int(random.integers(1, 60))
        u = np.convolve(u, np.ones(width) / width, "full")[: len(u)]
    elif odd == 1:
        u = np.where(np.arange(len(u)) % int(random.integers(100, 400)) < int(random.integers(1, 6)), 0.0, u)
    elif odd in (2, 3) and unit != "%":
        u = u + random.uniform(0.05, 5) * random.normal(size=len(u)) + (odd == 3) * random.uniform(0, 8)
    elif odd == 4:
        t = t + np.where(np.arange(len(t)) >= int(random.integers(1, len(t))), random.uniform(2, 12) / rate, 0.0)
    elif odd == 5:
        t = np.cumsum(1 / rate * (1 + random.uniform(0, 0.4) * random.uniform(-1, 1, len(t))))
    elif odd == 6:
        bits = random.integers(0, 2, 1 + len(u) // 15)
        u = 30.0 + 40.0 * np.repeat(bits, 15)[: len(u)]
    elif odd == 7:
        u = 50 + 40 * np.sin(2 * np.pi * random.uniform(0.1, 2) * t * (1 + random.choice([0.0, 0.3]) * t))
    elif odd == 8:
        u = np.full(len(u), random.choice([0.0, 50.0]))
    kind = {"%": "clutch", "V": "clutch", "N": "friction-force"}[unit]
    run = Run(
        name="a", time_s=read_only(t), input=read_only(u), output=read_only(y), input_unit=unit, output_unit="N·m",
        source="a.csv", sha256="0", kind=kind,
    )  # fmt: skip
    said = int(random.integers(0, 10))
    if said == 0:
        run = replace(run, input=read_only(np.full(len(t), np.nan)), level=50.0)
    elif said == 1:
        run = replace(run, input=read_only(np.full(len(t), np.nan)), level=50.0, step_s=float(t[counts[0]]))
        run = replace(run, until_s=float(t[-1] * random.uniform(0.5, 1.0))) if random.uniform() < 0.5 else run
    elif said == 2:
        run = replace(run, step_s=float(t[counts[0]]), until_s=float(t[-1] * random.uniform(0.3, 1.0)))
    elif said == 3:
        run = replace(run, level=abs(holds[-1]) * random.uniform(0.95, 1.05), step_s=float(t[sum(counts[:-1])]))
    return run


def asked(random: Random) -> StepOptions:
    """Options, most of them not given."""
    how = int(random.integers(0, 12))
    low = float(random.uniform(-2, 0.1))
    rules = {
        0: BaselineRule("first"), 1: BaselineRule("value", 0.0), 2: BaselineRule("value", 0.2),
        3: BaselineRule("window", window_s=(low, low + 0.5)),
    }  # fmt: skip
    options = StepOptions(baseline=rules.get(how, BaselineRule()), keep_sign=how == 4)
    return replace(options, levels="10:60") if how == 5 else replace(options, rest=20.0) if how == 6 else options


def of_step(step: LevelStep) -> list[Any]:
    places = (step.name, step.from_level, step.level, step.start, step.start_known, step.rest_s, step.rest_moved)
    return [*places, step.change, len(step.output), len(step.findings)]


def of_set(made: StepSet) -> list[Any]:
    averaged = [
        [
            one.level,
            len(one.names),
            len(one.time_s),
            one.uniform,
            one.mean[len(one.mean) // 9],
            one.mean.mean(),
            one.sd[-1],
        ]
        for one in (*made.levels, *made.releases)
    ]
    runs = [
        [run.name, run.level, run.repeat, run.baseline_nm, run.step_s, run.samples, run.rate_hz, run.edge, run.lost_pct,
         run.left_pct, run.from_level, run.idle_density, run.slip and astuple(run.slip), run.findings]
        for run in made.runs
    ]  # fmt: skip
    return [made.kind, averaged, runs, made.findings, [of_step(one) for one in made.level_steps]]


def a_set(random: Random) -> Any:
    """One to four logs, repeats among them, and what they are made to."""
    runs, options = [a_log(random)], asked(random)
    while random.uniform() < 0.4:
        other = replace(runs[0], name=f"r{len(runs)}", output=read_only(runs[0].output * random.uniform(0.85, 1.15)))
        if random.uniform() < 0.3:
            other = replace(other, output=read_only(-other.output))
        if random.uniform() < 0.3:
            other = replace(other, time_s=read_only(other.time_s * 1.7), input=read_only(other.input * 1.005))
        runs.append(other)
    settled = [step.name for step in settled_steps(runs, options)]
    try:
        return [*of_set(build_stepset(runs, options)), settled]
    except DataError as fault:
        return ["refused", len(fault.sentences), settled]


def a_ceiling(random: Random) -> Any:
    """Levels whose sensor stops at one value, or nearly so."""
    t = np.arange(600) / 50
    limit, tau, noise = random.uniform(0.3, 0.9), random.uniform(0.1, 1.5), random.choice([0.0, 0.002, 0.01])
    runs = []
    for k, level in enumerate((20.0, 40.0, 60.0, 80.0)):
        rise = level / 80 * -np.expm1(-np.maximum(t - 2, 0) / tau)
        y = np.minimum(rise, limit * (1 + random.choice([0.0, 0.004, 0.007]) * k)) + noise * random.normal(size=600)
        runs.append(
            Run(
                name=f"r{k}", time_s=read_only(t), input=read_only(np.where(t >= 2, level, 0.0)), output=read_only(y),
                input_unit="%", output_unit="N·m", source="a.csv", sha256=str(k), kind="clutch",
            )
        )  # fmt: skip
    made = build_stepset(runs)
    return [made.findings, [[one.code for one in run.findings] for run in made.runs]]


def a_signal(random: Random, count: int = 1500) -> tuple[Array, Array]:
    """An output with one to five edges that go up, down, swing or drift."""
    t = np.arange(count) / 100
    y = random.uniform(0, 0.06) * random.normal(size=count) * random.choice([0.0, 1.0])
    at, size = np.sort(random.uniform(0.05, 0.95, int(random.integers(1, 6)))) * t[-1], 1.0
    for one in at:
        y = y + size * rising(random, t - one, float(random.uniform(0.01, 0.6)))
        size = float(random.choice([-size, size, -0.4 * size]))
    return t, np.asarray(y)


def of_edges(random: Random) -> Any:
    t, y = a_signal(random, int(random.choice([39, 60, 300, 1500])))
    return [[astuple(one) for one in edges(t, y)], turns(y, 0.5 * float(np.ptp(y)))]


def of_stairs(random: Random) -> Any:
    """An output that goes up and down in three to five steps, each with a rest that is long enough, or hardly."""
    count, noise = 1200, float(random.choice([0.0, 0.0, 0.01]))
    y, at, size = noise * random.normal(size=count), 60, 0.0
    for _ in range(int(random.integers(3, 6))):
        rise, rest = int(random.integers(1, 60)), int(random.integers(20, 320))
        size += float(random.choice([1.0, 0.4, 0.2, -0.5, -1.0]))
        y[at:] = y[at:] - y[at] + size if noise == 0 else y[at:] + (size - float(np.median(y[at:])))
        y[at : at + rise] += np.linspace(y[at - 1] - size, 0, rise)[: len(y[at : at + rise])]
        at += rise + rest
        if at > count - 30:
            break
    return [astuple(edge) for edge in edges(np.arange(count) / 100, y)]


def of_tops(random: Random) -> Any:
    """One rise whose end is cut off, creeps, stands still, is coarse or spiked; what is said of its sensor."""
    count = int(random.choice([150, 250, 600, 1500]))
    since = (np.arange(count) - count // 5) / 100
    tau, limit = float(np.exp(random.uniform(-3, 1))), float(random.uniform(0.3, 1.1))
    y = np.minimum(rising(random, since, tau), limit)
    y = y + random.choice([0.0, 0.002, 0.006]) * np.maximum(since, 0) / since[-1]
    before, after = random.choice([0.0, 0.003, 0.01]), random.choice([0.0, 0.3, 0.6, 1.0])
    y = y + before * np.where(y < 0.98 * y.max(), 1.0, after) * random.normal(size=count)
    fault, at = int(random.integers(0, 5)), int(random.integers(count // 4, count - 10))
    if fault == 0:
        y = np.round(y * (finest := random.uniform(8, 60))) / finest
    elif fault == 1:
        y[at : at + int(random.integers(10, 60))] = y[at]
    elif fault == 2:
        y[at] += random.uniform(0.2, 3)
    elif fault == 3:
        y = np.minimum(y, np.quantile(y, random.uniform(0.7, 1)))
    run = Run(
        name="a", time_s=read_only(np.arange(count) / 100), input=read_only(np.where(since >= 0, 50.0, 0.0)),
        output=read_only(y), input_unit="%", output_unit="N·m", source="a.csv", sha256="0", kind="clutch",
        step_s=count // 5 / 100, level=50.0, baseline=0.0, cut=True,
    )  # fmt: skip
    step = Step(run)
    return [check(step) for check in (saturated, flat_top, stuck, coarse, isolated_spikes)]


def of_slips(random: Random) -> Any:
    count = int(random.choice([79, 200, 1200]))
    t = np.arange(count) / 200
    top, tau = random.uniform(0.05, 0.6) * t[-1], random.uniform(0.05, 1.0)
    y = np.where(t < top, t / top, 1 - random.uniform(0, 0.2) * -np.expm1(-(t - top) / tau))
    y = y + np.where(t > top, random.uniform(0, 0.08) * np.sin(2 * np.pi * random.uniform(3, 30) * t), 0.0)
    y = y + random.choice([0.0, 0.01]) * random.normal(size=count)
    slip = slip_of(t, y, 3 * t if random.uniform() < 0.3 else None)
    return None if slip is None else astuple(slip)


def of_rests(random: Random) -> Any:
    count = int(random.integers(1, 500))
    noise = float(random.choice([0.0, 0.005, 0.05]))
    hold = noise * random.normal(size=count)
    late = int(random.integers(0, 20))
    if late and count > 2 * late:
        hold[-late:] += random.uniform(0, 0.15)
    hold += random.choice([0.0, 0.0, 0.1]) * random.uniform(-1, 1) * np.linspace(0, 1, count)
    hold[: count // 3] += random.choice([0.0, 0.5])
    if count > 20:
        hold[int(random.integers(2, count - 2))] += random.choice([0.0, 0.2])
    start = random.uniform(-0.1, 0.1) + rising(random, np.arange(count) / 100, 0.2) + hold
    return [astuple(last_rest(hold, 1.0)), first_samples(start), spikes(hold, 0.02).tolist()]


def of_inputs(random: Random) -> Any:
    run = a_log(random)
    u = run.input if np.isfinite(run.input).all() else run.output
    stands, (joined, passed) = plateaus(u), bridge(plateaus(u))
    clear = looks_like(replace(run, input=u))
    return [[astuple(one) for one in stands], [astuple(one) for one in joined], passed, stands_still(stands, u), clear]


def of_moves(random: Random) -> Any:
    count = int(random.integers(200, 3000))
    t = np.arange(count) / 100
    phase = random.uniform(1, 15) * t / t[-1]
    phase = phase * (1 + random.choice([0.0, 0.0, 2.0]) * t / t[-1])
    wave = 2 * np.abs((phase % 1) - 0.5) if random.uniform() < 0.5 else np.sin(2 * np.pi * phase)
    wave = wave + random.choice([0.0, 0.01, 0.1]) * random.normal(size=count)
    return [moving("a", t, wave), turns_of(wave)]


def of_statistics(random: Random) -> Any:
    count = int(random.integers(2, 900))
    noise = random.normal(size=count)
    time = np.cumsum(0.01 * (1 + random.choice([0.0, 0.05, 0.3]) * random.uniform(-1, 1, count)))
    return [
        sample_noise(noise), block_error(noise), block_error(noise, 5), block_means(noise, 3).tolist(),
        idle_density(time, noise), astuple(clock_of(time)), uniform_step(np.round(time - time[0], 5)),
    ]  # fmt: skip


def of_rises(random: Random) -> Any:
    count = int(random.integers(15, 1200))
    t = np.arange(count) / 100
    tau = float(np.exp(random.uniform(-4, 2)))
    y = rising(random, t - random.choice([0.0, 0.3]) * t[-1], tau)
    y = y + random.choice([0.0, 0.01, 0.06]) * random.normal(size=count)
    low = float(random.choice([0.0, 0.1, 0.25]))
    slow, short = slow_constant(y, float(t[-1])) if count >= 100 else (0.0, False)
    return [onset(y + low), rises_at_once(y + low), rises_at_once(y + low, low), slow, short, sharpness(y, t, 0.9)]


FAMILIES: dict[str, tuple[int, Callable[[Random], Any]]] = {
    "sets": (150, a_set),
    "ceilings": (60, a_ceiling),
    "edges": (160, of_edges),
    "stairs": (160, of_stairs),
    "tops": (240, of_tops),
    "slips": (160, of_slips),
    "rests": (300, of_rests),
    "inputs": (100, of_inputs),
    "moves": (80, of_moves),
    "statistics": (30, of_statistics),
    "rises": (200, of_rises),
}


def answers(family: str) -> list[Any]:
    """What is answered now to every input of a family."""
    count, ask = FAMILIES[family]
    return [plain(ask(np.random.default_rng([k, count]))) for k in range(count)]


if __name__ == "__main__":
    rows = [
        f"{json.dumps(name)}: [\n" + ",\n".join(json.dumps(one, ensure_ascii=False) for one in answers(name)) + "\n]"
        for name in FAMILIES
    ]
    FILE.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")
    sys.exit(0)
