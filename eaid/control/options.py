"""The numbers of a design, all of them settled; the paper's where nothing is said (Table IV, §V)."""

from dataclasses import dataclass, field
from typing import Literal

from eaid.control.robust import Reading
from eaid.control.timing import RIG, Timing
from eaid.errors import GainsError
from eaid.limits import check_all


@dataclass(frozen=True)
class PIOptions:
    """PI gains given, or overshoot and settling time; the paper's 21 and 360 where neither is."""

    gains: tuple[float, float] | None = None
    """K_P [%/(N·m)], K_I [%/(N·m·s)]"""
    overshoot_pct: float | None = None
    settling_s: float | None = None
    """2 % band [s]"""


@dataclass(frozen=True)
class DesignOptions:
    """Everything `design` needs beside the fit; inputs and outputs in the rig's units."""

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
    """Bound on |η − η̂| in the input's unit; where given, φ is worked out from it."""
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
    """In the input's unit."""
    timing: Timing = RIG

    def __post_init__(self) -> None:
        check_all(
            epsilon=self.epsilon, gamma=self.gamma, p_scale=self.p_scale, q_max=self.Q_M, phi=self.phi,
            kp=self.K_P, kd=self.K_D, b_hat=None if isinstance(self.B_hat, str) else self.B_hat,
        )  # fmt: skip
        if not (self.K_P > 0 and self.K_D > 0):
            raise GainsError(
                f"K_P {self.K_P:g} and K_D {self.K_D:g} make the error dynamics s² + K_D s + K_P unstable; "
                "both have to be positive"
            )
        if not isinstance(self.B_hat, str) and not self.B_hat > 0:
            raise GainsError(f"B̂ is {self.B_hat:g} %·s/(N·m); it has to be positive, or the loop is turned round")
