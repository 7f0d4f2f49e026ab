"""The rig: geometry, drive and sampling, with the defaults of Feizi et al. 2022 (§II, §III)."""

import math
from dataclasses import dataclass
from typing import Annotated

import msgspec

Size = Annotated[float, msgspec.Meta(gt=0, le=1e60)]
# Kind → the units in which the paper's own rig was recorded
PAPER = {"clutch": ("%", "N·m"), "friction-force": ("N", "N·m"), "friction-speed": ("RPM", "N·m")}


@dataclass(frozen=True)
class Apparatus:
    """What is needed to turn torque into shear stress, and force into stress."""

    inner_radius_m: Size = 0.04
    outer_radius_m: Size = 0.06
    surfaces: Annotated[int, msgspec.Meta(ge=1, le=10**6)] = 2
    """Friction surfaces that carry the torque: two in the clutch, one in the friction rig."""
    dielectric_m: Size = 95e-6
    voltage_v: Size = 300.0
    """Amplitude of the bipolar PWM, half its peak-to-peak value."""
    pwm_hz: Size = 300.0
    sample_rate_hz: Size = 1000.0
    lever_ratio: Size = 4.33

    def __post_init__(self) -> None:
        inner, outer = self.inner_radius_m, self.outer_radius_m
        if inner >= outer:
            raise ValueError(f"an inner radius of {inner:g} m and an outer one of {outer:g} m")

    @property
    def area_m2(self) -> float:
        """Area of one friction ring [m²], A = π (r2² − r1²)."""
        return math.pi * (self.outer_radius_m**2 - self.inner_radius_m**2)

    @property
    def torque_per_shear_m3(self) -> float:
        """Torque per shear stress [N·m/Pa], Eq. (1): T = 2π (r2³ − r1³) σ_sh n / 3."""
        return 2 * math.pi * (self.outer_radius_m**3 - self.inner_radius_m**3) * self.surfaces / 3

    @property
    def field_v_per_um(self) -> float:
        """Electric field over the dielectric [V/µm]."""
        return self.voltage_v / (self.dielectric_m * 1e6)

    def stress_kpa(self, force_n: float) -> float:
        """Normal stress that a normal force makes on the ring [kPa], σ = f / A."""
        return force_n / self.area_m2 / 1e3

    def shear_kpa(self, torque_nm: float) -> float:
        """Shear stress behind a torque [kPa], Eq. (1) solved for σ_sh."""
        return torque_nm / self.torque_per_shear_m3 / 1e3

    def friction_coefficient(self, torque_nm: float, stress_kpa: float) -> float:
        """Coefficient of friction [1], C_f = T_s / (σ · 2π (r2³ − r1³) n / 3)."""
        return torque_nm / (stress_kpa * 1e3 * self.torque_per_shear_m3)


def rig_of(kind: str, input_unit: str, output_unit: str) -> Apparatus | None:
    """The paper's rig where kind and units are its own; None of another, whose sizes nobody knows."""
    paper = (input_unit, output_unit) == PAPER[kind]
    return Apparatus(surfaces=2 if kind == "clutch" else 1) if paper else None
