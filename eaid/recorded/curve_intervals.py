"""Intervals of the curves of a recorded fit, T_s, τ1 and τ2 at some inputs: by the parabola where they are narrow, else
where the residuals reject an end (score test)."""

from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array
from eaid.estimate.forms import RECORDS_FREE
from eaid.estimate.solver import approach, newton_step, rounding
from eaid.estimate.spread import free_inverse, score_test_end
from eaid.findings import Finding, finding
from eaid.levels.friction import HELD_BY
from eaid.plant.steps import decay
from eaid.recorded.engagements import EngagementScatter
from eaid.recorded.from_logs import Setup, Solved
from eaid.recorded.log_intervals import Spread
from eaid.results.common import Interval
from eaid.results.models import CurveLevel, LevelIntervals

FARTHEST_SCORE = np.log(20.0)  # An end farther off than this in log q is none
DAMPING = 1e-6  # Part of the curvature added to it, so that next to collinear unknowns do not run away


def score_end(solved: Solved, noise: EngagementScatter, x: Array, covariance: Array, g: Array, reach: float) -> float:
    """How far the end of log g'x lies where it is moved outward until the residuals reject it; ∞: they never do.

    On the copies on which the fit was looked for, x being its end there and `covariance` that of `newton`, with all
    that g'x leaves free at its least cost; `reach` is the half-width by the parabola, below 0 for the lower end.
    """
    problem, value, side = solved.fitted.problem(), float(g @ x), float(np.sign(reach))
    usual, place = float(g @ covariance @ g), x

    def at(factor: float) -> tuple[Array, float] | None:
        nonlocal place
        least = value * np.exp(factor * reach)
        bound = replace(problem, A=np.vstack([problem.A, side * g]), b=np.append(problem.b, side * least))
        moved = place + covariance @ g * (least - float(g @ place)) / usual
        _, gradient, curvature = problem.normal(moved)
        if not np.isfinite(curvature).all():
            return None
        damped = curvature + DAMPING * np.diag(np.diagonal(curvature))
        place = approach(bound, moved + newton_step(bound, moved, gradient, damped).d).x
        if float(g @ place) <= 0 or not np.isfinite(problem.normal(place)[2]).all():
            return None
        step, there = newton(solved.fitted, noise, place)
        wider = max(float(g @ there @ g) / usual, 1e-300) ** 0.5
        return np.log([float(g @ place)]), side * float(g @ step) / (abs(reach) * value * wider)

    with np.errstate(over="ignore", invalid="ignore"):  # far out no plant is left
        end = score_test_end(at)
    return np.inf if end is None else abs(float(end[0]) - float(np.log(value)))


def newton(setup: Setup, noise: EngagementScatter, x: Array) -> tuple[Array, Array]:
    """How far the residuals at x are from where they lead, (n,), and its covariance by the noise's density, (n, n).

    In the directions that the constraints on which x lies leave free.
    """
    problem, n = setup.problem(), setup.size
    H, omega, score = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    for log, drive in enumerate(setup.drives):
        J, r = setup.jacobian(x, log)
        counted, own = drive.w > 0, int(setup.places[log].own[0])
        torque = drive.y[counted] - (x[own] if own >= 0 else 0.0) + r / np.sqrt(drive.w[counted])
        at = setup.places[log].columns
        H[np.ix_(at, at)] += J.T @ J
        omega[np.ix_(at, at)] += (J * (noise.sensor_nm2_s + noise.ripple_s * torque**2)[:, None]).T @ J
        score[at] += J.T @ r
    back = free_inverse(H, problem.A[problem.A @ x - problem.b <= rounding(problem)])
    return back @ score, back @ omega @ back


LIMITS_PCT = {"Ts": 10.0, "tau1": 30.0, "tau2": 50.0}  # Half-widths beyond which the logs do not fix an input
WIDEST_ENDS = 10.0  # An interval wider than this factor says nothing
OF_SOME_INPUTS = ("tau2-endless", "Ts-zero")  # Constraints that say nothing of the inputs where they do not hold
NO_VALUE = 1e-9  # Of the largest value of a curve, below which one is 0 but for rounding
PARABOLA = 0.05  # Half-width in the logarithm up to which a parabola is a picture of the cost


def held_curves(solved: Solved) -> set[str]:
    """Which of T_s, τ1, τ2 an active constraint holds at some input."""
    held = solved.setup.limits.active(i for i in solved.active.tolist() if i < len(solved.setup.limits.b))
    # an endless τ2 is none of the inputs where it is not, and a T_s of 0 next to rest none of those above
    return {name for code in held if code not in OF_SOME_INPUTS for name in HELD_BY.get(code, ())[-1:]}


@dataclass(frozen=True, eq=False)
class CurveSpread:
    """T_s, τ1, τ2 at some inputs with their 95 % intervals; shapes (3, L)."""

    duty: Array
    values: Array
    low: Array
    high: Array
    half_width: Array  # Relative half-widths, e^h − 1; infinite where nothing is known

    @property
    def rows(self) -> tuple[CurveLevel, ...]:
        """The same input by input, without intervals that say nothing."""
        rows = []
        for i, level in enumerate(self.duty.tolist()):
            ends: list[Interval] = [
                (float(low), float(high)) if half < WIDEST_ENDS else None
                for low, high, half in zip(self.low[:, i], self.high[:, i], self.half_width[:, i], strict=True)
            ]
            Ts, tau1, tau2 = (None if np.isnan(one) else one for one in self.values[:, i].tolist())
            rows.append(CurveLevel(level, Ts, tau1, tau2, LevelIntervals(*ends)))
        return tuple(rows)

    @property
    def findings(self) -> list[Finding]:
        """Inputs at which a curve is all but unknown."""
        found = []
        for k, ((name, limit), half_width) in enumerate(zip(LIMITS_PCT.items(), self.half_width, strict=True)):
            if np.isnan(self.values[k]).all():  # the plant has none
                continue
            wide = self.duty[~(100 * half_width <= limit)]
            if len(wide):
                found.append(finding("input-leaves-tau-open", "nonlinear", wide, parameter=name, limit_pct=limit))
        return found


def curves(solved: Solved, uncertainty: Spread, duty: Array) -> CurveSpread:
    """Intervals of log T_s, log τ1, log τ2 at some inputs within the range."""
    slopes = solved.setup.slopes(duty)
    values = slopes @ solved.x
    constrained = held_curves(solved)  # what a constraint holds is not estimated
    noise, direct = uncertainty.scatter, solved.instruments is None and solved.beside is None
    x = approach(solved.fitted.problem(), solved.x).x if direct else solved.x
    covariance = newton(solved.fitted, noise, x)[1]
    off = np.full((2, *values.shape), np.inf)  # both ends in log, downwards and upwards
    names = tuple(LIMITS_PCT)
    none = NO_VALUE * np.abs(values).max(axis=1, keepdims=True)  # what is no more than rounding of the largest
    for k, i in np.argwhere(values > none).tolist():
        half = uncertainty.of(slopes[k, i])
        if names[k] in constrained or (k and values[k, i] > RECORDS_FREE * solved.setup.longest_s):
            continue  # no log tells it
        off[:, k, i] = half / values[k, i]
        if direct and PARABOLA < half / values[k, i] < FARTHEST_SCORE:
            reach = half / values[k, i]
            off[:, k, i] = [score_end(solved, noise, x, covariance, slopes[k, i], side * reach) for side in (-1, 1)]
    off[off > FARTHEST_SCORE] = np.inf
    setup = solved.setup
    share = float(solved.x[setup.model.size - 1]) if setup.model.share is None else setup.model.share
    unseen = np.where(np.isinf(off[:, 2]).any(axis=0) & (values[2] > setup.longest_hold_s), 1 - share, 0.0)
    # a slow part that no hold shows may as well be none: T_s is then what the holds have reached
    off[0, 0] = np.maximum(
        off[0, 0], -np.log1p(-unseen * decay(np.array(setup.longest_hold_s), np.maximum(values[2], 1e-300)))
    )
    values = np.where(slopes.any(axis=2), values, np.nan)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        low, high = values * np.exp(-off[0]), values * np.exp(off[1])
        wide = np.where(low > 0, np.sqrt(high / low) - 1, np.inf)
    return CurveSpread(duty, values, low, high, wide)
