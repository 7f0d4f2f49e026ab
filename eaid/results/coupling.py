"""couple.json as types: how stiff a wall each loop may render at each torque."""

from typing import ClassVar

from eaid.findings import sentences
from eaid.options import CoupleOptions
from eaid.results import codec
from eaid.results.common import Inputs, Made, Number, Result
from eaid.shown import pandas

# Unit of the output → units of stiffness, damping and inertia: about an axis, or along a line, where θ is a way in m
UNITS = {"N·m": ("N·m/rad", "N·m·s/rad", "kg·m²"), "N": ("N/m", "N·s/m", "kg")}


class Wall(Result, frozen=True):
    """The stiffest wall of one loop around one held torque; None: no limit below 1e6.

    In N·m/rad, of a force in N/m.
    """

    loop: str
    torque_nm: Number
    duty: Number | None = None
    """Input that holds the torque."""
    K_passive: Number | None = None
    """Passive against any passive limb of this damping."""
    K_stable: Number | None = None
    """Stable with this limb, linear and sampled."""
    K_replayed: Number | None = None
    """The same by bisected replay of the nonlinear plant; None also where the replay shows no edge nearby."""


class Impedance(Result, frozen=True):
    """The least and the largest impedance, and what else limits a wall."""

    idle_drag_nm: Number | None = None
    """Torque of the idle clutch, felt at K = 0."""
    residual_nm: Number | None = None
    """Torque left half a second after the highest of the torques was let go."""
    encoder_K: Number | None = None
    """2 f_c/Δ: a stiffer wall chatters on the encoder's steps [N·m/rad]."""
    slip_margin_rad_s: Number | None = None
    """Least rotor speed minus limb speed: below 0 the torque turns round."""
    turn_step_nm: Number | None = None
    """Step of torque where the rotor turns round half a second after the highest of the torques."""


class Coupling(codec.Saved, Made, frozen=True):
    """Walls of every loop at every torque.

    Examples
    --------
    >>> found = Coupling(walls=(Wall("rc", 1.0, K_passive=12.0, K_stable=40.0), Wall("pi", 1.0)))
    >>> found.to_frame().set_index("loop")["K_stable"].tolist()
    [40.0, nan]
    """

    FILE: ClassVar[str] = "couple"
    inputs: Inputs = {}
    options: CoupleOptions = CoupleOptions()
    output_unit: str = "N·m"
    walls: tuple[Wall, ...] = ()
    impedance: Impedance = Impedance()

    @property
    def units(self) -> tuple[str, str, str]:
        """Of stiffness, damping and inertia."""
        return UNITS[self.output_unit]

    def summary(self) -> str:
        """The stiffest passive and stable wall of each loop at each torque, and the gravest findings."""
        rows = []
        for wall in self.walls:
            known = wall.K_passive is not None and wall.K_stable is not None
            said = f"passive {wall.K_passive:.4g}, stable {wall.K_stable:.4g}" if known else "no limit below 1e6"
            rows.append(f"{wall.loop} at {wall.torque_nm:g} {self.output_unit}: {said} {self.units[0]}")
        return "\n".join([*rows, *sentences(self.findings[:3])])

    def to_frame(self) -> "pandas.DataFrame":
        """One row a wall: loop, torque, K passive, stable and replayed."""
        return codec.frame_of(self.walls)
