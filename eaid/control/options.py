"""The choices of a design, with the paper's values as defaults (Table IV, §V)."""

import math
from dataclasses import dataclass, field
from typing import Literal

from eaid.control.margins import Timing
from eaid.control.robust import Reading
from eaid.errors import GainsError, UsageError

RIG = Timing()
"""Control at 1 kHz, the duty latched at 300 Hz (§IV)."""


@dataclass(frozen=True)
class PIOptions:
    """PI gains given, or overshoot and settling time; the paper's 21 and 360 where neither is."""

    gains: tuple[float, float] | None = None
    """K_P [%/(N·m)], K_I [%/(N·m·s)]"""
    overshoot_pct: float | None = None
    settling_s: float | None = None
    """2 % band [s]"""

    def __post_init__(self) -> None:
        if (self.overshoot_pct is None) != (self.settling_s is None):
            raise UsageError("--pi-overshoot and --pi-settling belong together: give both or neither")
        if self.gains is not None and self.overshoot_pct is not None:
            raise UsageError("give either --pi-gains or --pi-overshoot with --pi-settling, not both")


@dataclass(frozen=True)
class DesignOptions:
    """Everything `design` may be told."""

    convention: str | None = None
    """Convention for b0 of a single level; None: the fit's."""
    levels: str | None = None
    """Levels that B_m, B_M are taken over, `30:100` or `30,40`; None: the fit's."""
    widen: bool = False
    """Take the far ends of the levels' 95 % intervals."""
    B_hat: Literal["pooled", "minimax"] | float = "pooled"
    K_P: float = 4.5
    K_D: float = 3.0
    Q_M: float = 5.0
    """Largest slope of the torque reference [N·m/s]."""
    phi: float = 0.05
    """φ in the reading's own number."""
    phi_honest_pct: float | None = None
    """Bound on |η − η̂| in % duty; where given, φ is worked out from it."""
    epsilon: float = 0.5
    gamma: float = 50.0
    p_scale: float = 5.0
    """P = p·I"""
    reading: Reading = "paper"
    alpha: Literal["formula", "reached"] = "formula"
    """The α that ρ is made with."""
    pi: PIOptions = field(default_factory=PIOptions)
    anti_windup: Literal["conditional", "back-calculation"] = "conditional"
    duty_limits_pct: tuple[float, float] = (0.0, 100.0)
    """[%], or the input's unit where that is another."""
    timing: Timing = RIG

    def __post_init__(self) -> None:
        positive = {"--epsilon": self.epsilon, "--gamma": self.gamma, "--p-scale": self.p_scale}
        for name, value in positive.items():
            if not (value > 0 and math.isfinite(value)):
                raise UsageError(f"{name} {value:g}: must be above 0")
        zero_or_more = {"--q-max": self.Q_M, "--phi": self.phi, "--phi data": self.phi_honest_pct or 0.0}
        for name, value in zero_or_more.items():
            if not (value >= 0 and math.isfinite(value)):
                raise UsageError(f"{name} {value:g}: must be 0 or above")
        low, high = self.duty_limits_pct
        if not (0 <= low < high and math.isfinite(high)):
            raise UsageError(f"--duty-limits {low:g},{high:g}: must rise from 0 or above")
        if not (self.K_P > 0 and self.K_D > 0):
            raise GainsError(
                f"K_P {self.K_P:g} and K_D {self.K_D:g} make the error dynamics s² + K_D s + K_P unstable; "
                "both have to be positive"
            )
        if not isinstance(self.B_hat, str) and not self.B_hat > 0:
            raise GainsError(f"B̂ is {self.B_hat:g} %·s/(N·m); it has to be positive, or the loop is turned round")
