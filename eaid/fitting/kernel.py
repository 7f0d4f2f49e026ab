"""Sums over the compressed points of the friction curve, Eq. (3), of all levels at once: cost, gradient, curvature.

Every fit of the curve needs, per level, only the sum of squared residuals and its derivatives by θ = (T_s, τ1, τ2, C);
the chain rule carries them to whatever unknowns a fit has. θ has shape (4, L). In ln τ the fewest operations are
needed: with x = −t/τ, ∂f/∂ln τ1 = T_s C x e^x, and ∂²f/∂(ln τ1)² = −(1 + x) ∂f/∂ln τ1.
"""

import numpy as np

from eaid.arrays import Array
from eaid.fitting.compress import Points


def level_costs(theta: Array, points: Points) -> Array:
    """Σ w (f − y)² alone, shape (…, L), for θ of shape (4, …, L)."""
    Ts, tau1, tau2, share = theta[..., None]
    e1, e2 = np.exp(points.t_s / -tau1), np.exp(points.t_s / -tau2)
    e1 -= e2
    e1 *= share
    e1 += e2
    residual = Ts - Ts * e1
    residual -= points.y
    residual *= points.root_w
    return np.asarray(np.einsum("...p,...p->...", residual, residual))


def level_normal(theta: Array, points: Points) -> tuple[Array, Array, Array]:
    """Cost (L,), gradient by θ (4, L) and Gauss–Newton curvature 2 J'WJ (L, 4, 4), all of one product of slopes."""
    Ts, tau1, tau2, share = theta
    t, y = points.t_s, points.y
    decay = np.exp(t * (-1.0 / theta[1:3])[:, :, None])
    slopes = np.empty((len(Ts), 5, y.shape[1]))  # by T_s, τ1, τ2, C, the middle ones yet to be scaled; the residual
    slopes[:, 0] = 1.0 - share[:, None] * decay[0] - (1.0 - share)[:, None] * decay[1]
    np.multiply(t, decay[0], out=slopes[:, 1])
    np.multiply(t, decay[1], out=slopes[:, 2])
    np.subtract(decay[1], decay[0], out=slopes[:, 3])
    np.subtract(Ts[:, None] * slopes[:, 0], y, out=slopes[:, 4])
    product = (slopes * points.w[:, None, :]) @ slopes.transpose(0, 2, 1)
    scale = np.stack([np.ones_like(Ts), -Ts * share / tau1**2, Ts * (share - 1.0) / tau2**2, Ts], axis=1)
    return _scaled(product, scale)


def weighted_shares(share: Array, points: Points) -> Array:
    """√w C and √w (1 − C) at the points, (2, L, P), from C of each level, (L,), or of all, (1,)."""
    return np.asarray(np.stack([share, 1.0 - share])[:, :, None] * points.root_w)


def log_products(theta: Array, shares: Array, points: Points) -> Array:
    """Σ w s s' per level, (L, 4, 4), with s = ∂f/∂T_s, then ∂f/∂ln τ1 and ∂f/∂ln τ2 over T_s, and f − y.

    `shares` are what `weighted_shares` gives.
    """
    s, _ = _log_slopes(theta, shares, points)
    s = s.transpose(1, 0, 2)
    return s @ s.transpose(0, 2, 1)


def by_tau(theta: Array, products: Array) -> tuple[Array, Array, Array]:
    """What `log_products` gave as `level_normal` does, by (T_s, τ1, τ2) alone: (L,), (3, L), (L, 3, 3)."""
    scale = np.ones((len(products), 3))
    scale[:, 1:] = (theta[0] / theta[1:3]).T
    return _scaled(products, scale)


def by_log(theta: Array, products: Array) -> tuple[Array, Array, Array]:
    """The same by (T_s, ln τ1, ln τ2)."""
    scale = np.ones((len(products), 3))
    scale[:, 1:] = theta[0][:, None]
    return _scaled(products, scale)


def _scaled(products: Array, scale: Array) -> tuple[Array, Array, Array]:
    """Cost, gradient and curvature from the products of k slopes, each yet to be scaled, and the residual."""
    k = scale.shape[1]
    scaled = scale + scale
    curvature = products[:, :k, :k] * scaled[:, :, None]
    curvature *= scale[:, None, :]
    return products[:, k, k], (products[:, k, :k] * scaled).T, curvature


def log_curvature(theta: Array, shares: Array, points: Points) -> tuple[Array, Array]:
    """Gradient, (L, 3), and second derivatives, (L, 3, 3), of the cost by (T_s, ln τ1, ln τ2).

    `shares` as in `log_products`.
    """
    s, x = _log_slopes(theta, shares, points)
    bent = np.einsum("klp,lp->lk", x * s[1:3], s[3])
    s = s.transpose(1, 0, 2)
    products = s @ s.transpose(0, 2, 1)
    _, gradient, H = by_log(theta, products)
    slope, cross = gradient.T, 2.0 * products[:, 1:3, 3]
    H[:, 0, 1:] += cross
    H[:, 1:, 0] += cross
    diagonal = slope[:, 1:] + 2.0 * theta[0][:, None] * bent
    H[:, 1, 1] -= diagonal[:, 0]
    H[:, 2, 2] -= diagonal[:, 1]
    return slope, H


def _log_slopes(theta: Array, shares: Array, points: Points) -> tuple[Array, Array]:
    """√w s of `log_products`, (4, L, P), and −t/τ1, −t/τ2, (2, L, P)."""
    x = points.t_s * (-1.0 / theta[1:3])[:, :, None]
    decay = np.exp(x)
    decay *= shares
    s = np.empty((4, *points.y.shape))
    np.subtract(points.root_w, decay[0], out=s[0])
    s[0] -= decay[1]
    np.multiply(x, decay, out=s[1:3])
    np.multiply(theta[0, :, None], s[0], out=s[3])
    s[3] -= points.root_y
    return s, x
