"""From starts to the least cost: compared on a coarse copy of the logs, ended on every sample, with our own verdict.

SLSQP works on whitened unknowns, a Gauss–Newton matrix at each round; the end is polished by constrained Newton steps
on every sample, and what one more of them would gain is the verdict, as with the step fits.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.fitting.problem import Problem
from eaid.fitting.solver import CONVERGED, EndPoint, approach, ended, judged, polish, slsqp
from eaid.models.parameters import Nonlinear
from eaid.recorded.drive import Drive
from eaid.recorded.problem import Setup
from eaid.recorded.starts import starts
from eaid.results.common import Solver

RIVALS = 3
"""Ends on the coarse copy that go on to every sample."""
NEAR = 0.02
"""An end this part of the cost above the best is no rival."""
SHIFT = 1e-5
"""Relative step of the difference that second derivatives come from."""


@dataclass(frozen=True, eq=False)
class Solved:
    """Where a fit ended."""

    setup: Setup
    x: Array
    cost: float
    solver: Solver
    rivals: tuple[tuple[Array, float], ...] = ()
    """Other minima that were found, with their costs."""
    instruments: tuple[Drive, ...] | None = None
    """Inputs without the noise of the outputs, where they stood in for the recorded ones in the derivatives."""

    @property
    def coefficients(self) -> Array:
        """Of the model alone."""
        return self.x[: self.setup.model.size]


def solve(
    setup: Setup,
    small: Sequence[Drive] | None = None,
    sketch: Sequence[Drive] | None = None,
    given: Sequence[Array] = (),
) -> Solved:
    """The least-squares unknowns, from our own starts and any given ones.

    `sketch` is a copy of the logs on which many starts are looked at, `small` a finer one on which the best are solved.
    """
    problem = setup.problem()
    rough = setup if small is None else replace(setup, drives=tuple(small))
    near = problem if small is None else rough.problem()
    drawn = rough if sketch is None else replace(setup, drives=tuple(sketch))
    begin = starts(drawn, near if sketch is None else drawn.problem())
    ends = [approach(near, x) for x in [*given, *begin]]
    tried = sum(end.evaluations for end in ends)
    if min(end.cost for end in ends) > near.floor:  # beneath it lies rounding, in which a line search finds no way
        ends = ended(ends, near)
    distinct: list[EndPoint] = []
    for end in sorted(ends, key=lambda one: one.cost):
        if all(abs(end.cost - other.cost) > 1e-6 * other.cost + near.floor for other in distinct):
            distinct.append(end)
    kept = [end for end in distinct[:RIVALS] if end.cost <= (1 + NEAR) * distinct[0].cost + near.floor]
    return finished(setup, problem, [end.x for end in kept], tried, rough, [end.cost for end in ends])


def refit(near: Solved, drives: Sequence[Drive]) -> Solved:
    """The minimum next to an earlier one, on other outputs of the same inputs."""
    setup = replace(near.setup, drives=tuple(drives))
    return finished(setup, setup.problem(), [near.x])


def finished(
    setup: Setup,
    problem: Problem,
    begin: Sequence[Array],
    tried: int = 0,
    rough: Setup | None = None,
    costs: Sequence[float] = (),
) -> Solved:
    """From near ends on every sample to the verdict."""
    found = [approach(problem, x) for x in begin]
    best = min(found, key=lambda end: end.cost)
    exact = with_second_derivatives(problem, rough or setup)

    def full(x: Array) -> tuple[float, Array]:
        return problem.value(x)

    end, predicted, active = polish(exact, best, full)
    if predicted > CONVERGED and end.cost > problem.floor:
        end, predicted, active = polish(exact, slsqp(problem, end.x), full)
    shift = end.cost - best.cost
    ended_at = tuple(costs) or tuple(one.cost + shift for one in found)
    evaluations = tried + sum(one.evaluations for one in found) + end.evaluations - best.evaluations
    solver = judged(predicted, evaluations, ended_at, [problem.names(i) for i in active])
    others = tuple((one.x, one.cost + shift) for one in found if one.cost > best.cost * (1 + 1e-6) + problem.floor)
    return Solved(setup, end.x, end.cost, solver, others)


def with_second_derivatives(problem: Problem, rough: Setup) -> Problem:
    """The same problem, its true curvature known: Gauss–Newton of every sample, and what the residuals add to it.

    The latter comes from differences of the exact gradient on the coarse copy.
    """

    def exact(x: Array) -> Array:
        whole = problem.normal(x)[2]
        own = rough.together(x)[2]
        scale = np.sqrt(np.maximum(np.diagonal(own), 1e-300))
        size = np.sqrt(max(problem.value(x)[0], problem.floor))
        added = np.empty_like(own)
        for j in range(len(x)):
            step = min(SHIFT * max(abs(x[j]), 1e-3), 0.1 * size / scale[j] + 1e-12)
            ahead = x.copy()
            ahead[j] += step
            behind = x.copy()
            behind[j] -= step
            added[j] = (rough.together(ahead)[1] - rough.together(behind)[1]) / (2 * step) - own[j]
        return np.asarray(whole + 0.5 * (added + added.T))

    return replace(problem, exact=exact)


def model_of(solved: Solved) -> Nonlinear:
    """The fitted model, with its release where that was fitted."""
    setup = solved.setup
    assert setup.model.basis is not None
    parameters = setup.model.basis.parameters(solved.coefficients)
    at = setup.at("rest")
    return parameters if at < 0 else replace(parameters, release=(float(solved.x[at]), float(solved.x[at + 1])))


def idle_of(solved: Solved, log: int) -> float:
    """Idle output of a log, fitted or known to be 0 after its baseline."""
    at = int(solved.setup.own[log][0])
    return float(solved.x[at]) if at >= 0 else 0.0
