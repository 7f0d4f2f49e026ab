"""Falling edges of steps: one τ1 and τ2 for all levels.

T(t) = residual + amplitude (s e^(−t/τ1) + (1 − s) e^(−t/τ2)), amplitude ≥ 0, specification 4.1 let go. Their
share s is what they had reached when the input left: with the rising curve and the time H that it was held,
s = C (1 − e^(−H/τ1↑)) / (C (1 − e^(−H/τ1↑)) + (1 − C)(1 − e^(−H/τ2↑))); C itself where the rise is not known.
"""

from collections.abc import Sequence
from dataclasses import replace

import msgspec
import numpy as np

from eaid.arrays import Array, best_gain
from eaid.estimate.data import Data, data_of
from eaid.estimate.forms import nonlinear
from eaid.estimate.solver import bring_in
from eaid.estimate.starts import form_starts
from eaid.findings import Finding, finding
from eaid.levels.from_steps import Solution, StepProblem, minimise
from eaid.plant.dynamics import Plant, Step
from eaid.plant.steps import rise, step_response
from eaid.results.models import Release
from eaid.steps.stepset import Level, StepSet

FALL_STARTS = 3  # Starts of the solve
LEFT_SAVES = 0.01  # Part of the squares that falls with the time constants of the input left have to save


def fit_falls(data: Data, shares: Array) -> Solution:
    """One τ1 and τ2 for all levels of `data`, from the `FALL_STARTS` best starts of a search."""
    model, alike = replace(nonlinear(data.u[:1], float(shares[0])), Ts=None), np.ones(len(shares))
    steps = StepProblem(data, model, alike, shares=shares)
    starts = [bring_in(x, steps.inner, steps.problem) for x in form_starts(model, data, alike)]
    return minimise(steps, sorted(starts, key=lambda x: steps.normal(x)[0])[:FALL_STARTS], records=1.0)


def sizes(falls: Sequence[Step], data: Data) -> Array:
    """Amplitude, residual and sum of squares over every sample of each level, (L, 3)."""
    parts = []
    for fall, record in zip(falls, data.records, strict=True):
        shape = 1 - step_response(fall, record.t_s)
        off = shape - shape.mean()
        amplitude = max(best_gain(off, record.y), 0.0)
        residual = float(record.y.mean()) - amplitude * float(shape.mean())
        left = amplitude * shape + residual - record.y
        parts.append((amplitude, residual, left @ left))
    return np.array(parts)


def release_fit(
    releases: Sequence[Level], levels: Sequence[Level], curves: Sequence[Step], share: float
) -> tuple[Release, list[Finding]]:
    """The release constants; `curves` are those on which the levels have risen."""
    data, shares = data_of(releases), np.full(len(releases), share)
    rises = {level.level: (curve, level.time_s[-1]) for level, curve in zip(levels, curves, strict=True)}
    known = [rises.get(u) for u in data.u.tolist()]
    for i, rose in enumerate(known):
        if rose is not None and rose[0].Ts > 0:
            curve, held_s = rose
            fast, slow = rise(held_s, np.array([curve.tau1, curve.tau2])) * [curve.C, 1 - curve.C]
            shares[i] = fast / (fast + slow)
    pooled = fit_falls(replace(data, compressed=data.points.of_falls), shares)
    tau1, tau2 = pooled.x.tolist()
    parts = sizes([Step(1.0, tau1, tau2, one) for one in shares.tolist()], data)
    total = float(parts[:, 2].sum())
    rmse = float(np.sqrt(total / sum(len(record.y) for record in data.records)))
    own = [replace(rose[0], Ts=1.0, C=C) for rose, C in zip(known, shares.tolist(), strict=True) if rose is not None]
    as_left = len(own) == len(shares) > 1 and float(sizes(own, data)[:, 2].sum()) < (1 - LEFT_SAVES) * total
    part = Release(tau1, tau2, share, rmse, total, solver=pooled.solver, as_left=as_left)
    return part, [*_release_findings(data, pooled, parts), *[finding("release-as-left", "release")] * as_left]


def release_of(plant: Plant, stepset: StepSet) -> Release | None:
    """The release of a plant whose states are other than the clutch's, from where its rises have ended; None where none
    was recorded, or the states do not fall each by itself."""
    if plant.zeta is not None or not stepset.releases:
        return None
    curves = [plant.at(level.level) for level in stepset.levels]
    found = release_fit(stepset.releases, stepset.levels, curves, plant.C)[0]
    return found if plant.C != 1 else msgspec.structs.replace(found, tau2=found.tau1)


def _release_findings(data: Data, pooled: Solution, parts: Array) -> list[Finding]:
    findings = []
    if not pooled.solver.converged:
        findings.append(finding("fit-not-converged", "release", predicted_decrease=pooled.solver.predicted_decrease))
    if pooled.x[1] > data.longest_s:
        tau2_s = float(pooled.x[1])
        findings.append(finding("release-beyond-record", "release", tau2_s=tau2_s, record_s=data.longest_s))
    if "tau1-floor" in pooled.solver.at_bounds:
        findings.append(finding("release-too-fast", "release"))
    amplitude, residual, _ = parts.T
    if (left := data.u[residual > 0.1 * amplitude]).size:
        findings.append(finding("release-leaves-output", "release", left))
    return findings
