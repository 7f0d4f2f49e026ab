"""False alarms and misses of every stop finding about steps, on synthetic logs.

`python -m benchmarks.stop_findings [COUNT]`: COUNT good logs (500), of which each finding may be raised at most by 2 %,
and COUNT bad logs of each kind, of which at most 5 % may pass without a stop or a refusal. A bad log counts as caught
where its own finding is among what is said, or where it is refused.
"""

import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array, read_only
from eaid.errors import DataError
from eaid.findings.sentences import SENTENCES
from eaid.logs.run import Run
from eaid.options import ReadOptions
from eaid.shapes.shape import fit_step
from eaid.steps.build import stepset_of
from eaid.steps.cut import cut_runs

MOST_FALSE_PCT, MOST_MISSED_PCT = 2.0, 5.0


def rise(t: Array, tau1: float, tau2: float, share: float) -> Array:
    """1 − C e^(−t/τ1) − (1 − C) e^(−t/τ2) from t = 0 on."""
    t = np.maximum(t, 0.0)
    return np.asarray(1 - share * np.exp(-t / tau1) - (1 - share) * np.exp(-t / tau2))


def wander(random: np.random.Generator, count: int, samples: float) -> Array:
    """Noise of unit variance whose autocorrelation falls to 1/e within so many samples."""
    rho = float(np.exp(-1 / samples))
    white = np.sqrt(1 - rho**2) * random.normal(size=count)
    from scipy.signal import lfilter  # slow to import, and tests collect this module

    return np.asarray(lfilter([1.0], [1.0, -rho], white))


def good(random: np.random.Generator) -> Run:
    """A log that can be used: one step, of any shape, rate, noise, offset, drift that a sound rig has."""
    rate = float(random.choice([50.0, 100.0, 200.0, 1000.0]))
    idle, hold = float(random.uniform(1.0, 5.0)), float(random.uniform(4.0, 20.0))
    t = np.arange(round((idle + hold) * rate)) / rate
    tau1 = float(np.exp(random.uniform(np.log(4 / rate), np.log(hold / 8))))
    share = float(random.choice([0.85, 0.85, 0.85, 1.0, random.uniform(0.5, 1.3)]))
    y = rise(t - idle, tau1, tau1 * float(random.uniform(3.0, 15.0)), share)
    if random.uniform() < 0.3:
        y = y + 0.01 * random.uniform() * np.sin(2 * np.pi * random.uniform(0.2, 20) * t)
    if random.uniform() < 0.3:
        y = y + random.uniform(-0.03, 0.03) * t / t[-1]
    y = y + float(random.choice([0.0, 0.002, 0.01, 0.03])) * random.normal(size=len(t))
    if random.uniform() < 0.3:
        y = y + 0.01 * random.uniform() * wander(random, len(t), random.uniform(2, 100))
    if random.uniform() < 0.3:
        y = np.round(y * 500) / 500
    level = float(random.uniform(10.0, 100.0))
    u = np.where(t >= idle - 1e-9, level, 0.0)
    if random.uniform() < 0.3:
        last = t >= idle + 0.8 * hold
        y = np.where(last, y * np.exp(-np.maximum(t - idle - 0.8 * hold, 0) / max(tau1, 0.1)), y)
        u = np.where(last, 0.0, u)
    size = float(10 ** random.uniform(-3, 3))
    return log(t, u, size * (y + random.uniform(-1, 1)))


def log(t: Array, u: Array, y: Array, **more: object) -> Run:
    facts: dict[str, object] = {"input_unit": "%", "output_unit": "N·m", "source": "a.csv", "sha256": "0"}
    facts |= {"kind": "clutch", "name": "a", **more}
    return Run(time_s=read_only(t), input=read_only(u), output=read_only(y), **facts)  # type: ignore[arg-type]


def _step(run: Run) -> int:
    return int(np.argmax(run.input > 0))


def _with(run: Run, y: Array, **more: object) -> Run:
    return replace(run, output=read_only(y), **more)


def _span(run: Run) -> float:
    return float(np.ptp(run.output[_step(run) :]))


def _base(run: Run) -> float:
    return float(np.median(run.output[: _step(run)]))


def not_at_rest(random: np.random.Generator, run: Run) -> list[Run]:
    """The input logged late, by two samples or more, and by 3 to 40 % of the rise: what its idle noise lets be seen.

    Seen is a mean of the late samples that lies eight standard deviations of as many idle samples off.
    """
    start, y = _step(run), run.output
    idle = y[:start]
    held = y[start + (len(y) - start) // 3 : start + 2 * (len(y) - start) // 3]
    swing = abs(float(np.median(held)) - float(idle.mean()))
    least = random.uniform(0.03, 0.4) * swing
    for late in range(2, start // 3):
        off = abs(y[start : start + late] - idle.mean())
        groups = idle[start % late :].reshape(-1, late).mean(axis=1)
        if off[-1] > least and off.mean() > max(8 * float(groups.std()), 0.03 * swing):
            break
    u = np.where(np.arange(len(y)) < start + late, 0.0, run.input[start])
    return [replace(run, input=read_only(np.where(run.input == 0, 0.0, u)))]


def step_in_gap(random: np.random.Generator, run: Run) -> list[Run]:
    start = _step(run)
    gone = max(12, int(random.uniform(0.02, 0.1) * len(run.time_s)))
    columns = {name: getattr(run, name) for name in ("time_s", "input", "output")}
    lost = slice(start - gone // 3, start + gone)
    return [replace(run, **{name: read_only(np.delete(column, lost)) for name, column in columns.items()})]


def saturated(random: np.random.Generator, run: Run) -> list[Run]:
    limit = _base(run) + random.uniform(0.3, 0.7) * (float(run.output.max()) - _base(run))
    return [_with(run, np.minimum(run.output, limit))]


def stuck(random: np.random.Generator, run: Run) -> list[Run]:
    y, start = run.output.copy(), _step(run)
    y += 0.005 * _span(run) * random.normal(size=len(y))
    count = int(random.uniform(0.1, 0.4) * (len(y) - start))
    at = start + int(random.uniform(0.1, 0.5) * (len(y) - start))
    y[at : at + count] = y[at]
    return [_with(run, y)]


def coarse(random: np.random.Generator, run: Run) -> list[Run]:
    finest = (float(run.output.max()) - _base(run)) / random.uniform(4, 18)
    smooth = np.convolve(run.output, np.ones(9) / 9, mode="same")
    return [_with(run, np.round(smooth / finest) * finest)]


def spiked(random: np.random.Generator, run: Run) -> list[Run]:
    y = run.output.copy()
    y[random.integers(_step(run) + 3, len(y) - 3)] += 100 * _span(run)
    return [_with(run, y)]


def other_sign(random: np.random.Generator, run: Run) -> list[Run]:
    runs = [_with(run, run.output * random.uniform(0.8, 1.2), name=f"r{k}") for k in range(4)]
    return [*runs[:3], _with(runs[3], -runs[3].output)]


def several(random: np.random.Generator, run: Run) -> list[Run]:
    """A closed loop behind a constant input: the output goes up and down."""
    t = run.time_s
    edges = int(random.integers(2, 7))
    at = np.sort(random.uniform(0.1, 0.9, edges))
    while np.diff(at).min(initial=1.0) < 0.08:
        at = np.sort(random.uniform(0.1, 0.9, edges))
    tau = float(t[-1]) * random.uniform(0.002, 0.02)
    y = np.zeros(len(t))
    for k, share in enumerate(at.tolist()):
        y += (1 if k % 2 == 0 else -1) * rise(t - share * float(t[-1]), tau, 2 * tau, 0.9)
    y += random.choice([0.0, 0.01, 0.03]) * random.normal(size=len(t))
    return [log(t, np.full(len(t), np.nan), y, level=50.0)]


def contradicted(random: np.random.Generator, run: Run) -> list[Run]:
    level = float(run.input.max())
    start = float(run.time_s[_step(run)])
    return [replace(run, level=level * random.choice([0.01, 0.5, 1.2, 100.0]), step_s=start)]


def sweeps(random: np.random.Generator, run: Run) -> list[Run]:
    t = run.time_s / run.time_s[-1]
    first, last = random.uniform(1, 3), random.uniform(10, 20)
    u = 50 + 30 * np.sin(2 * np.pi * (first * t + (last - first) * t**2 / 2))
    return [log(run.time_s, u, u * 0.02 + 0.01 * random.normal(size=len(t)))]


def unsettled(random: np.random.Generator, _run: Run) -> list[Run]:
    """A staircase that is left before the output rests."""
    tau = 1.0
    hold = random.uniform(0.5, 1.2)
    t = np.arange(0, 2 + 3 * hold, 0.01)
    y, u = np.zeros(len(t)), np.zeros(len(t))
    for k in range(3):
        y += rise(t - 2 - k * hold, tau, 3 * tau, 0.85)
        u = np.where(t >= 2 + k * hold - 1e-9, 20.0 * (k + 1), u)
    return [log(t, u, y + 0.003 * random.normal(size=len(t)))]


def no_step(random: np.random.Generator, run: Run) -> list[Run]:
    """An output that has nothing to do with the step."""
    t = run.time_s
    y = np.sin(2 * np.pi * t / t[-1] * random.uniform(2.5, 6) + random.uniform(0, 6))
    return [_with(run, y + 0.05 * random.normal(size=len(t)))]


Maker = Callable[[np.random.Generator, Run], list[Run]]
ALONE: dict[str, Maker] = {
    "not-at-rest": not_at_rest, "unsettled-before-step": unsettled, "step-in-gap": step_in_gap,
    "saturated": saturated, "sensor-stuck": stuck, "coarse-output": coarse, "spikes": spiked,
    "sign-differs": other_sign, "level-contradicts-input": contradicted, "several-edges": several,
    "input-moves": sweeps,
}  # fmt: skip
BAD: dict[str, tuple[Maker, tuple[str, ...]]] = {
    **{code: (make, (code,)) for code, make in ALONE.items()},
    "shape-explains-little": (no_step, ("shape-explains-little", "several-edges", "not-at-rest")),
}
"""Kind of bad log → what makes one, and the findings of which one has to be said."""


def stops(runs: Sequence[Run], shapes: bool) -> set[str]:
    """Codes of the stop findings that logs bring up; "refused" where they are refused."""
    try:
        steps, faults = cut_runs(list(runs), ReadOptions())
        if faults:
            return {"refused"}
        made = stepset_of(steps)
    except DataError:
        return {"refused"}
    found = [*made.findings, *(one for run in made.runs for one in run.findings)]
    if shapes:
        found += [one for step in made.level_steps if step.edge == "up" for one in fit_step(step).findings]
    return {one.code for one in found if SENTENCES[one.code].severity == "stop" or one.code == "shape-explains-little"}


def false_alarms(count: int, shapes: bool = True) -> Counter[str]:
    """How many of `count` good logs raise each stop finding."""
    random = np.random.default_rng(1)
    return Counter(code for _ in range(count) for code in stops([good(random)], shapes))


def misses(kind: str, count: int) -> int:
    """How many of `count` bad logs of a kind pass."""
    random = np.random.default_rng(2)
    make, codes = BAD[kind]
    shapes = kind == "shape-explains-little"
    return sum(not stops(make(random, good(random)), shapes) & {"refused", *codes} for _ in range(count))


def main(count: int = 500) -> int:
    """Print the table; 1 where a rate is beyond its limit."""
    alarms = false_alarms(count)
    rates = {kind: (100 * alarms.pop(kind, 0) / count, 100 * misses(kind, count) / count) for kind in BAD}
    rates |= {code: (100 * number / count, 0.0) for code, number in alarms.items()}
    print(f"{count} logs each\n{'finding':28}{'false alarms':>14}{'missed':>10}")
    for kind, (false, missed) in rates.items():
        print(f"{kind:28}{false:12.1f} %{missed:8.1f} %")
    return int(any(false > MOST_FALSE_PCT or missed > MOST_MISSED_PCT for false, missed in rates.values()))


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in sys.argv[1:2])))
