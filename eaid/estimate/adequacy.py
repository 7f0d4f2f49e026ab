"""Is the model right? Lack of fit against the spread of the repeats, and the alternatives side by side.

Shape of one level's curve: one or two exponentials, C held or free, and where repeats miss these alike a stretched
exponential, a logarithm, a power and three exponentials, by AICc and BIC with the effective sample size
n_e = n / (1 + 2 Σ ρ) that the residuals' autocorrelation ρ leaves.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.special import fdtri

from eaid.arrays import Array
from eaid.estimate.level_statistics import LevelStatistics, log_theta, refit
from eaid.estimate.linear import fit_each_level
from eaid.estimate.points import Points, level_normal
from eaid.estimate.runs import run_residuals, t_quantile
from eaid.estimate.share import Share
from eaid.estimate.solver import descend
from eaid.findings import Finding, finding
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.results.fit import Adequacy, Fit, LackOfFit, ShapeScore
from eaid.steps.noise import line
from eaid.steps.stepset import Level, StepSet

OVERSHOOT = 0.05
"""Output lost under hold beyond which no monotone curve is right."""
CHANCE = 0.01
"""Probability at which noise alone would be told to be a decay under hold."""
SINGLE_CHANCE = 0.001
"""The same for a single run, whose peak the same noise has chosen."""
SINGLE_DEGREES = 4.0
"""Degrees of freedom given to the scatter of a single smoothed run."""


def overshoot(level: Level) -> float:
    """Share of its peak that the mean output loses while the input is held, smoothed over a fiftieth of the record."""
    smooth = _smooth(level.mean)
    peak = float(smooth.max())
    return float((peak - smooth[-1]) / peak) if peak > 0 else 0.0


def _smooth(values: Array) -> Array:
    """Moving means over a fiftieth of the record, along the last axis."""
    width = max(1, values.shape[-1] // 50)
    sums = np.cumsum(np.concatenate([np.zeros((*values.shape[:-1], 1)), values], axis=-1), axis=-1)
    return np.asarray((sums[..., width:] - sums[..., :-width]) / width)


def decays(levels: Sequence[Level]) -> list[tuple[float, float]]:
    """(level, share of the peak lost) where the output falls under hold by more than `OVERSHOOT` and than chance.

    The peak of a run is looked for in the other runs, so that noise does not make one. The falls of the runs of a level
    are then compared with what they scatter, pooled over the levels (t test, one in a hundred); the fall of a single
    run with what its own smoothed output scatters about a straight line after the peak (one in a thousand).
    """
    falls = [_falls(level) for level in levels]
    spare = sum(len(fall) - 1 for fall in falls)
    pooled = sum(float(((fall - fall.mean()) ** 2).sum()) for fall in falls) / max(spare, 1)
    found = []
    for level, fall in zip(levels, falls, strict=True):
        lost = overshoot(level)
        error = np.sqrt(pooled / len(fall)) if len(fall) > 1 else _single_error(level)
        degrees, chance = (float(spare), CHANCE) if len(fall) > 1 else (SINGLE_DEGREES, SINGLE_CHANCE)
        if lost > OVERSHOOT and fall.mean() > t_quantile(degrees, 1 - 2 * chance) * error:
            found.append((level.level, lost))
    return found


def _falls(level: Level) -> Array:
    """What each run loses from its peak to its end, relative to the peak, shape (R,)."""
    smooth = _smooth(level.runs)
    others = smooth if len(smooth) == 1 else smooth.sum(axis=0) - smooth
    peak = np.take_along_axis(smooth, others.argmax(axis=1)[:, None], axis=1)[:, 0]
    return np.asarray((peak - smooth[:, -1]) / np.maximum(np.abs(peak), 1e-300))


def _single_error(level: Level) -> float:
    """Standard error of the fall of a single run, from its smoothed output about a line after the peak."""
    smooth = _smooth(level.mean)
    after = smooth[int(smooth.argmax()) :: max(1, len(level.mean) // 50)]
    if len(after) < 4 or smooth.max() <= 0:
        return np.inf
    left = line(np.arange(len(after)), after).left
    return float(np.sqrt(2 * (left @ left) / (len(after) - 2)) / smooth.max())


Shape = Callable[[Array, Array], tuple[Array, Array]]
"""θ (N, k) and t, (n,) or (N, n) → the curves (N, n) and their slopes by θ (N, n, k)."""
STEPS, ENOUGH = 40, 1e-7
BETAS = (0.5, 0.8)


def stretched(theta: Array, time_s: Array) -> tuple[Array, Array]:
    """T_s (1 − e^(−a)), a = (t/τ)^β, by (log T_s, log τ, log β)."""
    steady, tau, beta = np.exp(theta).T[:, :, None]
    with np.errstate(divide="ignore"):
        log_a = beta * np.log(time_s / tau)
    a = np.exp(np.minimum(log_a, 50.0))
    bent = steady * a * np.exp(-a)
    f = -steady * np.expm1(-a)
    return f, np.stack([f, -beta * bent, bent * np.where(a > 0, log_a, 0.0)], axis=-1)


def logarithm(theta: Array, time_s: Array) -> tuple[Array, Array]:
    """A ln(1 + t/τ), by (log A, log τ): it grows for ever, as a contact that ages may."""
    size, tau = np.exp(theta).T[:, :, None]
    f = size * np.log1p(time_s / tau)
    return f, np.stack([f, -size * time_s / (tau + time_s)], axis=-1)


def power(theta: Array, time_s: Array) -> tuple[Array, Array]:
    """A t^β, by (log A, log β): the creep of Andrade, β about 1/3, without an end."""
    size, beta = np.exp(theta).T[:, :, None]
    log_t = np.log(np.maximum(time_s, 1e-12))
    f = size * np.where(time_s > 0, np.exp(beta * log_t), 0.0)
    return f, np.stack([f, f * beta * log_t], axis=-1)


def three_exponentials(theta: Array, time_s: Array) -> tuple[Array, Array]:
    """Σ A_k (1 − e^(−t/τ_k)), by (log A_1..3, log τ_1..3)."""
    size, tau = np.exp(theta[:, None, :3]), np.exp(theta[:, None, 3:])
    a = np.atleast_2d(time_s)[:, :, None] / tau
    parts = -size * np.expm1(-a)
    return parts.sum(axis=-1), np.concatenate([parts, -size * a * np.exp(-a)], axis=-1)


def stretched_starts(curve: Friction) -> Array:
    """About the level's two exponentials, shape (2, 3)."""
    middle = curve.tau1 ** (curve.C) * curve.tau2 ** (1 - curve.C)
    return np.log([[curve.Ts, middle, beta] for beta in BETAS])


def logarithm_starts(curve: Friction) -> Array:
    """Through T_s at the level's τ2, shape (2, 2)."""
    return np.log([[curve.Ts / np.log1p(curve.tau2 / tau), tau] for tau in (curve.tau1, curve.tau1 / 5)])


def power_starts(curve: Friction) -> Array:
    """Through T_s at the level's τ2, shape (2, 2)."""
    return np.log([[curve.Ts / curve.tau2**beta, beta] for beta in (0.1, 1 / 3)])


def three_starts(curve: Friction) -> Array:
    """The two exponentials with a third one below, between and above them, shape (3, 6)."""
    fast, slow = curve.C * curve.Ts, (1 - curve.C) * curve.Ts
    between = np.sqrt(curve.tau1 * curve.tau2)
    return np.log(
        [
            [fast / 2, fast / 2, slow, curve.tau1 / 2, curve.tau1 * 1.5, curve.tau2],
            [fast * 0.8, fast * 0.2, slow, curve.tau1, between, curve.tau2],
            [fast, slow / 2, slow / 2, curve.tau1, between, curve.tau2 * 2],
        ]
    )


THREE = "three exponentials"
OTHERS: tuple[tuple[str, int, Shape, Callable[[Friction], Array]], ...] = (
    ("a stretched exponential", 3, stretched, stretched_starts),
    ("a logarithm of time", 2, logarithm, logarithm_starts),
    ("a power of time", 2, power, power_starts),
    (THREE, 6, three_exponentials, three_starts),
)
"""Shapes that are tried where two exponentials fail: name, parameters, curve, starts."""


def best_fits(shape: Shape, starts: Array, points: Points) -> Array:
    """Where a shape is nearest to each level of `points`, from starts of shape (L, S, k); shape (L, k)."""
    levels, several, count = starts.shape
    each = points.rows(np.repeat(np.arange(levels), several))

    def look(x: Array) -> tuple[Array, Array, Array]:
        f, slopes = shape(x, each.t_s)
        left, J = each.root_w * (f - each.y), each.root_w[:, :, None] * slopes
        cost = np.nan_to_num(np.einsum("nj,nj->n", left, left), nan=np.inf)
        sound = np.isfinite(cost)[:, None, None]
        J = np.where(sound, J, 0.0)
        return cost, 2 * np.einsum("njk,nj->nk", J, np.where(sound[:, :, 0], left, 0.0)), 2 * J.transpose(0, 2, 1) @ J

    found = descend(look, starts.reshape(-1, count), STEPS, ENOUGH, lambda x, move: x - np.clip(move, -1.0, 1.0))
    best = found.cost.reshape(levels, several).argmin(axis=1)
    return np.asarray(found.x.reshape(starts.shape)[np.arange(levels), best])


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
    falling = decays(levels)
    found = []
    if falling:
        worst, lost = max(falling, key=lambda pair: pair[1])
        places, values = [u for u, _ in falling], {"worst": worst, "lost_pct": 100 * lost, "of": len(levels)}
        found.append(finding("output-decays-under-hold", "friction", places, unit=stepset.input_unit, **values))
    if 2 * len(falling) <= len(levels):
        found += _recommended(shapes, missed, rows, runs_share)
    return Adequacy(
        shapes=shapes,
        lack_of_fit=tuple(rows),
        residual_autocorrelation=float(np.median([rho for _, rho in sizes])),
        effective_samples=float(counts.sum()),
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
    costs = refit(twice, np.concatenate([held, half]), np.ones(4, dtype=bool)).cost.reshape(2, -1)
    above = two - level_normal(np.array([[c.Ts, c.tau1, c.tau2, c.C] for c in curves]).T, points)[0]
    return np.asarray(np.minimum(two, np.maximum(above + costs.min(axis=0), 0.0)))


def _recommended(
    shapes: Sequence[ShapeScore],
    missed: dict[str, int],
    rows: Sequence[LackOfFit],
    runs_share: Share | None,
) -> list[Finding]:
    """Which shape the levels ask for; `missed`: where repeats miss other shapes alike."""
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
    if beyond:
        worst = max(beyond, key=lambda row: row.systematic_nm or 0.0)
        size = {"systematic": worst.systematic_nm, "worst": worst.level, "of": len(rows)}
        found.append(finding("repeats-miss-alike", "friction", [row.level for row in beyond], **size))
    return found
