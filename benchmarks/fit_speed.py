"""The fits against what a user would run instead, on the same data in the same run.

Ten levels, three repeats of 30 s at 1 kHz. Times are of the processor (run with OMP_NUM_THREADS=1): a few milliseconds
by the wall clock say more about what else the machine does.

Everyone fits every one of the 900,000 samples (ours by their means, which is exact) and is
judged by the same cost over all of them. `python -m benchmarks fit_speed`.
"""

import ctypes
import statistics
import subprocess
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import curve_fit, least_squares

from benchmarks.table import Row
from eaid.fitting.compress import _even, _steps
from eaid.fitting.data import data_of
from eaid.fitting.levels import fit_levels
from eaid.fitting.linear import fit_linear
from eaid.fitting.nonlinear import fit_nonlinear
from eaid.models import nonlinear
from eaid.models.parameters import REFERENCE_PLANT, Nonlinear
from eaid.steps.stepset import Level

Array = NDArray[np.float64]
DUTIES = np.arange(10.0, 101.0, 10.0)
START = np.array([0.1, 2.0, -1.5, 2.0, 30.0, -15.0, 0.1, 0.5, 2.0, 1.5])
"""Where the other tools begin, coefficients of (u/100)^k: within a factor of a few of the plant. Ours finds its own."""

C_READ = """
double read_once(const double *y, long n) {
    double a = 0, b = 0, c = 0, d = 0;
    for (long i = 0; i + 3 < n; i += 4) { a += y[i]; b += y[i + 1]; c += y[i + 2]; d += y[i + 3]; }
    return a + b + c + d;
}
"""


def levels() -> list[Level]:
    rng = np.random.default_rng(0)
    t = np.arange(30_000) / 1000
    return [
        Level(
            u,
            t,
            nonlinear.step_response(REFERENCE_PLANT, t, u) + 0.01 * rng.normal(size=(3, len(t))),
            ("a", "b", "c"),
        )
        for u in DUTIES
    ]


def curve(X: Array, a0, a1, a2, b0, b1, b2, c0, c1, c2, c3):
    t, v = X
    tau1, tau2 = a0 + a1 * v + a2 * v * v, b0 + b1 * v + b2 * v * v
    Ts = c0 + c1 * v + c2 * v * v + c3 * v * v * v
    return (0.85 * (1 - np.exp(-t / tau1)) + 0.15 * (1 - np.exp(-t / tau2))) * Ts


def one_curve(t: Array, Ts, tau1, tau2):
    return (0.85 * (1 - np.exp(-t / tau1)) + 0.15 * (1 - np.exp(-t / tau2))) * Ts


def once(call: Callable[[], object]) -> tuple[float, object]:
    begin = time.process_time()
    found = call()
    return time.process_time() - begin, found


def median_of(call: Callable[[], object], runs: int) -> float:
    return statistics.median(once(call)[0] for _ in range(runs))


def reader() -> Callable[[Array], float]:
    """The C loop that reads the data once."""
    folder = Path(tempfile.mkdtemp())
    (folder / "read.c").write_text(C_READ)
    subprocess.run(
        ["gcc", "-O3", "-march=native", "-shared", "-fPIC", "-o", folder / "read.so", folder / "read.c"], check=True
    )
    function = ctypes.CDLL(str(folder / "read.so")).read_once
    function.restype = ctypes.c_double
    return lambda y: function(ctypes.c_void_p(y.ctypes.data), ctypes.c_long(y.size))


def packed(p: Nonlinear) -> Array:
    return np.concatenate([np.array(c) * 100.0 ** np.arange(len(c)) for c in (p.tau1, p.tau2, p.Ts)])


def rows() -> Iterator[Row]:
    made = levels()
    t = np.concatenate([np.tile(level.time_s, 3) for level in made])
    v = np.concatenate([np.full(level.runs.size, level.level / 100) for level in made])
    y = np.concatenate([level.runs.ravel() for level in made])
    X = np.array([t, v])
    within = sum(float(((level.runs - level.mean) ** 2).sum()) for level in made)

    def cost(p: Array) -> float:
        return within + 3 * sum(
            float(
                np.sum(
                    (curve(np.array([level.time_s, np.full_like(level.time_s, level.level / 100)]), *p) - level.mean)
                    ** 2
                )
            )
            for level in made
        )

    def ours() -> Nonlinear:
        return fit_nonlinear(data_of(made), 0.85).parameters

    _steps.cache_clear()
    _even.cache_clear()
    cold, _ = once(ours)
    mine = packed(ours())
    others: dict[str, tuple[float, float, str]] = {}

    def measure(name: str, call: Callable[[], Array], runs: int) -> None:
        times, reached = [], np.inf
        for _ in range(runs):
            begin = time.process_time()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    reached = cost(np.asarray(call()))
                    said = ""
                except (ValueError, RuntimeError) as fault:
                    said = f"theirs gives up: {str(fault).split('!')[0]}"
            times.append(time.process_time() - begin)
        others[name] = statistics.median(times), reached, said

    measure("curve_fit, numeric derivatives", lambda: curve_fit(curve, X, y, p0=START)[0], 3)
    measure("lmfit leastsq", lambda: lmfit_fit(X, y, "leastsq"), 1)
    measure("lmfit slsqp", lambda: lmfit_fit(X, y, "slsqp"), 1)
    measure("iminuit", lambda: iminuit_fit(X, y), 1)
    times = [once(ours)[0] for _ in range(41)]
    fast = statistics.median(times)
    best = min(cost(mine), *(found for _, found, _ in others.values()))
    excess = cost(mine) / best - 1
    for name, (seconds, reached, said) in others.items():
        ratio = seconds / fast
        bar = 1000 if name.startswith("curve_fit") else 100
        yield Row(
            f"nonlinear, 900,000 samples, {name}",
            "eaid",
            fast,
            name,
            seconds,
            f"≥ {bar} × faster, cost within 1e-9",
            ratio >= bar and excess <= 1e-9,
            f"cost over the best: ours {excess:.0e}, {said or f'theirs {reached / best - 1:.0e}'}; "
            f"our first call {1e3 * cold:.1f} ms",
        )
    read = reader()
    mine_s, read_s = median_of(ours, 41), median_of(lambda: read(y), 41)
    yield Row(
        "nonlinear against reading",
        "eaid",
        mine_s,
        "C loop reading the data once",
        read_s,
        "≤ 10 × the time",
        mine_s <= 10 * read_s,
    )
    yield from per_level(made)
    yield from first_order(made)


NAMES = ("a0", "a1", "a2", "b0", "b1", "b2", "c0", "c1", "c2", "c3")


def lmfit_fit(X: Array, y: Array, method: str) -> Array:
    import lmfit

    model = lmfit.Model(curve, independent_vars=["X"])
    found = model.fit(y, X=X, method=method, calc_covar=False, **dict(zip(NAMES, START, strict=True)))
    return np.array([found.best_values[name] for name in NAMES])


def iminuit_fit(X: Array, y: Array) -> Array:
    from iminuit import Minuit
    from iminuit.cost import LeastSquares

    fitted = Minuit(LeastSquares(X, y, 0.01, lambda X, p: curve(X, *p)), START)
    fitted.strategy = 0
    fitted.migrad(ncall=500)
    return np.array(fitted.values)


def per_level(made: list[Level]) -> Iterator[Row]:
    """Two exponentials to each level, 10 × 90,000 samples; ours keeps τ above 0, curve_fit only where it is told to."""

    def theirs(**options: object) -> list[Array]:
        found = []
        for level in made:
            y, t = level.runs.ravel(), np.tile(level.time_s, 3)
            found.append(curve_fit(one_curve, t, y, p0=[y.max(), 0.5, 5.0], **options)[0])
        return found

    def ours() -> list[Array]:
        return [np.array([f.curve.Ts, f.curve.tau1, f.curve.tau2]) for f in fit_levels(data_of(made), 0.85)]

    def cost(found: list[Array]) -> float:
        return sum(float(np.sum((one_curve(a.time_s, *p) - a.runs) ** 2)) for a, p in zip(made, found, strict=True))

    fast, mine = median_of(ours, 41), cost(ours())
    for name, options in (("curve_fit", {}), ("curve_fit with bounds, T_s and τ above 0", {"bounds": (0.0, np.inf)})):
        times, found = zip(*(once(lambda options=options: theirs(**options)) for _ in range(3)), strict=True)
        slow = statistics.median(times)
        yield Row(
            f"per level, 10 × 90,000 samples, {name}", "eaid", fast, name, slow, "≥ 200 × faster", slow >= 200 * fast,
            f"our cost over theirs {mine / cost(found[0]) - 1:+.0e}",
        )  # fmt: skip


def first_order(made: list[Level]) -> Iterator[Row]:
    """The pooled linear model against least squares of the exact exponential."""
    t = np.concatenate([np.tile(level.time_s, 3) for level in made])
    u = np.concatenate([np.full(level.runs.size, level.level) for level in made])
    y = np.concatenate([level.runs.ravel() for level in made])

    def residual(p: Array) -> Array:
        return (p[1] * u + p[2]) / p[0] * (1 - np.exp(-p[0] * t)) - y

    def theirs() -> Array:
        return np.asarray(least_squares(residual, [1.0, 0.05, -1.0], x_scale=[1.0, 0.05, 1.0]).x)

    def ours() -> Array:
        p = fit_linear(data_of(made)).parameters
        return np.array([p.a0, p.b0, p.c0])

    slow, other = once(theirs)
    slow = statistics.median([slow, once(theirs)[0], once(theirs)[0]])
    fast = median_of(ours, 21)
    over = float(np.sum(residual(ours()) ** 2) / np.sum(residual(np.asarray(other)) ** 2) - 1)
    yield Row(
        "pooled first order, 900,000 samples", "eaid", fast, "least_squares, exact exponential", slow, "≥ 80 × faster",
        slow >= 80 * fast, f"our cost over theirs {over:+.0e}",
    )  # fmt: skip
