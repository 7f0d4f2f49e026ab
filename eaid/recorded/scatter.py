"""The noise behind a recorded fit: densities S = s0 + s1 T², and a gain that differs from engagement to engagement.

γ_e = −Σ T r/Σ T² of each engagement, r the residual; noise alone gives it the variance ∫ S T² dt/(∫ T² dt)². What the
gains explain is taken out of the residuals before densities, spectra and stretches are looked at.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.recorded.residual_noise import engagements
from eaid.recorded.solve import Solved, idle_of

WINDOW_S = 2.0
"""Stretch over which the density of the noise is taken [s]."""
FEWEST = 4
"""Fewest engagements whose scatter counts."""
CHANCE = 1e-3
"""Gains that noise makes so different more rarely than this are told."""
LEAST_LOAD = 0.02
"""An engagement with less than this part of the mean ∫ T² tells no gain."""


@dataclass(frozen=True, eq=False)
class Scatter:
    """Noise and scatter of a fit's residuals."""

    sensor_nm2_s: float
    ripple_s: float
    gain: float
    """Standard deviation of the gain between engagements beyond what noise makes of it."""
    count: int
    chance: float
    """That noise alone makes gains so different."""
    residuals: tuple[Array, ...]
    """Model less recorded, without what the gains explain, of each log."""


def scatter_of(solved: Solved) -> Scatter:
    """Gains of all engagements, and the noise about them."""
    gains, squares, fourths, cleaned, outputs, steps = [], [], [], [], [], []
    for k, drive in enumerate(solved.setup.drives):
        r = solved.missed[k]
        T = solved.outputs[k] - idle_of(solved, k) + r
        which = engagements(drive)[drive.w > 0]
        square = np.bincount(which, T**2)
        loaded = square > LEAST_LOAD * square.mean()
        gain = np.where(loaded, np.bincount(which, T * r) / np.maximum(square, 1e-300), 0.0)
        steps.append(float(drive.dt_s.sum()) / len(r))
        gains.append(gain[loaded])
        squares.append(square[loaded] * steps[-1])
        fourths.append(np.bincount(which, T**4)[loaded] * steps[-1])
        cleaned.append(r - gain[which] * T)
        outputs.append(T)
    gamma, T2, T4 = np.concatenate(gains), np.concatenate(squares), np.concatenate(fourths)
    if len(gamma) < FEWEST:
        return Scatter(*densities(solved.missed, outputs, steps), 0.0, len(gamma), 1.0, solved.missed)
    s0, s1 = densities(cleaned, outputs, steps)
    own = np.maximum((s0 * T2 + s1 * T4) / T2**2, 1e-300)
    mean = float((gamma / own).sum() / (1 / own).sum())
    chance = float(chi2.sf(float(((gamma - mean) ** 2 / own).sum()), len(gamma) - 1))
    gain = max(float(gamma.var(ddof=1)) - float(own.mean()), 0.0) ** 0.5
    return Scatter(s0, s1, gain, len(gamma), chance, tuple(cleaned))


def scatter_findings(seen: Scatter) -> list[Finding]:
    """Whether the output differs between engagements, where there are enough to see it."""
    if seen.count < FEWEST:
        return [finding("engagements-few", "data", count=seen.count)]
    if seen.chance < CHANCE and seen.gain > 0:
        return [finding("engagements-scatter", "data", scatter_pct=100 * seen.gain, count=seen.count)]
    return []


def densities(residuals: Sequence[Array], outputs: list[Array], steps: list[float]) -> tuple[float, float]:
    """s0 and s1 of S = s0 + s1 T², from squared sums of the residuals over short stretches."""
    squares, found = [], []
    for r, T, dt_s in zip(residuals, outputs, steps, strict=True):
        width = max(1, round(WINDOW_S / dt_s))
        count = len(r) // width
        squares.append(np.mean(T[: count * width].reshape(count, width) ** 2, axis=1))
        found.append(r[: count * width].reshape(count, width).sum(axis=1) ** 2 * dt_s / width)
    x, S = np.concatenate(squares), np.concatenate(found)
    design = np.column_stack([np.ones_like(x), x])
    weight = 1 / np.maximum(S.mean() * (0.1 + x / max(x.mean(), 1e-300)), 1e-300)
    s0, s1 = np.linalg.lstsq(design * weight[:, None], S * weight, rcond=None)[0].tolist()
    if s1 < 0:
        return float(S.mean()), 0.0
    if s0 < 0:
        return 0.0, float((S * weight).sum() / max((x * weight).sum(), 1e-300))
    return s0, s1
