"""The guarantee watched: along a replay of the robust controller, the uncertainty χ(t) against the ρ(t) that has to
cover it, Eq. (15).

Whatever the plant is, with u = B̂ y + η̂ played on B q̈ + η = u (Siciliano et al., Robotics, §8.5.3; the paper's η
there is our χ),

    q̈ = B⁻¹ (B̂ y + η̂ − η) = y − χ,      χ = (1 − B⁻¹B̂) y + B⁻¹ (η − η̂)

so that χ = y − Ṫ: the slope that the law asks for minus the one that comes, with no B or η to be agreed upon. The
Lyapunov argument holds
at an instant where |χ| ≤ ρ. Taken sample by sample, Ṫ being the plant's slope when the duty has just been set.

Where it does not hold while the duty is at a limit, the limit may be the cause. It is, where |χ| ≤ ρ would hold had
the duty gone on to what
the law asked for, the slope of the torque growing as it does just inside the limit: Ṫ(u*) = Ṫ(u) + (u* − u) ∂Ṫ/∂u.
"""

from dataclasses import dataclass

import numpy as np

from eaid.arrays import Array, read_only
from eaid.control.rc import RCGains, rc_start, rc_step, rc_terms
from eaid.replay.loop import Replay, reference_rate
from eaid.replay.plant import PlantParameters, plant_slope, plant_step

NEAR_PCT = 1.0
"""∂Ṫ/∂u at a limit is a difference over so much duty inside it [%]."""


@dataclass(frozen=True, eq=False)
class Watch:
    """χ and ρ along a replay, shapes (n,)."""

    chi_nm_s: Array
    rho_nm_s: Array
    limited: Array
    """1 where the law asked for more than the limits give, else 0."""
    chi_unlimited_nm_s: Array
    """χ had the duty gone on beyond its limit; χ itself elsewhere."""

    def numbers(self, begin: int = 0) -> dict[str, float | None]:
        """Shares of the samples from `begin` on: where it holds, where it fails, and of these how many at a limit
        and because of it."""
        rho = self.rho_nm_s[begin:]
        fails = np.abs(self.chi_nm_s[begin:]) > rho
        at_limit = fails & (self.limited[begin:] > 0)
        by_limit = at_limit & (np.abs(self.chi_unlimited_nm_s[begin:]) <= rho)
        count = int(fails.sum())
        return {
            "guarantee_holds_fraction": 1.0 - count / len(rho),
            "guarantee_largest_chi_over_rho": float((np.abs(self.chi_nm_s[begin:]) / rho).max()),
            "guarantee_failures_at_limit": int(at_limit.sum()) / count if count else None,
            "guarantee_failures_by_saturation": int(by_limit.sum()) / count if count else None,
        }


def watch(gains: RCGains, plant: PlantParameters, replay: Replay) -> Watch:
    """χ and ρ along a replay of the robust controller on a plant; the duty limits are the replay's.

    The law is run again on what it read, the plant on the duty it was given (its mean from sample to sample where
    the PWM latches).
    """
    low, high = replay.limits_pct
    gains = gains._replace(duty_min=low, duty_max=high)
    n = len(replay.time_s)
    measured = replay.torque_nm if replay.measured_nm is None else replay.measured_nm
    acting = (replay.duty_pct if replay.applied_pct is None else replay.applied_pct).tolist()
    rates = reference_rate(replay.reference_nm, replay.dt_s, False).tolist()
    chi, rho, limited, beyond = np.empty(n), np.empty(n), np.zeros(n), np.empty(n)
    state, x1, x2, dt = rc_start(), 0.0, 0.0, replay.dt_s
    for k, (reference, torque) in enumerate(zip(replay.reference_nm.tolist(), measured.tolist(), strict=True)):
        integral, error = state.integral, reference - torque
        terms = rc_terms(gains, integral, error)
        y = rates[k] + gains.K_D * error + gains.K_P * integral + terms.omega
        slope = plant_slope(plant, x1, x2, acting[k])
        chi[k] = beyond[k] = y - slope
        rho[k] = terms.rho
        wanted = gains.B_hat * y + (gains.a0 * torque - gains.c0) / gains.b0
        if not low <= wanted <= high:
            limit, inside = (high, -NEAR_PCT) if wanted > high else (low, NEAR_PCT)
            steepness = (plant_slope(plant, x1, x2, limit + inside) - plant_slope(plant, x1, x2, limit)) / inside
            limited[k] = 1.0
            beyond[k] = chi[k] - (wanted - limit) * steepness
        state, _ = rc_step(gains, state, reference, rates[k], torque, dt)
        x1, x2 = plant_step(plant, x1, x2, acting[k], dt)
    return Watch(read_only(chi), read_only(rho), read_only(limited), read_only(beyond))
