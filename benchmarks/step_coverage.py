"""Coverage of the 95 % intervals of single steps, on synthetic staircases.

`python -m benchmarks.step_coverage [STAIRCASES]`: so many staircases (67, 201 steps) of each shape, held for 5 to 8
slow time constants, noise of 0.2 to 3 % of a step that remembers 0 to 20 samples, each fitted as `eaid fit` does, its
shape chosen by the evidence. What is not quoted (null) is not counted, but told.
"""

import sys
from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from benchmarks.stop_findings import log, wander
from eaid.fitting.step_shapes import fit_step
from eaid.steps.build import build_stepset
from eaid.uncertainty.step_intervals import with_interval

KINDS = ("two", "one", "dead time", "overshoot")
LEVELS, GAINS, RATE_HZ = (20.0, 50.0, 80.0, 40.0), (0.03, 0.04, 0.02, 0.05), 100.0


def quoted(kind: str, count: int) -> Iterator[tuple[str, float, tuple[float, float] | None]]:
    """Name, truth and interval of every number of every step of so many staircases."""
    random = np.random.default_rng(5)
    for _ in range(count):
        tau1 = float(np.exp(random.uniform(np.log(0.1), np.log(0.6))))
        tau2 = tau1 * float(random.uniform(4, 10))
        share = {"one": 1.0, "overshoot": 1.3}.get(kind, 0.85)
        dead = float(random.uniform(0.2, 0.5)) if kind == "dead time" else 0.0
        hold = round(random.uniform(5, 8) * tau2 * RATE_HZ)
        t = np.arange(hold * len(LEVELS)) / RATE_HZ
        changes = {(a, b): gain * (b - a) for a, b, gain in zip(LEVELS, LEVELS[1:], GAINS[1:], strict=False)}
        y = np.full(len(t), GAINS[0] * LEVELS[0])
        for k, change in enumerate(changes.values()):
            since = np.maximum(t - (k + 1) * hold / RATE_HZ - dead, 0.0)
            y += change * (1 - share * np.exp(-since / tau1) - (1 - share) * np.exp(-since / tau2)) * (since > 0)
        y += random.choice([0.002, 0.01, 0.03]) * wander(random, len(t), float(random.choice([0.1, 5, 20])))
        for step in build_stepset([log(t, np.repeat(LEVELS, hold), y)]).level_steps:
            found = with_interval(step, fit_step(step)).ci95
            change = changes[step.from_level, step.level]
            yield "change", change, found.change
            yield "gain", change / (step.level - step.from_level), found.gain
            yield "tau1", tau1, found.tau1
            if kind != "one":
                yield "tau2", tau2, found.tau2
            if kind == "dead time":
                yield "dead_time_s", dead, found.dead_time_s


def coverage(kind: str, count: int) -> dict[str, tuple[float, int, int]]:
    """Share of intervals that hold the truth, how many were quoted, and how many were not, by name."""
    holds: defaultdict[str, list[bool | None]] = defaultdict(list)
    for name, truth, interval in quoted(kind, count):
        holds[name].append(None if interval is None else interval[0] <= truth <= interval[1])
    told = {name: [one for one in some if one is not None] for name, some in holds.items()}
    return {name: (float(np.mean(some)), len(some), len(holds[name]) - len(some)) for name, some in told.items()}


def main() -> int:
    """Print the table; 1 where a coverage is outside 91 … 99 % of 100 intervals or more."""
    count, failed = int(sys.argv[1]) if len(sys.argv) > 1 else 67, False
    for kind in KINDS:
        for name, (share, told, untold) in coverage(kind, count).items():
            failed |= told >= 100 and not 0.91 <= share <= 0.99
            print(f"{kind:10} {name:12} {100 * share:5.1f} % of {told}, {untold} not quoted")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
