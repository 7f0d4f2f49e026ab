"""Many small least-squares problems at once, by Gauss–Newton steps with Levenberg's and Marquardt's damping.

Row i goes from x_i to x_i − (H_i + λ_i diag H_i)⁻¹ g_i where its cost falls there, and λ_i with it; elsewhere it stays,
and λ_i grows.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from eaid.arrays import Array

Look: TypeAlias = Callable[[Array], tuple[Array, Array, Array]]
"""x (N, n) → cost (N,), gradient (N, n), curvature (N, n, n)."""


@dataclass(frozen=True, eq=False)
class Descent:
    """Where N rows have come to."""

    x: Array
    """(N, n)."""
    cost: Array
    """(N,)."""
    gradient: Array
    """(N, n)."""
    curvature: Array
    """(N, n, n)."""
    predicted: Array
    """By how much one more step would lower the cost, (N,)."""


def solved(H: Array, right: Array) -> Array:
    """x of H x = right for each of N rows, (N, n)."""
    return np.asarray(np.linalg.solve(H, right[:, :, None])[:, :, 0], dtype=np.float64)


def descend(
    look: Look, x: Array, steps: int, enough: float, within: Callable[[Array, Array], Array] = np.subtract
) -> Descent:
    """At most `steps` steps of every row; they end where one more predicts less than `enough` of the cost.

    That is asked of the rows that still move. `within` takes x and the step to be taken off it to the place that is
    tried.
    """
    cost, gradient, curvature = look(x)
    damping, moved = np.full(len(x), 1e-3), np.full(len(x), True)
    for step in range(steps + 1):
        normal = curvature.copy()
        diagonal = np.einsum("nii->ni", normal)
        diagonal += damping[:, None] * diagonal + 1e-300
        move = solved(normal, gradient)
        predicted = 0.5 * (gradient * move).sum(axis=1)
        if step == steps or (moved.any() and (predicted <= enough * cost)[moved].all()):
            break
        tried = within(x, move)
        found, slope, bent = look(tried)
        moved = found < cost
        if moved.all():
            x, cost, gradient, curvature = tried, found, slope, bent
        else:
            x, cost = np.where(moved[:, None], tried, x), np.where(moved, found, cost)
            gradient = np.where(moved[:, None], slope, gradient)
            curvature = np.where(moved[:, None, None], bent, curvature)
        # where τ1 and τ2 have met, two rows of the curvature are one, and only damping keeps it from being singular
        damping = np.where(moved, np.maximum(damping / 10, 1e-12), damping * 10)
    return Descent(x, cost, gradient, curvature, predicted)


def last_step(cost: Array, gradient: Array, curvature: Array, inside: NDArray[np.bool_]) -> tuple[Array, Array]:
    """The Newton step of each row, (N, n), and what it predicts relative to the cost, (N,); no step, ∞ if not `inside`.

    Where that is next to nothing the row has ended, and the step is still taken: the unknowns show it, the cost does
    not.
    """
    H = np.where(inside[:, None, None], curvature, np.eye(gradient.shape[1]))
    step = np.where(inside[:, None], solved(H, gradient), 0.0)
    predicted = 0.5 * (gradient * step).sum(axis=1) / np.where(inside, cost, 1.0)
    return step, np.where(inside, predicted, np.inf)
