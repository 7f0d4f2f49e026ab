"""`--weights equal` and `sd` side by side: where the two fits part beyond their intervals, and which to believe.

Weights by the spread of the repeats keep a level whose runs scatter from bending the time constants of the others.
Gain scatter makes the spread rise with the torque; where it does not, the weights are the chance of a few repeats. A
level's variance s² of R repeats is σ² χ²/(R − 1), so log s has the variance ψ'((R − 1)/2)/4 by chance alone.
"""

from typing import Any

import numpy as np
from scipy.special import chdtri, polygamma

from eaid.arrays import Array
from eaid.fitting.result import LinearFit, NonlinearFit
from eaid.uncertainty.joint import Coefficients
from eaid.uncertainty.level_statistics import LevelStatistics
from eaid.uncertainty.student_t import Degrees, t_quantile

SYMBOLS = {"Ts": "T_s", "tau1": "τ1", "tau2": "τ2"}
RISES = 2.0
"""Standard errors by which the spread has to rise with the torque."""


def agreement(
    fit: NonlinearFit,
    own: Coefficients,
    other: Coefficients | None,
    degrees: Degrees,
    stats: LevelStatistics,
    output_unit: str,
) -> dict[str, Any]:
    """Where the curves of the two weightings lie outside each other's intervals, which to believe, and why.

    `own`: the fit under the weights that were asked for; `other`: under the other ones. Both with the scatter alone.
    """
    asked = _name(fit.weights)
    if other is None:
        return {"disagreements": [], "believe": asked, "because": fit.no_other or "there is no other fit beside it"}
    equal, sd = (own, other) if asked == "equal" else (other, own)
    apart = [_apart(equal, sd, degrees[name], name, stats, output_unit) for name in ("Ts", "tau1", "tau2")]
    apart = [one for one in apart if one["levels"]]
    if not apart:
        return {
            "disagreements": [],
            "believe": "either",
            "because": "equal and sd weights agree within their intervals",
        }
    believe, because = _judged(stats)
    return {"disagreements": apart, "believe": believe, "because": because}


def _name(weights: tuple[float, ...] | None) -> str:
    return "equal" if weights is None else "sd"


def _apart(
    equal: Coefficients, sd: Coefficients, degrees: float | Array, name: str, stats: LevelStatistics, unit: str
) -> dict[str, Any]:
    """One parameter at the levels where each fit lies outside the other's interval; the worst level in numbers."""
    duty, t = stats.duty_pct, t_quantile(np.asarray(degrees))
    one, other = equal.at(name, duty), sd.at(name, duty)
    reach = [t * c.log_sd(name, duty) for c in (equal, sd)]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(np.log(one / other)) / np.maximum(*reach)
    estimable = name not in equal.constrained and name not in sd.constrained
    out = np.flatnonzero(ratio > 1) if estimable else np.array([], dtype=int)
    if not len(out):
        return {"parameter": name, "levels": []}
    i = int(out[ratio[out].argmax()])
    with np.errstate(over="ignore"):
        ends = [
            [float(v[i] * np.exp(-r[i])), float(min(v[i] * np.exp(r[i]), 1e60))]
            for v, r in zip((one, other), reach, strict=True)
        ]
    return {
        "parameter": name,
        "levels": duty[out].tolist(),
        "worst": float(duty[i]),
        "equal": float(one[i]),
        "sd": float(other[i]),
        "ci95_equal": ends[0],
        "ci95_sd": ends[1],
        "words": (
            f"{SYMBOLS[name]} at {duty[i]:g} with equal weights {_with(one[i], ends[0])}, "
            f"with sd weights {_with(other[i], ends[1])} {unit if name == 'Ts' else 's'}"
        ),
    }


def _with(value: float, ends: list[float]) -> str:
    return f"{value:.3g} [{ends[0]:.3g}, {ends[1]:.3g}]"


def spread_rises(stats: LevelStatistics) -> tuple[float, float]:
    """Slope of log s over log torque, and its size in standard errors of chance; s: rms spread of a level's repeats."""
    spread = np.array([np.sqrt(np.mean(level.sd**2)) for level in stats.levels])
    torque = np.array([np.abs(level.mean[-max(1, len(level.mean) // 10) :]).mean() for level in stats.levels])
    spare = np.array([len(level.runs) - 1 for level in stats.levels], dtype=float)
    if not ((spread > 0) & (torque > 0)).all():
        return 0.0, 0.0
    x = np.log(torque) - np.log(torque).mean()
    y = np.log(spread)
    if x @ x == 0:
        return 0.0, 0.0
    slope = float(x @ y / (x @ x))
    error = float(np.sqrt(x**2 @ (polygamma(1, spare / 2) / 4)) / (x @ x))
    return slope, slope / error


def _judged(stats: LevelStatistics) -> tuple[str, str]:
    """Which weights to believe, and why."""
    fewest = min(len(level.runs) for level in stats.levels)
    spare = fewest - 1
    low, high = (float(np.sqrt(spare / chdtri(spare, p))) for p in (0.025, 0.975))
    poor = f"from {fewest} repeats a level's spread is known within a factor of {low:.2g} to {high:.2g} only"
    _, size = spread_rises(stats)
    if size > RISES:
        return "sd", (
            "the repeats' spread rises with the torque, and with equal weights the levels that scatter most bend the "
            f"time constants of the others; yet {poor}, so the weights are rough: more repeats sharpen them"
        )
    return "equal", (f"the repeats' spread does not rise with the torque, and {poor}: the sd weights are mostly chance")


def linear_agreement(
    fit: LinearFit, own: dict[str, list[float]], other: dict[str, list[float]] | None, stats: LevelStatistics
) -> dict[str, Any]:
    """The same of the pooled a0, b0, c0, whose 95 % intervals are `own` and `other`."""
    asked = _name(fit.weights)
    if fit.other is None or other is None:
        return {"disagreements": [], "believe": asked, "because": fit.no_other or "there is no other fit beside it"}
    apart = []
    for name in own:
        pair = [(getattr(fit.parameters, name), own[name]), (getattr(fit.other.parameters, name), other[name])]
        (one, first), (two, second) = pair if asked == "equal" else pair[::-1]
        if abs(one - two) > max((first[1] - first[0]) / 2, (second[1] - second[0]) / 2):
            words = f"{name} with equal weights {_with(one, first)}, with sd weights {_with(two, second)}"
            row = {"parameter": name, "equal": one, "sd": two, "ci95_equal": first, "ci95_sd": second, "words": words}
            apart.append(row)
    if not apart:
        because = "equal and sd weights agree within their intervals"
        return {"disagreements": [], "believe": "either", "because": because}
    weights = np.array(fit.weights if fit.weights is not None else fit.other.weights)
    heavy = [f"{stats.levels[i].level:g}" for i in np.argsort(-weights)[:3] if weights[i] > 1]
    errors = (fit.rmse, fit.other.rmse) if asked == "equal" else (fit.other.rmse, fit.rmse)
    because = (
        "one time constant stands for two, so the best values depend on the levels that count: equal weights come "
        f"nearest over all samples (RMSE {errors[0]:.3g} against {errors[1]:.3g}), sd weights follow the levels of "
        f"least spread ({', '.join(heavy)})"
    )
    return {"disagreements": apart, "believe": "equal", "because": because}


def weights_array(weights: tuple[float, ...] | None) -> Array | None:
    """A fit's level weights as an array; None where all are alike."""
    return None if weights is None else np.array(weights)
