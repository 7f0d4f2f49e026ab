"""Equal and sd weights side by side: where the two fits part beyond their intervals, and which to believe.

Weights by the spread of the repeats keep a level whose runs scatter from bending the time constants of the others.
Gain scatter makes the spread rise with the torque; where it does not, the weights are the chance of a few repeats. A
level's variance s² of R repeats is σ² χ²/(R − 1), so log s has the variance ψ'((R − 1)/2)/4 by chance alone.
"""

import numpy as np
from scipy.special import chdtri, polygamma

from eaid.arrays import Array
from eaid.findings import Finding, Value, finding
from eaid.results.linear import Linear, Pooled, PooledIntervals
from eaid.results.nonlinear import Agreement, Disagreement, Estimate, Nonlinear
from eaid.uncertainty.joint import Coefficients, curves_apart
from eaid.uncertainty.level_statistics import LevelStatistics
from eaid.uncertainty.student_t import Degrees

BETWEEN = ("equal", "sd")
RISES = 2.0
"""Standard errors by which the spread has to rise with the torque."""


def agreement(
    fit: Nonlinear, own: Coefficients, other: Coefficients | None, degrees: Degrees, stats: LevelStatistics
) -> Agreement:
    """Where the curves of the two weightings lie outside each other's intervals, which to believe, and why.

    `own`: the fit under the weights that were asked for; `other`: under the other ones. Both with the scatter alone.
    """
    if other is None:
        return Agreement(BETWEEN, fit.weights, "alone")
    equal, sd = (own, other) if fit.weights == "equal" else (other, own)
    held = {*equal.constrained, *sd.constrained}
    apart = tuple(one for one in curves_apart(equal, sd, degrees, stats.duty_pct) if one.parameter not in held)
    if not apart:
        return Agreement(BETWEEN, "either", "agree")
    if rise_of_spread(stats) > RISES:
        return Agreement(BETWEEN, "sd", "spread-rises", apart)
    return Agreement(BETWEEN, "equal", "spread-is-chance", apart)


def rise_of_spread(stats: LevelStatistics) -> float:
    """Slope of log s over log torque in standard errors of chance; s: rms spread of a level's repeats."""
    spread = np.array([np.sqrt(np.mean(level.sd**2)) for level in stats.levels])
    torque = np.array([np.abs(level.mean[-max(1, len(level.mean) // 10) :]).mean() for level in stats.levels])
    spare = np.array([len(level.runs) - 1 for level in stats.levels], dtype=float)
    if not ((spread > 0) & (torque > 0)).all():
        return 0.0
    x = np.log(torque) - np.log(torque).mean()
    if x @ x == 0:
        return 0.0
    return float(x @ np.log(spread) / np.sqrt(x**2 @ (polygamma(1, spare / 2) / 4)))


def linear_agreement(fit: Linear, own: PooledIntervals, other: PooledIntervals | None) -> Agreement:
    """The same of the pooled a0, b0, c0, whose 95 % intervals are `own` and `other`."""
    beside = fit.other_weights
    if beside is None or other is None:
        return Agreement(BETWEEN, fit.weights, "alone")
    apart = []
    for name in ("a0", "b0", "c0"):
        pair = [(getattr(fit, name), getattr(own, name)), (getattr(beside, name), getattr(other, name))]
        (one, first), (two, second) = pair if fit.weights == "equal" else pair[::-1]
        if first is None or second is None:
            continue
        if abs(one - two) > max((first[1] - first[0]) / 2, (second[1] - second[0]) / 2):
            apart.append(Disagreement(name, (), None, one, two, first, second))
    if not apart:
        return Agreement(BETWEEN, "either", "agree")
    return Agreement(BETWEEN, "equal", "one-time-constant", tuple(apart))


def weights_array(fit: Estimate | Pooled) -> Array | None:
    """A fit's level weights as an array; None where all are alike."""
    return None if fit.level_weights is None else np.array(fit.level_weights)


def findings(subject: str, fit: Estimate | Pooled, says: Agreement, stats: LevelStatistics) -> list[Finding]:
    """Where equal and sd weights part, unless the believed ones were asked for."""
    if not says.disagreements or says.believe == fit.weights:
        return []
    first = says.disagreements[0]
    repeats = min(len(level.runs) for level in stats.levels)
    # the factors within which so few repeats tell a level's spread
    low, high = (float(np.sqrt((repeats - 1) / chdtri(repeats - 1, p))) for p in (0.025, 0.975))
    estimates: dict[str, Value] = {"equal": first.one, "sd": first.other, "worst": first.worst}
    spread: dict[str, Value] = {"repeats": repeats, "low": low, "high": high}
    verdict = {"parameter": first.parameter, "believe": says.believe, "because": says.because}
    return [finding("weights-part", subject, first.levels, **estimates, **spread, **verdict)]
