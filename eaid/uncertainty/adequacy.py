"""Is the model right? Lack of fit against the spread of the repeats, and the alternatives side by side.

Shape of one level's curve: one or two exponentials, C held or free, and where repeats miss these alike a stretched
exponential, a logarithm, a power and three exponentials, by AICc and BIC with the effective sample size
n_e = n / (1 + 2 Σ ρ) that the residuals' autocorrelation ρ leaves. Curves over the duty: polynomials of one to four
powers for τ1, τ2, T_s, by χ² against the levels' own scatter and by leaving one level out (`orders`).
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.special import fdtri

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.fitting.first_order import fit_each_level
from eaid.fitting.kernel import level_costs
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.results.fit import Fit
from eaid.results.uncertainty import Adequacy, LackOfFit, OrderScore, ShapeScore
from eaid.steps.stepset import Level, StepSet
from eaid.uncertainty.decay import decays
from eaid.uncertainty.level_statistics import LevelStatistics
from eaid.uncertainty.levels import log_theta
from eaid.uncertainty.orders import leave_one_level_out, orders_of, raised_orders
from eaid.uncertainty.refit import free_parameters, refit
from eaid.uncertainty.run_statistics import run_residuals
from eaid.uncertainty.shapes import OTHERS, THREE, Shape, best_fits
from eaid.uncertainty.share import Share

STRONG = 6.0
"""Difference of BIC that counts as strong evidence (Kass and Raftery)."""
CLOSER = 0.1
"""Part of the RMSE that a free C has to save to be worth it."""
FEW = 2
"""Levels that repeats may miss alike by chance."""


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


def lack_of_fit(level: Level, noise_nm: Array) -> LackOfFit | None:
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
    chance = float(fdtri(count, count * (runs - 1), 0.999))
    systematic = float(np.sqrt(np.mean(common**2) * max(0.0, 1 - 1 / ratio))) if ratio > 0 else 0.0
    return LackOfFit(level.level, ratio, chance, bool(ratio > chance), systematic)


def adequacy(
    stepset: StepSet, fit: Fit, base: LevelStatistics, runs_share: Share | None = None
) -> tuple[Adequacy, list[Finding]]:
    """Judge the models of a fit, on the levels that it rests on; `runs_share` is the C that its runs ask for."""
    levels = base.levels
    residuals = [
        level.mean - friction.step_response(one.curve, level.time_s)
        for level, one in zip(levels, base.estimates, strict=True)
    ]
    sizes = [effective_samples(r) for r in residuals]
    counts = np.array([size for size, _ in sizes])
    rows = [row for level, one in zip(levels, base.estimates, strict=True) if (row := lack_of_fit(level, one.noise_nm))]
    shapes, missed = _shapes(base, fit, residuals, counts, rows)
    polynomial = fit.nonlinear is not None and base.source == "repeats" and len(levels) >= 4
    orders = orders_of(base) if polynomial else ()
    falling = decays(levels)
    found = []
    if falling:
        worst, lost = max(falling, key=lambda pair: pair[1])
        places, values = [u for u, _ in falling], {"worst": worst, "lost_pct": 100 * lost, "of": len(levels)}
        found.append(finding("output-decays-under-hold", "friction", places, unit=stepset.input_unit, **values))
    if 2 * len(falling) <= len(levels):
        found += _recommended(shapes, missed, orders, rows, runs_share)
    return Adequacy(
        shapes=shapes,
        orders=orders,
        lack_of_fit=tuple(rows),
        residual_autocorrelation=float(np.median([rho for _, rho in sizes])),
        effective_samples=float(counts.sum()),
        leave_one_level_out_nm=leave_one_level_out(base) if polynomial and len(levels) > 4 else None,
    ), found


def _shapes(
    base: LevelStatistics, fit: Fit, residuals: Sequence[Array], counts: Array, rows: Sequence[LackOfFit]
) -> tuple[tuple[ShapeScore, ...], dict[str, int]]:
    """All shapes that were tried, over all levels together, and the levels at which repeats miss the new ones alike.

    The other shapes are tried where repeats miss the two exponentials alike, or nothing can tell. The
    samples that count are then those that the memory of the closest shape leaves.
    """
    levels, share = base.levels, base.estimates[0].curve.C
    samples = np.array([len(level.time_s) for level in levels], dtype=float)
    two = np.array([float(r @ r) for r in residuals])
    if fit.linear is not None:
        single = np.array([row.sse for row in fit.linear.per_level])
    else:
        single = np.array([one.cost for one in fit_each_level(base.data)])
    found = [
        ("one exponential", 2, np.maximum(single, two)),
        (f"two exponentials, C = {share:g}", 3, two),
        ("two exponentials, C free", 4, _free_share(base, two)),
    ]
    missed: dict[str, int] = {}
    if not rows or any(row.beyond for row in rows):
        for name, parameters, shape, starts in OTHERS:
            left, missed[name] = _other(base, shape, starts)
            found.append((name, parameters, np.array([float(r @ r) for r in left])))
            if name == THREE:
                counts = np.array([effective_samples(r)[0] for r in left])

    def judged(name: str, parameters: int, sse: Array) -> ShapeScore:
        p = parameters + 1  # the noise's own size is a parameter too
        score = counts * np.log(np.maximum(sse / samples, 1e-300))
        spare = np.maximum(counts - p - 1, 1.0)
        aicc = float((score + 2 * p + 2 * p * (p + 1) / spare).sum())
        bic = float((score + p * np.log(counts)).sum())
        return ShapeScore(name, parameters, float(np.sqrt(sse.sum() / samples.sum())), aicc, bic)

    return tuple(judged(*one) for one in found), missed


def _other(base: LevelStatistics, shape: Shape, starts: Callable[[Friction], Array]) -> tuple[list[Array], int]:
    """Residuals of the levels' means about another shape, and at how many levels all repeats miss it alike."""
    left, missed = [], 0
    best = best_fits(shape, np.array([starts(one.curve) for one in base.estimates]), base.data.points)
    for level, theta in zip(base.levels, best, strict=True):
        fitted, slopes = (found[0] for found in shape(theta[None], level.time_s))
        left.append(level.mean - fitted)
        row = lack_of_fit(level, run_residuals(level.runs, fitted, slopes))
        missed += row is not None and row.beyond
    return left, missed


def _free_share(base: LevelStatistics, two: Array) -> Array:
    """Least sums of squares of the levels with C free too, from the held curves and from C = 0.5, shape (L,).

    `two` are those of the held curves: what the points' costs are above them is the same for all curves.
    """
    points, curves = base.data.points, [one.curve for one in base.estimates]
    held = np.array([log_theta(curve, True) for curve in curves])
    half = np.where(np.arange(4) == 3, 0.0, held)
    twice = points.rows(np.tile(np.arange(len(curves)), 2))
    costs = refit(twice, np.concatenate([held, half]), free_parameters(True)).cost.reshape(2, -1)
    above = two - level_costs(np.array([[c.Ts, c.tau1, c.tau2, c.C] for c in curves]).T, points)
    return np.asarray(np.minimum(two, np.maximum(above + costs.min(axis=0), 0.0)))


def _recommended(
    shapes: Sequence[ShapeScore],
    missed: dict[str, int],
    orders: Sequence[OrderScore],
    rows: Sequence[LackOfFit],
    runs_share: Share | None,
) -> list[Finding]:
    """Which shape and which polynomials the levels ask for; `missed`: where repeats miss other shapes alike."""
    best, usual = min(shapes, key=lambda shape: shape.bic or 0.0), shapes[1]
    beyond = [row for row in rows if row.beyond]
    strong = (usual.bic or 0.0) - (best.bic or 0.0) >= STRONG
    values = {"shape": best.name, "usual": usual.name, "rmse": best.rmse, "usual_rmse": usual.rmse}
    closer = 1 - (best.rmse or 0.0) / usual.rmse if usual.rmse else 0.0
    if missed and min(missed.values()) > max(FEW, len(rows) / 4):
        name = min(missed, key=missed.__getitem__)
        found = [finding("no-shape-fits", "friction", (), shape=name, count=missed[name], of=len(rows))]
    elif best.name in missed and strong:
        found = [finding("shape-of-another-kind", "friction", (), **values)]
    elif runs_share is not None and runs_share.matters and not runs_share.differ and best is not shapes[0]:
        return [finding("shape-needs-the-share", "friction", held=runs_share.held, estimate=runs_share.estimate)]
    elif best is usual or not strong:
        found = [finding("shape-fits", "friction", (), **values)]
    elif best is shapes[2] and closer < CLOSER:
        found = [finding("shape-fits", "friction", (), closer_pct=100 * closer, **values)]
    else:
        found = [finding("shape-of-another-kind", "friction", (), **values)]
    raised = raised_orders(orders)
    if raised:
        found.append(finding("polynomials-too-low", "nonlinear", (), **raised))
    elif orders:
        found.append(finding("polynomials-fit", "nonlinear"))
    if beyond:
        worst = max(beyond, key=lambda row: row.systematic_nm or 0.0)
        size = {"systematic": worst.systematic_nm, "worst": worst.level, "of": len(rows)}
        found.append(finding("repeats-miss-alike", "friction", [row.level for row in beyond], **size))
    return found
