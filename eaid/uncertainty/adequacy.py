"""Is the model right? Lack of fit against the spread of the repeats, and the alternatives side by side.

Shape of one level's curve: one or two exponentials, C held or free, by AICc and BIC with the effective sample size
n_e = n / (1 + 2 Σ ρ) that the residuals' autocorrelation ρ leaves. Curves over the duty: polynomials of one to four
powers for τ1, τ2, T_s, by χ² against the levels' own scatter and by leaving one level out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.special import fdtri

from eaid.arrays import Array, median
from eaid.fitting.kernel import level_sums
from eaid.fitting.linear import fit_own_levels
from eaid.fitting.result import Fit
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.steps.stepset import Level, StepSet
from eaid.uncertainty.curve import Curve, curve_with_repeats
from eaid.uncertainty.level_statistics import TERMS, LevelStatistics
from eaid.uncertainty.levels import log_theta
from eaid.uncertainty.profile import least_of_all
from eaid.uncertainty.share import Share

OVERSHOOT = 0.05
"""Torque lost under hold beyond which no monotone curve is right."""
STRONG = 6.0
"""Difference of BIC that counts as strong evidence (Kass and Raftery)."""
ORDERS = (1, 2, 3, 4)


@dataclass(frozen=True)
class Shape:
    """One alternative for the curve of a level, judged over all levels together."""

    name: str
    parameters: int
    rmse: float
    aicc: float
    bic: float


@dataclass(frozen=True)
class Order:
    """One alternative for the polynomial of τ1, τ2 or T_s."""

    parameter: str
    order: int
    chi_square: float
    """Σ res²/V over the levels, to be compared with L − p."""
    aicc: float
    leave_one_out_pct: float
    """RMS error of the parameter at a level that was left out [%]."""


@dataclass(frozen=True)
class Adequacy:
    """Tables, one recommended sentence, and warnings."""

    shapes: tuple[Shape, ...]
    orders: tuple[Order, ...]
    lack_of_fit: tuple[dict[str, Any], ...]
    autocorrelation: float
    """Median lag-1 autocorrelation of the residuals."""
    effective_samples: float
    leave_one_level_out_nm: float | None
    """RMS error of the torque of a left-out level [output unit]."""
    recommended: str
    warnings: tuple[str, ...] = field(default=())

    def as_json(self) -> dict[str, Any]:
        """For fit.json."""
        return {
            "shapes": [vars(one) for one in self.shapes],
            "orders": [vars(one) for one in self.orders],
            "lack_of_fit": list(self.lack_of_fit),
            "residual_autocorrelation": self.autocorrelation,
            "effective_samples": self.effective_samples,
            "leave_one_level_out_nm": self.leave_one_level_out_nm,
            "recommended": self.recommended,
            "warnings": list(self.warnings),
        }


def effective_samples(residual: Array) -> tuple[float, float]:
    """n_e = n/(1 + 2 Σ ρ_j), summed to the first negative pair (Geyer), and ρ_1; by FFT."""
    n = len(residual)
    e = residual - residual.mean()
    power = float(e @ e)
    if power <= 1e-28 * max(float(residual @ residual), 1e-300) or n < 4:
        return float(n), 0.0
    size = 1 << (n + n // 2).bit_length()  # lags up to n/2 stay clear of the far end
    rho = np.fft.irfft(_spectrum(e, size), size)[: n // 2] / power
    pairs = rho[1 : len(rho) - 1 : 2] + rho[2::2][: len(rho[1 : len(rho) - 1 : 2])]
    stop = int(np.argmax(pairs <= 0)) if (pairs <= 0).any() else len(pairs)
    total = 1 + 2 * float(pairs[:stop].sum())
    return float(np.clip(n / total, 2.0, n)), float(rho[1])


def _spectrum(values: Array, size: int | None = None) -> Array:
    """Squared size of the Fourier transform, padded with zeros to `size`."""
    z = np.fft.rfft(values, size)
    return np.asarray(z.real**2 + z.imag**2)


def spectral_degrees(residual: Array) -> float:
    """Degrees of freedom of a sum of squares of coloured noise, (Σ P)²/Σ P² over its spectrum P; two for a sine."""
    power = _spectrum(residual)
    total = float((power**2).sum())
    return float(2 * power.sum() ** 2 / total) if total > 0 else float(len(residual))


def overshoot(level: Level) -> float:
    """Share of its peak that the mean torque loses while the input is held, smoothed over a fiftieth of the record."""
    width = max(1, len(level.time_s) // 50)
    sums = np.cumsum(np.concatenate(([0.0], level.mean)))
    smooth = (sums[width:] - sums[:-width]) / width
    peak = float(smooth.max())
    if peak <= 0:
        return 0.0
    return float((peak - smooth[-1]) / peak)


def lack_of_fit(level: Level, noise_nm: Array) -> dict[str, Any] | None:
    """Whether the runs of one level miss their own curves in the same way; None for a single run.

    `ratio` is R Σ ē² / (Σ_r Σ (e_r − ē)²/(R − 1)): 1 for a right model, whatever the colour of the noise.
    """
    runs = len(noise_nm)
    if runs < 2:
        return None
    common = noise_nm.mean(axis=0)
    off = noise_nm - common
    apart = float(np.vdot(off, off)) / (runs - 1)
    ratio = runs * float(common @ common) / apart if apart > 0 else 1.0
    count = float(np.mean([spectral_degrees(run) for run in off]))
    chance = fdtri(count, count * (runs - 1), 0.999)
    return {
        "level": level.level,
        "ratio": ratio,
        "chance": chance,
        "beyond": bool(ratio > chance),
        "systematic_nm": float(np.sqrt(np.mean(common**2) * max(0.0, 1 - 1 / ratio))) if ratio > 0 else 0.0,
    }


def adequacy(stepset: StepSet, fit: Fit, base: LevelStatistics, asked: Share | None = None) -> Adequacy:
    """Judge the models of a fit, on the levels that it rests on; `asked` is the C that its runs ask for."""
    levels = base.levels
    residuals = [
        level.mean - friction.step_response(one.curve, level.time_s)
        for level, one in zip(levels, base.estimates, strict=True)
    ]
    sizes = [effective_samples(r) for r in residuals]
    counts = np.array([size for size, _ in sizes])
    shapes = _shapes(base, fit, residuals, counts)
    rows = [row for level, one in zip(levels, base.estimates, strict=True) if (row := lack_of_fit(level, one.noise_nm))]
    polynomial = fit.nonlinear is not None and base.source == "repeats" and len(levels) >= 4
    orders = _orders(base) if polynomial else ()
    falling = [(level, lost) for level in levels if (lost := overshoot(level)) > OVERSHOOT]
    if 2 * len(falling) > len(levels):
        recommended = (
            f"none of these models: the output decays under hold at {len(falling)} of {len(levels)} levels; "
            "end the window before it does (--until), or take T_s for an average"
        )
    else:
        recommended = _sentence(shapes, orders, rows, asked)
    return Adequacy(
        shapes=shapes,
        orders=orders,
        lack_of_fit=tuple(rows),
        autocorrelation=median([rho for _, rho in sizes]),
        effective_samples=float(counts.sum()),
        leave_one_level_out_nm=_leave_one_out(base) if polynomial and len(levels) > 4 else None,
        recommended=recommended,
        warnings=tuple(_warnings(stepset, falling)),
    )


def _shapes(base: LevelStatistics, fit: Fit, residuals: Sequence[Array], counts: Array) -> tuple[Shape, ...]:
    levels, share = base.levels, base.estimates[0].curve.C
    samples = np.array([len(level.time_s) for level in levels], dtype=float)

    def judged(name: str, parameters: int, sse: Array) -> Shape:
        p = parameters + 1  # the noise's own size is a parameter too
        score = counts * np.log(np.maximum(sse / samples, 1e-300))
        spare = np.maximum(counts - p - 1, 1.0)
        aicc = float((score + 2 * p + 2 * p * (p + 1) / spare).sum())
        bic = float((score + p * np.log(counts)).sum())
        return Shape(name, parameters, float(np.sqrt(sse.sum() / samples.sum())), aicc, bic)

    two = np.array([float(r @ r) for r in residuals])
    if fit.linear is not None and fit.linear.bounds.convention != "pooled-dynamics":
        single = np.array([row.sse for row in fit.linear.per_level])
    else:
        single = np.array([one.cost for one in fit_own_levels(base.data)])
    found = [judged("one exponential", 2, np.maximum(single, two))]
    found.append(judged(f"two exponentials, C = {share:g}", 3, two))
    found.append(judged("two exponentials, C free", 4, _free_share(base, two)))
    return tuple(found)


def _free_share(base: LevelStatistics, two: Array) -> Array:
    """Least sums of squares of the levels with C free too, from the held curves and from C = 0.5, shape (L,).

    `two` are those of the held curves: what the points' costs are above them is the same for all curves.
    """
    points, curves = base.data.points, [one.curve for one in base.estimates]
    held = np.array([log_theta(curve, True) for curve in curves])
    half = np.where(np.arange(4) == 3, 0.0, held)
    costs = least_of_all(points, np.stack([held, half]))
    above = two - level_sums(np.array([[c.Ts, c.tau1, c.tau2, c.C] for c in curves]).T, points)[0]
    return np.asarray(np.minimum(two, np.maximum(above + costs.min(axis=0), 0.0)))


def _orders(base: LevelStatistics) -> tuple[Order, ...]:
    rows = []
    for k, name in enumerate(("Ts", "tau1", "tau2")):
        row = base.determined[:, k]
        duty, theta, variance = base.duty_pct[row], base.log_theta[row, k], base.expected[row, k]
        for order in ORDERS:
            p = order + 1
            if len(duty) < p + 1:
                continue
            curve = curve_with_repeats(duty, theta, variance, base.total_degrees, p)
            chi = float(curve.misfit) * (len(duty) - p)
            spare = max(len(duty) - p - 1, 1)
            errors = left_out(curve, duty, theta)
            inner = errors[1:-1] if len(errors) > 4 else errors  # the ends would be extrapolation
            error = 100 * float(np.sqrt(np.mean(inner**2)))
            rows.append(Order(name, order, chi, chi + 2 * p + 2 * p * (p + 1) / spare, error))
    return tuple(rows)


def left_out(curve: Curve, duty_pct: Array, log_values: Array) -> Array:
    """log p(u) − θ̂ at each level if it were left out, residual/(1 − h) with h its own say in the curve, shape (L,)."""
    own = np.einsum("ij,ji->i", curve.slopes(duty_pct), curve.gains)
    return np.asarray((np.log(curve.at(duty_pct)) - log_values) / np.maximum(1 - own, 1e-9))


def _leave_one_out(base: LevelStatistics) -> float:
    """RMS torque error of inner levels that the curves of all others predict [output unit]."""
    inner = slice(1, -1)
    values = []
    for k, name in enumerate(("Ts", "tau1", "tau2")):
        row = base.determined[:, k]
        count = int(row.sum())
        if count < 3:
            return float("nan")
        duty, theta = base.duty_pct[row], base.log_theta[row, k]
        curve = curve_with_repeats(duty, theta, base.expected[row, k], 10.0, min(TERMS[name], count - 1))
        said = np.log(np.maximum(curve.at(base.duty_pct), 1e-6))
        said[row] = theta + left_out(curve, duty, theta)
        values.append(np.exp(np.clip(said, np.log(1e-6), 50.0)))
    total, samples = 0.0, 0
    shares = [one.curve.C for one in base.estimates]
    for level, Ts, tau1, tau2, C in list(zip(base.levels, *values, shares, strict=True))[inner]:
        left = level.mean - friction.step_response(Friction(float(Ts), float(tau1), float(tau2), C), level.time_s)
        total += float(left @ left)
        samples += len(left)
    return float(np.sqrt(total / samples))


def _sentence(
    shapes: Sequence[Shape], orders: Sequence[Order], rows: Sequence[dict[str, Any]], asked: Share | None
) -> str:
    best = min(shapes, key=lambda shape: shape.bic)
    usual = shapes[1]
    told = asked is not None and asked.matters and not asked.differ and best.name != "one exponential"
    if asked is not None and asked.estimate is not None and told:
        return (
            f"use two exponentials, C = {asked.estimate:.3f} at all levels: the runs reject C = {asked.held:g}; "
            f"fit again with --share {asked.estimate:.3f} before judging the polynomials"
        )
    if best is usual or usual.bic - best.bic < STRONG:
        said = f"keep {usual.name}"
    elif best.name == "two exponentials, C free" and best.rmse > 0.9 * usual.rmse:
        closer = 100 * (1 - best.rmse / usual.rmse)
        said = f"keep {usual.name}: a free C fits {f'only {closer:.0f} %' if closer >= 0.5 else 'no'} closer"
    else:
        said = f"use {best.name}: RMSE {best.rmse:.3g} against {usual.rmse:.3g}"
    raised = []
    for name, paper in (("Ts", 3), ("tau1", 2), ("tau2", 2)):
        own = [order for order in orders if order.parameter == name]
        there = next((order for order in own if order.order == paper), None)
        if there is None:
            continue
        better = min(own, key=lambda order: order.aicc)
        if better.order > paper and better.aicc < there.aicc - 4:
            raised.append(f"order {better.order} for {name}")
    if raised:
        said += f"; the levels ask for {', '.join(raised)} instead of the paper's polynomials"
    elif orders:
        said += "; the paper's polynomials follow the levels as well as any of orders 1 to 4"
    missed = [row for row in rows if row["beyond"]]
    if missed:
        worst = max(missed, key=lambda row: float(row["systematic_nm"]))
        said += (
            f"; at {len(missed)} of {len(rows)} levels all repeats miss the curve alike "
            f"(by {worst['systematic_nm']:.2g} at {worst['level']:g}): the shape is not quite right"
        )
    return said


def _warnings(stepset: StepSet, falling: Sequence[tuple[Level, float]]) -> list[str]:
    said = []
    if falling:
        worst, lost = max(falling, key=lambda pair: pair[1])
        several = f" and at {len(falling) - 1} more levels" if len(falling) > 1 else ""
        said.append(
            f"the output overshoots and decays under hold: {100 * lost:.0f} % of its peak is lost by the end at "
            f"{f'{worst.level:g} {stepset.input_unit}'.rstrip()}{several}; no sum of rising exponentials shows that, "
            "so T_s is an average and τ2 means nothing there"
        )
    return said
