"""Lopsided intervals of one level's parameters by profiling its cost, scaled to the scatter that is really there.

With the other parameters refitted, the cost S rises by t² V/[A⁻¹]_kk at the ends of the interval: where the cost is a
parabola in log θ this is θ̂ exp(±t √V) again; where it is not (τ2 of a short record) the interval leans as the data do.
"""

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.uncertainty.levels import log_jacobian, log_theta

FARTHEST = np.log(1000.0)
"""An end more than a factor of 1000 away counts as none."""


def profile_interval(
    points: Points, curve: Friction, k: int, rise: float, share_free: bool = False
) -> tuple[float, float]:
    """Ends of the interval of parameter k on its log (logit) scale, −inf or inf where the cost never rises by `rise`.

    `points` is one level (1, P); `rise` is in the cost's own unit, above the least cost.
    """
    start = log_theta(curve, share_free)
    least = _cost(points, start, curve.C)[0]
    return _end(points, start, curve.C, k, least + rise, -1.0), _end(points, start, curve.C, k, least + rise, 1.0)


def _cost(points: Points, theta: Array, share: float) -> tuple[float, Array, Array]:
    """Cost, weighted residuals and weighted Jacobian at log θ."""
    free = len(theta) == 4
    c = float(1 / (1 + np.exp(-theta[3]))) if free else share
    Ts, tau1, tau2 = np.exp(np.clip(theta[:3], -60, 60)).tolist()
    curve = Friction(Ts, tau1, tau2, c)
    root = np.sqrt(points.w[0])
    left = root * (points.y[0] - friction.step_response(curve, points.t_s[0]))
    return float(left @ left), left, log_jacobian(curve, points.t_s[0], free) * root[:, None]


def least(points: Points, theta: Array, share: float, k: int | None = None) -> tuple[float, Array]:
    """Least cost over the parameters, k held where `theta` has it (damped Gauss–Newton), and where it lies."""
    others = [i for i in range(len(theta)) if i != k]
    cost, left, jacobian = _cost(points, theta, share)
    damping = 1e-6
    for _ in range(25):
        J = jacobian[:, others]
        H = J.T @ J
        if not np.isfinite(H).all():
            break
        step = np.linalg.lstsq(H + damping * np.diag(np.diag(H) + 1e-300), J.T @ left, rcond=None)[0]
        tried = theta.copy()
        tried[others] += np.clip(step, -1.0, 1.0)
        tried[1:3] = np.sort(tried[1:3]) if k not in (1, 2) else tried[1:3]
        tried[3:] = np.clip(tried[3:], -7.0, 7.0)
        found = _cost(points, tried, share)
        if found[0] <= cost:
            done = cost - found[0] <= 1e-9 * cost
            theta, (cost, left, jacobian) = tried, found
            damping = max(damping / 10, 1e-9)
            if done:
                break
        else:
            damping *= 10
            if damping > 1e6:
                break
    return cost, theta


def _end(points: Points, start: Array, share: float, k: int, wanted: float, side: float) -> float:
    """Where the profile crosses `wanted`, going one way in growing steps, then halving."""
    inside, theta, step = 0.0, start, 0.02
    while True:
        outside = inside + step
        if outside > FARTHEST:
            return side * np.inf
        tried = theta.copy()
        tried[k] = start[k] + side * outside
        cost, found = least(points, tried, share, k)
        if cost >= wanted:
            break
        inside, theta, step = outside, found, 1.6 * step
    for _ in range(20):
        middle = 0.5 * (inside + outside)
        tried = theta.copy()
        tried[k] = start[k] + side * middle
        cost, found = least(points, tried, share, k)
        if cost >= wanted:
            outside = middle
        else:
            inside, theta = middle, found
        if outside - inside < 1e-3 * outside:
            break
    return float(start[k] + side * 0.5 * (inside + outside))
