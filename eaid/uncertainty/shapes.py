"""Other shapes for the step response of one level, fitted to its mean: stretched and three exponentials.

stretched           T_s (1 − e^(−(t/τ)^β))
three exponentials  Σ A_k (1 − e^(−t/τ_k)), A_k > 0

Both in logarithms, by damped Gauss–Newton from starts about the level's two exponentials of Eq. (3).
"""

from collections.abc import Callable, Sequence

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.models.parameters import Friction

Shape = Callable[[Array, Array], tuple[Array, Array]]
"""(θ, t) → the curve (n,) and its slopes by θ (n, k)."""
FIRST_STEPS, STEPS = 8, 30
"""Steps of every start, and then of the best."""
BETAS = (0.5, 0.8)


def stretched(theta: Array, time_s: Array) -> tuple[Array, Array]:
    """T_s (1 − e^(−a)), a = (t/τ)^β, by (log T_s, log τ, log β)."""
    steady, tau, beta = np.exp(theta)
    with np.errstate(divide="ignore"):
        log_a = beta * np.log(time_s / tau)
    a = np.exp(np.minimum(log_a, 50.0))
    bent = steady * a * np.exp(-a)
    f = -steady * np.expm1(-a)
    return f, np.stack([f, -beta * bent, bent * np.where(a > 0, log_a, 0.0)], axis=1)


def three_exponentials(theta: Array, time_s: Array) -> tuple[Array, Array]:
    """Σ A_k (1 − e^(−t/τ_k)), by (log A_1..3, log τ_1..3)."""
    size, tau = np.exp(theta[:3]), np.exp(theta[3:])
    a = time_s[:, None] / tau
    parts = -size * np.expm1(-a)
    return parts.sum(axis=1), np.concatenate([parts, -size * a * np.exp(-a)], axis=1)


def stretched_starts(curve: Friction) -> list[Array]:
    """About the level's two exponentials."""
    middle = curve.tau1 ** (curve.C) * curve.tau2 ** (1 - curve.C)
    return [np.log([curve.Ts, middle, beta]) for beta in BETAS]


def three_starts(curve: Friction) -> list[Array]:
    """The two exponentials with a third one below, between and above them."""
    fast, slow = curve.C * curve.Ts, (1 - curve.C) * curve.Ts
    between = np.sqrt(curve.tau1 * curve.tau2)
    return [
        np.log([fast / 2, fast / 2, slow, curve.tau1 / 2, curve.tau1 * 1.5, curve.tau2]),
        np.log([fast * 0.8, fast * 0.2, slow, curve.tau1, between, curve.tau2]),
        np.log([fast, slow / 2, slow / 2, curve.tau1, between, curve.tau2 * 2]),
    ]


def best_fit(shape: Shape, starts: Sequence[Array], points: Points) -> tuple[float, Array]:
    """Least cost of a shape over its starts on one level's points (1, P), and where it lies."""
    _, theta = min((_descended(shape, start, points, FIRST_STEPS) for start in starts), key=lambda found: found[0])
    return _descended(shape, theta, points, STEPS)


def _descended(shape: Shape, theta: Array, points: Points, steps: int) -> tuple[float, Array]:
    time_s, root, y = points.t_s[0], np.sqrt(points.w[0]), points.y[0]

    def look(x: Array) -> tuple[float, Array, Array]:
        f, J = shape(x, time_s)
        left = root * (y - f)
        cost = float(left @ left)
        return (cost if np.isfinite(cost) else np.inf), left, J * root[:, None]

    cost, left, J = look(theta)
    damping = 1e-3
    for _ in range(steps):
        H = J.T @ J
        step = np.linalg.lstsq(H + damping * np.diag(np.diag(H) + 1e-300), J.T @ left, rcond=None)[0]
        tried = theta + np.clip(step, -1.0, 1.0)
        found = look(tried)
        if found[0] <= cost:
            done = cost - found[0] <= 1e-6 * cost
            theta, (cost, left, J) = tried, found
            damping = max(damping / 10, 1e-9)
            if done:
                break
        else:
            damping *= 10
            if damping > 1e8:
                break
    return cost, theta
