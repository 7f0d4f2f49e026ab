"""Falling edges: one τ1 and τ2 for all, and of each level.

T(t) = residual + amplitude (s e^(−t/τ1) + (1 − s) e^(−t/τ2)), amplitude ≥ 0, specification 4.1 let go. Their
share s is what they had reached when the input left: with the rising curve and the time H that it was held,
s = C (1 − e^(−H/τ1↑)) / (C (1 − e^(−H/τ1↑)) + (1 − C)(1 − e^(−H/τ2↑))); C itself where the rise is not known.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.estimate.data import Data, data_of, quality
from eaid.estimate.forms import RECORDS
from eaid.estimate.points import Points, decay
from eaid.estimate.solver import ROUNDING, Problem, minimised
from eaid.estimate.starts import LEVEL_GRID, Indices, bowls, table_of
from eaid.findings import Finding, finding
from eaid.models.parameters import SHARE, TAU_FLOOR_S, Friction
from eaid.results.common import Solver
from eaid.results.fit import Release, ReleaseLevel
from eaid.steps.stepset import Level

MOST = 3
"""Starts of every solve."""
NAMES = ("tau1-floor", "tau2-meets-tau1", "tau2-endless")


@dataclass(frozen=True, eq=False)
class ReleaseSolution:
    """Time constants of one or of all levels, the verdict on them, and what was solved for."""

    tau: Array
    """τ1 and τ2 [s], (2,)."""
    solver: Solver
    parts: Array
    """Amplitude, residual and sum of squares over every sample of each level, (L, 3)."""


def fit_each_release(data: Data, shares: Array) -> list[ReleaseSolution]:
    """Every level by itself."""
    level, x = _starts(data, shares)
    return [solve(data.one(i), shares[i : i + 1], x[level == i]) for i in range(len(shares))]


def _starts(data: Data, shares: Array) -> tuple[Indices, Array]:
    """Level and (ln τ1, ln τ2) of what single levels begin from: minima over a grid for −y above an offset, (N, 2)."""
    points, level, starts = data.points, [], []
    for i, share in enumerate(shares.tolist()):
        one = points.rows(slice(i, i + 1))
        table = table_of(replace(one, y=-one.y), share, LEVEL_GRID, offset=True)
        _, first, second = bowls(table.gain, MOST)
        level += [i] * len(first)
        starts.append(np.log(table.grid[[first, second]].T))
    return np.array(level, dtype=np.intp), np.concatenate(starts)


def solve(data: Data, shares: Array, starts: Array) -> ReleaseSolution:
    """One τ1 and τ2 for all levels of `data`, from the `MOST` best of `starts`, rows of (ln τ1, ln τ2).

    SLSQP ends the fit from the best of what they lead to.
    """
    A = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]])  # in ln τ: τ1 ≥ 1 ms, τ2 ≥ τ1, τ2 ≤ RECORDS records
    b, names = np.array([np.log(TAU_FLOOR_S), 0.0, -np.log(RECORDS * data.longest_s)]), NAMES
    points = data.points
    problem = Problem(
        lambda x: _projected(x, points, shares)[:3],
        A,
        b,
        names.__getitem__,
        lambda x: _projected(x, points, shares)[3],
        ROUNDING * data.energy,
    )
    starts = np.clip(starts, b[0], -b[2])
    order = np.argsort([problem.value(start)[0] for start in starts], kind="stable")[:MOST]
    end, solver, _ = minimised(problem, starts[order])
    return ReleaseSolution(np.exp(end.x), solver, _sizes(end.x, data, shares))


def _sizes(x: Array, data: Data, shares: Array) -> Array:
    """Amplitude, residual and sum of squares over every sample of each level, (L, 3)."""
    tau1, tau2 = np.exp(x)
    parts = []
    for share, record in zip(shares, data.records, strict=True):
        y, shape = record.y, share * decay(record, tau1) + (1 - share) * decay(record, tau2)
        sums = np.array([len(y), shape.sum(), shape @ shape, y.sum(), shape @ y])
        amplitude, residual = _solved_for(*sums[:, None])
        left = amplitude * shape + residual - y
        parts.append((amplitude[0], residual[0], left @ left))
    return np.array(parts)


def _solved_for(n: Array, s1: Array, s2: Array, sy: Array, sf: Array) -> tuple[Array, Array]:
    """Amplitude ≥ 0 and residual of least squares, from Σ 1, Σ φ, Σ φ², Σ y and Σ φ y of each level, (L,) each."""
    determinant = n * s2 - s1**2
    amplitude = (n * sf - s1 * sy) / np.where(determinant > 1e-12 * n * s2, determinant, np.inf)
    amplitude = np.maximum(amplitude, 0.0)
    return amplitude, (sy - amplitude * s1) / n


def _projected(x: Array, points: Points, shares: Array) -> tuple[float, Array, Array, Array]:
    """Cost over the points, its gradient (2,), Gauss–Newton curvature (2, 2) and second derivatives (2, 2)."""
    tau1, tau2 = np.exp(np.clip(x, -8.0, 25.0))  # SLSQP may look far outside before it comes back
    t, s, y = points.t_s, shares[:, None], points.y
    z1, z2 = t / tau1, t / tau2
    e1, e2 = s * np.exp(-z1), (1 - s) * np.exp(-z2)
    slopes = np.empty((len(y), 5, y.shape[1]))  # by ln τ1, ln τ2 for amplitude 1, by amplitude, by residual; the data
    slopes[:, 0], slopes[:, 1], slopes[:, 2], slopes[:, 3], slopes[:, 4] = z1 * e1, z2 * e2, e1 + e2, 1.0, y
    product = (slopes * points.w[:, None, :]) @ slopes.transpose(0, 2, 1)
    n, s1, s2, sy, sf = (product[:, i, j] for i, j in ((3, 3), (2, 3), (2, 2), (3, 4), (2, 4)))
    amplitude, residual = _solved_for(n, s1, s2, sy, sf)
    r = residual[:, None] + amplitude[:, None] * slopes[:, 2] - y
    wr = points.w * r
    left = residual[:, None] * product[:, :2, 3] + amplitude[:, None] * product[:, :2, 2] - product[:, :2, 4]
    by_taus = product[:, :2, :2] * amplitude[:, None, None] ** 2
    cross = product[:, :2, 2:4] * amplitude[:, None, None]
    inner = product[:, 2:4, 2:4] + (1e-12 * (n + s2)[:, None, None] + 1e-300) * np.eye(2)
    curvature = by_taus - cross @ np.linalg.solve(inner, cross.transpose(0, 2, 1))
    # ∂²f/∂(ln τ)² = A z (z − 1) e, and ∂²f/∂A ∂ln τ = z e, with z = t/τ
    for k, z in enumerate((z1, z2)):
        by_taus[:, k, k] += amplitude * (wr * slopes[:, k] * (z - 1)).sum(axis=1)
    cross[:, :, 0] += left
    exact = by_taus - cross @ np.linalg.solve(inner, cross.transpose(0, 2, 1))
    gradient = 2 * (amplitude[:, None] * left).sum(axis=0)
    return float((wr * r).sum()), gradient, 2 * curvature.sum(axis=0), 2 * exact.sum(axis=0)


def release_fit(
    releases: Sequence[Level],
    rises: Mapping[float, Friction],
    held_s: Mapping[float, float],
    share: float = SHARE,
) -> tuple[Release, list[Finding]]:
    """Pooled release constants, and each level's own beside the rising ones.

    `rises` are the rising curves by level, `held_s` is how long each level was held before its release [s].
    """
    data = data_of(releases)
    shares = np.array([share_reached(rises.get(r.level), held_s.get(r.level), share) for r in releases])
    alone = fit_each_release(data, shares)
    pooled = solve(data, shares, np.log([level_fit.tau for level_fit in alone]))
    rows = []
    for release, level_fit, fast, record in zip(releases, alone, shares.tolist(), data.records, strict=True):
        sse, curve = float(level_fit.parts[0, 2]), rises.get(release.level)
        fit_pct, R2 = quality(sse, [record.y])
        rows.append(
            ReleaseLevel(
                level=float(release.level),
                share=fast,
                tau1=float(level_fit.tau[0]),
                tau2=float(level_fit.tau[1]),
                amplitude=float(level_fit.parts[0, 0]),
                residual=float(level_fit.parts[0, 1]),
                rmse=float(np.sqrt(sse / len(release.time_s))),
                sse=sse,
                fit_pct=fit_pct,
                R2=R2,
                solver=level_fit.solver,
                rising_tau1=curve.tau1 if curve else None,
                rising_tau2=curve.tau2 if curve else None,
            )
        )
    total = float(pooled.parts[:, 2].sum())
    rmse = float(np.sqrt(total / data.samples))
    tau1, tau2 = pooled.tau.tolist()
    found = Release(tau1, tau2, share, rmse, total, levels=tuple(rows), solver=pooled.solver)
    return found, _findings(data, rows, pooled)


def share_reached(rise: Friction | None, held_s: float | None, share: float) -> float:
    """The fast state's part of the torque when a level is let go after `held_s` seconds."""
    if rise is None or held_s is None or rise.Ts <= 0:
        return share
    fast = -rise.C * np.expm1(-held_s / rise.tau1)
    slow = -(1 - rise.C) * np.expm1(-held_s / rise.tau2)
    return float(fast / (fast + slow))


def _findings(data: Data, rows: Sequence[ReleaseLevel], pooled: ReleaseSolution) -> list[Finding]:
    found = []
    if not pooled.solver.converged:
        found.append(finding("fit-not-converged", "release", predicted_decrease=pooled.solver.predicted_decrease))
    if pooled.tau[1] > data.longest_s:
        tau2_s = float(pooled.tau[1])
        found.append(finding("release-beyond-record", "release", tau2_s=tau2_s, record_s=data.longest_s))
    if "tau1-floor" in pooled.solver.at_bounds:
        found.append(finding("release-too-fast", "release"))
    if "tau2-meets-tau1" in pooled.solver.at_bounds:
        found.append(finding("release-one-exponential", "release"))
    left = [row.level for row, (size, rest) in zip(rows, pooled.parts[:, :2], strict=True) if rest > 0.1 * abs(size)]
    if left:
        found.append(finding("release-leaves-output", "release", left))
    return found
