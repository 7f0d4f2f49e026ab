"""A sum of squares under A x ≥ b, and one constrained Newton step of it, by least distance programming.

The step d minimises g'd + d'Hd/2 with A (x + d) ≥ b. With H = LL' it is the shortest z = L'd + L⁻¹g within the
constraints, which non-negative least squares finds (Lawson and Hanson); the decrease that it predicts is exact for a
parabola.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from eaid.arrays import Array

NEAR = 1e-9
"""Slack of a row of A at which it counts as active, beside those that hold the Newton step."""
TINY = 1e-280
"""Curvature below which nothing determines an unknown: its square root can still be squared and divided by."""
ROUNDING = 1e-15
"""A predicted is judged against at least this part of the sum of squared data: beneath it lies rounding."""

Value = Callable[[Array], tuple[float, Array]]
"""x → cost, gradient (n,)."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Minimise a sum of squares under A x ≥ b."""

    normal: Callable[[Array], tuple[float, Array, Array]]
    """x → cost, gradient (n,) and its Gauss–Newton matrix, positive semidefinite, (n, n)."""
    A: Array
    b: Array
    names: Callable[[int], str]
    """The code of the constraint that a row of A is part of, as in `Solver.at_bounds`."""
    exact: Callable[[Array], Array] | None = None
    """x → true second derivatives, (n, n), where they are known."""
    floor: float = 0.0
    """Cost below which differences are rounding: `ROUNDING` times the sum of squared data."""

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
    scale = np.sqrt(np.maximum(np.diagonal(curvature), TINY))
    scaled = curvature / (scale * scale[:, None])
    ridge = 0.0
    while True:
        try:
            return np.asarray(scale[:, None] * np.linalg.cholesky(scaled))
        except np.linalg.LinAlgError:
            ridge = 10 * ridge if ridge else 1e-13
            scaled = curvature / (scale * scale[:, None]) + ridge * np.eye(len(scale))


def inside(problem: Problem, feasible: Array, x: Array) -> Array:
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
    return np.asarray(NEAR * (1.0 + np.abs(problem.b)))


def draw_in(x: Array, inner: Array, problem: Problem) -> Array:
    """The point nearest to `x` on the line to a feasible `inner`, a little inside."""
    slack, inner_slack = problem.A @ x - problem.b, problem.A @ inner - problem.b
    out = slack < 0
    if not out.any():
        return x
    room = np.maximum(inner_slack[out], 1e-300)
    kept = float(np.min(room / (room - slack[out])))
    return inner + max(0.0, kept - 0.001 * (1.0 - kept)) * (x - inner)


def bring_in(x: Array, inner: Array, problem: Problem) -> Array:
    """A feasible point for `x`: by the constrained Newton step, then along the line to a feasible `inner`."""
    if (problem.A @ x - problem.b).min(initial=0.0) >= 0:
        return x
    step = newton_step(problem, x, *problem.normal(x)[1:])
    return draw_in(x + step.d, inner, problem)


def newton_step(problem: Problem, x: Array, gradient: Array, curvature: Array) -> NewtonStep:
    """The step d that minimises g'd + d'Hd/2 with A (x + d) ≥ b, by least distance programming (Lawson and Hanson)."""
    lower = whiten(curvature)
    back = np.linalg.inv(lower)
    q = back @ gradient
    free = -(q @ back)
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
    if r[-1] == 0.0:
        return NewtonStep(np.zeros_like(x), 0.0, tuple(np.flatnonzero(multipliers > 0).tolist()))
    z = -r[:-1] / r[-1] * size - q
    d, held = z @ back, np.flatnonzero(multipliers > 0)
    off, little = slack + problem.A @ d, rounding(problem)
    if (off < -little).any() or (off > little)[held].any():  # where next to nothing determines d, rounding leads off
        back_on = _along(problem.A[held], -slack[held], gradient, curvature)
        if (slack + problem.A @ back_on >= -little).all():
            d, z = back_on, back_on @ lower
        else:
            d = inside(problem, x, x + d) - x
    decrease = -float(q @ z + 0.5 * z @ z)
    return NewtonStep(d, max(decrease, 0.0), tuple(held.tolist()))


def _along(A: Array, b: Array, gradient: Array, curvature: Array) -> Array:
    """The d that minimises g'd + d'Hd/2 with A d = b, shape (n,), by the directions that A leaves free."""
    d = np.linalg.lstsq(A, b, rcond=None)[0]
    _, size, ways = np.linalg.svd(A)
    free = ways[int((size > 1e-12 * size.max(initial=0.0)).sum()) :]
    back = np.linalg.inv(whiten(free @ curvature @ free.T))
    return np.asarray(d - free.T @ (back.T @ (back @ (free @ (gradient + curvature @ d)))))
