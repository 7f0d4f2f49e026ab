"""Ends of a wide interval, about which a parabola is no picture of the cost: values that a test does not reject.

With q = g'x (T_s, τ1 or τ2 at an input) held at a value, the others fitted, x̃ is where the cost is least and

    d = g' H⁻¹ J' r at x̃,   |d| ≤ t √(V v(x̃)/v(x̂)),   v = g' H⁻¹ (∫ J J' (s0 + s1 T²) dt) H⁻¹ g

d is the step that the residuals ask for (Rao's score test), V the variance of q by the coloured residuals at the least
cost x̂, v what the noise's density makes of it, here and there. Of a parabola the ends are q ± t √V.
"""

from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.fitting.problem import Problem, newton_step
from eaid.fitting.solver import approach
from eaid.recorded.intervals import Spread, inverse
from eaid.recorded.problem import Setup
from eaid.recorded.scatter import Scatter
from eaid.recorded.solve import Solved, idle_of

TRIES = 6
"""Values that are tested, at most, for one end."""
CLOSE = 0.02
"""An end is where the test's ratio is this near to 1."""
STEPS = 10
"""Newton steps to one value, at most …"""
SETTLED = 1e-4
"""… until one is worth less than this part of the cost that lies between the value and the least cost."""
FARTHEST = np.log(20.0)
"""An end farther off than this in log q is none."""


@dataclass(frozen=True, eq=False)
class ScoreTest:
    """The cost about its minimum, on the copies on which the fit was looked for."""

    setup: Setup
    problem: Problem
    x: Array
    idle: tuple[float, ...]
    """Idle output of each log."""
    pull: Array
    """H⁻¹ where the constraints leave it free."""
    noise: Scatter

    def ends(self, g: Array, half: float) -> tuple[float, float]:
        """How far the ends lie from g'x in its logarithm, given its half-width by the parabola; infinite: none."""
        usual = self.step(self.x, g)[1]
        low, high = (self._end(g, half, usual, side) for side in (-1.0, 1.0))
        return low, high

    def _end(self, g: Array, half: float, usual: float, side: float) -> float:
        """Regula falsi in log q for the ratio of the step to what the test allows, which is 0 at the least cost."""
        known, place = [(0.0, 0.0)], half / float(g @ self.x)
        for _ in range(TRIES):
            place = min(place, FARTHEST)
            x = self.held(g, side * place)
            if x is None:
                return np.inf
            step, variance = self.step(x, g)
            ratio = abs(step) / (half * (variance / usual) ** 0.5)
            if abs(ratio - 1) <= CLOSE:
                break
            if place == FARTHEST and ratio < 1:
                return np.inf
            known.append((place, ratio))
            below = max((row for row in known if row[1] < 1), key=lambda row: row[0])
            above = min((row for row in known if row[1] >= 1), key=lambda row: row[0], default=None)
            if above is None:
                place *= min(max(1 / max(ratio, 1e-3), 1.2), 3.0)
            else:
                place = below[0] + (above[0] - below[0]) * (1 - below[1]) / (above[1] - below[1])
        return place

    def held(self, g: Array, place: float) -> Array | None:
        """Where the cost is least with log g'x off its least-squares value by `place`; None where none is known."""
        value, side, p = float(g @ self.x), np.sign(place), self.problem
        off = value * np.expm1(place)
        bound = replace(p, A=np.vstack([p.A, side * g]), b=np.append(p.b, side * (value + off)))
        x, size = self.x, off**2 / float(g @ self.pull @ g)
        for _ in range(STEPS):
            _, gradient, curvature = p.normal(x)
            if not np.isfinite(curvature).all():
                return None
            move = newton_step(bound, x, gradient, curvature).d
            x = x + move
            if move @ curvature @ move <= SETTLED * size:
                break
        return x

    def step(self, x: Array, g: Array) -> tuple[float, float]:
        """The step that the residuals ask for, and its variance by the density of the noise."""
        n = self.setup.size
        H, omega, score = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
        for log, drive in enumerate(self.setup.drives):
            J, r = self.setup.jacobian(x, log)
            counted = drive.w > 0
            torque = drive.y[counted] - self.idle[log] + r / np.sqrt(drive.w[counted])
            at = self.setup.places[log].columns
            H[np.ix_(at, at)] += J.T @ J
            omega[np.ix_(at, at)] += (J * (self.noise.sensor_nm2_s + self.noise.ripple_s * torque**2)[:, None]).T @ J
            score[at] += J.T @ r
        along = inverse(H) @ g
        return float(along @ score), float(along @ omega @ along)


def score_test(solved: Solved, uncertainty: Spread) -> ScoreTest:
    """The test about the end of a fit."""
    problem = solved.fitted.problem()
    idle = tuple(idle_of(solved, log) for log in range(len(solved.fitted.drives)))
    return ScoreTest(solved.fitted, problem, approach(problem, solved.x).x, idle, uncertainty.pull, uncertainty.scatter)
