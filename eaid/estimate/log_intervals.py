"""Intervals of a recorded fit: what its residuals, coloured as they are, leave open about any function of its unknowns.

    V = H⁻¹ Ω H⁻¹',   H = Σ Z'J,   Ω = Σ_f S0 |F(Z)|² + S1 |F(Z T)|²,   the variance of Σ_k Z_k' r_k

Z is J but where an instrument stands in for it. r is white and coloured noise of the sensor, and noise that goes with
the output T: S(f) = S0(f) + T² S1(f), both spectra smoothed. A function's variance has two degrees of freedom for each
line of the spectra that carries it (Satterthwaite). Where the logs hold four engagements or more (stretches under load
between returns to rest, and whole logs) and their gains differ, these are taken out of r, and what they do is added:
σ² H⁻¹ Σ s s' H⁻¹, s = Σ Z T of an engagement. Directions that an active constraint holds are left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eaid.arrays import Array, scaled_inverse
from eaid.estimate.forms import RECORDS_FREE
from eaid.estimate.friction import HELD_BY
from eaid.estimate.from_logs import Setup, Solved, idle_of
from eaid.estimate.noise import Lines, Piece, Scatter, by_spectrum, piece_of, scatter_of
from eaid.estimate.solver import approach, newton_step
from eaid.estimate.spread import free_inverse, rejected, t_quantile
from eaid.findings import Finding, finding
from eaid.results.common import Interval
from eaid.results.fit import CurveLevel, LevelIntervals

SEEN = 2e-3  # Gains of engagements that noise makes so different more rarely than this scatter


@dataclass(frozen=True, eq=False)
class Spread:
    """What is needed for the variance of any function of the unknowns."""

    noise: Array  # Covariance of the unknowns by the noise
    lines: tuple[Lines, ...]  # What it rests on, log by log
    between: Array  # Covariance by scatter between engagements
    scatter: Scatter
    pull: Array  # H⁻¹ where the constraints leave it free

    @np.errstate(over="ignore", invalid="ignore")  # what nothing determines has no bound
    def variance(self, gradient: Array) -> tuple[float, float]:
        """Variance of a function with that gradient, and its degrees of freedom."""
        along = self.pull.T @ gradient
        within = max(float(gradient @ self.noise @ gradient), 0.0)
        parts = np.array([one.degrees(along) for one in self.lines])  # variance and degrees of freedom of each log
        share = parts[:, 0] / max(float(parts[:, 0].sum()), 1e-300)
        degrees = 1 / max(float((share**2 / parts[:, 1]).sum()), 1e-3)
        between = max(float(gradient @ self.between @ gradient), 0.0)
        if between == 0.0:
            return within, degrees
        total = within + between  # degrees of freedom of a sum of variances (Satterthwaite)
        return total, total**2 / (within**2 / degrees + between**2 / (self.scatter.count - 1))

    def of(self, gradient: Array) -> float:
        """Half-width of the 95 % interval of a function with that gradient."""
        variance, degrees = self.variance(gradient)
        return t_quantile(degrees) * float(np.sqrt(variance))

    @property
    def covariance(self) -> Array:
        """One covariance for drawing."""
        return np.asarray(self.noise + self.between)


@np.errstate(over="ignore", invalid="ignore")  # what nothing determines has no bound
def spread(solved: Solved) -> Spread:
    """Everything that intervals need where a fit ended."""
    setup, x = solved.setup, solved.x
    clean = setup if solved.instruments is None else replace(setup, drives=solved.instruments)
    n = setup.size
    H = np.zeros((n, n))
    pieces = []
    scatter = scatter_of(solved)
    residuals = scatter.residuals if scatter.chance <= SEEN else solved.missed
    for log, drive in enumerate(setup.drives):
        J, r = setup.jacobian(x, log)[0], residuals[log] * np.sqrt(drive.w[drive.w > 0])
        Z = J if solved.instruments is None else clean.jacobian(x, log)[0]
        at = setup.places[log].columns
        H[np.ix_(at, at)] += Z.T @ J
        pieces.append(piece_of(Z, r, at, n, drive, idle_of(solved, log)))
    pull = free_inverse(H, solved.setup.problem().A[solved.active])
    lines = tuple(by_spectrum(one, pull) for one in pieces)
    noise = pull @ sum((one.total for one in lines), np.zeros((n, n))) @ pull.T
    between = _between(pieces, pull) * scatter.gain**2 * (scatter.chance <= SEEN)
    return Spread(noise, lines, between, scatter, pull)


def _between(pieces: Sequence[Piece], pull: Array) -> Array:
    """What gains of standard deviation 1 do, one an engagement: H⁻¹ Σ_e s s' H⁻¹, s = Σ Z T of an engagement."""
    ends = [np.flatnonzero(np.append(True, np.diff(one.engaged) != 0)) for one in pieces]
    S = np.vstack([np.add.reduceat(one.scaled, at) for one, at in zip(pieces, ends, strict=True)]) @ pull.T
    return np.asarray(S.T @ S)


STEPS = 3  # Newton steps to the least cost
FARTHEST = np.log(20.0)  # An end farther off than this in log q is none


def score_end(solved: Solved, noise: Scatter, x: Array, covariance: Array, g: Array, reach: float) -> float:
    """How far the end of log g'x lies where it is moved outward until the residuals reject it; ∞: they never do.

    On the copies on which the fit was looked for, x being its end there and `covariance` that of `newton`, with all
    that g'x leaves free at its least cost; `reach` is the half-width by the parabola, below 0 for the lower end.
    """
    problem, value, side = solved.fitted.problem(), float(g @ x), float(np.sign(reach))
    usual, place = float(g @ covariance @ g), x

    def at(factor: float) -> tuple[Array, float] | None:
        nonlocal place
        least = side * value * np.exp(factor * reach)
        bound = replace(problem, A=np.vstack([problem.A, side * g]), b=np.append(problem.b, least))
        for _ in range(STEPS):
            _, gradient, curvature = problem.normal(place)
            if not np.isfinite(curvature).all():
                return None
            place = place + newton_step(bound, place, gradient, curvature).d
        step, there = newton(solved.fitted, noise, place)
        wider = max(float(g @ there @ g) / usual, 1e-300) ** 0.5
        return np.log([float(g @ place)]), side * float(g @ step) / (abs(reach) * value * wider)

    end = rejected(at)
    return np.inf if end is None else abs(float(end[0]) - float(np.log(value)))


def newton(setup: Setup, noise: Scatter, x: Array) -> tuple[Array, Array]:
    """How far the residuals at x are from where they lead, (n,), and its covariance by the noise's density, (n, n)."""
    n = setup.size
    H, omega, score = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    for log, drive in enumerate(setup.drives):
        J, r = setup.jacobian(x, log)
        counted, own = drive.w > 0, int(setup.places[log].own[0])
        torque = drive.y[counted] - (x[own] if own >= 0 else 0.0) + r / np.sqrt(drive.w[counted])
        at = setup.places[log].columns
        H[np.ix_(at, at)] += J.T @ J
        omega[np.ix_(at, at)] += (J * (noise.sensor_nm2_s + noise.ripple_s * torque**2)[:, None]).T @ J
        score[at] += J.T @ r
    back = scaled_inverse(H)
    return back @ score, back @ omega @ back


LIMITS_PCT = {"Ts": 10.0, "tau1": 30.0, "tau2": 50.0}  # Half-widths beyond which an input was never asked about
WIDEST = 10.0  # An interval wider than this factor says nothing
PARABOLA = 0.05  # Half-width in the logarithm up to which a parabola is a picture of the cost


def held(solved: Solved) -> set[str]:
    """Which of T_s, τ1, τ2 an active constraint holds at some input."""
    held = solved.setup.limits.active(i for i in solved.active.tolist() if i < len(solved.setup.limits.b))
    # an endless τ2 is none of the inputs where it is not
    return {name for code in held if code != "tau2-endless" for name in HELD_BY.get(code, ())[-1:]}


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
                (float(low), float(high)) if half < WIDEST else None
                for low, high, half in zip(self.low[:, i], self.high[:, i], self.half_width[:, i], strict=True)
            ]
            Ts, tau1, tau2 = self.values[:, i].tolist()
            rows.append(CurveLevel(level, Ts, tau1, tau2, LevelIntervals(*ends)))
        return tuple(rows)


def curves(solved: Solved, uncertainty: Spread, duty: Array) -> CurveSpread:
    """Intervals of log T_s, log τ1, log τ2 at some inputs within the range."""
    slopes = solved.setup.slopes(duty)
    values = slopes @ solved.x
    constrained = held(solved)  # what a constraint holds is not estimated
    noise, direct = uncertainty.scatter, solved.instruments is None
    x = approach(solved.fitted.problem(), solved.x).x if direct else solved.x
    covariance = newton(solved.fitted, noise, x)[1]
    off = np.full((2, *values.shape), np.inf)  # both ends in log, downwards and upwards
    names = tuple(LIMITS_PCT)
    for k, i in np.argwhere(values > 0).tolist():
        half = uncertainty.of(slopes[k, i])
        if names[k] in constrained or (k and values[k, i] > RECORDS_FREE * solved.setup.longest_s):
            continue  # no log tells it
        off[:, k, i] = half / values[k, i]
        if direct and PARABOLA < half / values[k, i] < FARTHEST:
            reach = half / values[k, i]
            off[:, k, i] = [score_end(solved, noise, x, covariance, slopes[k, i], side * reach) for side in (-1, 1)]
    off[off > FARTHEST] = np.inf
    setup = solved.setup
    share = float(solved.x[setup.model.size - 1]) if setup.model.share is None else setup.model.share
    unseen = np.where(np.isinf(off[:, 2]).any(axis=0) & (values[2] > setup.longest_hold_s), 1 - share, 0.0)
    # a slow part that no hold shows may as well be none: T_s is then what the holds have reached
    off[0, 0] = np.maximum(
        off[0, 0], -np.log1p(-unseen * np.exp(-setup.longest_hold_s / np.maximum(values[2], 1e-300)))
    )
    values = np.where(slopes.any(axis=2), values, np.nan)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        low, high = values * np.exp(-off[0]), values * np.exp(off[1])
        wide = np.where(low > 0, np.sqrt(high / low) - 1, np.inf)
    return CurveSpread(duty, values, low, high, wide)


def never_asked(known: CurveSpread) -> list[Finding]:
    """Inputs at which a curve is all but unknown."""
    found = []
    for (name, limit), half_width in zip(LIMITS_PCT.items(), known.half_width, strict=True):
        wide = known.duty[~(100 * half_width <= limit)]
        if len(wide):
            found.append(finding("not-told-by-the-input", "nonlinear", wide, parameter=name, limit_pct=limit))
    return found
