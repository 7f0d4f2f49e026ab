"""What a fit and its gains tell a design and its loops: linear model, range of B, plant; gains as the steps take them.

B_i of a level is 1/b0_i. One step cannot tell b0 from c0: c0 is 0 (`zero-offset`), b0_i = a_i gain_i / u_i.
"""

from dataclasses import dataclass

from eaid.control.kinds import LAW_KINDS, Law
from eaid.errors import DataError, GainsError, UsageError
from eaid.findings import sentences
from eaid.plant.dynamics import Plant
from eaid.plant.linear import LinearPlant
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.models import LinearLevel
from eaid.results.verdict import unphysical

SLOWEST_A0, FASTEST_A0 = 1e-6, 1e6  # a0 of anything that is controlled by samples [1/s]
LARGEST_B0 = 1e15  # b0, its inverse and c0 of any rig, whatever its units


@dataclass(frozen=True)
class RangeOfB:
    """The range of B and where it comes from."""

    B_m: float  # [%·s/(N·m)]
    B_M: float  # [%·s/(N·m)]
    rows: tuple[LinearLevel, ...]  # The levels kept; empty where the fit holds none


def model_of(fit: Fit) -> LinearPlant:
    """The pooled linear model; DataError where it is missing, GainsError where it is not physical."""
    if fit.linear is None and fit.data.kind != "clutch":
        raise DataError(
            f"the fit is one of {fit.data.kind}, which no loop drives; where its input is yours to command, fit the "
            "logs with «kind» clutch and «columns» input=NAME"
        )
    if fit.linear is None:
        raise DataError("the fit holds no linear model; fit clutch data with «model» linear (or all models)")
    return physical(fit.linear.parameters)


def physical(linear: LinearPlant) -> LinearPlant:
    """The model itself; GainsError where it is none of a rig."""
    a0, b0, c0 = linear.a0, linear.b0, linear.c0
    if not a0 > 0:
        raise GainsError(
            f"the fit's a0 is {a0:.4g} 1/s; a plant whose output does not settle by itself is not physical"
        )
    if not b0 > 0:
        raise GainsError(f"the fit's b0 is {b0:.4g}; more input has to give more output, check the sign of the data")
    if not (SLOWEST_A0 <= a0 <= FASTEST_A0 and max(b0, 1 / b0, abs(c0)) <= LARGEST_B0):
        raise GainsError(
            f"the fit's a0 is {a0:.4g} 1/s, its b0 is {b0:.4g} and its c0 {c0:.4g}, which no rig has that samples "
            "control; check the time column and the units of the data"
        )
    return linear


def range_of_b(fit: Fit) -> RangeOfB:
    """B_m and B_M as fitted; a range that is not positive is refused (GainsError)."""
    linear = fit.linear
    if linear is None or linear.bounds is None:
        raise UsageError("the fit holds no range of B; fit again with «model» linear (or all models)")
    ends = []
    for name in ("B_m", "B_M"):
        value = getattr(linear.bounds, name)
        if value is None or not value > 0:
            raise GainsError(
                f"{name} is {'missing' if value is None else f'{value:.4g}'}, so the range of B touches 0 and no gain "
                "is robust over it; leave out the levels without a positive b0 («levels»)"
            )
        ends.append(value)
    B_m, B_M = ends
    if B_m > B_M:
        raise GainsError(f"B_m {B_m:.4g} lies above B_M {B_M:.4g}; check linear.bounds of the fit")
    kept = linear.bounds.levels
    rows = [row for row in linear.per_level if row.level and (row.level in kept or not kept)]
    if any(not row.a0 * row.gain / row.level > 0 for row in rows):
        raise GainsError(
            "a level has no positive b0, so the range of B touches 0; leave it out of the fit with «bounds_levels»"
        )
    return RangeOfB(B_m, B_M, tuple(rows))


LARGEST_GAIN = 1e30  # Of any gain, and of the inverse of one that has to be positive, whatever the rig's units


def refuse_other_units(fit: Fit, gains: Gains | None) -> None:
    """DataError where gains are for another input or output than the fit's."""
    if gains is not None and (gains.input_unit, gains.output_unit) != (fit.data.input_unit, fit.data.output_unit):
        raise DataError(
            f"the gains are for an input in {gains.input_unit} and an output in {gains.output_unit}, the fit has "
            f"{fit.data.input_unit} and {fit.data.output_unit}; run tune-rc on this fit"
        )


def law_of(gains: Gains | None, name: str) -> Law | None:
    """Gains of a controller of the table as its step takes them; None without any, DataError where no loop runs with
    them."""
    held = None if gains is None else gains.controllers_by_name.get(name)
    if gains is None or held is None or name not in LAW_KINDS:
        return None
    kind = LAW_KINDS[name]
    try:
        law = kind.law(gains.model, held, gains.duty_limits_pct)
    except KeyError as missing:
        raise DataError(f"gains.json: {name} has no {missing.args[0]}; run tune-rc again") from None
    for key, value in list(law._asdict().items())[:-2]:  # the limits of the duty stand last
        if key in kind.positive and not value > 0:
            raise DataError(f"gains.json: {name}: {key} is {value:g}, it has to be positive; run tune-rc again")
        if abs(value) > LARGEST_GAIN or (key in kind.positive and value < 1 / LARGEST_GAIN):
            raise DataError(f"gains.json: {name}: {key} is {value:g}, which no loop of a rig has; run tune-rc again")
    return law


def plant_of(fit: Fit) -> Plant | None:
    """`Fit.plant`, None where the fit holds none; DataError where, within the identified inputs, its curves are none
    that a plant has: the floors of the replay are for drawn plants and rounding."""
    if fit.plant_ is None and fit.nonlinear is None:
        return None
    plant = fit.plant
    low, high = plant.u_range
    if not (0 <= low <= high and high > 0):
        raise DataError(f"the fit's nonlinear.u_range is [{low:g}, {high:g}]; it has to rise from 0 or above")
    if wrong := unphysical(plant):
        raise DataError(*sentences(wrong[:1]))
    return plant
