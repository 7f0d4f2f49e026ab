"""Kernels of the best duty: follow a torque path, roll a duty out, and improve it by Gauss–Newton steps within limits.

The step is that of differential dynamic programming with a limited control: backwards along a rolled-out duty the cost
to go is kept to second order in the two states, V = v'δx + δx'Sδx/2, and gives at each sample the change of duty that
would be best, d + g'δx, cut at the limits. Derivatives of `plant_step` by central differences (one-sided at a limit);
whether a step is taken is for the true cost to say. Floats, arrays and `plant_step` only: numba compiles them.
"""

from eaid.arrays import Array
from eaid.replay.plant import PlantParameters, plant_step

DUTY_NUDGE = 1e-3
"""Difference of duty for a derivative [%]."""
STATE_NUDGE = 1e-4
"""Difference of a state for a derivative [N·m]."""


def follow(
    plant: PlantParameters, wanted: Array, dt: float, low: float, high: float, duty: Array, fast: Array, slow: Array
) -> None:
    """Fill the duty [%] that brings the torque onto `wanted` [N·m] at each next sample, or as near as a limit lets it.

    Between the limits by false position (Illinois); `fast` and `slow` are filled with the states, all of shape (n,).
    """
    x1 = 0.0
    x2 = 0.0
    n = len(wanted)
    for k in range(n):
        fast[k] = x1
        slow[k] = x2
        if k == n - 1:
            duty[k] = duty[k - 1]
            break
        target = wanted[k + 1]
        u_high, u_low = high, low
        y1, y2 = plant_step(plant, x1, x2, u_high, dt)
        above = y1 + y2 - target
        z1, z2 = plant_step(plant, x1, x2, u_low, dt)
        below = z1 + z2 - target
        u = u_high
        if above > 0.0 and below < 0.0:
            for _ in range(60):
                u = u_high - above * (u_high - u_low) / (above - below)
                y1, y2 = plant_step(plant, x1, x2, u, dt)
                missed = y1 + y2 - target
                if abs(missed) < 1e-15 or u_high - u_low < 1e-12:
                    break
                if missed > 0.0:
                    u_high, above, below = u, missed, below * 0.5
                else:
                    u_low, below, above = u, missed, above * 0.5
        elif below >= 0.0:
            u, y1, y2 = u_low, z1, z2
        duty[k] = u
        x1, x2 = y1, y2


def rolled(
    plant: PlantParameters,
    reference: Array,
    weight: Array,
    dt: float,
    limits: tuple[float, float],
    before: tuple[Array, Array, Array],
    change: tuple[Array, Array, Array],
    share: float,
    after: tuple[Array, Array, Array],
) -> float:
    """Cost Σ w (T − r)² of a duty `before` [%] with a share of the change d + g'δx, cut at the limits; fills `after`.

    `before` and `after` are (duty, fast, slow), `change` (d, g_fast, g_slow), all of shape (n,).
    """
    low, high = limits
    old, old1, old2 = before
    d, g1, g2 = change
    duty, fast, slow = after
    x1 = 0.0
    x2 = 0.0
    cost = 0.0
    for k in range(len(reference)):
        fast[k] = x1
        slow[k] = x2
        error = x1 + x2 - reference[k]
        cost += weight[k] * error * error
        u = old[k] + share * d[k] + g1[k] * (x1 - old1[k]) + g2[k] * (x2 - old2[k])
        u = min(max(u, low), high)
        duty[k] = u
        x1, x2 = plant_step(plant, x1, x2, u, dt)
    return cost


def improvement(
    plant: PlantParameters,
    reference: Array,
    weight: Array,
    dt: float,
    limits: tuple[float, float],
    now: tuple[Array, Array, Array],
    damping: float,
    change: tuple[Array, Array, Array],
) -> float:
    """Fill the change (d, g_fast, g_slow) that lowers the cost of the duty `now`; return what it promises (≤ 0)."""
    low, high = limits
    duty, fast, slow = now
    d, g1, g2 = change
    last = len(reference) - 1
    d[last] = 0.0
    g1[last] = 0.0
    g2[last] = 0.0
    v1 = 2.0 * weight[last] * (fast[last] + slow[last] - reference[last])
    v2 = v1
    s11 = 2.0 * weight[last]
    s12 = s11
    s22 = s11
    promised = 0.0
    for k in range(last - 1, -1, -1):
        u, x1, x2 = duty[k], fast[k], slow[k]
        more, less = min(u + DUTY_NUDGE, high), max(u - DUTY_NUDGE, low)
        p1, p2 = plant_step(plant, x1, x2, more, dt)
        m1, m2 = plant_step(plant, x1, x2, less, dt)
        b1, b2 = (p1 - m1) / (more - less), (p2 - m2) / (more - less)
        p1, p2 = plant_step(plant, x1 + STATE_NUDGE, x2 + STATE_NUDGE, u, dt)
        m1, m2 = plant_step(plant, x1 - STATE_NUDGE, x2 - STATE_NUDGE, u, dt)
        a1, a2 = (p1 - m1) / (2.0 * STATE_NUDGE), (p2 - m2) / (2.0 * STATE_NUDGE)
        # the cost to go as a function of this sample's states and duty: its derivatives
        own = 2.0 * weight[k]
        error = own * (x1 + x2 - reference[k])
        q_u = b1 * v1 + b2 * v2
        q_uu = b1 * b1 * s11 + 2.0 * b1 * b2 * s12 + b2 * b2 * s22
        q_u1 = a1 * (b1 * s11 + b2 * s12)
        q_u2 = a2 * (b1 * s12 + b2 * s22)
        step = 0.0
        f1 = 0.0
        f2 = 0.0
        held = (u <= low and q_u > 0.0) or (u >= high and q_u < 0.0)
        if q_uu > 0.0 and not held:
            step = -q_u / (q_uu + damping)
            f1 = -q_u1 / (q_uu + damping)
            f2 = -q_u2 / (q_uu + damping)
            if u + step < low:
                step, f1, f2 = low - u, 0.0, 0.0
            elif u + step > high:
                step, f1, f2 = high - u, 0.0, 0.0
        d[k] = step
        g1[k] = f1
        g2[k] = f2
        promised += step * (q_u + 0.5 * step * q_uu)
        v1, v2 = (
            error + a1 * v1 + f1 * (q_uu * step + q_u) + q_u1 * step,
            error + a2 * v2 + f2 * (q_uu * step + q_u) + q_u2 * step,
        )
        s11, s12, s22 = (
            own + a1 * a1 * s11 + f1 * f1 * q_uu + 2.0 * f1 * q_u1,
            own + a1 * a2 * s12 + f1 * f2 * q_uu + f1 * q_u2 + f2 * q_u1,
            own + a2 * a2 * s22 + f2 * f2 * q_uu + 2.0 * f2 * q_u2,
        )
    return promised


def slow_reach(decay: Array, gain: Array, reach: Array) -> None:
    """Largest slow part [N·m] that any duty can have made by each sample, from rest: the most of decay x + gain."""
    x = 0.0
    for k in range(len(reach)):
        reach[k] = x
        most = 0.0
        for j in range(len(decay)):
            most = max(most, decay[j] * x + gain[j])
        x = most
