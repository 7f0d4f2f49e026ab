"""What `couple` may be told."""

from dataclasses import dataclass

from eaid.control.timing import Timing
from eaid.coupling.linearised import LOOPS
from eaid.coupling.sampled import Limb
from eaid.errors import UsageError, unknown
from eaid.limits import check_all

MOST_DELAY = 100
"""Each sample of delay is a state of the loop's linear map."""
MOST_PLANTS = 10_000
"""Each is looked at with every loop and torque."""


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
    """From reading to duty; 0: the dead time that the fit's steps show."""
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
        check_all(**{
            name: getattr(self, name)
            for name in (
                "virtual_damping", "pwm_hz", "sensor_hz", "rotor_rpm", "limb_speed_rad_s", "rate_hz", "delay_samples",
                "limb_spread", "wall", "encoder_counts", "idle_drag_nm", "pair_bias_nm", "seed", "limb_damping",
                "limb_inertia",
            )
        }, plants=self.plants or None)  # fmt: skip
        if self.plants > MOST_PLANTS:
            raise UsageError(f"«plants» {self.plants}: give a whole number from 0 to {MOST_PLANTS}")
        if self.delay_samples > MOST_DELAY:
            raise UsageError(f"«delay_samples» {self.delay_samples}: give a whole number from 0 to {MOST_DELAY}")
        for torque in self.torques:
            check_all(torque=torque)
        if self.plants == 0 and self.limb_spread != CoupleOptions.limb_spread:
            raise UsageError("«limb_spread»: does nothing without «plants»; give both or neither")
        for loop in self.loops:
            if loop not in LOOPS:
                raise UsageError(unknown("«loops»", loop, LOOPS))
        Limb(self.limb_inertia, self.limb_damping)

    @property
    def limb(self) -> Limb:
        """The limb."""
        return Limb(self.limb_inertia, self.limb_damping)

    @property
    def timing(self) -> Timing:
        """When the loop samples and its duty takes effect."""
        return Timing(self.rate_hz, self.pwm_hz or None, self.delay_samples, self.sensor_hz)
