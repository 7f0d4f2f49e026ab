"""Falling edges: one τ1 and τ2 for all, and of each level.

T(t) = residual + amplitude (s e^(−t/τ1) + (1 − s) e^(−t/τ2)), amplitude ≥ 0, specification 4.1 let go. Their
share s is what they had reached when the input left: with the rising curve and the time H that it was held,
s = C (1 − e^(−H/τ1↑)) / (C (1 − e^(−H/τ1↑)) + (1 − C)(1 − e^(−H/τ2↑))); C itself where the rise is not known.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array
from eaid.estimate.data import Data, data_of, quality
from eaid.estimate.forms import nonlinear
from eaid.estimate.from_steps import Solution, StepProblem
from eaid.estimate.points import decay
from eaid.estimate.solver import bring_in, minimised
from eaid.estimate.starts import form_starts
from eaid.findings import Finding, finding
from eaid.models.parameters import SHARE, Friction
from eaid.results.fit import Release, ReleaseLevel
from eaid.steps.stepset import Level

MOST = 3  # Starts of every solve


def solve(data: Data, shares: Array, starts: Iterable[Array] | None = None) -> Solution:
    """One τ1 and τ2 for all levels of `data`, from the `MOST` best of `starts`, (2,) each, else of a search."""
    model = nonlinear(data.u[:1], float(shares[0])).without_torque
    starts = form_starts(model, data, np.ones(len(shares))) if starts is None else starts
    steps = StepProblem(data, model, np.ones(len(shares)), shares=shares)
    begin = sorted((bring_in(x, steps.inner, steps.problem) for x in starts), key=lambda x: steps.normal(x)[0])
    end, solver, active = minimised(steps.problem, begin[:MOST])
    return Solution(steps, end.x, solver, active)


def sizes(solved: Solution, data: Data) -> Array:
    """Amplitude, residual and sum of squares over every sample of each level, (L, 3)."""
    tau1, tau2 = solved.x
    parts = []
    for share, record in zip(solved.at.theta[3], data.records, strict=True):
        shape = share * decay(record, tau1) + (1 - share) * decay(record, tau2)
        off = shape - shape.mean()
        amplitude = max(float(off @ record.y) / max(float(off @ off), 1e-300), 0.0)
        residual = float(record.y.mean()) - amplitude * float(shape.mean())
        left = amplitude * shape + residual - record.y
        parts.append((amplitude, residual, left @ left))
    return np.array(parts)


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
    falling = replace(data)
    falling.__dict__["points"] = data.points.of_falls
    alone = [solve(falling.one(i), shares[i : i + 1]) for i in range(len(shares))]
    pooled = solve(falling, shares, [one.x for one in alone])
    rows = []
    for i, (release, one, fast) in enumerate(zip(releases, alone, shares.tolist(), strict=True)):
        (amplitude, residual, sse), y = sizes(one, data.one(i))[0].tolist(), data.records[i].y
        fit_pct, R2 = quality(sse, [y])
        rows.append(
            ReleaseLevel(
                level=float(release.level),
                share=fast,
                tau1=float(one.x[0]),
                tau2=float(one.x[1]),
                amplitude=amplitude,
                residual=residual,
                rmse=float(np.sqrt(sse / len(release.time_s))),
                sse=sse,
                fit_pct=fit_pct,
                R2=R2,
                solver=one.solver,
            )
        )
    parts = sizes(pooled, data)
    total = float(parts[:, 2].sum())
    rmse = float(np.sqrt(total / data.samples))
    tau1, tau2 = pooled.x.tolist()
    part = Release(tau1, tau2, share, rmse, total, levels=tuple(rows), solver=pooled.solver)
    return part, _findings(data, rows, pooled, parts)


def share_reached(rise: Friction | None, held_s: float | None, share: float) -> float:
    """The fast state's part of the torque when a level is let go after `held_s` seconds."""
    if rise is None or held_s is None or rise.Ts <= 0:
        return share
    fast = -rise.C * np.expm1(-held_s / rise.tau1)
    slow = -(1 - rise.C) * np.expm1(-held_s / rise.tau2)
    return float(fast / (fast + slow))


def _findings(data: Data, rows: Sequence[ReleaseLevel], pooled: Solution, parts: Array) -> list[Finding]:
    findings = []
    if not pooled.solver.converged:
        findings.append(finding("fit-not-converged", "release", predicted_decrease=pooled.solver.predicted_decrease))
    if pooled.x[1] > data.longest_s:
        tau2_s = float(pooled.x[1])
        findings.append(finding("release-beyond-record", "release", tau2_s=tau2_s, record_s=data.longest_s))
    if "tau1-floor" in pooled.solver.at_bounds:
        findings.append(finding("release-too-fast", "release"))
    left = [row.level for row, (size, rest) in zip(rows, parts[:, :2], strict=True) if rest > 0.1 * abs(size)]
    if left:
        findings.append(finding("release-leaves-output", "release", left))
    return findings
