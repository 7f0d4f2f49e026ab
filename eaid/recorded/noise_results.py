"""The noise behind a recorded fit, for fit.json and for plans: densities, and scatter between engagements."""

import numpy as np
from scipy.stats import chi2

from eaid.recorded.intervals import ENGAGEMENTS, Spread
from eaid.recorded.noise import engagements
from eaid.recorded.solve import Solved, idle_of
from eaid.results.uncertainty import Noise, Uncertainty

NOISE_WINDOW_S = 2.0
"""Stretch over which the density of the noise is taken [s]."""


def degrees_of(solved: Solved, sure: Spread) -> dict[str, float]:
    """Degrees of freedom of T_s, τ1, τ2 at the middle of the range."""
    model = solved.setup.model
    slopes = model.slopes(np.array([0.5 * (model.low + model.high)]), solved.setup.size)
    return {name: sure.variance(slopes[k, 0])[1] for name, k in (("tau1", 1), ("tau2", 2), ("Ts", 0))}


def uncertainty_part(solved: Solved, sure: Spread) -> Uncertainty:
    """Where the intervals come from, and the noise that further recordings can be planned with."""
    return Uncertainty(
        ci="robust",
        scatter_from="engagements" if sure.engagements >= 4 else "within",
        degrees_of_freedom=min(degrees_of(solved, sure).values()),
        noise=noise_part(solved),
    )


def noise_part(solved: Solved) -> Noise:
    """Density of the noise, S = s0 + s1 T², from squared sums of the residuals over short stretches."""
    squares, densities = [], []
    for k, drive in enumerate(solved.setup.drives):
        r, y = solved.missed[k], solved.outputs[k] - idle_of(solved, k)
        dt_s = float(drive.dt_s.sum()) / len(r)
        width = max(1, round(NOISE_WINDOW_S / dt_s))
        count = len(r) // width
        if count:
            squares.append(np.mean((y[: count * width] + r[: count * width]).reshape(count, width) ** 2, axis=1))
            densities.append(r[: count * width].reshape(count, width).sum(axis=1) ** 2 * dt_s / width)
    x, S = np.concatenate(squares), np.concatenate(densities)
    design = np.column_stack([np.ones_like(x), x])
    weight = 1 / np.maximum(S.mean() * (0.1 + x / max(x.mean(), 1e-300)), 1e-300)
    s = np.linalg.lstsq(design * weight[:, None], S * weight, rcond=None)[0]
    if (s < 0).any():
        alone = [float(S.mean()), float((S * weight).sum() / max((x * weight).sum(), 1e-300))]
        s = np.array([alone[0], 0.0]) if s[1] < 0 else np.array([0.0, alone[1]])
    scatter, _, _ = engagement_scatter(solved, float(s[0]), float(s[1]))
    return Noise(float(s[0]), float(s[1]), {"Ts": scatter, "tau1": 0.0, "tau2": 0.0})


def engagement_scatter(solved: Solved, s0: float, s1: float) -> tuple[float, int, float]:
    """Standard deviation of the output's gain between engagements beyond what noise makes, their number, the chance.

    γ = Σ T r/Σ T² of each engagement; noise alone gives it the variance ∫ (s0 + s1 T²) T² dt/(∫ T² dt)².
    """
    gains, own = [], []
    for k, drive in enumerate(solved.setup.drives):
        r = solved.missed[k]
        T = solved.outputs[k] - idle_of(solved, k) + r
        dt_s = float(drive.dt_s.sum()) / len(r)
        which = engagements(drive)[drive.w > 0]
        squares, fourths = np.bincount(which, T**2), np.bincount(which, T**4)
        loaded = squares > 0.02 * squares.mean()
        gains += list((np.bincount(which, T * r)[loaded] / squares[loaded]).tolist())
        own += list(((s0 * squares + s1 * fourths)[loaded] / squares[loaded] ** 2 / dt_s).tolist())
    count = len(gains)
    if count < ENGAGEMENTS:
        return 0.0, count, 1.0
    gamma, h = np.array(gains), np.maximum(np.array(own), 1e-300)
    mean = float((gamma / h).sum() / (1 / h).sum())
    chance = float(chi2.sf(float(((gamma - mean) ** 2 / h).sum()), count - 1))
    return max(float(gamma.var(ddof=1)) - float(h.mean()), 0.0) ** 0.5, count, chance
