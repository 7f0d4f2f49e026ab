"""The fits against what a user would run instead, on the same data in the same run.

Ten levels, three repeats of 30 s at 1 kHz. Times are of the processor (run with OMP_NUM_THREADS=1): a few milliseconds
by the wall clock say more about what else the machine does.

Everyone fits every one of the 900,000 samples (ours by their means, which is exact) and is
judged by the same cost over all of them. `python -m benchmarks fit_speed`.
"""

import statistics
import time
import warnings
from collections.abc import Callable, Iterator

import numpy as np
from scipy.optimize import curve_fit, least_squares

from benchmarks.table import Row
from eaid.arrays import Array
from eaid.estimate.data import data_of
from eaid.levels.each_level import own_levels
from eaid.levels.from_steps import fit_nonlinear
from eaid.levels.linear import fit_linear, parameters
from eaid.plant.dynamics import REFERENCE_PLANT
from eaid.plant.respond import from_rest
from eaid.steps.stepset import Level

DUTIES = np.arange(10.0, 101.0, 10.0)
SAMPLES, RUNS, REPEATS = 30_000, 41, 3
"""Of a step, and how often ours and the others are timed."""
START = np.array([0.1, 2.0, -1.5, 2.0, 30.0, -15.0, 0.1, 0.5, 2.0, 1.5])
"""Where the other tools begin, coefficients of (u/100)^k: within a factor of a few of the plant. Ours finds its own."""


def levels() -> list[Level]:
    rng, t = np.random.default_rng(0), np.arange(SAMPLES) / 1000
    return [
        Level(u, t, from_rest(REFERENCE_PLANT, t, u) + 0.01 * rng.normal(size=(3, len(t))), ("a", "b", "c"))
        for u in DUTIES
    ]


def one_curve(t: Array, Ts, tau1, tau2):
    return (0.85 * (1 - np.exp(-t / tau1)) + 0.15 * (1 - np.exp(-t / tau2))) * Ts


def curve(X: Array, a0, a1, a2, b0, b1, b2, c0, c1, c2, c3):
    t, v = X
    return one_curve(t, c0 + c1 * v + c2 * v**2 + c3 * v**3, a0 + a1 * v + a2 * v**2, b0 + b1 * v + b2 * v**2)


def timed(call: Callable[[], Array], runs: int) -> tuple[float, Array | None, str]:
    """Median processor time [s], what was found, why nothing was."""
    times, found, why = [], None, ""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in range(runs):
            begin = time.process_time()
            try:
                found = np.asarray(call())
            except (ValueError, RuntimeError, ImportError) as fault:
                why = f"theirs gives up: {str(fault).split('!')[0]}"
            times.append(time.process_time() - begin)
    return statistics.median(times), found, why


def lmfit_fit(X: Array, y: Array, method: str) -> Array:
    import lmfit

    names = ("a0", "a1", "a2", "b0", "b1", "b2", "c0", "c1", "c2", "c3")
    model = lmfit.Model(curve, independent_vars=["X"])
    found = model.fit(y, X=X, method=method, calc_covar=False, **dict(zip(names, START, strict=True)))
    return np.array([found.best_values[name] for name in names])


def iminuit_fit(X: Array, y: Array) -> Array:
    from iminuit import Minuit
    from iminuit.cost import LeastSquares

    fitted = Minuit(LeastSquares(X, y, 0.01, lambda X, p: curve(X, *p)), START)
    fitted.strategy = 0
    fitted.migrad(ncall=500)
    return np.array(fitted.values)


def rows() -> Iterator[Row]:
    made = levels()
    t = np.concatenate([np.tile(level.time_s, 3) for level in made])
    u = np.concatenate([np.full(level.runs.size, level.level) for level in made])
    y = np.concatenate([level.runs.ravel() for level in made])
    X = np.array([t, u / 100])

    def cost(p: Array | None) -> float:
        return np.inf if p is None else float(np.sum((curve(X, *p) - y) ** 2))

    def ours() -> Array:
        p = fit_nonlinear(data_of(made), 0.85).parameters
        return np.concatenate([np.array(c) * 100.0 ** np.arange(len(c)) for c in (p.tau1, p.tau2, p.Ts)])

    fast, mine, _ = timed(ours, RUNS)
    others = [
        (name, bar, *timed(call, runs))
        for name, bar, runs, call in (
            ("curve_fit, numeric derivatives", 200, REPEATS, lambda: curve_fit(curve, X, y, p0=START)[0]),
            ("lmfit leastsq", 100, 1, lambda: lmfit_fit(X, y, "leastsq")),
            ("lmfit slsqp", 100, 1, lambda: lmfit_fit(X, y, "slsqp")),
            ("iminuit", 100, 1, lambda: iminuit_fit(X, y)),
        )
    ]
    best = min(cost(p) for p in (mine, *(p for _, _, _, p, _ in others)))
    excess = cost(mine) / best - 1
    for name, bar, slow, p, why in others:
        yield Row(
            f"nonlinear, {y.size:,} samples, {name}", "eaid", fast, name, slow,
            f"≥ {bar} × faster, cost within 1e-9", slow >= bar * fast and excess <= 1e-9,
            f"cost over the best: ours {excess:.0e}, {why or f'theirs {cost(p) / best - 1:.0e}'}",
        )  # fmt: skip
    yield from per_level(made)
    yield first_order(made, t, u, y)


def per_level(made: list[Level]) -> Iterator[Row]:
    """Two exponentials to each level; ours keeps τ above 0, curve_fit only where it is told to."""

    def theirs(**options: object) -> list[Array]:
        return [
            curve_fit(one_curve, np.tile(a.time_s, 3), a.runs.ravel(), p0=[a.runs.max(), 0.5, 5.0], **options)[0]
            for a in made
        ]

    def ours() -> list[Array]:
        return list(own_levels(made, data_of(made), 0.85).scatter.theta[:3].T)

    def cost(found: Array) -> float:
        return sum(float(np.sum((one_curve(a.time_s, *p) - a.runs) ** 2)) for a, p in zip(made, found, strict=True))

    fast, mine, _ = timed(ours, RUNS)
    for name, options in (("curve_fit", {}), ("curve_fit with bounds, T_s and τ above 0", {"bounds": (0.0, np.inf)})):
        slow, found, _ = timed(lambda options=options: theirs(**options), REPEATS)
        yield Row(
            f"per level, 10 × {made[0].runs.size:,} samples", "eaid", fast, name, slow, "≥ 200 × faster",
            slow >= 200 * fast, f"our cost over theirs {cost(mine) / cost(found) - 1:+.0e}",
        )  # fmt: skip


def first_order(made: list[Level], t: Array, u: Array, y: Array) -> Row:
    """The pooled linear model against least squares of the exact exponential."""

    def residual(p: Array) -> Array:
        return (p[1] * u + p[2]) / p[0] * (1 - np.exp(-p[0] * t)) - y

    def ours() -> Array:
        solved = fit_linear(data_of(made))
        p = parameters(solved.steps.model, solved.x)
        return np.array([p.a0, p.b0, p.c0])

    slow, other, _ = timed(lambda: least_squares(residual, [1.0, 0.05, -1.0], x_scale=[1.0, 0.05, 1.0]).x, REPEATS)
    fast, mine, _ = timed(ours, RUNS)
    over = float(np.sum(residual(mine) ** 2) / np.sum(residual(other) ** 2) - 1)
    return Row(
        f"pooled first order, {y.size:,} samples", "eaid", fast, "least_squares, exact exponential", slow,
        "≥ 80 × faster", slow >= 80 * fast, f"our cost over theirs {over:+.0e}",
    )  # fmt: skip
