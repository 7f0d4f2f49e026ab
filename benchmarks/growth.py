"""How cost grows: fit time and memory over samples and levels, Monte-Carlo over plants; figures in docs/figures.

Times of fits are of the processor (run with OMP_NUM_THREADS=1); the Monte-Carlo, which has threads, goes by the clock.
"""

import statistics
import time
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.table import Row
from eaid.control.gains import paper_gains
from eaid.fitting.data import data_of
from eaid.fitting.levels import fit_levels
from eaid.fitting.linear import fit_linear
from eaid.fitting.nonlinear import fit_nonlinear
from eaid.models import nonlinear
from eaid.models.parameters import REFERENCE_PLANT
from eaid.replay.controllers import Knowledge, controller
from eaid.replay.many import replay_many
from eaid.replay.montecarlo import montecarlo
from eaid.replay.plant import plant_parameters
from eaid.replay.references import multisine
from eaid.replay.rig import Rig
from eaid.steps.stepset import Level

SAMPLES = tuple(10**k for k in range(2, 8))
LEVELS = (3, 5, 10, 20, 30, 50, 100)
PLANTS = (10, 100, 1_000, 10_000, 100_000)
SECONDS = 20.0
FIGURES = Path(__file__).parent.parent / "docs" / "figures"
Points = Sequence[tuple[float, float]]


def made(samples: int, levels: int) -> list[Level]:
    """Noisy steps of the reference plant, 20 s each, `samples` in all, one run a level [N·m]."""
    rng = np.random.default_rng(0)
    n = max(samples // levels, 3)
    time_s = np.arange(n) * (SECONDS / n)
    found = []
    for duty in np.linspace(10.0, 100.0, levels):
        torque = nonlinear.step_response(REFERENCE_PLANT, time_s, float(duty)) + 0.01 * rng.standard_normal(n)
        found.append(Level(float(duty), time_s, torque[None], (f"{duty:g}",)))
    return found


def fitted(levels: list[Level]) -> None:
    """Every model of a clutch fit: compression, each level's curve, nonlinear, linear."""
    data = data_of(levels)
    fit_levels(data, 0.85)
    fit_nonlinear(data, 0.85)
    fit_linear(data)


def measured(samples: int, levels: int) -> tuple[float, float]:
    """Median processor time [s] of five fits, and the peak of what one allocates, its data included [bytes]."""
    steps = made(samples, levels)
    times = []
    for _ in range(6):
        start = time.process_time()
        fitted(steps)
        times.append(time.process_time() - start)
    held = sum(one.runs.nbytes for one in steps) + steps[0].time_s.nbytes
    return statistics.median(times[1:]), peak(lambda: fitted(steps)) + held


def drawn(count: int) -> tuple[float, float, float]:
    """Robust control of a 2 s multisine on `count` plants: median times [s] of five, of the replays alone and of a
    whole Monte-Carlo (metrics of each plant, bands), and the peak of what the latter allocates [bytes]."""
    control = controller("rc", Knowledge(REFERENCE_PLANT, None, *paper_gains()))
    reference = multisine(1e-3, 2.0)
    factors = np.random.default_rng(0).uniform(0.9, 1.1, count)
    plants = [replace(REFERENCE_PLANT, Ts=tuple(f * c for c in REFERENCE_PLANT.Ts)) for f in factors.tolist()]
    flat = [plant_parameters(plant) for plant in plants]

    def replays() -> None:
        replay_many(flat, control, reference.torque_nm, Rig(), reference.dt_s, lambda *_block: None)

    def whole() -> None:
        montecarlo(plants, control, reference, Rig())

    alone, all_of_it = (clocked(call) for call in (replays, whole))
    return alone, all_of_it, peak(whole)


def clocked(call: Callable[[], None]) -> float:
    """Median time [s] of five calls by the clock, after one warm-up."""
    times = []
    for _ in range(6):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return statistics.median(times[1:])


def peak(call: Callable[[], None]) -> float:
    """Most that a call holds at a time [bytes]."""
    tracemalloc.start()
    call()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most


def figure(name: str, across: str, curves: dict[str, tuple[Points, str]]) -> None:
    """One panel a curve, both axes logarithmic, a dotted line of linear growth."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    drawing, axes = plt.subplots(1, len(curves), figsize=(4.2 * len(curves), 3.2), layout="constrained", squeeze=False)
    for axis, (label, (points, unit)) in zip(axes[0], curves.items(), strict=True):
        x, y = np.array(points).T
        axis.loglog(x, y, "o-", color="tab:blue", label=label)
        axis.loglog(x, y[-1] * x / x[-1], ":", color="0.5", label="linear")
        axis.set_xlabel(across)
        axis.set_ylabel(f"{label} [{unit}]")
        axis.grid(alpha=0.3)
        axis.legend(frameon=False)
    FIGURES.mkdir(exist_ok=True)
    drawing.savefig(FIGURES / f"{name}.png", dpi=80)
    plt.close(drawing)


def row(what: str, points: Points, accuracy: str = "") -> Row:
    """Largest size against the smallest and the one before: linear or better in both; the steepest step is told."""
    (xa, ya), (x0, y0), (x1, y1) = points[0], points[-2], points[-1]
    linear = min(ya * x1 / xa, y0 * x1 / x0)
    worst = max(pairwise(points), key=lambda step: step[1][1] / step[1][0] * step[0][0] / step[0][1])
    (a, ta), (b, tb) = worst
    return Row(
        what,
        f"at {x1:,.0f}",
        y1,
        "linear growth from less",
        linear,
        "≤ 1.1 × linear",
        y1 <= 1.1 * linear,
        f"steepest step {a:,.0f} → {b:,.0f}: {tb / ta:.3g} × the time{accuracy}",
    )


def rows() -> Iterator[Row]:
    by_samples = [(n, *measured(n, 10)) for n in SAMPLES]
    by_levels = [(n, *measured(1_000_000, n)) for n in LEVELS]
    for name, across, found in (
        ("growth-samples", "samples in 10 levels", by_samples),
        ("growth-levels", "levels, 1,000,000 samples", by_levels),
    ):
        figure(name, across, {
            "time of a fit": ([(n, s) for n, s, _ in found], "s"),
            "peak memory": ([(n, b / 1e6) for n, _, b in found], "MB"),
        })  # fmt: skip
    for what, found in (("fit time over samples", by_samples), ("fit time over levels", by_levels)):
        yield row(what, [(n, s) for n, s, _ in found], held(found[-1][2], ", data included"))
    by_plants = [(n, *drawn(n)) for n in PLANTS]
    alone, whole = [(n, s) for n, s, _, _ in by_plants], [(n, s) for n, _, s, _ in by_plants]
    figure("growth-plants", "plants, 2 s at 1 kHz", {
        "time of the replays": (alone, "s"),
        "time of a Monte-Carlo": (whole, "s"),
        "its peak memory": ([(n, b / 1e6) for n, _, _, b in by_plants], "MB"),
    })  # fmt: skip
    yield row("replays alone, time over plants", alone)
    yield row("Monte-Carlo time over plants", whole, held(by_plants[-1][3]))


def held(most: float, what: str = "") -> str:
    """The peak in words."""
    return f"; peak {most / 1e6:,.0f} MB at the largest{what}"


if __name__ == "__main__":
    for one in rows():
        print(one.what, one.ratio, one.bar, one.met, one.accuracy)
