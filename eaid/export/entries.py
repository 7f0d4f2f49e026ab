"""What each exported constant is: its value, unit and meaning, for every language alike.

Units are written with i for the rig's input unit and o for its output unit.
"""

import re
from dataclasses import dataclass
from typing import Any

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
    ".back_calculation": ("o/i", "anti-windup; 0: the integral stands still at a limit"),
    ".duty_on_fault": ("i", "given while an input is no number; yours to change"),
    ".dt": ("s", "sample time"),
    ".stuck_samples": ("", "readings alike after which the status tells"),
}
"""`law.field` → unit and meaning; with nothing before the dot, what all laws share."""


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

    def named(found: re.Match[str]) -> str:
        slash, name = found[1], units["io".index(found[2])]
        return f"{slash}({name})" if slash and "·" in name else slash + name

    return re.sub("(/?)(?<![a-zA-Z])([io])(?![a-zA-Z])", named, unit)
