"""The guarantee watched: along a replay of the robust controller, the uncertainty χ(t) against ρ(t), Eq. (15).

Whatever the plant is, with u = B̂ y + η̂ played on B q̈ + η = u (Siciliano et al., Robotics, §8.5.3; the paper's η
there is our χ),

    q̈ = B⁻¹ (B̂ y + η̂ − η) = y − χ,      χ = (1 − B⁻¹B̂) y + B⁻¹ (η − η̂)

so that χ = y − Ṫ: the slope that the law asks for minus the one that comes, with no B or η to be agreed upon. The
Lyapunov argument holds at an instant where |χ| ≤ ρ. Taken sample by sample, Ṫ is the mean slope until the next one.

Where it does not hold while the duty is at a limit, the limit may be the cause. It is, where |χ| ≤ ρ would hold had
the duty gone on to the u* that the law asked for, the slope of the torque growing as it does just inside the limit:
Ṫ(u*) = Ṫ(u) + (u* − u) ∂Ṫ/∂u.
"""

import math
from dataclasses import dataclass

import msgspec
import numpy as np

from eaid.arrays import Array, read_only
from eaid.control.rc import RCGains, rc_terms
from eaid.replay.loop import Trace, reference_rate
from eaid.replay.plant import PlantParameters, plant_slope
from eaid.results.metrics import Metrics

NEAR = 0.01
"""∂Ṫ/∂u at a limit is a difference over so much of the actuator's span inside it."""


@dataclass(frozen=True, eq=False)
class Watch:
    """χ and ρ along a replay, shapes (n,)."""

    chi_nm_s: Array
    rho_nm_s: Array
    limited: Array
    """1 where the law asked for more than the limits give, else 0."""
    chi_unlimited_nm_s: Array
    """χ had the duty gone on beyond its limit; χ itself elsewhere."""

    def measured(self, metrics: Metrics, begin: int = 0) -> Metrics:
        """The metrics with the shares of the samples from `begin` on at which it holds and fails, and of the latter
        how many at a limit and because of it."""
        rho = self.rho_nm_s[begin:]
        fails = np.abs(self.chi_nm_s[begin:]) > rho
        at_limit = fails & (self.limited[begin:] > 0)
        by_limit = at_limit & (np.abs(self.chi_unlimited_nm_s[begin:]) <= rho)
        count = int(fails.sum())
        with np.errstate(divide="ignore", invalid="ignore"):  # a model without uncertainty has ρ = 0
            largest = float((np.abs(self.chi_nm_s[begin:]) / rho).max())
        return msgspec.structs.replace(
            metrics,
            guarantee_holds_fraction=1.0 - count / len(rho),
            guarantee_largest_chi_over_rho=largest if math.isfinite(largest) else None,
            guarantee_failures_at_limit=int(at_limit.sum()) / count if count else None,
            guarantee_failures_by_saturation=int(by_limit.sum()) / count if count else None,
        )


def watch(gains: RCGains, plant: PlantParameters, replay: Trace) -> Watch:
    """χ and ρ along a replay of the robust controller on a plant; the duty limits are the replay's."""
    assert replay.fast_nm is not None and replay.state is not None
    low, high = replay.limits_pct
    measured = replay.torque_nm if replay.measured_nm is None else replay.measured_nm
    integral, error = replay.state, replay.reference_nm - measured
    terms = [rc_terms(gains, *at) for at in zip(integral.tolist(), error.tolist(), strict=True)]
    rho, omega = np.array([(each.rho, each.omega) for each in terms]).T
    rate = reference_rate(replay.reference_nm, replay.dt_s, False)
    y = rate + gains.K_D * error + gains.K_P * integral + omega
    slope = np.diff(replay.torque_nm, append=np.nan) / replay.dt_s
    slope[-1] = slope[-2]
    chi = y - slope
    wanted = gains.B_hat * y + (gains.a0 * measured - gains.c0) / gains.b0
    limited = (wanted < low) | (wanted > high)
    unlimited = chi.copy()
    for k in np.flatnonzero(limited).tolist():
        x1 = float(replay.fast_nm[k])
        x2 = float(replay.torque_nm[k]) - x1
        limit, inside = (high, -NEAR * (high - low)) if wanted[k] > high else (low, NEAR * (high - low))
        steepness = (plant_slope(plant, x1, x2, limit + inside) - plant_slope(plant, x1, x2, limit)) / inside
        unlimited[k] -= (wanted[k] - limit) * steepness
    return Watch(read_only(chi), read_only(rho), read_only(limited), read_only(unlimited))
