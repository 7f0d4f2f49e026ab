"""Falling edges: one τ1 and τ2 for all, and of each level.

T(t) = residual + amplitude (s e^(−t/τ1) + (1 − s) e^(−t/τ2)), amplitude ≥ 0, the two states of SPEC §4.1 let go. Their
share s is what they had reached when the input left: with the rising curve and the time H that it was held,
s = C (1 − e^(−H/τ1↑)) / (C (1 − e^(−H/τ1↑)) + (1 − C)(1 − e^(−H/τ2↑))); C itself where the rise is not known.
The cost is linear in amplitude and residual, which are solved for; SLSQP sees ln τ1 and ln τ2.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from eaid.arrays import Array, distinct
from eaid.fitting.compress import Points
from eaid.fitting.data import Data, data_of
from eaid.fitting.kernel import decay
from eaid.fitting.levels import GRID, RECORDS, TAU1_LEAST_S, grid_bowls, verdict
from eaid.fitting.result import LevelFit, ReleaseFit, ReleaseLevel, Solver
from eaid.fitting.solver import PROMISE, ROUNDING, Problem, approach, ended, polish
from eaid.models.friction import grid_fits, tau_grid
from eaid.models.parameters import SHARE, Friction
from eaid.steps.stepset import Level

MOST = 3
"""Starts of every solve."""


def release_fit(
    releases: Sequence[Level],
    rising: Sequence[LevelFit],
    held_s: Mapping[float, float],
    share: float = SHARE,
) -> ReleaseFit:
    """Pooled release constants, and each level's own beside the rising ones.

    `held_s` is how long each level was held before its release [s].
    """
    data = data_of(releases)
    rises = {fit.level: fit.curve for fit in rising}
    shares = np.array([share_reached(rises.get(r.level), held_s.get(r.level), share) for r in releases])
    singles = [data.one(i) for i in range(len(shares))]
    alone = [_solve(one, shares[i : i + 1], _starts(one, shares[i])) for i, one in enumerate(singles)]
    pooled, solver, parts = _solve(data, shares, np.log([own[0] for own in alone]))
    rows = []
    for i, release in enumerate(releases):
        own, own_solver, ((amplitude, residual),) = alone[i]
        sse = min(own_solver.starts)
        curve = rises.get(release.level)
        rows.append(
            ReleaseLevel(
                level=float(release.level),
                share=float(shares[i]),
                tau1=float(own[0]),
                tau2=float(own[1]),
                amplitude=float(amplitude),
                residual=float(residual),
                rmse=float(np.sqrt(sse / len(release.time_s))),
                sse=sse,
                solver=own_solver,
                rising_tau1=curve.tau1 if curve else None,
                rising_tau2=curve.tau2 if curve else None,
            )
        )
    total = min(solver.starts)
    return ReleaseFit(
        share,
        float(pooled[0]),
        float(pooled[1]),
        float(np.sqrt(total / data.samples)),
        total,
        tuple(rows),
        solver,
        tuple(_warnings(data, rows, pooled, parts, solver)),
    )


def share_reached(rise: Friction | None, held_s: float | None, share: float) -> float:
    """The fast state's part of the torque when a level is let go after `held_s` seconds."""
    if rise is None or held_s is None or rise.Ts <= 0:
        return share
    fast = -rise.C * np.expm1(-held_s / rise.tau1)
    slow = -(1 - rise.C) * np.expm1(-held_s / rise.tau2)
    return float(fast / (fast + slow))


def _warnings(data: Data, rows: Sequence[ReleaseLevel], pooled: Array, parts: Array, solver: Solver) -> list[str]:
    warnings = []
    if pooled[1] > data.longest_s:
        warnings.append(
            f"the slow release constant ({pooled[1]:.3g} s) is longer than the longest record after a release "
            f"({data.longest_s:.3g} s): these data cannot tell it"
        )
    if "τ1 at 1 ms" in solver.at_bounds:
        warnings.append(
            "the release is faster than 1 ms or than the samples can tell: its fast constant is at its floor"
        )
    if "τ2 at τ1" in solver.at_bounds:
        warnings.append("one exponential is enough for the releases: τ1 and τ2 coincide")
    left = [
        f"{row.level:g}"
        for row, (amplitude, residual) in zip(rows, parts, strict=True)
        if residual > 0.1 * abs(amplitude)
    ]
    if left:
        warnings.append(
            f"more than a tenth of the output is left long after the release of level {', '.join(left)}; "
            "the model's release goes to zero"
        )
    return warnings


def _starts(data: Data, share: float) -> Array:
    """(ln τ1, ln τ2) to begin from for one level, shape (n, 2): minima over a grid for −y above an offset."""
    points = data.points
    grid = distinct(np.maximum(tau_grid(points.t_s[points.w > 0], GRID), 1.01 * TAU1_LEAST_S))
    inner, square = grid_fits(points.t_s, -points.y, points.w, grid, share, offset=True)
    _, first, second = grid_bowls(inner, square, MOST)
    return np.asarray(np.log(np.stack([grid[first], grid[second]], axis=1)))


def _solve(data: Data, shares: Array, starts: Array) -> tuple[Array, Solver, Array]:
    """(τ1, τ2), the verdict, and amplitude and residual of each level, shape (L, 2); costs are of the full data.

    SLSQP ends the fit from the best of what the `MOST` best of `starts`, rows of (ln τ1, ln τ2), lead to.
    """
    limit = RECORDS * data.longest_s
    A = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]])
    b = np.array([np.log(TAU1_LEAST_S), 0.0, -np.log(limit)])
    names = ("τ1 at 1 ms", "τ2 at τ1", "τ2 endless")
    found = _once(lambda x: _projected(x, data.points, shares))
    problem = Problem(
        lambda x: found(x)[:2], lambda x: found(x)[2], A, b, names.__getitem__, None, floor=ROUNDING * data.energy
    )
    starts = np.clip(starts, b[0], -b[2])
    order = np.argsort([problem.value(start)[0] for start in starts], kind="stable")[:MOST]
    ends = ended([approach(problem, starts[k]) for k in order], problem)
    best = min(ends, key=lambda end: end.cost)
    on_all = _once(lambda x: _on_every_sample(x, data, shares))
    end, promise, active = polish(problem, best, lambda x: on_all(x)[:2])
    converged = promise <= PROMISE
    solver = Solver(
        converged,
        verdict(converged, promise),
        sum(e.evaluations for e in ends) + end.evaluations - best.evaluations,
        tuple(e.cost + end.cost - best.cost for e in ends),
        tuple(names[i] for i in active),
        promise,
    )
    return np.exp(end.x), solver, on_all(end.x)[2]


Sums = TypeVar("Sums")


def _once(call: Callable[[Array], Sums]) -> Callable[[Array], Sums]:
    """`call`, with its last answer kept: cost and curvature of one place are asked for one after the other."""
    last: list[tuple[bytes, Sums]] = []

    def kept(x: Array) -> Sums:
        if not last or last[0][0] != x.tobytes():
            last[:] = [(x.tobytes(), call(x))]
        return last[0][1]

    return kept


def _on_every_sample(x: Array, data: Data, shares: Array) -> tuple[float, Array, Array]:
    """Cost, gradient by (ln τ1, ln τ2), and amplitude and residual of each level."""
    each = []
    for share, record in zip(shares, data.records, strict=True):
        points = Points(record.t_s[None], record.y[None], np.ones((1, 1)))
        each.append(_projected(x, points, share[None], tuple(decay(record, tau)[None] for tau in np.exp(x))))
    cost, gradient, _, parts = zip(*each, strict=True)
    return float(sum(cost)), np.asarray(np.sum(gradient, axis=0)), np.concatenate(parts)


def _projected(
    x: Array, points: Points, shares: Array, decays: tuple[Array, ...] | None = None
) -> tuple[float, Array, Array, Array]:
    """Cost with amplitude and residual solved for, gradient by (ln τ1, ln τ2), curvature, and the two solved.

    `decays` are e^(−t/τ1) and e^(−t/τ2) at the points, where they are known.
    """
    tau1, tau2 = np.exp(np.clip(x, -8.0, 25.0))  # SLSQP may look far outside before it comes back
    t, s, y = points.t_s, shares[:, None], points.y
    e1, e2 = decays or (np.exp(-t / tau1), np.exp(-t / tau2))
    slopes = np.empty((len(y), 5, y.shape[1]))  # by ln τ1, ln τ2 for amplitude 1, by amplitude, by residual; the data
    slopes[:, 0], slopes[:, 1] = s * e1 * (t / tau1), (1 - s) * e2 * (t / tau2)
    slopes[:, 2] = s * e1 + (1 - s) * e2
    slopes[:, 3] = 1.0
    slopes[:, 4] = y
    product = (slopes * points.w[:, None, :]) @ slopes.transpose(0, 2, 1)
    n, s1, s2, sy, sf = (product[:, i, j] for i, j in ((3, 3), (2, 3), (2, 2), (3, 4), (2, 4)))
    determinant = n * s2 - s1**2
    amplitude = (n * sf - s1 * sy) / np.where(determinant > 1e-12 * n * s2, determinant, np.inf)
    amplitude = np.maximum(amplitude, 0.0)
    residual = (sy - amplitude * s1) / n
    r = residual[:, None] + amplitude[:, None] * slopes[:, 2] - y
    left = residual[:, None] * product[:, :2, 3] + amplitude[:, None] * product[:, :2, 2] - product[:, :2, 4]
    own, cross = product[:, :2, :2] * amplitude[:, None, None] ** 2, product[:, :2, 2:4] * amplitude[:, None, None]
    inner = product[:, 2:4, 2:4] + (1e-12 * (n + s2)[:, None, None] + 1e-300) * np.eye(2)
    reduced = own - cross @ np.linalg.solve(inner, cross.transpose(0, 2, 1))
    return (
        float((points.w * r * r).sum()),
        2 * amplitude @ left,
        2 * reduced.sum(axis=0),
        np.stack([amplitude, residual], axis=1),
    )


def release_curve(row: ReleaseLevel, time_s: Array) -> Array:
    """The fitted release of one level [N·m] at times since the release, shape of `time_s`."""
    e1, e2 = np.exp(-time_s / row.tau1), np.exp(-time_s / row.tau2)
    return np.asarray(row.residual + row.amplitude * (row.share * e1 + (1 - row.share) * e2))
