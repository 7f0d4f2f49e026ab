"""What `couple` may be told."""

import math
from dataclasses import dataclass

from eaid.control.timing import Timing
from eaid.coupling.linear import LOOPS
from eaid.coupling.sampled import Limb
from eaid.errors import UsageError


@dataclass(frozen=True)
class CoupleOptions:
    """The limb, the timing, the torques and loops, and what is drawn."""

    torques: tuple[float, ...] = ()
    """Torques held, in the output's unit; empty: four over the fitted range."""
    loops: tuple[str, ...] = LOOPS
    limb_inertia: float = 0.1
    """[kg·m²]"""
    limb_damping: float = 0.8
    """[N·m·s/rad]"""
    virtual_damping: float = 0.0
    """B_v of the wall [N·m·s/rad]."""
    wall: float | None = None
    """A stiffness that has to be rendered [N·m/rad]: loops that cannot are told."""
    rate_hz: float = 1000.0
    pwm_hz: float = 0.0
    delay_samples: int = 0
    sensor_hz: float = 0.0
    encoder_counts: int | None = None
    """Counts per turn of the limb's encoder."""
    idle_drag_nm: float | None = None
    """None: what the fit's own idle records show."""
    rotor_rpm: float = 10.0
    limb_speed_rad_s: float = 0.41
    """Fastest motion of the limb; 25° at 0.15 Hz by default."""
    pair_bias_nm: float | None = None
    """Torque that each clutch of a pair is held at; None: the middle of the fitted range."""
    plants: int = 0
    """Plants drawn from the fit's uncertainty, each with a limb of its own."""
    limb_spread: float = 0.3
    """J and b of the drawn limbs: up to this share either way."""
    seed: int = 0
    replay: bool = True
    """Also bisect the replay of the nonlinear plant."""

    def __post_init__(self) -> None:
        for name in ("virtual_damping", "pwm_hz", "sensor_hz", "rotor_rpm", "limb_speed_rad_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0 <= value <= 1e6):
                raise UsageError(f"«{name}» {value:g}: must be 0 or above, and 1e6 at most")
        if not 1 <= self.rate_hz <= 1e6:
            raise UsageError(f"«rate_hz» {self.rate_hz:g}: must lie between 1 and 1e6")
        if not 0 <= self.delay_samples <= 100:
            raise UsageError(f"«delay_samples» {self.delay_samples}: must lie between 0 and 100")
        if not 0 <= self.plants <= 10_000:
            raise UsageError(f"«plants» {self.plants}: must lie between 0 and 10000")
        if not 0 <= self.limb_spread < 1:
            raise UsageError(f"«limb_spread» {self.limb_spread:g}: must be a share from 0 on and below 1")
        if self.wall is not None and not (0 < self.wall < math.inf):
            raise UsageError(f"«wall» {self.wall:g}: a stiffness must be above 0")
        if self.encoder_counts is not None and self.encoder_counts < 1:
            raise UsageError(f"«encoder_counts» {self.encoder_counts}: must be 1 or more")
        for loop in self.loops:
            if loop not in LOOPS:
                raise UsageError(f"«loops» {loop}: must be one of {', '.join(LOOPS)}")
        Limb(self.limb_inertia, self.limb_damping)

    @property
    def limb(self) -> Limb:
        """The limb."""
        return Limb(self.limb_inertia, self.limb_damping)

    @property
    def timing(self) -> Timing:
        """When the loop samples and its duty takes effect."""
        return Timing(self.rate_hz, self.pwm_hz or None, self.delay_samples, self.sensor_hz)
