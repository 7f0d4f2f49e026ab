"""Friction curves fitted again, many at once, in (log T_s, log τ1, log τ2, logit C), each parameter free or held."""

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array
from eaid.fitting.compress import Points
from eaid.fitting.descent import Descent, descend
from eaid.fitting.kernel import level_normal

STEPS, ENOUGH = 25, 1e-10


def refit(points: Points, theta: Array, free: NDArray[np.bool_]) -> Descent:
    """Least costs over the parameters that are `free`, shape (4,), from θ, shape (L, 4), one row a level of `points`.

    τ1 and τ2 that cross are exchanged, unless one of them is held.
    """
    both = np.outer(free, free)

    def look(x: Array) -> tuple[Array, Array, Array]:
        natural = np.exp(np.clip(x, -60, 60)).T
        share = natural[3] = 1 / (1 + 1 / natural[3])
        cost, gradient, curvature = level_normal(natural, points)
        scale = natural.T.copy()
        scale[:, 3] *= 1 - share
        curvature = np.where(both, curvature * (scale[:, :, None] * scale[:, None, :]), np.eye(4))
        return cost, np.where(free, gradient.T * scale, 0.0), curvature

    def within(x: Array, move: Array) -> Array:
        tried = x - np.clip(move, -1.0, 1.0)
        if free[1] and free[2]:
            tried[:, 1:3] = np.sort(tried[:, 1:3], axis=1)
        if free[3]:
            tried[:, 3] = np.clip(tried[:, 3], -7.0, 7.0)
        return tried

    return descend(look, theta, STEPS, ENOUGH, within)


def free_parameters(share_free: bool) -> NDArray[np.bool_]:
    """T_s, τ1 and τ2, and C where it is one too."""
    return np.array([True, True, True, share_free])
