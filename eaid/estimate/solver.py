"""The one SLSQP call of every fit, on whitened unknowns, and the damped Newton steps that lead next to its end.

The cost is a sum of squares with gradient g and curvature H. With H = LL' at the start, SLSQP works in z = L'(x − x0),
where the cost is nearly |z|²: it then needs a dozen evaluations and cannot stop early. Constraints are A x ≥ b.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri
from scipy.optimize import minimize, nnls

from eaid.arrays import Array
from eaid.results.common import Solver, StartCost

ACTIVE_SLACK = 1e-9  # Slack of a row of A at which it counts as active, beside those that hold the Newton step
# Curvature below which nothing determines an unknown: its square root can still be squared and divided by
TINY = 1e-280
FARTHEST_STEP = 1e100  # Size of a whitened step beyond which there is none: only rounding determines it
# A predicted decrease is judged against at least this part of the sum of squared data: beneath it lies rounding
ROUNDING = 1e-15


@dataclass(frozen=True, eq=False)
class Problem:
    """Minimise a sum of squares under A x ≥ b."""

    # x → cost, gradient (n,) and its Gauss–Newton matrix, positive semidefinite, (n, n)
    normal: Callable[[Array], tuple[float, Array, Array]]
    A: Array
    b: Array
    names: Callable[[int], str]  # The code of the constraint that a row of A is part of, as in `Solver.at_bounds`
    exact: Callable[[Array], Array] | None = None  # x → true second derivatives, (n, n), where they are known
    floor: float = 0.0  # Cost below which differences are rounding: `ROUNDING` times the sum of squared data

    def value(self, x: Array) -> tuple[float, Array]:
        """Cost and gradient."""
        return self.normal(x)[:2]

    def curvature(self, x: Array) -> Array:
        """The true second derivatives where they are known and positive, else Gauss–Newton."""
        if self.exact is not None:
            exact = self.exact(x)
            scale = np.sqrt(np.maximum(np.diagonal(exact), TINY))
            try:
                np.linalg.cholesky(exact / np.outer(scale, scale))
                return exact
            except np.linalg.LinAlgError:
                pass
        return self.normal(x)[2]


@dataclass(frozen=True, eq=False)
class NewtonStep:
    """A constrained Newton step: where it goes, what it predicts, and the rows of A that hold it."""

    d: Array
    decrease: float
    active: tuple[int, ...]


def whiten(curvature: Array) -> Array:
    """L with LL' = curvature, a trace of its diagonal added where it is singular, (n, n) lower triangular."""
    scale = np.sqrt(np.maximum(curvature.diagonal(), TINY))
    scaled = curvature / (scale * scale[:, None])
    (lower, failed), ridge = dpotrf(scaled, lower=1), 1e-13  # NumPy's takes three times as long of a few unknowns
    while failed:
        (lower, failed), ridge = dpotrf(scaled + ridge * np.eye(len(scale)), lower=1), 10 * ridge
    return np.asarray(scale[:, None] * lower)


def draw_back_inside(problem: Problem, feasible: Array, x: Array) -> Array:
    """`x`, drawn back towards a feasible point by as much as rounding left it outside."""
    if not len(problem.b):
        return x
    slack, inner_slack = problem.A @ x - problem.b, problem.A @ feasible - problem.b
    room = np.where(inner_slack > 0, inner_slack, rounding(problem))
    out = slack < inner_slack - room
    if not out.any():
        return x
    kept = float(np.min(room[out] / (inner_slack[out] - slack[out])))
    return feasible + kept * (x - feasible)  # from the feasible end: `x` may lie where nothing is determined, at 1e100


def rounding(problem: Problem) -> Array:
    """How far outside each row of A a point counts as on it."""
    return np.asarray(ACTIVE_SLACK * (1.0 + np.abs(problem.b)))


def draw_in(x: Array, inner: Array, problem: Problem) -> Array:
    """The point nearest to `x` on the line to a feasible `inner`, a little inside."""
    reached = draw_back_inside(problem, inner, x)
    return x if reached is x else reached + 1e-3 * (inner - reached)


def bring_in(x: Array, inner: Array, problem: Problem) -> Array:
    """A feasible point for `x`: by the constrained Newton step, then along the line to a feasible `inner`."""
    if (problem.A @ x - problem.b).min(initial=0.0) >= 0:
        return x
    step = newton_step(problem, x, *problem.normal(x)[1:])
    return draw_in(x + step.d, inner, problem)


def newton_step(problem: Problem, x: Array, gradient: Array, curvature: Array) -> NewtonStep:
    """The step d that minimises g'd + d'Hd/2 with A (x + d) ≥ b, by least distance programming (Lawson and Hanson).

    Where the model overflows there is none: it is 0, and what it would gain has no end, so that nothing has converged.
    """
    if not np.isfinite(gradient.sum() + curvature.sum()):
        return NewtonStep(np.zeros_like(x), np.inf, ())
    lower = whiten(curvature)
    back = np.asarray(dtrtri(lower, lower=1)[0])
    with np.errstate(over="ignore", invalid="ignore"):
        q = back @ gradient
        free = -(q @ back)
    if not np.isfinite(free).all():  # only rounding determines it
        return NewtonStep(np.zeros_like(x), 0.0, ())
    slack = problem.A @ x - problem.b
    moved = slack + problem.A @ free
    if not len(slack) or moved.min() >= 0:
        return NewtonStep(free, 0.5 * float(q @ q), ())
    G = problem.A @ back.T
    h = -slack + G @ q
    size = max(float(np.abs(h).max()), 1e-300)
    E = np.vstack([G.T, h / size])
    f = np.zeros(len(E))
    f[-1] = 1.0
    multipliers = nnls(E, f)[0]
    r = E @ multipliers - f
    held = np.flatnonzero(multipliers > 0)
    z = -r[:-1] / r[-1] * size - q if r[-1] else np.full(len(x), np.inf)
    if not np.isfinite(z).all() or np.abs(z).max() > FARTHEST_STEP:
        return NewtonStep(np.zeros_like(x), 0.0, tuple(held.tolist()))
    d = z @ back
    off, little = slack + problem.A @ d, rounding(problem)
    if (off < -little).any() or (off > little)[held].any():  # where next to nothing determines d, rounding leads off
        back_on = _along(problem.A[held], -slack[held], gradient, curvature)
        if (slack + problem.A @ back_on >= -little).all():
            d, z = back_on, back_on @ lower
        else:
            d = draw_back_inside(problem, x, x + d) - x
    decrease = -float(q @ z + 0.5 * z @ z)
    return NewtonStep(d, max(decrease, 0.0), tuple(held.tolist()))


def _along(A: Array, b: Array, gradient: Array, curvature: Array) -> Array:
    """The d that minimises g'd + d'Hd/2 with A d = b, shape (n,), by the directions that A leaves free."""
    d = np.linalg.lstsq(A, b, rcond=None)[0]
    _, size, ways = np.linalg.svd(A)
    free = ways[int((size > 1e-12 * size.max(initial=0.0)).sum()) :]
    back = np.linalg.inv(whiten(free @ curvature @ free.T))
    return np.asarray(d - free.T @ (back.T @ (back @ (free @ (gradient + curvature @ d)))))


SOLVE_SETTLED = 1e-12  # A solve has ended where the Newton step predicts less than this part of the cost
FTOL = 1e-13  # SLSQP's own stopping rule, relative to the cost at the start of the round
# Where a Newton step predicts less than a little of the cost, SLSQP stops at a step that gains no more than that
ENDS, LITTLE = 1.5, 1e-5
SLSQP_ROUNDS, SLSQP_TRIES = 8, 12  # How often SLSQP is begun anew at most, and a round with more rows of A
NEAR_END = 1e-7  # A start has come near enough to its end where a Newton step predicts less than this part of the cost
RIVAL = 1e-2  # An end this part of the cost above the best is no rival: SLSQP does not go on from it
SAME_COST = 1e-6  # Ends whose costs differ by less than this part have found the same minimum


@dataclass(frozen=True, eq=False)
class EndPoint:
    """Where a solve ended."""

    x: Array
    cost: float
    evaluations: int


def slsqp(problem: Problem, near: EndPoint) -> EndPoint:
    """SLSQP from a place near the minimum, whitened anew each round, until a Newton step predicts nothing more.

    Its constraints are those that hold a Newton step, and those that a round has left: a handful of rows instead of
    hundreds, which the solver's own least squares would go through every time.
    """
    held: set[int] = set()
    for _ in range(SLSQP_ROUNDS):
        x, (cost, gradient, curvature) = near.x, problem.normal(near.x)
        step = newton_step(problem, x, gradient, curvature)
        if step.decrease <= SOLVE_SETTLED * cost or not np.isfinite(step.decrease):
            break
        held |= set(step.active)
        ftol = ENDS * step.decrease / cost if step.decrease <= LITTLE * cost else FTOL
        for _ in range(SLSQP_TRIES):
            reached, used = _one_round(problem, x, cost, curvature, sorted(held), ftol)
            left = set(np.flatnonzero(problem.A @ reached - problem.b < -rounding(problem)).tolist()) - held
            held |= left
            if not left:
                break
        reached = draw_back_inside(problem, x, reached)
        lower = problem.value(reached)[0]
        if not lower < cost:
            break
        near = EndPoint(reached, lower, near.evaluations + used)
    return near


def _one_round(
    problem: Problem, x: Array, cost: float, curvature: Array, held: list[int], ftol: float
) -> tuple[Array, int]:
    """Where SLSQP ends on unknowns whitened at one place, under some rows of A, and its evaluations."""
    # x − x0 = L'^(-1) z √cost: cost/cost(x0) then has curvature 1 in z, which is what SLSQP assumes at first
    back = np.linalg.inv(whiten(curvature)).T * np.sqrt(cost)
    rows, slack = problem.A[held] @ back, problem.A[held] @ x - problem.b[held]
    longest = np.maximum(np.abs(rows).max(axis=1, initial=0.0), 1e-300)  # a way that the data do not see is very long
    size = longest * np.linalg.norm(rows / longest[:, None], axis=1)
    size = np.where(size > 0, size, 1e-300)

    def scaled(z: Array) -> tuple[float, Array]:
        value, slope = problem.value(x + back @ z)
        return value / cost, slope @ back / cost

    constraints = {"type": "ineq", "fun": lambda z: (rows @ z + slack) / size, "jac": lambda _: rows / size[:, None]}
    with np.errstate(over="ignore", invalid="ignore"):  # SLSQP may look far outside before it comes back
        end = minimize(  # type: ignore[call-overload]  # the stubs know no vector-valued constraint
            scaled,
            np.zeros(len(x)),
            jac=True,
            method="SLSQP",
            constraints=constraints if held else (),
            options={"ftol": ftol, "maxiter": 40},
        )
    return x + back @ end.x, int(end.nfev)


@np.errstate(over="ignore", invalid="ignore")  # a step too far is not taken
def approach(problem: Problem, start: Array, steps: int = 40, near: float = NEAR_END) -> EndPoint:
    """Damped constrained Newton steps (Marquardt) from a feasible start until one gains less than `near` of it."""
    x, evaluations, damping = start, 1, 1e-6
    cost, gradient, curvature = problem.normal(x)
    for _ in range(steps):
        step = newton_step(problem, x, gradient, curvature + damping * np.diag(np.diagonal(curvature)))
        if step.decrease <= near * max(cost, problem.floor):
            break
        reached = draw_back_inside(problem, x, x + step.d) if step.active else x + step.d
        lower, slope, bent = problem.normal(reached)
        evaluations += 1
        if lower < cost:
            x, cost, gradient, curvature = reached, lower, slope, bent
            damping = max(0.1 * damping, 1e-9)
        else:
            damping *= 30
    return EndPoint(x, cost, evaluations)


def solve_ends(ends: Sequence[EndPoint], problem: Problem) -> list[EndPoint]:
    """The ends, best first, SLSQP having gone on from each that may be the best: once where several are the same."""
    order = sorted(ends, key=lambda end: end.cost)
    polished: list[EndPoint] = []
    last, solved = -np.inf, order[0]
    for end in order:
        if end.cost - last <= SAME_COST * end.cost + problem.floor:
            end = EndPoint(solved.x, solved.cost, end.evaluations)
        elif end.cost <= (1 + RIVAL) * order[0].cost:
            last = end.cost
            solved = end = slsqp(problem, end)
        polished.append(end)
    return polished


SHIFT = 1e-5  # Relative step of the differences that second derivatives come from


def with_second_derivatives(problem: Problem) -> Problem:
    """The same with the true curvature, by differences of the exact gradient."""

    def exact(x: Array) -> Array:
        cost, _, curvature = problem.normal(x)
        reach = 0.1 * np.sqrt(max(cost, problem.floor) / np.maximum(np.diagonal(curvature), TINY)) + 1e-12
        steps = np.diag(np.minimum(SHIFT * np.maximum(np.abs(x), 1e-3), reach))
        rows = [(problem.normal(x + h)[1] - problem.normal(x - h)[1]) / (2 * h.sum()) for h in steps]
        return np.asarray(0.5 * (np.array(rows) + np.array(rows).T))

    return replace(problem, exact=exact)


FINISHED = 1e-15  # Polishing ends where the Newton step predicts less than this part of the cost
# The last step, too small to be seen in the cost, is taken where it changes no unknown by more than this part
LAST_STEP_PART = 1e-4
# A fit has converged where the Newton step would lower the cost by less than this part: where τ2 meets τ1 rounding
# keeps some 1e-9 out of reach
CONVERGED = 1e-8
# At a bend of the cost, as where a state turns from rising to falling at a row, it predicts up to this part
MOST_AT_BEND = 1e-4


def polish(
    problem: Problem, end: EndPoint, steps: int = 40, finished: float = FINISHED
) -> tuple[EndPoint, float, tuple[int, ...]]:
    """Take constrained Newton steps from an end point while one predicts to gain `finished` of the cost.

    Returns the point with its cost, what a further step predicts relative to the cost, and the active rows.
    """
    x, evaluations = end.x, end.evaluations + 1
    cost, gradient = problem.value(x)
    step = newton_step(problem, x, gradient, problem.curvature(x))
    for _ in range(steps):
        if step.decrease <= finished * cost:
            break
        for length in (1.0, 0.5, 0.25, 0.1, 0.01):
            reached = draw_back_inside(problem, x, x + length * step.d)
            lower, slope = problem.value(reached)
            evaluations += 1
            if lower < cost:
                break
        else:
            break
        x, cost, gradient = reached, lower, slope
        step = newton_step(problem, x, gradient, problem.curvature(x))
    predicted = step.decrease / max(cost, problem.floor) if step.decrease > 0 else 0.0
    if CONVERGED < predicted < MOST_AT_BEND and all(
        problem.value(draw_back_inside(problem, x, x + length * step.d))[0] > cost for length in (1e-3, 1e-4)
    ):
        predicted = 0.0  # down a slope there is always a way: the cost has a bend here, which no derivative tells
    if step.decrease <= SOLVE_SETTLED * cost and (np.abs(step.d) <= LAST_STEP_PART * np.abs(x)).all():
        x = draw_back_inside(problem, x, x + step.d)  # the cost shows no difference any more, the unknowns do
    near = np.flatnonzero(problem.A @ x - problem.b < rounding(problem))
    return EndPoint(x, cost, evaluations), predicted, tuple(sorted({*step.active, *near.tolist()}))


def solver_verdict(predicted: float, evaluations: int, costs: Sequence[float], at_bounds: Iterable[str] = ()) -> Solver:
    """Our verdict on a fit, from the decrease that a further step predicts, relative to the cost."""
    converged = predicted <= CONVERGED
    gain = f"a further constrained Newton step would lower the cost by {predicted:.0e} of it"
    return Solver(
        converged=converged,
        message=f"{'converged' if converged else 'not converged'}: {gain}",
        predicted_decrease=predicted,
        evaluations=evaluations,
        starts=tuple(StartCost(float(cost)) for cost in costs),
        at_bounds=tuple(dict.fromkeys(at_bounds)),
    )
