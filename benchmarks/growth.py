"""How cost grows: fit time and memory over samples and levels, Monte-Carlo over plants; figures in docs/figures.

Times of fits are of the processor (run with OMP_NUM_THREADS=1); the Monte-Carlo, which has threads, goes by the clock.
"""

import statistics
import time
import tracemalloc
from collections.abc import Iterator
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
from eaid.replay.plant import plant_parameters
from eaid.replay.references import multisine
from eaid.replay.rig import Rig
from eaid.steps.stepset import Level

SAMPLES = tuple(10**k for k in range(2, 8))
LEVELS = (3, 5, 10, 20, 30, 50, 100)
PLANTS = (10, 100, 1_000, 10_000, 100_000)
SECONDS = 20.0
FIGURES = Path(__file__).parent.parent / "docs" / "figures"
Points = list[tuple[float, float]]


def made(samples: int, levels: int) -> list[Level]:
    """Noisy steps of the reference plant, 20 s each, `samples` in all, one run a level [N·m]."""
    rng = np.random.default_rng(0)
    n = max(samples // levels, 3)
    time_s = np.arange(n) * (SECONDS / n)
    found = []
    for duty in np.linspace(10.0, 100.0, levels):
        torque = nonlinear.step_response(REFERENCE_PLANT, time_s, float(duty)) + 0.01 * rng.standard_normal(n)
        found.append(Level(float(duty), time_s, torque[None], (f"{duty:g}",), True))
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
    tracemalloc.start()
    fitted(steps)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return statistics.median(times[1:]), peak + sum(one.runs_nm.nbytes for one in steps) + steps[0].time_s.nbytes


def drawn(count: int) -> float:
    """Time [s] of a robust-control replay of a 2 s multisine on `count` drawn plants, after one warm-up."""
    control = controller("rc", Knowledge(REFERENCE_PLANT, None, *paper_gains()))
    reference = multisine(1e-3, 2.0)
    plant = plant_parameters(REFERENCE_PLANT)
    plants = [plant._replace(Ts_1=plant.Ts_1 * f) for f in np.random.default_rng(0).uniform(0.9, 1.1, count)]

    def visit(*_block: object) -> None:
        pass

    replay_many(plants[:10], control, reference.torque_nm, Rig(), reference.dt_s, visit)
    start = time.perf_counter()
    replay_many(plants, control, reference.torque_nm, Rig(), reference.dt_s, visit)
    return time.perf_counter() - start


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
        peak = found[-1][2] / 1e6
        yield row(what, [(n, s) for n, s, _ in found], f"; peak {peak:,.0f} MB at the largest, data included")
    by_plants: Points = [(n, drawn(n)) for n in PLANTS]
    figure("growth-plants", "plants, 2 s at 1 kHz", {"time of a Monte-Carlo": (by_plants, "s")})
    yield row("Monte-Carlo time over plants", by_plants)


if __name__ == "__main__":
    for one in rows():
        print(one.what, one.ratio, one.bar, one.met, one.accuracy)
