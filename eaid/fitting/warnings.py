"""What a fit's data cannot tell, in words, for the nonlinear and the linear model."""

from collections.abc import Sequence

import numpy as np

from eaid.fitting.basis import DEGREES
from eaid.fitting.data import Data
from eaid.fitting.result import Bounds, LinearLevel, Solver
from eaid.models.nonlinear import time_constants
from eaid.models.parameters import Linear, Nonlinear


def listed(levels: Sequence[float]) -> str:
    """Levels for a sentence: 10, 20 and 30."""
    words = [f"{level:g}" for level in levels]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def nonlinear_warnings(data: Data, p: Nonlinear, solver: Solver, held: Sequence[float]) -> tuple[str, ...]:
    """Doubts about the ten coefficients."""
    warnings = []
    if not solver.converged:
        warnings.append(f"the nonlinear fit {solver.message}; its numbers are not to be used")
    count = len(np.unique(data.u))
    if count == 1:
        warnings.append(
            "one level only: τ1, τ2 and T_s are known at this level, not how they depend on it; "
            "their polynomials are constants"
        )
    elif count <= max(DEGREES):
        warnings.append(
            f"{count} levels cannot tell a cubic T_s(u){' or quadratic time constants' if count < 3 else ''}: "
            "the polynomials pass through the levels, their missing coefficients are 0"
        )
    _, tau2 = time_constants(p, data.u)
    long = [float(u) for u, tau, r in zip(data.u, tau2, data.records, strict=True) if tau > r.t_s[-1]]
    if long:
        warnings.append(
            f"τ2 is longer than the record at level {listed(long)}: these data cannot tell it, "
            "nor how far T_s goes on rising; record longer"
        )
    if solver.at_bounds:
        shown = ", ".join(solver.at_bounds[:4]) + (", …" if len(solver.at_bounds) > 4 else "")
        warnings.append(f"a constraint holds the fit ({shown}): what it holds is not estimated there")
    best = min(solver.starts)
    if best > 0 and max(solver.starts) > (1 + 1e-6) * best:
        warnings.append(
            f"{sum(cost > (1 + 1e-6) * best for cost in solver.starts)} of {len(solver.starts)} starts "
            "ended at a higher cost; the least is given"
        )
    outside = [u for u in held if not p.u_range[0] <= u <= p.u_range[1]]
    if outside:
        warnings.append(
            f"held-out level {listed(outside)} lies outside the fitted ones: "
            "there the model is held at its edge, it predicts nothing"
        )
    return tuple(warnings)


def linear_warnings(
    data: Data, p: Linear, solver: Solver, rows: Sequence[LinearLevel], bounds: Bounds
) -> tuple[str, ...]:
    """Doubts about the linear model and the bounds of B."""
    warnings = []
    if not solver.converged:
        warnings.append(f"the linear fit {solver.message}; its numbers are not to be used")
    if len(np.unique(data.u)) == 1:
        warnings.append("one level only: one step cannot tell b0 from c0, so c0 is 0 and B has no range")
    if solver.at_bounds:
        warnings.append(f"a0 is at the edge of what is looked for ({solver.at_bounds[0]}): these data cannot tell it")
    drive = p.b0 * data.u + p.c0
    negative = [float(u) for u, d in zip(data.u, drive, strict=True) if d < 0]
    if negative:
        warnings.append(f"the linear model gives a negative torque at level {listed(negative)}")
    slow = [row.level for row, r in zip(rows, data.records, strict=True) if row.a0 * r.t_s[-1] < 1]
    if slow:
        warnings.append(
            f"1/a0 is longer than the record at level {listed(slow)}: gain and B of these levels are extrapolated"
        )
    without = [row.level for row in rows if row.B is None and row.level in bounds.levels]
    if without:
        warnings.append(
            f"b0 is not positive at level {listed(without)} under {bounds.convention}: left out of B_m and B_M"
        )
    if bounds.B_m is None:
        warnings.append("no level has a positive b0: there are no bounds of B, and tune-rc cannot use this fit")
    return tuple(warnings)
