"""1,000 bootstrap refits of the shipped clutch set, one BLAS thread, against one fit."""

import statistics
import time
from collections.abc import Iterator

from benchmarks.table import Row
from eaid.cli.inputs import runs_from
from eaid.fitting.fit import fit
from eaid.results.fit import FitOptions
from eaid.synth.datasets import shipped
from eaid.uncertainty.bootstrap import bootstrap

RESAMPLES = 1000


def rows() -> Iterator[Row]:
    steps = runs_from([shipped()["clutch"]])[1]
    times = []
    for _ in range(8):
        start = time.perf_counter()
        found = fit(steps, FitOptions())
        times.append(time.perf_counter() - start)
    one = statistics.median(times[1:])
    start = time.perf_counter()
    draws = bootstrap(steps.levels, found, seed=0, draws=RESAMPLES)
    many = time.perf_counter() - start
    assert draws.joint is not None
    yield Row(
        f"bootstrap of {RESAMPLES:,} resamples, shipped clutch set",
        "all refits",
        many,
        "one fit",
        one,
        "≤ 300 × one fit",
        many <= 300 * one,
        f"{1e3 * many / RESAMPLES:.2f} ms a resample: every level, joint, pooled and per-level linear",
    )


if __name__ == "__main__":
    for row in rows():
        print(row.what, row.ratio, row.bar, row.met, row.accuracy)
