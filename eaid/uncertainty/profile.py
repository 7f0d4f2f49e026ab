"""Lopsided intervals of one level's parameters by profiling its cost, scaled to the scatter that is really there.

With the other parameters refitted, the cost S rises by t² V/[A⁻¹]_kk at the ends of the interval: where the cost is a
parabola in log θ this is θ̂ exp(±t √V) again; where it is not (τ2 of a short record) the interval leans as the data do.
"""

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.fitting.kernel import level_normal
from eaid.models import friction
from eaid.models.parameters import Friction
from eaid.uncertainty.levels import log_jacobian, log_theta

FARTHEST = np.log(1000.0)
"""An end more than a factor of 1000 away counts as none."""
MOST_STEPS = 25
"""Damped Gauss–Newton steps to a least cost."""


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
    for _ in range(MOST_STEPS):
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


def least_of_all(points: Points, theta: Array) -> Array:
    """Least costs of L levels over all four parameters, from K starts (K, L, 4) at once, (K, L)."""
    starts, levels = theta.shape[:2]
    shared = len(points.t_s) == 1
    rows = np.tile(np.arange(levels), starts)
    points = Points(
        points.t_s if shared else points.t_s[rows], points.y[rows], points.w if len(points.w) == 1 else points.w[rows]
    )

    def look(x: Array) -> tuple[Array, Array, Array]:
        """Cost (N,), gradient by log θ (N, 4), Gauss–Newton curvature (N, 4, 4)."""
        natural = np.exp(np.clip(x, -60, 60)).T
        share = 1 / (1 + 1 / natural[3])
        natural[3] = share
        cost, gradient, H = level_normal(natural, points)
        scale = natural.T.copy()
        scale[:, 3] *= 1 - share
        return cost, gradient.T * scale, H * (scale[:, :, None] * scale[:, None, :])

    x = theta.reshape(-1, 4)
    cost, gradient, H = look(x)
    damping, going = np.full(len(x), 1e-6), np.full(len(x), True)
    for _ in range(MOST_STEPS):
        size = np.sqrt(np.maximum(np.einsum("nii->ni", H), 1e-300))
        normal = H / (size[:, :, None] * size[:, None, :]) + damping[:, None, None] * np.eye(4)
        step = np.linalg.solve(normal, (gradient / size)[:, :, None])[:, :, 0] / size
        tried = x - np.clip(step, -1.0, 1.0)
        tried[:, 1:3] = np.sort(tried[:, 1:3], axis=1)
        tried[:, 3] = np.clip(tried[:, 3], -7.0, 7.0)
        found, slope, bent = look(tried)
        better = going & (found <= cost)
        going &= ~(better & (cost - found <= 1e-9 * cost))
        x, cost = np.where(better[:, None], tried, x), np.where(better, found, cost)
        gradient, H = np.where(better[:, None], slope, gradient), np.where(better[:, None, None], bent, H)
        damping = np.where(better, np.maximum(damping / 10, 1e-9), damping * 10)
        if not going.any():
            break
    return cost.reshape(starts, levels)


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
