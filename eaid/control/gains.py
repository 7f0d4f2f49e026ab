"""What a fit and its gains tell a design and its loops: linear model, range of B, plant; gains as the steps take them.

B_i of a level is 1/b0_i. One step cannot tell b0 from c0: c0 is 0 (`zero-offset`), b0_i = a_i gain_i / u_i.
"""

import math
from dataclasses import dataclass

from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.errors import DataError, GainsError, UsageError
from eaid.findings import sentences
from eaid.models.parameters import Linear, Nonlinear
from eaid.results.fit import Fit, LinearLevel
from eaid.results.fit import Linear as LinearFit
from eaid.results.gains import Gains
from eaid.results.verdict import unphysical

SLOWEST, FASTEST = 1e-6, 1e6  # a0 of anything that is controlled by samples [1/s]
LARGEST = 1e15  # b0, its inverse and c0 of any rig, whatever its units


@dataclass(frozen=True)
class Bounds:
    """The range of B and where it comes from."""

    levels: tuple[float, ...]
    B_m: float  # [%·s/(N·m)]
    B_M: float  # [%·s/(N·m)]
    rows: tuple[LinearLevel, ...]  # The levels kept; empty where the fit holds none


def model_of(fit: Fit) -> Linear:
    """The pooled linear model; DataError where it is missing, GainsError where it is not physical."""
    linear = _part(fit)
    return physical(Linear(linear.a0, linear.b0, linear.c0))


def physical(linear: Linear) -> Linear:
    """The model itself; GainsError where it is none of a rig."""
    if not linear.a0 > 0:
        raise GainsError(
            f"the fit's a0 is {linear.a0:.4g} 1/s; a clutch whose torque does not settle by itself is not physical"
        )
    if not linear.b0 > 0:
        raise GainsError(
            f"the fit's b0 is {linear.b0:.4g}; more duty has to give more torque, check the sign of the data"
        )
    if not SLOWEST <= linear.a0 <= FASTEST:
        raise GainsError(
            f"the fit's a0 is {linear.a0:.4g} 1/s; a plant with a time constant of {1 / linear.a0:.3g} s is none that "
            f"samples control ({1 / FASTEST:g} to {1 / SLOWEST:g} s); check the time column"
        )
    if not max(linear.b0, 1 / linear.b0, abs(linear.c0)) <= LARGEST:
        raise GainsError(
            f"the fit's b0 is {linear.b0:.4g} and its c0 {linear.c0:.4g}, which no rig has; check the units of the data"
        )
    return linear


def _part(fit: Fit) -> LinearFit:
    if fit.linear is None:
        raise DataError("the fit holds no linear model; fit clutch data with «model» linear (or all models)")
    return fit.linear


def bounds_of(fit: Fit) -> Bounds:
    """B_m and B_M as fitted; a range that is not positive is refused (GainsError)."""
    linear = _part(fit)
    stored = linear.bounds
    if stored is None:
        raise UsageError("the fit holds no range of B; fit again with «model» linear (or all models)")
    kept = stored.levels or tuple(row.level for row in linear.per_level if row.level)
    kept_rows = [row for row in linear.per_level if row.level and row.level in kept]
    ends = stored.B_m, stored.B_M
    B_m, B_M = (_positive(value, name) for value, name in zip(ends, ("B_m", "B_M"), strict=True))
    if B_m > B_M:
        raise GainsError(f"B_m {B_m:.4g} lies above B_M {B_M:.4g}; check linear.bounds of the fit")
    if any(not (zero_offset_B(row) > 0 and math.isfinite(zero_offset_B(row))) for row in kept_rows):
        raise GainsError(
            "a level has no positive b0, so the range of B touches 0; leave it out of the fit with «bounds_levels»"
        )
    return Bounds(kept, B_m, B_M, tuple(kept_rows))


def zero_offset_B(row: LinearLevel) -> float:
    """B of a level, c0 = 0; infinite where its gain is 0."""
    b0 = row.a0 * row.gain / row.level
    return 1 / b0 if b0 else math.inf


def _positive(value: float | None, name: str) -> float:
    if value is not None and math.isfinite(value) and value > 0:
        return float(value)
    shown = f"{value:.4g}" if value is not None else "missing"
    raise GainsError(
        f"{name} is {shown}, so the range of B touches 0 and no gain is robust over it; "
        "leave out the levels without a positive b0 («levels»)"
    )


LARGEST_GAIN = 1e30  # Of any gain, and of the inverse of one that has to be positive, whatever the rig's units


def refuse_other_units(fit: Fit, gains: Gains | None) -> None:
    """DataError where gains are for another input or output than the fit's."""
    if gains is not None and (gains.input_unit, gains.output_unit) != (fit.data.input_unit, fit.data.output_unit):
        raise DataError(
            f"the gains are for an input in {gains.input_unit} and an output in {gains.output_unit}, the fit has "
            f"{fit.data.input_unit} and {fit.data.output_unit}; run tune-rc on this fit"
        )


def rc_gains(gains: Gains | None) -> RCGains | None:
    """Gains of the robust controller; None where there are none. DataError where a loop cannot run with them."""
    if gains is None or gains.rc is None:
        return None
    rc = gains.rc
    low, high = gains.duty_limits_pct
    model, (Q12, Q22) = gains.model, rc.Q[1]
    positive = {"b0": model.b0, "Q[1][1]": Q22, "B_hat": rc.B_hat, "epsilon": rc.epsilon, "gamma": rc.gamma}
    _check(
        {**positive, "K_P": rc.K_P, "K_D": rc.K_D},
        {"a0": model.a0, "c0": model.c0, "Q[1][0]": Q12, "rho.constant": rc.rho.constant, "rho.slope": rc.rho.slope},
    )
    return RCGains(
        K_P=rc.K_P, K_D=rc.K_D, B_hat=rc.B_hat, a0=model.a0, b0=model.b0, c0=model.c0, rho_constant=rc.rho.constant,
        rho_slope=rc.rho.slope, epsilon=rc.epsilon, gamma=rc.gamma, Q12=Q12, Q22=Q22, duty_min=low, duty_max=high,
    )  # fmt: skip


def pi_gains(gains: Gains | None) -> PIGains | None:
    """Gains of the PI controller; None where there are none. DataError where a loop cannot run with them."""
    if gains is None or gains.pi is None:
        return None
    pi = gains.pi
    _check({}, {"pi.K_P": pi.K_P, "pi.K_I": pi.K_I})
    low, high = gains.duty_limits_pct
    return PIGains(pi.K_P, pi.K_I, low, high)


def _check(positive: dict[str, float], other: dict[str, float]) -> None:
    """Refuse numbers with which no loop of a rig runs."""
    for name, value in {**positive, **other}.items():
        if name in positive and not value > 0:
            raise DataError(f"gains.json: {name} is {value:g}, it has to be positive; run tune-rc again")
        if abs(value) > LARGEST_GAIN or (name in positive and value < 1 / LARGEST_GAIN):
            raise DataError(f"gains.json: {name} is {value:g}, which no loop of a rig has; run tune-rc again")


def plant_of(fit: Fit) -> Nonlinear | None:
    """The nonlinear model of a fit, `Fit.plant`; None where the fit holds none.

    Raises `DataError` where, within the identified inputs, a time constant or T_s is none that a plant has: the floors
    of the replay are for drawn plants and for rounding, not for a model that is wrong.
    """
    part = fit.nonlinear
    if part is None:
        return None
    low, high = part.u_range
    if low > high:
        raise DataError(f"the fit's nonlinear.u_range is [{low:g}, {high:g}]; it has to rise from 0 or above")
    if wrong := unphysical(part):
        raise DataError(*sentences(wrong[:1]))
    return fit.plant
