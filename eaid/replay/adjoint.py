"""Cost of a duty on a reference, and its gradient over every sample of the duty, by the adjoint of the plant.

    cost = Σ w_k (T_k − r_k)²,   x_{k+1} = x_k + (1 − e^(−dt/τ)) p,   p = target − x the pull; for each of the two parts
    ∂x_{k+1}/∂u = (1 − e^(−dt/τ)) p' − e^(−dt/τ) dt/τ² τ' p,            ∂x_{k+1}/∂x_k = e^(−dt/τ)

p' and τ' are differences of `plant_pull`, whose polynomials they meet to rounding, one-sided at a limit of the duty.
Floats, arrays and `plant_pull` only: numba compiles it.
"""

import math

from eaid.arrays import Array
from eaid.replay.plant import PlantParameters, plant_pull

NUDGE = 1e-3
"""Difference of duty for a slope [%]."""


def cost_and_gradient(
    plant: PlantParameters,
    reference: Array,
    weight: Array,
    dt: float,
    limits: tuple[float, float],
    duty: Array,
    torque: Array,
    work: Array,
    gradient: Array,
) -> float:
    """Cost of a duty [%] from rest; fills torque [N·m] and gradient, all of shape (n,); `work` has shape (4, n)."""
    low, high = limits
    n = len(duty)
    x1 = 0.0
    x2 = 0.0
    cost = 0.0
    for k in range(n):
        torque[k] = x1 + x2
        cost += weight[k] * (torque[k] - reference[k]) ** 2
        u = duty[k]
        more, less = min(u + NUDGE, high), max(u - NUDGE, low)
        fast, slow, tau1, tau2 = plant_pull(plant, x1, x2, u)
        fast_more, slow_more, tau1_more, tau2_more = plant_pull(plant, x1, x2, more)
        fast_less, slow_less, tau1_less, tau2_less = plant_pull(plant, x1, x2, less)
        gone1, gone2 = -math.expm1(-dt / tau1), -math.expm1(-dt / tau2)
        kept1, kept2 = 1.0 - gone1, 1.0 - gone2
        pace1, pace2 = kept1 * dt / (tau1 * tau1) * fast, kept2 * dt / (tau2 * tau2) * slow
        work[0, k] = kept1
        work[1, k] = kept2
        work[2, k] = (gone1 * (fast_more - fast_less) - pace1 * (tau1_more - tau1_less)) / (more - less)
        work[3, k] = (gone2 * (slow_more - slow_less) - pace2 * (tau2_more - tau2_less)) / (more - less)
        x1 += gone1 * fast
        x2 += gone2 * slow
    v1 = 0.0
    v2 = 0.0
    for k in range(n - 1, -1, -1):
        gradient[k] = v1 * work[2, k] + v2 * work[3, k]
        slope = 2.0 * weight[k] * (torque[k] - reference[k])
        v1 = slope + work[0, k] * v1
        v2 = slope + work[1, k] * v2
    return cost
