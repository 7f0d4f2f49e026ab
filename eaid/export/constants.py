"""Gains and plant → the constants of `eaid.export.reference` at one sample time.

PI, RC    the gains as they are; tanh(γε) once, Eq. (14)
inverse   observer poles at e^(−w dt): correction 1 − e^(−2 w dt), learning (1 − e^(−w dt))²/dt
rate      r ← m r + (1 − m)/dt (x − x before),  m = e^(−2π f dt)
"""

import math
import re
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from eaid.control.pi import PIGains
from eaid.control.rc import RCGains
from eaid.export import reference as law
from eaid.models.parameters import TAU_FLOOR_S, Nonlinear
from eaid.replay.controllers import DUTY_TOLERANCE_PCT, OBSERVER_PER_S
from eaid.replay.plant import plant_parameters

Precision = Literal["double", "single"]
# P of 1 − e^(−x) = x P(x) on 0…1, lowest power first: Taylor's series in Chebyshev polynomials of 2x − 1, cut after the
# 13th or 6th
SERIES: dict[Precision, tuple[float, ...]] = {
    "double": (
        1.0, -0.5, 0.16666666666666657, -0.04166666666666428, 0.008333333333301267, -0.0013888888886311973,
        0.00019841269707000008, -2.4801582547234134e-05, 2.755720169804312e-06, -2.7555266954791067e-07,
        2.502684445743284e-08, -2.066139635495516e-09, 1.4838225325665164e-10, -7.2247884038067735e-12,
    ),
    "single": (
        0.9999999979889346, -0.4999998012069866, 0.1666634490024249, -0.041647044298979564, 0.008275879694584938,
        -0.001301107315188573, 0.00012918686680724904,
    ),
}  # fmt: skip


def rounded(value: Any, precision: Precision) -> Any:
    """A constant, or a NamedTuple of them, as the target holds it: floats stay, or become numpy.float32."""
    if isinstance(value, tuple):
        inner = [rounded(item, precision) for item in value]
        return type(value)(*inner) if hasattr(value, "_fields") else tuple(inner)
    if precision == "single" and isinstance(value, float):
        return np.float32(value)
    return value


def hexadecimal(value: Any) -> str:
    """A C99 hex float, exact: float for a numpy.float32, double for a float; integers as unsigned."""
    if isinstance(value, int):
        return f"{value}U"
    suffix = "F" if isinstance(value, np.float32) else ""
    number = float(value)
    if math.isnan(number):
        return "EAID_NAN"
    if math.isinf(number):
        return "EAID_INF" if number > 0 else "-EAID_INF"
    return number.hex() + suffix


def decimal(value: Any) -> str:
    """The shortest decimal that gives the number back, always with a point: YAML and C both take it for a real one."""
    if isinstance(value, int):
        return str(value)
    number = float(value)
    text = str(value) if isinstance(value, np.float32) else repr(number)
    if not math.isfinite(number):
        return {"nan": "NaN", "inf": "Inf", "-inf": "-Inf"}[text]
    mantissa, mark, exponent = text.partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{mark}{exponent}"


def commented(lines: list[str], before: str) -> str:
    """The head's lines behind a comment mark; nothing in them can end the comment."""
    return "\n".join((before + harmless(line)).rstrip() for line in lines)


def harmless(text: str) -> str:
    """A text of one line that ends no comment and goes on to no next line, whatever a file or a unit is called."""
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *").rstrip("\\ ")


def unit_name(text: str) -> str:
    """A unit as any language may hold it: one short word, no quotes."""
    return harmless(re.sub(r"[\"'\\{}<>]", "", text))[:20] or "1"


# Of one law, or of the rate's filter
Constants: TypeAlias = law.PIConstants | law.RCConstants | law.InverseConstants | law.PlantConstants | law.RateConstants
SEARCHES = 16  # Tries of the inverse's search at most: twelve are the most seen
# The search ends when it moves the duty by no more than that
TOLERANCE = {"double": DUTY_TOLERANCE_PCT, "single": 1e-4}


@dataclass(frozen=True)
class Timing:
    """What an export bakes in beside the gains."""

    dt_s: float
    precision: Precision = "double"
    duty_on_fault: float = 0.0  # Duty while an input is no number, or the state was not made ready

    @property
    def rate_filter_hz(self) -> float:
        """Corner of the reference's filtered derivative [Hz]: 25, a tenth of a lower rate."""
        return min(25.0, 0.1 / self.dt_s)


def pi_constants(gains: PIGains, timing: Timing) -> law.PIConstants:
    """Constants of the PI."""
    return law.PIConstants(*gains, timing.duty_on_fault, timing.dt_s)


def rc_constants(gains: RCGains, timing: Timing) -> law.RCConstants:
    """Constants of the robust controller."""
    g = gains
    return law.RCConstants(
        g.K_P, g.K_D, g.B_hat, g.a0, g.b0, g.c0, g.rho_constant, g.rho_slope, g.epsilon, g.gamma, g.Q12, g.Q22,
        math.tanh(g.gamma * g.epsilon), g.duty_min, g.duty_max,
        timing.duty_on_fault, timing.dt_s, SERIES[timing.precision],
    )  # fmt: skip


def plant_constants(plant: Nonlinear, timing: Timing) -> law.PlantConstants:
    """Constants of the plant."""
    p = plant_parameters(plant)
    return law.PlantConstants(
        p.C, *p.tau1, *p.tau2, *p.Ts, p.u_low, p.u_high, *p.release, TAU_FLOOR_S, timing.dt_s, SERIES[timing.precision]
    )


def inverse_constants(plant: Nonlinear, limits: tuple[float, float], timing: Timing) -> law.InverseConstants:
    """Constants of the inverse between the duty limits."""
    gone = -math.expm1(-OBSERVER_PER_S * timing.dt_s)
    kept = 1.0 - gone
    return law.InverseConstants(
        correction=1.0 - kept * kept,
        learning=gone * gone / timing.dt_s,
        tolerance=TOLERANCE[timing.precision],
        duty_min=limits[0],
        duty_max=limits[1],
        duty_on_fault=timing.duty_on_fault,
        dt=timing.dt_s,
        searches=SEARCHES,
        plant=plant_constants(plant, timing),
    )


def rate_constants(timing: Timing) -> law.RateConstants:
    """Constants of the filtered derivative."""
    memory = math.exp(-2 * math.pi * timing.rate_filter_hz * timing.dt_s)
    return law.RateConstants(memory, (1.0 - memory) / timing.dt_s)


# `law.field` → unit and meaning; with nothing before the dot, what all laws share
MEANS = {
    "pi.K_P": ("i/o", "proportional gain"),
    "pi.K_I": ("i/(o·s)", "integral gain"),
    "rc.K_P": ("1/s²", "Eq. (12)"),
    "rc.K_D": ("1/s", "Eq. (12)"),
    "rc.B_hat": ("i·s/o", "B̂, Eq. (11)"),
    "rc.a0": ("1/s", "linear model, Eq. (8)"),
    "rc.b0": ("o/(s·i)", "linear model"),
    "rc.c0": ("o/s", "linear model"),
    "rc.rho_constant": ("o/s", "ρ at ξ = 0, Eq. (15)"),
    "rc.rho_slope": ("1/s", "dρ/d‖ξ‖"),
    "rc.epsilon": ("", "half width of the boundary layer, in units of z"),
    "rc.gamma": ("", "sharpness of the soft switch, per unit of z"),
    "rc.Q12": ("", "z = Q12 ∫e + Q22 e"),
    "rc.Q22": ("", ""),
    "rc.at_zero": ("", "tanh(γε)"),
    "plant.C": ("", "share of the fast part"),
    "plant.tau1_0": ("s", "τ1(u), Eq. (5)"),
    "plant.tau1_1": ("s/i", ""),
    "plant.tau1_2": ("s/i²", ""),
    "plant.tau2_0": ("s", "τ2(u), Eq. (6)"),
    "plant.tau2_1": ("s/i", ""),
    "plant.tau2_2": ("s/i²", ""),
    "plant.Ts_0": ("o", "T_s(u), Eq. (7)"),
    "plant.Ts_1": ("o/i", ""),
    "plant.Ts_2": ("o/i²", ""),
    "plant.Ts_3": ("o/i³", ""),
    "plant.u_low": ("i", "lowest identified duty"),
    "plant.u_high": ("i", "highest identified duty"),
    "plant.release1": ("s", "τ1 of a fall to rest; 0: none was fitted"),
    "plant.release2": ("s", "τ2 of a fall to rest; 0: none was fitted"),
    "plant.tau_floor": ("s", "shortest time constant"),
    "inverse.correction": ("", "observer: share of the innovation that corrects the model's states"),
    "inverse.learning": ("1/s", "observer: rate at which it learns what the model lacks"),
    "inverse.tolerance": ("i", "the search ends when it moves the duty by no more"),
    "inverse.searches": ("", "tries of the search at most"),
    "rate.memory": ("", "r ← memory r + gain (x − x before)"),
    "rate.gain": ("1/s", ""),
    ".duty_min": ("i", "lowest duty of the actuator"),
    ".duty_max": ("i", "highest duty of the actuator"),
    ".duty_on_fault": ("i", "given while an input is no number; yours to change"),
    ".dt": ("s", "sample time"),
}


@dataclass(frozen=True)
class Entry:
    """One constant."""

    name: str
    value: Any
    unit: str
    words: str

    @property
    def comment(self) -> str:
        """Meaning and unit, as a comment has them."""
        unit = f"[{self.unit}]" if self.unit else ""
        return " ".join(part for part in (self.words, unit) if part)


def entries(law: str, constants: Any, units: tuple[str, str]) -> tuple[Entry, ...]:
    """The constants of one law but its polynomial, in their order; a model inside is an entry of its own."""
    made = []
    for name, value in constants._asdict().items():
        if hasattr(value, "_fields"):
            made.append(Entry(name, entries(name, value, units), "", "the model that is inverted"))
        elif name != "series":
            unit, words = MEANS.get(f"{law}.{name}") or MEANS[f".{name}"]
            made.append(Entry(name, value, _in(unit, units), words))
    return tuple(made)


def _in(unit: str, units: tuple[str, str]) -> str:
    """A unit in the rig's own; a compound one is put in brackets where it has to be."""

    def named(match: re.Match[str]) -> str:
        slash, name = match[1], units["io".index(match[2])]
        return f"{slash}({name})" if slash and "·" in name else slash + name

    return re.sub("(/?)(?<![a-zA-Z])([io])(?![a-zA-Z])", named, unit)
