"""Falling edges: T(t) = residual + amplitude (C e^(−t/τ1) + (1 − C) e^(−t/τ2)), one τ1 and τ2 for all, and of each.

With g = residual + amplitude the curve is g − amplitude (C (1 − e^(−t/τ1)) + …): the friction curve of Eq. (3) below an
offset. The cost is linear in amplitude and residual, which are solved for; SLSQP sees ln τ1 and ln τ2.
"""

from collections.abc import Sequence

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.fitting.data import Data, data_of
from eaid.fitting.levels import RECORDS, TAU1_LEAST_S, verdict
from eaid.fitting.result import LevelFit, ReleaseFit, ReleaseLevel, Solver
from eaid.fitting.solver import PROMISE, ROUNDING, Problem, polish, slsqp
from eaid.models.friction import tau_grid
from eaid.models.parameters import SHARE
from eaid.steps.stepset import Level


def release_fit(releases: Sequence[Level], rising: Sequence[LevelFit], share: float = SHARE) -> ReleaseFit:
    """Pooled release constants, and each level's own beside the rising ones."""
    data = data_of(releases)
    pooled, solver, linear = _solve(data, share)
    rises = {fit.level: fit.curve for fit in rising}
    rows, samples = [], 0
    for i, release in enumerate(releases):
        own, verdict_, parts = _solve(data.one(i), share)
        amplitude, residual = parts[0]
        sse = min(verdict_.starts)
        curve = rises.get(release.level)
        rows.append(
            ReleaseLevel(
                level=float(release.level),
                tau1=float(own[0]),
                tau2=float(own[1]),
                amplitude=float(amplitude),
                residual=float(residual),
                rmse=float(np.sqrt(sse / len(release.time_s))),
                sse=sse,
                solver=verdict_,
                rising_tau1=curve.tau1 if curve else None,
                rising_tau2=curve.tau2 if curve else None,
            )
        )
        samples += len(release.time_s)
    total = min(solver.starts)
    return ReleaseFit(
        share,
        float(pooled[0]),
        float(pooled[1]),
        float(np.sqrt(total / samples)),
        total,
        tuple(rows),
        solver,
        tuple(_warnings(releases, rows, pooled, linear)),
    )


def _warnings(releases: Sequence[Level], rows: Sequence[ReleaseLevel], pooled: Array, parts: Array) -> list[str]:
    warnings = []
    longest = max(float(level.time_s[-1]) for level in releases)
    if pooled[1] > longest:
        warnings.append(
            f"the slow release constant ({pooled[1]:.3g} s) is longer than the longest record after a release ({longest:.3g} s): "
            "these data cannot tell it"
        )
    left = [
        f"{row.level:g}"
        for row, (amplitude, residual) in zip(rows, parts, strict=True)
        if residual > 0.1 * abs(amplitude)
    ]
    if left:
        warnings.append(
            f"more than a tenth of the output is left long after the release of level {', '.join(left)}; the model's release "
            "goes to zero"
        )
    return warnings


def _solve(data: Data, share: float) -> tuple[Array, Solver, Array]:
    """(τ1, τ2), the verdict, and amplitude and residual of each level, shape (L, 2); costs are of the full data."""
    limit = RECORDS * data.longest_s
    compressed, every = data.points, _every_sample(data)
    A = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]])
    b = np.array([np.log(TAU1_LEAST_S), 0.0, -np.log(limit)])
    names = ("τ1 at 1 ms", "τ2 at τ1", f"τ2 at {RECORDS:g} record lengths")
    problem = Problem(
        lambda x: _projected(x, compressed, share)[:2],
        lambda x: _projected(x, compressed, share)[2],
        A,
        b,
        names,
        None,
        ROUNDING * data.energy,
    )
    grid = np.log(np.maximum(tau_grid(compressed.t_s[compressed.w > 0], 12), 1.01 * TAU1_LEAST_S))
    pairs = [(i, j) for i in range(12) for j in range(i, 12)]
    costs = [problem.value(np.array([grid[i], grid[j]]))[0] for i, j in pairs]
    order = np.argsort(costs)
    starts = [np.array([grid[pairs[k][0]], grid[pairs[k][1]]]) for k in (order[0], order[2])]
    ends = [slsqp(problem, start) for start in starts]
    best = min(ends, key=lambda end: end.cost)

    def full(x: Array) -> tuple[float, Array]:
        costs, gradients = zip(*[_projected(x, points, share)[:2] for points in every], strict=True)
        return float(sum(costs)), np.asarray(np.sum(gradients, axis=0))

    end, promise, active = polish(problem, best, full)
    converged = promise <= PROMISE
    parts = np.concatenate([_projected(end.x, points, share)[3] for points in every])
    solver = Solver(
        converged,
        verdict(converged, promise),
        sum(e.evaluations for e in ends) + end.evaluations - best.evaluations,
        tuple(e.cost + end.cost - best.cost for e in ends),
        tuple(names[i] for i in active),
        promise,
    )
    return np.exp(end.x), solver, parts


def _every_sample(data: Data) -> list[Points]:
    return [Points(r.t_s[None], r.y[None], np.ones((1, len(r.y)))) for r in data.records]


def _projected(x: Array, points: Points, share: float) -> tuple[float, Array, Array, Array]:
    """Cost with amplitude and residual solved for, its gradient by (ln τ1, ln τ2), curvature, and (amplitude, residual)."""
    tau1, tau2 = np.exp(x)
    t = points.t_s
    e1, e2 = np.exp(-t / tau1), np.exp(-t / tau2)
    fall = np.broadcast_to(share * e1 + (1 - share) * e2, points.y.shape)
    w = np.broadcast_to(points.w, points.y.shape)
    n, s1, s2 = w.sum(axis=1), (w * fall).sum(axis=1), (w * fall**2).sum(axis=1)
    sy, sf = (w * points.y).sum(axis=1), (w * fall * points.y).sum(axis=1)
    determinant = n * s2 - s1**2
    amplitude = (n * sf - s1 * sy) / np.where(determinant > 0, determinant, 1.0)
    residual = (sy - amplitude * s1) / n
    r = residual[:, None] + amplitude[:, None] * fall - points.y
    slopes = np.stack(
        [
            amplitude[:, None] * share * e1 * t / tau1,
            amplitude[:, None] * (1 - share) * e2 * t / tau2,
            fall,
            np.ones_like(fall),
        ]
    )
    gradient = 2 * np.einsum("lp,klp->k", w * r, slopes[:2])
    full = np.einsum("alp,lp,blp->lab", slopes, w, slopes)
    inner = full[:, 2:, 2:] + 1e-12 * np.eye(2) * np.trace(full[:, 2:, 2:], axis1=1, axis2=2)[:, None, None]
    reduced = full[:, :2, :2] - full[:, :2, 2:] @ np.linalg.solve(inner, full[:, 2:, :2])
    curvature = 2 * reduced.sum(axis=0)
    return float((w * r * r).sum()), gradient, curvature, np.stack([amplitude, residual], axis=1)


def decays_to(row: ReleaseLevel, share: float, record_time_s: Array) -> Array:
    """The fitted release of one level [N·m] at some times, shape of `record_time_s`."""
    e1, e2 = np.exp(-record_time_s / row.tau1), np.exp(-record_time_s / row.tau2)
    return row.residual + row.amplitude * (share * e1 + (1 - share) * e2)
