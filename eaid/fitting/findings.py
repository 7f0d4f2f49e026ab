"""What the data of a fit cannot tell, for the nonlinear and the linear model."""

from collections.abc import Mapping, Sequence

from eaid.arrays import Array
from eaid.findings import Finding, finding
from eaid.fitting.data import Data
from eaid.fitting.metrics import explains_little
from eaid.models.parameters import Linear, Nonlinear
from eaid.results.common import Solver
from eaid.results.linear import Bounds, LinearLevel, Pooled
from eaid.results.nonlinear import Estimate

SAME_COST = 1e-6
"""Starts whose costs differ by less than this part have found the same minimum."""


def nonlinear_findings(
    p: Nonlinear, solver: Solver, active_at: Mapping[str, Sequence[float]], held_out: Sequence[float]
) -> list[Finding]:
    """Doubts about the ten coefficients; `active_at`: the constraints that hold them, and where."""
    found = []
    if not solver.converged:
        found.append(finding("fit-not-converged", "nonlinear", predicted_decrease=solver.predicted_decrease))
    for code, at in active_at.items():
        found.append(finding("constraint-holds", "nonlinear", sorted({*at[:1], *at[-1:]}), constraint=code))
    costs = solver.costs
    best = min(costs)
    higher = sum(cost > (1 + SAME_COST) * best for cost in costs)
    if best > 0 and higher:
        found.append(finding("starts-end-apart", "nonlinear", higher=higher, starts=len(costs)))
    if outside := [u for u in held_out if not p.u_range[0] <= u <= p.u_range[1]]:
        found.append(finding("held-out-beyond-the-levels", "nonlinear", outside))
    return found


def missed(subject: str, data: Data, residuals: Sequence[Array], model: Estimate | Pooled) -> list[Finding]:
    """Said where a model misses the curves themselves."""
    if not explains_little([record.y for record in data.records], residuals):
        return []
    return [finding("model-explains-little", subject, R2=model.R2, fit_pct=model.fit_pct)]


def linear_findings(
    data: Data, p: Linear, solver: Solver | None, rows: Sequence[LinearLevel], bounds: Bounds
) -> list[Finding]:
    """Doubts about the linear model and the bounds of B."""
    found = []
    if solver is not None and not solver.converged:
        found.append(finding("fit-not-converged", "linear", predicted_decrease=solver.predicted_decrease))
    if solver is not None and solver.at_bounds:
        found.append(finding("a0-not-determined", "linear", constraint=solver.at_bounds[0]))
    levels = {
        "linear-output-negative": [u for u in data.u.tolist() if p.b0 * u + p.c0 < 0],
        "linear-level-beyond-record": [
            row.level for row, r in zip(rows, data.records, strict=True) if row.a0 * r.t_s[-1] < 1
        ],
        "level-without-b": [row.level for row in rows if row.B is None and row.level in bounds.levels],
    }
    found += [finding(code, "linear", at) for code, at in levels.items() if at]
    return found
