"""The one SLSQP call of every fit, on whitened unknowns, and our own verdict on where it ends.

The cost is a sum of squares with gradient g and curvature H. With H = LL' at the start, SLSQP works in z = L'(x − x0),
where the cost is nearly |z|²: it then needs a dozen evaluations and cannot stop early. Constraints are A x ≥ b.

The verdict does not trust the solver: at the end point the constrained Newton step d solves
min g'd + d'Hd/2 with A (x + d) ≥ b, and the decrease that it predicts, relative to the cost, has to be nothing.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from eaid.arrays import Array
from eaid.fitting.problem import TINY, Problem, Value, inside, newton_step, rounding, whiten
from eaid.results.common import Solver, StartCost

FTOL = 1e-13
"""SLSQP's own stopping rule, relative to the cost at the start of the round."""
ENDS = 1.5
"""The same next to the minimum, times what a Newton step predicts: a step that gains about that much is the last."""
FINISHED = 1e-15
"""Polishing ends where the Newton step predicts less than this part of the cost."""
UNSEEN = 1e-4
"""The last step, too small to be seen in the cost, is taken where it changes no unknown by more than this part."""
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
CONVERGED = 1e-9
"""A fit has converged where the Newton step would lower the cost by less than this part of it."""


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


def slsqp(problem: Problem, start: Array, near: Local | None = None, rounds: int = 8) -> EndPoint:
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
        now, ftol = replace(near, curvature=_curvature(problem, x)), ENDS * near.predicted / max(near.cost, TINY)
    for _ in range(rounds):
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


def _one_round(
    problem: Problem, x: Array, value: Value, now: Local, held: Array, ftol: float, most: int = 40
) -> tuple[Array, int]:
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
            options={"ftol": ftol, "maxiter": most},
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


def polish(
    problem: Problem,
    end: EndPoint,
    full: Callable[[Array], tuple[float, Array]],
    steps: int = 40,
    finished: float = FINISHED,
) -> tuple[EndPoint, float, tuple[int, ...]]:
    """Confirm an end point on the full data and take constrained Newton steps while one predicts to gain `finished`.

    Returns the point with its full-data cost, what a further step predicts relative to the cost, and the active rows.
    """
    x, evaluations = end.x, end.evaluations + 1
    cost, gradient = full(x)
    step = newton_step(problem, x, gradient, _curvature(problem, x))
    for _ in range(steps):
        if step.decrease <= finished * cost:
            break
        for length in (1.0, 0.5, 0.25, 0.1, 0.01):
            reached = inside(problem, x, x + length * step.d)
            found, slope = full(reached)
            evaluations += 1
            if found < cost:
                break
        else:
            break
        x, cost, gradient = reached, found, slope
        step = newton_step(problem, x, gradient, _curvature(problem, x))
    predicted = step.decrease / max(cost, problem.floor) if step.decrease > 0 else 0.0
    if step.decrease <= SETTLED * cost and (np.abs(step.d) <= UNSEEN * np.abs(x)).all():
        x = inside(problem, x, x + step.d)  # the cost shows no difference any more, the unknowns do
    near = np.flatnonzero(problem.A @ x - problem.b < rounding(problem))
    return EndPoint(x, cost, evaluations), predicted, tuple(sorted({*step.active, *near.tolist()}))


def judged(predicted: float, evaluations: int, costs: Sequence[float], at_bounds: Sequence[str] = ()) -> Solver:
    """Our verdict on a fit, from the decrease that a further step predicts, relative to the cost."""
    converged = predicted <= CONVERGED
    said = f"a further constrained Newton step on the full data would lower the cost by {predicted:.0e} of it"
    return Solver(
        converged=converged,
        message=f"{'converged' if converged else 'not converged'}: {said}",
        predicted_decrease=predicted,
        evaluations=evaluations,
        starts=tuple(StartCost(float(cost)) for cost in costs),
        at_bounds=tuple(dict.fromkeys(at_bounds)),
    )


def concluded(
    problem: Problem, ends: Sequence[EndPoint], full: Callable[[Array], tuple[float, Array]]
) -> tuple[EndPoint, Solver, tuple[int, ...]]:
    """The best end, polished on the full data, with our verdict and the active rows."""
    best = min(ends, key=lambda end: end.cost)
    end, predicted, active = polish(problem, best, full)
    evaluations = sum(one.evaluations for one in ends) + end.evaluations - best.evaluations
    offset = end.cost - best.cost  # what compression leaves out of every start's cost alike
    costs = [one.cost + offset for one in ends]
    return end, judged(predicted, evaluations, costs, [problem.names(i) for i in active]), active


def _curvature(problem: Problem, x: Array) -> Array:
    """The true second derivatives where they are known and positive, else Gauss–Newton."""
    if problem.exact is not None:
        exact = problem.exact(x)
        if np.diagonal(exact).min() <= TINY:
            return problem.normal(x)[2]
        scale = np.sqrt(np.diagonal(exact))
        try:
            np.linalg.cholesky(exact / np.outer(scale, scale))
            return exact
        except np.linalg.LinAlgError:
            pass
    return problem.normal(x)[2]
