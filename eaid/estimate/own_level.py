"""T_s of each level, its own about the curve through all: nearer to the curve, the less its runs tell of it.

    T_l / T(u_l) = 1 + d_l + e_l,    Var d_l = σ_d²,    Var e_l = W

W is what the gains of the runs, as they scatter, and the time constants leave open; σ_d is found by REML, and 1 + d_l
with it (`estimate/mixed.py`).
"""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.estimate.mixed import MixedLine, MixedValues, restricted
from eaid.estimate.scatter import RunStatistics, bartlett_variance, pooled_scatter
from eaid.estimate.spread import LevelScatter, satterthwaite, t_quantile
from eaid.findings import Finding, finding
from eaid.steps.stepset import Level

SURE = 1e-4  # Part of T_s below which nothing scatters
# Twice the logarithm of how much likelier levels with a scatter of their own are, from which it is told: one in 200
SCATTER_SEEN = 6.6


def gains_of_runs(levels: Sequence[Level], curves: Sequence[Array]) -> LevelScatter:
    """How ln T_s of the runs of levels scatters where their time constants are known; `curves` (n,) are their own."""
    found = []
    for level, f in zip(levels, curves, strict=True):
        square = float(f @ f) or 1.0
        off = (level.runs - level.mean) @ f / square
        left = level.runs - np.outer(1 + off, f)
        noise = bartlett_variance(level.time_s, (left * f).T / square).max(axis=0)
        found.append(RunStatistics(off[:, None], np.array([noise.mean()])))
    return pooled_scatter(found)


def levels_about(Ts: Array, size: Array, D: Array, gains: LevelScatter, of_lags: Array) -> MixedLine:
    """T_s of L levels by themselves over the curve's `size`, whose rows are D (L, p); `of_lags` is the covariance of
    ln T_s by what is not known of the time constants, (L, L)."""
    W = np.diag(gains.expected[:, 0]) + of_lags + SURE**2 * np.eye(len(Ts))
    W = W * np.outer(Ts / size, Ts / size)
    return restricted(MixedValues(Ts / size, D / size[:, None], W, (np.eye(len(Ts)),)))


def own_of_levels(line: MixedLine, size: Array, gains: LevelScatter, known: float) -> tuple[Array, Array, Array]:
    """ln T_s of the levels, half-width of its interval, degrees of freedom, (L,), W being `known` by so many."""
    each = np.eye(len(size))
    ahead = line.further(line.values.X, each[None], each[None])
    mean, degrees = np.maximum(ahead.mean, SURE), ahead.degrees(each, known)
    variance = np.diagonal(ahead.covariance) / mean**2
    if (shared := float(gains.common[0])) > 0:  # what sweeps shift alike
        parts, sweeps = (variance, np.full(len(size), shared)), float(gains.degrees.max())
        variance, degrees = variance + shared, satterthwaite(parts, (degrees, sweeps))
    return np.log(mean * size), t_quantile(degrees) * np.sqrt(variance), degrees


def levels_scatter(line: MixedLine, u: Array, own: Array, curve: Array, levels_off: bool = False) -> list[Finding]:
    """Where levels lie off their curve by more than their runs scatter; `own` and `curve` are ln T_s, (L,)."""
    if line.gained < SCATTER_SEEN:
        return []
    off = own - curve
    i = int(np.abs(off).argmax())
    sizes = {"scatter_pct": 100 * float(np.sqrt(line.v[0])), "off_pct": 100 * float(np.expm1(off[i]))}
    return [finding("levels-scatter", "nonlinear", (), worst=float(u[i]), levels_off=levels_off, **sizes)]
