"""From starts to the least cost: compared on a coarse copy of the logs, ended on every sample, with our own verdict.

SLSQP works on whitened unknowns, a Gauss–Newton matrix at each round; the end is polished by constrained Newton steps
on every sample, and what one more of them would gain is the verdict, as with the step fits.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.fitting.problem import Problem
from eaid.fitting.solver import SETTLED, EndPoint, approach, ended, slsqp
from eaid.fitting.verdict import CONVERGED, judged, polish
from eaid.models.parameters import Nonlinear
from eaid.recorded.drive import Drive
from eaid.recorded.log import RecordedLog
from eaid.recorded.problem import Setup, setup_of
from eaid.recorded.starts import starts
from eaid.recorded.states import Tables
from eaid.results.common import Solver

AT_BOUND = 1e-6
"""A constraint a'x ≥ b holds a fit that ends within this part of b: where no cost tells, a solver stops short."""
RIVALS = 3
"""Ends on the coarse copy that go on to every sample."""
SAME = 1e-6
"""Ends whose costs differ by less than this part are one."""
NEAR = 0.05
"""An end this part of the cost above the best is no rival."""
LONG_WAY = 1000
"""Newton steps along a bent valley, where τ1 and τ2 all but meet."""
SHIFT = 1e-5
"""Relative step of the difference that second derivatives come from."""


@dataclass(frozen=True, eq=False)
class Solved:
    """Where a fit ended."""

    fitted: Setup
    """With the copies on which it was looked for."""
    x: Array
    cost: float
    solver: Solver
    rivals: tuple[tuple[Array, float], ...] = ()
    """Other minima that were found, with their costs."""
    instruments: tuple[Drive, ...] | None = None
    """Inputs without the noise of the outputs, where they stood in for the recorded ones in the derivatives."""

    @property
    def setup(self) -> Setup:
        """On every sample."""
        return self.fitted.every

    @cached_property
    def outputs(self) -> tuple[Array, ...]:
        """What was recorded in the rows that are compared, less a known baseline, of each log."""
        return tuple(drive.y[drive.w > 0] for drive in self.setup.drives)

    @cached_property
    def missed(self) -> tuple[Array, ...]:
        """Model less recorded in those rows."""
        drives = enumerate(self.setup.drives)
        return tuple(self.setup.jacobian(self.x, k)[1] / np.sqrt(one.w[one.w > 0]) for k, one in drives)

    @property
    def coefficients(self) -> Array:
        """Of the model alone."""
        return self.x[: self.setup.model.size]

    @cached_property
    def active(self) -> NDArray[np.intp]:
        """Constraints that hold it, those of the model first."""
        problem = self.setup.problem()
        return np.flatnonzero(problem.A @ self.x - problem.b < 1e-9 + AT_BOUND * np.abs(problem.b))

    def curves(self, duty: Array) -> Tables:
        """T_s, τ1 and τ2 at some inputs."""
        return self.setup.model.tables(self.setup.model.rows_of(duty), self.coefficients)


def solve(setup: Setup) -> Solved:
    """The least-squares unknowns, from our own starts."""
    sketch = setup.drawn.problem()
    ends = [approach(sketch, x) for x in starts(setup.drawn, sketch)]
    kept = apart(ends, sketch.floor)
    kept = [end for end in kept[:RIVALS] if end.cost <= (1 + NEAR) * kept[0].cost + sketch.floor]
    tried = sum(end.evaluations for end in ends)
    return finished(setup, [end.x for end in kept], tried, [end.cost for end in ends])


def apart(ends: Sequence[EndPoint], floor: float) -> list[EndPoint]:
    """Ends of different costs, the best first."""
    found: list[EndPoint] = []
    for end in sorted(ends, key=lambda one: one.cost):
        if all(abs(end.cost - other.cost) > SAME * other.cost + floor for other in found):
            found.append(end)
    return found


def refit(near: Solved, logs: Sequence[RecordedLog]) -> Solved:
    """The minimum next to an earlier one, on other logs of the same kind."""
    setup = setup_of(near.fitted.model, logs, near.fitted.idle_free)
    return finished(replace(setup, extras=near.fitted.extras), [near.x])


def finished(setup: Setup, begin: Sequence[Array], tried: int = 0, costs: Sequence[float] = ()) -> Solved:
    """From near ends to the verdict: solved on the small copy, confirmed, or taken to its end, on every sample."""
    near, held = setup.problem(), all(one.log.stepwise for one in setup.copies)
    ends = [approach(near, x) for x in begin]
    if min(end.cost for end in ends) > near.floor:  # beneath it lies rounding, in which a line search finds no way
        ends = ended(ends, near)
    if not held:  # copies are averages, and their ends near ones
        near = setup.every.problem()
        ends = [approach(near, end.x) for end in ends]
    whole = setup.on_every_sample if held and setup.copies else near.value
    end, predicted, active = polish(near, min(ends, key=lambda one: one.cost), near.value)
    bent = predicted > CONVERGED  # far from a parabola
    if bent:
        near = with_second_derivatives(setup)
        end, predicted, active = polish(near, slsqp(near, end.x), near.value, steps=LONG_WAY)
    if setup.copies and (held or bent):
        end, predicted, active = polish(near, end, whole, finished=SETTLED)
    evaluations = tried + sum(one.evaluations for one in ends) + end.evaluations
    solver = judged(predicted, evaluations, costs or [one.cost for one in ends], [near.names(i) for i in active])
    others = tuple((one.x, one.cost) for one in ends if one.cost > end.cost * (1 + SAME) + near.floor)
    return Solved(setup, end.x, end.cost, solver, others)


def with_second_derivatives(setup: Setup) -> Problem:
    """Its problem with the true curvature, by differences of the exact gradient."""
    problem = setup.problem()

    def exact(x: Array) -> Array:
        cost, _, own = setup.together(x)
        scale = np.sqrt(np.maximum(np.diagonal(own), 1e-300))
        size = np.sqrt(max(cost, problem.floor))
        found = np.empty_like(own)
        for j in range(len(x)):
            step = np.zeros_like(x)
            step[j] = min(SHIFT * max(abs(x[j]), 1e-3), 0.1 * size / scale[j] + 1e-12)
            found[j] = (setup.together(x + step)[1] - setup.together(x - step)[1]) / (2 * step[j])
        return np.asarray(0.5 * (found + found.T))

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
    at = int(solved.setup.places[log].own[0])
    return float(solved.x[at]) if at >= 0 else 0.0
