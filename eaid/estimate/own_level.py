"""T_s of each level, its own about the curve through all: nearer to the curve, the less its runs tell of it.

    T_l / T(u_l) = 1 + d_l + e_l,    Var d_l = σ_d²,    Var e_l = W

W is what the gains of the runs, as they scatter, and the time constants leave open; σ_d is found by REML, and 1 + d_l
with it (`estimate/mixed.py`).
"""

import itertools
from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.estimate.mixed import MixedLine, MixedValues, fit_restricted
from eaid.estimate.scatter import RunStatistics, bartlett_variance, pool_scatter
from eaid.estimate.spread import LevelScatter, satterthwaite, t_quantile
from eaid.findings import Finding, Value, finding
from eaid.steps.stepset import Level

LAG_OFF = 0.08  # Of ln τ, from which a lag is told to lie off its curve: that of one run scatters by 5 %
NO_SCATTER = 1e-4  # Part of T_s below which nothing scatters
# Twice the logarithm of how much likelier levels with a scatter of their own are, from which it is told: one in 200
SCATTER_SEEN = 6.6
# Squares over those of T_s(u) through levels of one output, up to which a limit of the drive explains them
AS_LIMITED = 1.02
FAR = np.log(10.0)  # Logarithm from which a level is far off its curve, as where that is next to 0
# Levels that tell an exchange of two, by which part T_s falls at one, and what a cubic then leaves of its squares
FEWEST_EXCHANGED, FALLEN, EXCHANGED_LEAVES = 5, 0.1, 0.1
# Levels of one output: the part of it, and standard errors of the difference, by which they differ at most; how many,
# over which inputs, and how far the curve is off a level
LEAST_ALIKE, ALIKE_TO, SURELY, FEWEST_FLAT, FLAT_OVER, OFF_CURVE = 0.01, 0.04, 3.5, 2, 1.2, 0.04


def gains_of_runs(levels: Sequence[Level], curves: Sequence[Array]) -> LevelScatter:
    """How ln T_s of the runs of levels scatters where their time constants are known; `curves` (n,) are their own."""
    found = []
    for level, f in zip(levels, curves, strict=True):
        square, off = float(f @ f) or 1.0, gain_shifts(level, f)
        left = level.runs - np.outer(1 + off, f)
        noise = bartlett_variance(level.time_s, (left * f).T / square).max(axis=0)
        found.append(RunStatistics(off[:, None], np.array([noise.mean()])))
    return pool_scatter(found)


def gain_shifts(level: Level, f: Array) -> Array:
    """How far ln T_s of each run of a level lies off their mean, the time constants being those of its curve, (R,)."""
    return np.asarray((level.runs - level.mean) @ f / (float(f @ f) or 1.0))


def levels_about(Ts: Array, size: Array, D: Array, of_logs: Array) -> MixedLine:
    """T_s of L levels by themselves over the curve's `size`, whose rows are D (L, p); `of_logs` is the covariance of
    their logarithms, (L, L)."""
    W = (of_logs + NO_SCATTER**2 * np.eye(len(Ts))) * np.outer(Ts / size, Ts / size)
    return fit_restricted(MixedValues(Ts / size, D / size[:, None], W, (np.eye(len(Ts)),)))


def pull_to_line(
    line: MixedLine, size: Array, known: float, gains: LevelScatter | None = None
) -> tuple[Array, Array, Array]:
    """ln T_s of the levels, half-width of its interval, degrees of freedom, (L,), W being `known` by so many; `gains`
    of runs tell what sweeps have in common. The interval is no wider than that of the level's own logs: how levels
    scatter may be told by less than one degree of freedom."""
    each = np.eye(len(size))
    ahead = line.further(line.values.X, each[None], each[None])
    mean, degrees = np.maximum(ahead.mean, NO_SCATTER), ahead.degrees(each, known)
    variance = np.diagonal(ahead.covariance) / mean**2
    alone = np.diagonal(line.values.W) / np.maximum(line.values.y, NO_SCATTER) ** 2
    wide = t_quantile(degrees) * np.sqrt(variance) > t_quantile(known) * np.sqrt(alone)
    variance, degrees = np.where(wide, alone, variance), np.where(wide, known, degrees)
    if gains is not None and (shared := float(gains.common[0])) > 0:  # what sweeps shift alike
        parts, sweeps = (variance, np.full(len(size), shared)), float(gains.degrees.max())
        variance, degrees = variance + shared, satterthwaite(parts, (degrees, sweeps))
    return np.log(mean * size), t_quantile(degrees) * np.sqrt(variance), degrees


def levels_scatter(
    line: MixedLine, u: Array, own: Array, curve: Array, by_curve: bool = False, parameter: str = "Ts"
) -> list[Finding]:
    """Where levels lie off their curve by more than their logs leave open, and whether that is `by_curve` and not by
    the days of their records; `own` and `curve` are ln T_s, or ln of another `parameter`, (L,)."""
    if line.gained < SCATTER_SEEN:
        return []
    off = own - curve
    i = int(np.abs(off).argmax())
    far = off[i] > FAR
    sizes = {"scatter_pct": 100 * float(np.sqrt(line.v[0])), "off_pct": None if far else 100 * float(np.expm1(off[i]))}
    said: dict[str, Value] = {"worst": float(u[i]), "by_curve": by_curve, "parameter": parameter}
    return [finding("levels-scatter", "nonlinear", (), **said, **sizes)]


def find_exchanged(u: Array, Ts: Array) -> list[Finding]:
    """Two levels whose names look exchanged: T_s of the levels, (L,), then rises with the input where it did not, and a
    cubic leaves a small part of what it left."""
    order = np.argsort(u)
    Ts = Ts[order]
    if len(u) < FEWEST_EXCHANGED or (Ts <= 0).any() or (np.diff(Ts) > -FALLEN * Ts[:-1]).all():
        return []
    rows = np.vander(u[order] / u.max(), 4) / Ts.max()

    def misfit(values: Array) -> float:
        return float(np.sum((rows @ np.linalg.lstsq(rows, values, rcond=None)[0] - values) ** 2))

    tried = []
    for i, j in itertools.combinations(range(len(u)), 2):
        other = Ts.copy()
        other[[i, j]] = Ts[[j, i]]
        if (np.diff(other) > 0).all():
            tried.append((misfit(other), i, j))
    if not tried or min(tried)[0] > EXCHANGED_LEAVES * misfit(Ts):
        return []
    pair = [u[order][k].item() for k in min(tried)[1:]]
    return [finding("levels-exchanged", "nonlinear", pair, low=pair[0], high=pair[1])]


def find_levelled_off(
    u: Array, own: Array, curve: Array, error: float | None, keeps: str = "levels", how: str = ""
) -> list[Finding]:
    """Where the highest levels have one output, and the curve another: the drive clips, or the clutch saturates; `own`
    and `curve` are ln T_s, (L,), the one known to a standard `error` where that is known; the option `keeps` levels,
    and `how` T_s(u) follows them."""
    order, to = np.argsort(u), ALIKE_TO if error is None else min(ALIKE_TO, max(LEAST_ALIKE, SURELY * error))
    flat = order[np.flatnonzero(np.abs(own[order] - own[order[-1]]) > to).max(initial=-1) + 1 :]
    many = FEWEST_FLAT <= len(flat) < len(u) and u[flat[-1]] >= FLAT_OVER * u[flat[0]]
    if not many or np.abs(own - curve).max() < OFF_CURVE:
        return []
    within_pct, levels = 100 * float(np.expm1(np.ptp(own[flat]))), u[flat].tolist()
    values: dict[str, Value] = {"least": float(u.min()), "knee": levels[0], "keeps": keeps, "how": how}
    values["within_pct"] = within_pct
    return [finding("output-levels-off", "nonlinear", levels, **values)]
