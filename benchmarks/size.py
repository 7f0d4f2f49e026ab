"""How cost grows: fit time and memory over samples and levels, Monte-Carlo over plants.

Times of fits are of the processor; the Monte-Carlo, which has threads, goes by the clock.
"""

import statistics
import time
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from benchmarks.table import Row
from eaid.control.gains import paper_gains
from eaid.estimate.data import data_of
from eaid.estimate.joint import fit_nonlinear
from eaid.estimate.levels import fit_levels
from eaid.estimate.linear import fit_linear
from eaid.models import nonlinear
from eaid.models.parameters import REFERENCE_PLANT
from eaid.replay.controllers import CONTROLLERS, Knowledge
from eaid.replay.many import montecarlo
from eaid.replay.references import multisine
from eaid.replay.rig import Rig
from eaid.steps.stepset import Level

SAMPLES = tuple(10**k for k in range(2, 8))
LEVELS = (3, 5, 10, 20, 30, 50, 100)
OVER_LEVELS = 1_000_000
PLANTS = (10, 100, 1_000, 10_000, 100_000)


def fits(samples: int, levels: int) -> Callable[[], None]:
    """Every model of a clutch fit to noisy steps of the reference plant, 20 s each, `samples` in all."""
    rng, n = np.random.default_rng(0), max(samples // levels, 3)
    time_s = np.arange(n) * (20.0 / n)
    steps = [
        Level(
            u,
            time_s,
            (nonlinear.step_response(REFERENCE_PLANT, time_s, u) + 0.01 * rng.standard_normal(n))[None],
            ("a",),
        )
        for u in np.linspace(10.0, 100.0, levels).tolist()
    ]

    def fitted() -> None:
        data = data_of(steps)
        fit_levels(data, 0.85)
        fit_nonlinear(data, 0.85)
        fit_linear(data)

    return fitted


def plants(count: int) -> Callable[[], None]:
    """Robust control of a 2 s multisine on `count` plants: metrics of each, bands."""
    control = CONTROLLERS["rc"](Knowledge(REFERENCE_PLANT, None, *paper_gains()))
    factors = np.random.default_rng(0).uniform(0.9, 1.1, count).tolist()
    drawn = [replace(REFERENCE_PLANT, Ts=tuple(f * c for c in REFERENCE_PLANT.Ts)) for f in factors]
    return lambda: montecarlo(drawn, control, multisine(1e-3, 2.0), Rig())


def measured(call: Callable[[], None], clock: Callable[[], float]) -> tuple[float, float]:
    """Median time [s] of five calls after one warm-up, and the most that one allocates at a time [bytes]."""
    times = []
    for _ in range(6):
        start = clock()
        call()
        times.append(clock() - start)
    tracemalloc.start()
    call()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return statistics.median(times[1:]), most


def rows() -> Iterator[Row]:
    """Largest size against the smallest and the one before: linear or better in both; the steepest step is printed."""
    for name, sizes, made, clock in (
        ("samples", SAMPLES, lambda n: fits(n, 10), time.process_time),
        ("levels", LEVELS, lambda n: fits(OVER_LEVELS, n), time.process_time),
        ("plants", PLANTS, plants, time.perf_counter),
    ):
        points = [(n, *measured(made(n), clock)) for n in sizes]
        (xa, ya, _), (x0, y0, _), (x1, y1, most) = points[0], points[-2], points[-1]
        linear = min(ya * x1 / xa, y0 * x1 / x0)
        (a, ta, _), (b, tb, _) = max(pairwise(points), key=lambda two: two[1][1] / two[0][1] * two[0][0] / two[1][0])
        yield Row(
            f"time over {name}", f"at {x1:,}", y1, "linear growth from less", linear, "≤ 1.1 × linear",
            y1 <= 1.1 * linear,
            f"steepest step {a:,} → {b:,}: {tb / ta:.3g} × the time; peak {most / 1e6:,.0f} MB at the largest",
        )  # fmt: skip
