"""The one SLSQP call of every fit, on whitened unknowns, and the damped Newton steps that lead next to its end.

The cost is a sum of squares with gradient g and curvature H. With H = LL' at the start, SLSQP works in z = L'(x − x0),
where the cost is nearly |z|²: it then needs a dozen evaluations and cannot stop early. Constraints are A x ≥ b.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from eaid.arrays import Array
from eaid.fitting.problem import TINY, Problem, Value, inside, newton_step, rounding, whiten

FTOL = 1e-13
"""SLSQP's own stopping rule, relative to the cost at the start of the round."""
ENDS = 1.5
"""Next to the minimum SLSQP stops at a step that gains less than this many times what a Newton step predicts."""
SETTLED = 1e-12
"""A start has ended where the Newton step predicts less than this part of the cost."""
NEAR_END = 1e-7
"""A start has come near enough to its end where a Newton step predicts less than this part of the cost."""
LITTLE = 1e-5
"""Where a Newton step predicts less than this part of the cost, it is next to the minimum and right about it."""
LIGHT = 1e-3
"""Damping up to which a step predicts what one without damping does."""
RIVAL = 1e-2
"""An end this part of the cost above the best is no rival: SLSQP does not go on from it."""
SAME = 1e-6
"""Ends whose costs differ by less than this part have found the same minimum."""
ROUNDS = 8
"""How often SLSQP is begun anew at most."""
TRIES = 12
"""How often a round is begun again with more rows of A."""


@dataclass(frozen=True, eq=False)
class EndPoint:
    """Where a solve ended."""

    x: Array
    cost: float
    evaluations: int
    local: "Local | None" = None
    """What is known of that place, where it is at hand."""


@dataclass(frozen=True, eq=False)
class Local:
    """What is known of one place."""

    cost: float
    gradient: Array
    curvature: Array
    """Gauss–Newton matrix."""
    predicted: float
    """By how much a constrained Newton step would lower the cost."""


def slsqp(problem: Problem, start: Array, near: Local | None = None) -> EndPoint:
    """Solve from one feasible start, whitened anew each round, until a Newton step predicts nothing more.

    A round leaves the constraints out at first; where it ends outside some, it is begun again with those, until it ends
    inside: a handful of rows instead of hundreds, which the solver's own least squares would go through every time.
    `near` is what is known of a start next to the minimum: one step gains all that is to be had there, and the first
    round ends with it.
    """
    x, evaluations = start, 1
    held = np.zeros(len(problem.b), dtype=bool)
    now = near or _local(problem, x)
    value = _once(problem.value, x, (now.cost, now.gradient))
    ftol = FTOL
    if near is not None:
        now, ftol = replace(near, curvature=problem.curvature(x)), ENDS * near.predicted / max(near.cost, TINY)
    for _ in range(ROUNDS):
        if now.cost == 0.0 or now.predicted <= SETTLED * now.cost:
            break
        for _ in range(TRIES):
            reached, used = _one_round(problem, x, value, now, held, ftol)
            evaluations += used
            outside = problem.A @ reached - problem.b < -rounding(problem)
            if not (outside & ~held).any():
                break
            held |= outside
        reached = inside(problem, x, reached)
        found, _ = value(reached)
        if not found < now.cost:
            break
        x, ftol = reached, FTOL
        if now.predicted <= LITTLE * now.cost and now.cost - found >= 0.5 * now.predicted:
            return EndPoint(x, found, evaluations)  # what there was to gain next to the minimum has been gained
        now = _local(problem, x)
    return EndPoint(x, now.cost, evaluations)


def _local(problem: Problem, x: Array) -> Local:
    cost, gradient, curvature = problem.normal(x)
    return Local(cost, gradient, curvature, newton_step(problem, x, gradient, curvature).decrease)


def _once(value: Value, x: Array, there: tuple[float, Array]) -> Value:
    """`value` that keeps its last answer, `there` at `x` to begin with: a round begins and ends where one is known."""
    last = [(x.tobytes(), there)]

    def kept(x: Array) -> tuple[float, Array]:
        place = x.tobytes()
        if last[0][0] != place:
            last[0] = place, value(x)
        return last[0][1]

    return kept


def _one_round(problem: Problem, x: Array, value: Value, now: Local, held: Array, ftol: float) -> tuple[Array, int]:
    # x − x0 = L'^(-1) z √cost: cost/cost(x0) then has curvature 1 in z, which is what SLSQP assumes at first.
    back = np.linalg.inv(whiten(now.curvature)).T * np.sqrt(now.cost)

    def scaled(z: Array) -> tuple[float, Array]:
        found, gradient = value(x + back @ z)
        return found / now.cost, gradient @ back / now.cost

    rows, slack = problem.A[:0], problem.b[:0]
    if held.any():
        rows = problem.A[held] @ back
        size = np.linalg.norm(rows, axis=1)
        size[size == 0] = 1.0
        rows /= size[:, None]
        slack = (problem.A[held] @ x - problem.b[held]) / size
    constraints = {"type": "ineq", "fun": lambda z: rows @ z + slack, "jac": lambda _: rows}
    with np.errstate(over="ignore", invalid="ignore"):  # SLSQP may look far outside before it comes back
        end = minimize(  # type: ignore[call-overload]  # the stubs know no vector-valued constraint
            scaled,
            np.zeros(len(x)),
            jac=True,
            method="SLSQP",
            constraints=constraints if len(slack) else (),
            options={"ftol": ftol, "maxiter": 40},
        )
    return x + back @ end.x, end.nfev


def approach(problem: Problem, start: Array, steps: int = 40) -> EndPoint:
    """Go down from a feasible start until a step predicts next to nothing: where the solver may then end the fit.

    Steps are constrained Newton steps with Levenberg's and Marquardt's damping, which grows where a step gains nothing.
    """
    x, evaluations, damping, local = start, 1, 1e-6, None
    cost, gradient, curvature = problem.normal(x)
    for _ in range(steps):
        step = newton_step(problem, x, gradient, curvature + damping * np.diag(np.diagonal(curvature)))
        if step.decrease <= NEAR_END * max(cost, problem.floor):
            if damping <= LIGHT:
                local = Local(cost, gradient, curvature, step.decrease)
            break
        reached = inside(problem, x, x + step.d) if step.active else x + step.d
        found, slope, bent = problem.normal(reached)
        evaluations += 1
        if found < cost:
            x, cost, gradient, curvature = reached, found, slope, bent
            damping = max(0.1 * damping, 1e-9)
        else:
            damping *= 30
    return EndPoint(x, cost, evaluations, local)


def ended(ends: Sequence[EndPoint], problem: Problem) -> list[EndPoint]:
    """The ends, best first, SLSQP having gone on from each that may be the best: once where several are the same."""
    order = sorted(ends, key=lambda end: end.cost)
    found: list[EndPoint] = []
    last, solved = -np.inf, order[0]
    for end in order:
        if end.cost - last <= SAME * end.cost + problem.floor:
            end = EndPoint(solved.x, solved.cost, end.evaluations)
        elif end.cost <= (1 + RIVAL) * order[0].cost:
            last = end.cost
            solved = end = slsqp(problem, end.x, end.local)
        found.append(end)
    return found
