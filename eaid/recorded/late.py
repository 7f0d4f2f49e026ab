"""Is the input noted some rows late, or early? Then τ1 is wrong, and no residual looks it.

With f_s the response to the input of s rows later (what acted, if the log shows a change s rows late), D = (f₁ − f₋₁)/2
is the derivative by that delay. In residuals r whitened by an autoregression, J and D with them,

    δ = −D̃'r/D̃'D̃,   D̃ = D − J (J'J)⁻¹ J'D,   var δ = Σ_stretches (D̃'r)²/(D̃'D̃)²

is the delay in rows. The input is moved row by row while half a row or more is left. What noise does not explain is
told where it matters: H⁻¹ J'D δ is what the delay does to the coefficients.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter
from scipy.stats import t as student

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.fitting.solver import approach
from eaid.recorded.curve_intervals import CurveSpread
from eaid.recorded.drive import Copies, Drive
from eaid.recorded.intervals import inverse
from eaid.recorded.log import RecordedLog
from eaid.recorded.problem import Setup
from eaid.recorded.solve import Solved

MOST = 3
"""Rows that are looked for."""
ORDER = 8
"""Of the autoregression."""
STRETCHES = 40
CHANCE = 0.01
"""Of a delay as large by noise alone, at most."""
LEAST_CHANGES = 4
MATTERS = 0.25
"""A delay that moves τ1 by less than this part of its interval's half-width at all inputs is not told."""


@dataclass(frozen=True)
class Delay:
    """How many rows late an input is noted, and what that does to the fit."""

    rows: float
    sd: float
    shift: Array
    """Of the unknowns, (n,)."""

    @property
    def seen(self) -> bool:
        """It is half a row or more, and noise does not explain it."""
        reach = float(student.isf(CHANCE / 2, STRETCHES - 1))
        return abs(self.rows) >= 0.5 and abs(self.rows) > reach * self.sd


def delay_findings(base: Solved, logs: Sequence[RecordedLog], known: CurveSpread | None) -> list[Finding]:
    """What is said of each log with a held input; a loop's input answers the output, and tells no delay."""
    found = []
    for k, log in enumerate(logs):
        if not log.stepwise or log.reference is not None or len(log.changes) < LEAST_CHANGES:
            continue
        delay = delay_of(base, k, log)
        size = 1.0 if known is None else _bias(base, delay, known)
        if not delay.seen or size < MATTERS:
            continue
        code = "input-late" if delay.rows > 0 else "input-early"
        rows = max(1, round(abs(delay.rows)))
        ms = 1e3 * rows * float(np.median(log.dt_s))
        found.append(finding(code if size <= 1 else f"{code}-biases", log.name, rows=rows, ms=ms, widths=size))
    return found


def delay_of(base: Solved, index: int, log: RecordedLog) -> Delay:
    """The delay of one log: the input is moved row by row while half a row or more is left."""
    columns = base.setup.places[index].columns
    x, rows = base.x[columns], 0
    step, sd, slope = one_step(base.fitted, x, log)
    shift = np.zeros(len(base.x))
    shift[columns] = slope
    while abs(step) >= 0.5 and abs(rows) < MOST:
        further = rows + int(np.sign(step))
        x = approach(alone(base.fitted, Copies(shifted(log, further)).small).problem(), x).x
        found = one_step(base.fitted, x, shifted(log, further))
        if found[0] * step < 0 and abs(found[0]) >= abs(step):
            break
        rows, (step, sd, _) = further, found
    return Delay(rows + step, sd, shift * (rows + step))


def one_step(setup: Setup, x: Array, log: RecordedLog) -> tuple[float, float, Array]:
    """The delay in rows by one step from x, (p,), its standard deviation, and what a row does to x, (p,)."""
    J, r = alone(setup, Copies(log).every).jacobian(x, 0)
    after, before = (alone(setup, Copies(shifted(log, rows)).every).jacobian(x, 0)[1] for rows in (1, -1))
    D = 0.5 * (after - before)
    shift = inverse(J.T @ J) @ (J.T @ D)
    ar = np.append(1.0, -autoregression(r))
    J, D, r = (np.asarray(lfilter(ar, [1.0], one, axis=0))[ORDER:] for one in (J, D, r))
    D = D - J @ (inverse(J.T @ J) @ (J.T @ D))
    size = max(float(D @ D), 1e-300)
    rows = -float(D @ r) / size
    starts = np.linspace(0, len(r), STRETCHES, endpoint=False).astype(int)
    scores = np.add.reduceat(D * (r + rows * D), starts)
    return rows, float(np.sqrt(scores @ scores)) / size, shift


def autoregression(r: Array) -> Array:
    """Coefficients of r_k on the `ORDER` values before it (Yule and Walker)."""
    n = 2 ** int(np.ceil(np.log2(2 * len(r))))
    rho = np.fft.irfft(np.abs(np.fft.rfft(r, n)) ** 2)[: ORDER + 1]
    rho[0] *= 1 + 1e-9
    return np.asarray(solve_toeplitz(rho[:-1], rho[1:])) if rho[0] > 0 else np.zeros(ORDER)


def shifted(log: RecordedLog, rows: int) -> RecordedLog:
    """The log with the input of so many rows later."""
    at = np.clip(np.arange(len(log.input)) + rows, 0, len(log.input) - 1)
    return replace(log, input=log.input[at], idle_start=log.starts_idle)


def alone(setup: Setup, drive: Drive) -> Setup:
    """One log by itself."""
    return replace(setup, drives=(drive,), copies=())


def _bias(base: Solved, delay: Delay, known: CurveSpread) -> float:
    """What the delay does to τ1 over the half-width of its interval, at the input where that is most."""
    slopes = base.setup.model.slopes(known.duty, base.setup.size)[1]
    half = known.values[1] * known.half_width[1]
    return float(np.max(np.abs(slopes @ delay.shift) / half, initial=0.0, where=np.isfinite(half)))
