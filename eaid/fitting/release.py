"""Falling edges: one τ1 and τ2 for all, and of each level.

T(t) = residual + amplitude (s e^(−t/τ1) + (1 − s) e^(−t/τ2)), amplitude ≥ 0, specification 4.1 let go. Their
share s is what they had reached when the input left: with the rising curve and the time H that it was held,
s = C (1 − e^(−H/τ1↑)) / (C (1 − e^(−H/τ1↑)) + (1 − C)(1 − e^(−H/τ2↑))); C itself where the rise is not known.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from eaid.findings import Finding, finding
from eaid.fitting.data import Data, data_of
from eaid.fitting.falling import ReleaseSolution, fit_each_release, solve
from eaid.fitting.metrics import quality
from eaid.models.parameters import SHARE, Friction
from eaid.results.friction import FrictionLevel, Release, ReleaseLevel
from eaid.steps.stepset import Level


def release_fit(
    releases: Sequence[Level],
    rising: Sequence[FrictionLevel],
    held_s: Mapping[float, float],
    share: float = SHARE,
) -> tuple[Release, list[Finding]]:
    """Pooled release constants, and each level's own beside the rising ones.

    `held_s` is how long each level was held before its release [s].
    """
    data = data_of(releases)
    rises = {fit.level: fit.curve for fit in rising}
    shares = np.array([share_reached(rises.get(r.level), held_s.get(r.level), share) for r in releases])
    alone = fit_each_release(data, shares)
    pooled = solve(data, shares, np.log([level_fit.tau for level_fit in alone]))
    rows = []
    for release, level_fit, fast, record in zip(releases, alone, shares.tolist(), data.records, strict=True):
        sse, curve = min(level_fit.solver.costs), rises.get(release.level)
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
    total = min(pooled.solver.costs)
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
    left = [row.level for row, (size, rest) in zip(rows, pooled.parts, strict=True) if rest > 0.1 * abs(size)]
    if left:
        found.append(finding("release-leaves-output", "release", left))
    return found
