"""Our own verdict on where a solver ended, on every sample; it does not trust the solver.

At the end point the constrained Newton step d solves min g'd + d'Hd/2 with A (x + d) ≥ b, and the decrease that it
predicts, relative to the cost, has to be nothing.
"""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from eaid.arrays import Array
from eaid.fitting.problem import Problem, inside, newton_step, rounding
from eaid.fitting.solver import SETTLED, EndPoint, approach, ended
from eaid.results.common import Solver, StartCost

FINISHED = 1e-15
"""Polishing ends where the Newton step predicts less than this part of the cost."""
UNSEEN = 1e-4
"""The last step, too small to be seen in the cost, is taken where it changes no unknown by more than this part."""
CONVERGED = 1e-9
"""A fit has converged where the Newton step would lower the cost by less than this part of it."""


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
    step = newton_step(problem, x, gradient, problem.curvature(x))
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
        step = newton_step(problem, x, gradient, problem.curvature(x))
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


def minimised(
    problem: Problem, starts: Iterable[Array], full: Callable[[Array], tuple[float, Array]]
) -> tuple[EndPoint, Solver, tuple[int, ...]]:
    """The least of what feasible starts lead to, `concluded`."""
    return concluded(problem, ended([approach(problem, start) for start in starts], problem), full)


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
