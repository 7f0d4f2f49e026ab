"""What is recorded synthetically: for each kind of experiment, the two exponentials that one input gives.

Clutch:          T_s(u), τ1(u), τ2(u) of the reference plant or of a fit, with the edges of specification 4.2.
Friction, force: Table I as printed, over σ = f / A, at 15 RPM.
Friction, speed: Table II's T_s and τ1 as printed, and τ2 = 5.4 e^(−0.0101 Ω) s, which agrees with Table I at 15 RPM
                 (the printed τ2 of Table II has nothing left at its own digits, specification 5).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp, inf

from eaid.apparatus import Apparatus
from eaid.control.plant import plant_of
from eaid.errors import DataError, UsageError
from eaid.logs.run import INPUT_UNITS, Kind
from eaid.models.parameters import REFERENCE_PLANT, SHARE, Friction, Nonlinear
from eaid.replay.plant import plant_parameters, plant_terms
from eaid.results.fit import Fit

ROTOR_RPM: dict[str, float | None] = {"clutch": 10.0, "friction-force": 15.0, "friction-speed": None}
"""Rotor speed of each experiment [RPM] (§III, §IV-A); None: the input is the speed."""

LEVELS: dict[str, tuple[float, ...]] = {
    "clutch": tuple(map(float, range(10, 101, 10))),
    "friction-force": tuple(map(float, range(17, 171, 17))),
    "friction-speed": tuple(map(float, range(5, 41, 5))),
}
"""Inputs of each experiment: duty [%], force [N], speed [RPM]."""


@dataclass(frozen=True)
class Plant:
    """A thing to be recorded."""

    kind: Kind
    at: Callable[[float], Friction]
    """What an input [%, N or RPM] leads to, held for ever."""
    rotor_rpm: float | None
    """Rotor speed [RPM]; None: the input is the speed."""
    levels: tuple[float, ...]
    """Inputs that are recorded unless the user names others."""
    made_of: str
    """What stands behind the numbers, in words."""
    release: tuple[float, float] | None = None
    """(τ1, τ2) of a fall to rest [s], where they are known."""
    rest_below: float = 0.0
    """Lowest identified input: a fall to an input below it goes over to `release`, as in `eaid.replay.plant`."""
    model: Nonlinear | None = None
    """The clutch's own model, which a closed loop needs."""
    input_unit: str = ""
    """Unit of the input; empty: that of the kind."""
    output_unit: str = "N·m"

    def __post_init__(self) -> None:
        if not self.input_unit:
            object.__setattr__(self, "input_unit", INPUT_UNITS[self.kind])


def clutch(p: Nonlinear = REFERENCE_PLANT, made_of: str = "the reference plant (docs/synthetic.md)") -> Plant:
    """The clutch itself: input is the duty [%]."""
    parameters = plant_parameters(p)

    def at(duty_pct: float) -> Friction:
        tau1, tau2, steady = plant_terms(parameters, duty_pct)
        return Friction(steady, tau1, tau2, p.C)

    below = inf if p.falls_as_release else p.u_range[0]
    levels = tuple(u for u in LEVELS["clutch"] if p.u_range[0] <= u <= p.u_range[1]) or p.u_range
    return Plant("clutch", at, ROTOR_RPM["clutch"], levels, made_of, p.release, below, p)


def table_i(force_n: float) -> Friction:
    """Table I at one normal force [N] and 15 RPM; no force, no torque."""
    sigma = Apparatus().stress_kpa(force_n)
    return Friction(
        Ts=max(0.0, 0.0944 * sigma - 0.0896) if force_n > 0 else 0.0,
        tau1=6.01 * exp(-0.431 * sigma) + 0.11 * exp(0.0492 * sigma),
        tau2=40.25 * exp(-0.219 * sigma) + 1.37 * exp(0.0476 * sigma),
    )


def table_ii(speed_rpm: float) -> Friction:
    """Table II at one speed [RPM] and 86 N, τ2 as this module's head says; a rotor at rest gives no torque."""
    return Friction(
        Ts=0.349 * exp(-0.230 * speed_rpm) + 1.042 * exp(0.00608 * speed_rpm) if speed_rpm > 0 else 0.0,
        tau1=0.425 * exp(-0.310 * speed_rpm) + 0.0498 * exp(-0.0150 * speed_rpm),
        tau2=5.4 * exp(-0.0101 * speed_rpm),
    )


def friction_force() -> Plant:
    """The friction rig under weights: input is the normal force [N]."""
    return Plant("friction-force", table_i, ROTOR_RPM["friction-force"], LEVELS["friction-force"], "Table I as printed")


def friction_speed() -> Plant:
    """The friction rig under 86 N: input is the speed [RPM]."""
    made_of = "Table II as printed, with tau2 = 5.4 exp(-0.0101 RPM) s"
    return Plant("friction-speed", table_ii, ROTOR_RPM["friction-speed"], LEVELS["friction-speed"], made_of)


REFERENCE: dict[str, Callable[[], Plant]] = {
    "clutch": clutch,
    "friction-force": friction_force,
    "friction-speed": friction_speed,
}
"""`--plant reference`, by kind."""


def of_fit(fit: Fit, kind: Kind, named: str) -> Plant:
    """The plant that a fit found, in its units; of friction only the fitted levels can be recorded."""
    data = fit.data
    if kind == "clutch":
        model = plant_of(fit)
        if model is None:
            raise DataError(f"{named}: holds no nonlinear model, which is the plant; fit clutch logs with it")
        made = clutch(model, named)
        own = tuple(u for u in data.levels if model.u_range[0] <= u <= model.u_range[1])
        if data.input_unit == "%" and model.u_range[1] <= 100:
            own = made.levels if not data.levels or set(made.levels) >= set(own) else own
        return replace(made, levels=own or model.u_range, input_unit=data.input_unit, output_unit=data.output_unit)
    if data.kind != kind:
        raise UsageError(f"{named}: is a fit of {data.kind} logs; ask for «kind» {data.kind}")
    share = fit.friction.C if fit.friction is not None and fit.friction.C else SHARE
    rows = [row for row in (fit.friction.levels if fit.friction is not None else ()) if row.from_ == 0]
    levels = {row.level: Friction(row.Ts, row.tau1, row.tau2, share) for row in rows}
    if not levels:
        raise DataError(f"{named}: holds no friction levels; fit the friction model first")

    def at(value: float) -> Friction:
        if value == 0.0:
            return Friction(Ts=0.0, tau1=1.0, tau2=1.0)
        if value not in levels:
            known = ", ".join(f"{level:g}" for level in sorted(levels))
            raise UsageError(f"«levels» {value:g}: is not in {named}, which holds {known}")
        return levels[value]

    return Plant(
        kind, at, ROTOR_RPM[kind], tuple(sorted(levels)), named, input_unit=data.input_unit,
        output_unit=data.output_unit,
    )  # fmt: skip
